// Elements from code. Text is always text: nothing is ever parsed as HTML.

import { said } from "./format.js";

/** What the arrow keys mean in the picture: [right, down]. */
export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const SVG = "http://www.w3.org/2000/svg";

function fill(element, props, children) {
  for (const [name, value] of Object.entries(props ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "testid") element.setAttribute("data-testid", value);
    else if (name === "value") element.value = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** h("button", {class: "primary", onclick: go, testid: "run"}, "Run"). */
export const h = (tag, props, ...children) => fill(document.createElement(tag), props, children);
export const s = (tag, props, ...children) => fill(document.createElementNS(SVG, tag), props, children);

/** A small button. */
export const button = (label, testid, onclick, more = {}) =>
  h("button", { type: "button", class: "small", testid, onclick, ...more }, label);

/** A button that is a sign, with what it does as its name. */
export const iconButton = (label, testid, title, onclick, more = {}) =>
  button(label, testid, onclick, { class: "icon", title, "aria-label": title, ...more });

export const row = (...children) => h("div", { class: "row" }, ...children);

/** Whether a finger is what points here: then there is no right button, no wheel, and seldom a key. */
export const BY_TOUCH = globalThis.matchMedia?.("(hover: none)").matches ?? false;

export const byId = (id) => document.getElementById(id);

/** Sets attributes of an element; null removes one. */
export function attrs(element, values) {
  for (const [name, value] of Object.entries(values)) {
    if (value === null || value === undefined || value === false) element.removeAttribute(name);
    else {
      const text = value === true ? "" : String(value);
      if (element.getAttribute(name) !== text) element.setAttribute(name, text);
    }
  }
}

/** Sets the text of an element, if it is another. */
export function text(element, value) {
  if (element.textContent !== value) element.textContent = value;
}

/** Sets the value of a field, unless somebody is writing in it. */
export function fieldValue(field, value) {
  if (document.activeElement !== field && field.value !== String(value)) field.value = value;
}

/** A message of an error for people: what, and where. */
export function problemText(error) {
  const detail = error?.detail || error?.message || String(error);
  return error?.where ? `${detail} (${error.where})` : detail;
}

/** A place for an error; empty and hidden until showProblem() fills it. */
export const problemPlace = (testid) => h("p", { class: "problem", role: "alert", hidden: true, testid });

/** Shows an error in a place made for it, or clears it. */
export function showProblem(place, error) {
  place.hidden = !error;
  if (!error) return place.replaceChildren();
  place.replaceChildren(
    h("span", {}, said(error.detail || error.message || String(error))),
    error.where ? h("code", { class: "where" }, error.where) : "",
  );
}

/** A handler that does `ask`; what that throws is shown in `place` until the next time. */
export const asking = (place, ask) => async () => {
  try {
    showProblem(place, null);
    await ask();
  } catch (error) {
    showProblem(place, error);
  }
};

/** Children of `parent`, one per item, made once and kept: focus and selection survive an update.
 *    key(item)            what tells items apart
 *    make(item)           -> {element, update(item, index)} */
export function keyedList(parent, key, make) {
  const entries = new Map();
  return (items) => {
    const wanted = new Set(items.map(key));
    for (const [k, entry] of entries)
      if (!wanted.has(k)) {
        entry.element.remove();
        entries.delete(k);
      }
    items.forEach((item, i) => {
      let entry = entries.get(key(item));
      if (!entry) entries.set(key(item), (entry = make(item)));
      entry.update?.(item, i);
      if (parent.children[i] !== entry.element) parent.insertBefore(entry.element, parent.children[i] ?? null);
    });
  };
}
