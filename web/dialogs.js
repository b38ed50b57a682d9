// Questions, the token, and short messages.

import * as api from "./api.js";
import { BY_TOUCH, byId, h, iconButton, problemPlace, showProblem } from "./dom.js";

/** A short message, on the picture or over the list of scenes; read out by screen readers.
 *    kind    "good", "bad", or nothing
 *    action  {label, run}: a button in it */
export function say(message, { kind = "", action = null, seconds = 6 } = {}) {
  const close = () => element.remove();
  const element = h(
    "div",
    { class: `toast ${kind}`, testid: "toast" },
    h("span", {}, message),
    action && h("button", { class: "small", onclick: () => (close(), action.run()) }, action.label),
    iconButton("✕", null, "Dismiss", close),
  );
  const all = byId("toasts");
  all.append(element);
  while (all.children.length > 3) all.firstElementChild.remove();
  setTimeout(close, seconds * 1000);
}

/** A dialog with a heading.
 *    closes   whether it has a button for that alone
 *    returns  the dialog, open */
export function openDialog(testid, title, content, { closes = false, class: more = "" } = {}) {
  const heading = h("h2", { id: `${testid}-title` }, title);
  const close = iconButton("✕", null, "Close", () => dialog.close());
  const dialog = h(
    "dialog",
    { class: `dialog ${more}`, testid, "aria-labelledby": `${testid}-title` },
    closes ? h("div", { class: "row between" }, heading, close) : heading,
    content,
  );
  document.body.append(dialog);
  dialog.addEventListener("close", () => dialog.remove());
  dialog.showModal();
  return dialog;
}

/** A dialog that is answered: read(returnValue) once it is closed. */
function asked(testid, title, content, read) {
  const dialog = openDialog(testid, title, content((value) => dialog.close(value)));
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(read(dialog.returnValue))));
}

const end = (...buttons) => h("div", { class: "row end" }, ...buttons);

/** Asks before something that cannot be undone. */
export function askConfirmation({ title, detail, yes }) {
  const content = (close) => [
    h("p", {}, detail),
    end(
      h("button", { testid: "confirm-no", onclick: () => close("no"), autofocus: true }, "Keep"),
      h("button", { class: "danger", testid: "confirm-yes", onclick: () => close("yes") }, yes),
    ),
  ];
  return asked("confirm", title, content, (value) => value === "yes");
}

/** Asks for a line of text; null: given up.
 *    optional  whether it may be empty */
export function askText({ title, label, value, optional = false }) {
  const id = "ask-input";
  const input = h("input", { type: "text", value, maxlength: 200, required: !optional, testid: id, id });
  const content = (close) =>
    h(
      "form",
      { method: "dialog" },
      h("label", { class: "field" }, h("span", {}, label), input),
      end(
        h("button", { type: "button", onclick: () => close("") }, "Cancel"),
        h("button", { class: "primary", value: "ok", testid: "ask-ok" }, "Save"),
      ),
    );
  const answer = asked("ask", title, content, (value) => (value === "ok" ? input.value.trim() : null));
  input.select();
  return answer;
}

/** Asks to choose one of several; null: given up. */
export function askChoice({ title, options }) {
  const content = (close) => [
    h("div", { class: "stack" }, options.map((o) => h("button", { onclick: () => close(o) }, o))),
    end(h("button", { onclick: () => close("") }, "Cancel")),
  ];
  return asked("choose", title, content, (value) => (options.includes(value) ? value : null));
}

const STEPS = [
  "Click a thing: all of it is found and tinted. “More” and “Less” widen and narrow it.",
  "Drag it to where it should go, and let go: what it uncovers is repaired, as a draft.",
  "“Run it well” takes longer and does it better. Each result is a new version; the old ones stay, but for drafts that a better one has replaced.",
  "For a part of a thing, select it (clicks, brush, lasso), or place handles: each holds the Gaussians within its radius. One without a target is an anchor: what it holds stays.",
  "“Heal” selects what is made anew in the next run: a stain, a shadow that stays behind.",
];

