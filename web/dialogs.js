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

export function showHelp() {
  const keys = [
    ["Drag", "orbit"],
    ["Right drag, or Shift + drag", "move sideways"],
    ["Wheel, or + and −", "nearer, farther"],
    ["Click", "place a handle on the surface"],
    ["Drag a handle's dot", "set where it goes"],
    ["Wheel over a dot", "its radius"],
    ["Arrow keys", "orbit; with Shift: move sideways"],
    ["Enter", "place a handle, or a point that selects, in the middle of the picture"],
    ["F", "turn about the point under the pointer"],
    ["S", "select what moves, and back to handles"],
    ["1, 2, 3", "select by clicks, brush, lasso"],
    ["Right click, or Alt", "selecting: what is not meant"],
    ["[ and ]", "previous, next view"],
    ["R", "back to the start"],
    ["B (hold)", "compare with before"],
    ["P", "preview"],
    ["Del", "remove the selected handle"],
    ["Ctrl + Z, Ctrl + Shift + Z", "undo, redo what you placed"],
    ["Esc", "give a drag up; end selecting; no handle"],
  ];
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
        h("li", {}, "Click a part of the scene: a handle takes hold of the Gaussians within its radius."),
        h(
          "li",
          {},
          "To say more exactly what moves, select it: click it, paint over it or draw around it. What is selected is tinted.",
        ),
        h(
          "li",
          {},
          "Drag the handle's dot to where that part should go. A handle without a target is an anchor: what it holds stays.",
        ),
        h(
          "li",
          {},
          "Look at the preview, change what you like, then run the edit. The result is a new version; the old one stays.",
        ),
      ),
      h(
        "dl",
        { class: "keys" },
        keys.flatMap(([key, what]) => [h("dt", {}, key), h("dd", {}, what)]),
      ),
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
