// Questions, the token, and short messages.

import * as api from "./api.js";
import { byId, h, problemPlace, showProblem } from "./dom.js";

/** A short message at the foot of the page; read out by screen readers.
 *    kind    "good", "bad", or nothing
 *    action  {label, run}: a button in it */
export function say(message, { kind = "", action = null, seconds = 6 } = {}) {
  const close = () => element.remove();
  const element = h(
    "div",
    { class: `toast ${kind}`, testid: "toast" },
    h("span", {}, message),
    action && h("button", { class: "small", onclick: () => (close(), action.run()) }, action.label),
    h("button", { class: "icon", "aria-label": "Dismiss", onclick: close }, "✕"),
  );
  const all = byId("toasts");
  all.append(element);
  while (all.children.length > 3) all.firstElementChild.remove();
  setTimeout(close, seconds * 1000);
}

function modal(element) {
  document.body.append(element);
  element.addEventListener("close", () => element.remove());
  element.showModal();
  return element;
}

/** Asks before something that cannot be undone. */
export function askConfirmation({ title, detail, yes, danger = true }) {
  return new Promise((resolve) => {
    const dialog = modal(
      h(
        "dialog",
        { class: "dialog", testid: "confirm", "aria-labelledby": "confirm-title" },
        h("h2", { id: "confirm-title" }, title),
        h("p", {}, detail),
        h(
          "div",
          { class: "row end" },
          h("button", { testid: "confirm-no", onclick: () => dialog.close("no"), autofocus: true }, "Keep"),
          h(
            "button",
            { class: danger ? "danger" : "primary", testid: "confirm-yes", onclick: () => dialog.close("yes") },
            yes,
          ),
        ),
      ),
    );
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"));
  });
}

/** Asks for a line of text; null: given up. */
export function askText({ title, label, value }) {
  return new Promise((resolve) => {
    const input = h("input", {
      type: "text",
      value,
      maxlength: 200,
      required: true,
      testid: "ask-input",
      id: "ask-input",
    });
    const dialog = modal(
      h(
        "dialog",
        { class: "dialog", testid: "ask", "aria-labelledby": "ask-title" },
        h(
          "form",
          { method: "dialog" },
          h("h2", { id: "ask-title" }, title),
          h("label", { class: "field" }, h("span", {}, label), input),
          h(
            "div",
            { class: "row end" },
            h("button", { type: "button", onclick: () => dialog.close() }, "Cancel"),
            h("button", { class: "primary", value: "ok", testid: "ask-ok" }, "Save"),
          ),
        ),
      ),
    );
    input.select();
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "ok" ? input.value.trim() : null));
  });
}

/** Asks to choose one of several; null: given up. */
export function askChoice({ title, options }) {
  return new Promise((resolve) => {
    const dialog = modal(
      h(
        "dialog",
        { class: "dialog", testid: "choose", "aria-labelledby": "choose-title" },
        h("h2", { id: "choose-title" }, title),
        h(
          "div",
          { class: "stack" },
          options.map((o) => h("button", { onclick: () => dialog.close(o) }, o)),
        ),
        h("div", { class: "row end" }, h("button", { onclick: () => dialog.close() }, "Cancel")),
      ),
    );
    dialog.addEventListener("close", () => resolve(options.includes(dialog.returnValue) ? dialog.returnValue : null));
  });
}

/** Pictures at their full size, side by side. */
export function showPictures(title, pictures) {
  const dialog = modal(
    h(
      "dialog",
      { class: "dialog pictures", testid: "pictures", "aria-labelledby": "pictures-title" },
      h(
        "div",
        { class: "row between" },
        h("h2", { id: "pictures-title" }, title),
        h("button", { class: "icon", "aria-label": "Close", onclick: () => dialog.close() }, "✕"),
      ),
      h(
        "div",
        { class: "side-by-side" },
        pictures.map(({ label, url }) =>
          h("figure", {}, h("img", { src: url, alt: `${title}, ${label}` }), h("figcaption", {}, label)),
        ),
      ),
    ),
  );
}