/**   letterKeys, setLetterKeys(on)  whether single letters are keys for commands */
export function showHelp({ letterKeys, setLetterKeys }) {
  const touch = [
    ["Tap", "take the thing under the finger, or what the tool does"],
    ["Drag a thing that is taken", "move it; let go, and it is repaired"],
    ["Drag beside it", "orbit"],
    ["Two fingers", "move sideways, nearer, farther; lift one, and the other orbits, whatever the tool"],
    ["Lasso, Frame", "draw, or tap the corners; a lasso ends where it began"],
    ["A tab at the foot", "opens the panel: all of it as numbers, edits, versions; ⌄ folds it away"],
    ["Tap twice", "turn about that point"],
    ["✢", "turn, move and come nearer by buttons"],
    ["Hold to compare", "see it as it was before; beside it, a slider, blinking, the difference"],
  ];
  const keys = [
    ["Click", "take the thing under the pointer; with Handles: place one; with Select: select"],
    ["Drag a thing that is taken", "move it; let go, and it is repaired"],
    ["Drag beside it", "orbit"],
    ["Right drag, or Shift + drag", "move sideways"],
    ["Wheel, or + and −", "nearer, farther"],
    ["Double click, or F", "turn about the point under the pointer"],
    ["T", "fly, and back: W, A, S, D and the arrow keys, E up, Q down, with Shift faster; a drag looks around"],
    ["Drag a handle's dot", "set where it goes; the arrow keys move it, too"],
    ["Wheel over a dot", "its radius"],
    ["Arrow keys, or ✢", "orbit; with Shift: move sideways"],
    ["Enter", "click in the middle of the picture"],
    [". and ,", "more, less of the thing that is taken"],
    ["D, H", "drag things, place handles"],
    ["S", "select what moves, and back"],
    ["E", "mark what a run heals"],
    ["O", "the dataset's photo over its camera's picture"],
    ["1 to 6", "select by clicks, brush, lasso, rectangle, sphere, box"],
    ["Clicks, with lasso or frame", "its corners, for who does not draw; a lasso ends where it began"],
    ["Right click, or Alt", "selecting: what is not meant"],
    ["V, U, L, X, Y, Z, N", "drag in the view's plane, on surfaces, level, along an axis, along the normal"],
    ["G, W", "next part of the gizmo: move, turn, size; next of its axes: world, view, surface"],
    ["Arrow keys on a part of it", "a step; with Shift a small one"],
    ["[ and ]", "previous, next view"],
    ["R", "back to the start"],
    ["B (hold)", "compare with before"],
    ["C", "the next way to compare: slider, blink, difference, none"],
    ["P", "preview"],
    ["Del", "remove the selected handle"],
    ["Ctrl + Z, Ctrl + Shift + Z", "undo, redo"],
    ["Esc", "give a drag up; end selecting; let go"],
    ["?", "this help"],
  ];
  const rows = BY_TOUCH ? touch : keys;
  const letters = h("input", { type: "checkbox", testid: "letter-keys", checked: letterKeys });
  letters.addEventListener("change", () => setLetterKeys(letters.checked));
  openDialog(
    "help",
    "How to edit a scene",
    [
      h("ol", { class: "steps" }, STEPS.map((step) => h("li", {}, step))),
      h("dl", { class: "keys" }, rows.flatMap(([key, what]) => [h("dt", {}, key), h("dd", {}, what)])),
      h("label", { class: "toggle" }, letters, "Single letters are keys for these commands"),
    ],
    { closes: true },
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
    const dialog = openDialog(
      "sign-in",
      "This service needs a token",
      h(
        "form",
        { onsubmit: submit },
        h(
          "p",
          {},
          "It is in the file that the service was started with (--token-file). This browser keeps a session, not the token.",
        ),
        // Password managers file what they keep under a name.
        h("input", { type: "text", autocomplete: "username", value: "splatdrag", hidden: true }),
        h("label", { class: "field" }, h("span", {}, "Token"), input),
        problem,
        end(button),
      ),
    );
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "ok"));
  });
}