/**   letterKeys, setLetterKeys(on)  whether single letters are keys for commands */
export function showHelp({ letterKeys, setLetterKeys }) {
  const touch = [
    ["Tap", "take the thing under the finger, or what the tool does"],
    ["Drag a thing that is taken", "move it; let go, and it is repaired"],
    ["Drag beside it", "orbit"],
    ["Two fingers", "move sideways, nearer, farther"],
    ["Tap twice", "turn about that point"],
    ["Hold to compare", "see it as it was before"],
  ];
  const keys = [
    ["Click", "take the thing under the pointer; with Handles: place one; with Select: select"],
    ["Drag a thing that is taken", "move it; let go, and it is repaired"],
    ["Drag beside it", "orbit"],
    ["Right drag, or Shift + drag", "move sideways"],
    ["Wheel, or + and −", "nearer, farther"],
    ["Double click, or F", "turn about the point under the pointer"],
    ["Drag a handle's dot", "set where it goes; the arrow keys move it, too"],
    ["Wheel over a dot", "its radius"],
    ["Arrow keys", "orbit; with Shift: move sideways"],
    ["Enter", "click in the middle of the picture"],
    [". and ,", "more, less of the thing that is taken"],
    ["D, H", "drag things, place handles"],
    ["S", "select what moves, and back"],
    ["1 to 6", "select by clicks, brush, lasso, rectangle, sphere, box"],
    ["Right click, or Alt", "selecting: what is not meant"],
    ["V, U, L, X, Y, Z, N", "drag in the view's plane, on surfaces, level, along an axis, along the normal"],
    ["G, W", "next part of the gizmo: move, turn, size; next of its axes: world, view, surface"],
    ["Arrow keys on a part of it", "a step; with Shift a small one"],
    ["[ and ]", "previous, next view"],
    ["R", "back to the start"],
    ["B (hold)", "compare with before"],
    ["P", "preview"],
    ["Del", "remove the selected handle"],
    ["Ctrl + Z, Ctrl + Shift + Z", "undo, redo"],
    ["Esc", "give a drag up; end selecting; let go"],
    ["?", "this help"],
  ];
  const rows = matchMedia("(hover: none)").matches ? touch : keys;
  const letters = h("input", { type: "checkbox", testid: "letter-keys", checked: letterKeys });
  letters.addEventListener("change", () => setLetterKeys(letters.checked));
  const dialog = modal(
    h(
      "dialog",
      { class: "dialog", testid: "help", "aria-labelledby": "help-title" },
      h(
        "div",
        { class: "row between" },
        h("h2", { id: "help-title" }, "How to edit a scene"),
        h("button", { class: "icon", "aria-label": "Close", onclick: () => dialog.close() }, "✕"),
      ),
      h(
        "ol",
        { class: "steps" },
        h("li", {}, "Click a thing: all of it is found and tinted. “More” and “Less” widen and narrow it."),
        h("li", {}, "Drag it to where it should go, and let go: what it uncovers is repaired, as a draft."),
        h("li", {}, "“Run it well” takes longer and does it better. Each result is a new version; the old ones stay."),
        h(
          "li",
          {},
          "For a part of a thing, select it (clicks, brush, lasso), or place handles: each holds the Gaussians within its radius. One without a target is an anchor: what it holds stays.",
        ),
      ),
      h(
        "dl",
        { class: "keys" },
        rows.flatMap(([key, what]) => [h("dt", {}, key), h("dd", {}, what)]),
      ),
      h("label", { class: "toggle" }, letters, "Single letters are keys for these commands"),
    ),
  );
}

let signingIn = null;

/** Asks for the token until the service takes it. However many requests wait for it, one question. */
export function signIn() {
  signingIn ??= askForToken().finally(() => (signingIn = null));
  return signingIn;
}

function askForToken() {
  return new Promise((resolve) => {
    const input = h("input", {
      type: "password",
      autocomplete: "current-password",
      required: true,
      testid: "token",
      id: "token",
    });
    const problem = problemPlace("token-problem");
    const button = h("button", { class: "primary", testid: "token-submit" }, "Sign in");
    const submit = async (event) => {
      event.preventDefault();
      button.disabled = true;
      try {
        await api.createSession(input.value.trim());
        dialog.close("ok");
      } catch (error) {
        showProblem(problem, error.status === 401 ? { detail: "The service does not know this token." } : error);
        input.select();
      }
      button.disabled = false;
    };
    const dialog = modal(
      h(
        "dialog",
        { class: "dialog", testid: "sign-in", "aria-labelledby": "sign-in-title" },
        h(
          "form",
          { onsubmit: submit },
          h("h2", { id: "sign-in-title" }, "This service needs a token"),
          h(
            "p",
            {},
            "It is in the file that the service was started with (--token-file). This browser keeps a session, not the token.",
          ),
          // Password managers file what they keep under a name.
          h("input", { type: "text", autocomplete: "username", value: "splatdrag", hidden: true }),
          h("label", { class: "field" }, h("span", {}, "Token"), input),
          problem,
          h("div", { class: "row end" }, button),
        ),
      ),
    );
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "ok"));
  });
}
