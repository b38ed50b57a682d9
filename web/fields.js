// Form fields that several panels share.

import { attrs, fieldValue, h } from "./dom.js";
import { coordinate, coordinates } from "./format.js";

/** A number. `changed` is called with valid values only; an invalid one marks the field. */
export function numberField({
  label,
  testid,
  min,
  max,
  step = "any",
  placeholder,
  changed,
  whole = false,
  optional = false,
}) {
  const input = h("input", {
    type: "number",
    min,
    max,
    step: whole ? 1 : step,
    placeholder,
    testid,
    "aria-label": label,
    inputmode: "decimal",
  });
  const read = () => {
    if (input.value === "" && !input.validity.badInput && optional) return null;
    const value = Number(input.value);
    const fine =
      input.value !== "" &&
      Number.isFinite(value) &&
      (min === undefined || value >= min) &&
      (max === undefined || value <= max) &&
      (!whole || Number.isSafeInteger(value));
    return fine ? value : undefined;
  };
  let shown = "";
  input.addEventListener("change", () => {
    const value = read();
    attrs(input, { "aria-invalid": value === undefined });
    if (value !== undefined && input.value !== shown) changed(value);
  });
  return {
    element: input,
    update(value, text = coordinate(value)) {
      shown = value === null || value === undefined ? "" : text;
      fieldValue(input, shown);
      if (document.activeElement !== input) attrs(input, { "aria-invalid": null });
    },
  };
}

/** Three numbers in a row. */
export function pointField({ label, testid, min, changed }) {
  let present = [0, 0, 0];
  const fields = ["x", "y", "z"].map((axis, i) =>
    numberField({
      label: `${label} ${axis}`,
      testid: `${testid}-${axis}`,
      min,
      changed: (value) => changed(present.map((p, k) => (k === i ? value : p))),
    }),
  );
  return {
    element: h(
      "div",
      { class: "point", role: "group", "aria-label": label },
      fields.map((f) => f.element),
    ),
    update(point) {
      present = point;
      const texts = coordinates(point);
      fields.forEach((f, i) => f.update(point[i], texts[i]));
    },
  };
}

/** A choice from a list: options as [value, label, title?, disabled?]. */
export function choice({ label, testid, options, changed }) {
  const select = h("select", { "aria-label": label, testid, onchange: () => changed(select.value) });
  let known = "";
  const fill = (list) => {
    const text = JSON.stringify(list);
    if (text === known) return;
    known = text;
    select.replaceChildren(
      ...list.map(([value, name, title, disabled]) => h("option", { value, title, disabled }, name)),
    );
  };
  fill(options);
  return {
    element: select,
    options: fill,
    update: (value) => {
      if (select.value !== value) select.value = value;
    },
  };
}

/** A row of buttons of which one is pressed: options as [value, label, title?]. */
export function segments({ label, testid, options, changed }) {
  const buttons = options.map(([value, name, title]) =>
    h(
      "button",
      { type: "button", class: "segment", title, testid: `${testid}-${value}`, onclick: () => changed(value) },
      name,
    ),
  );
  return {
    element: h("div", { class: "segments", role: "group", "aria-label": label, testid }, buttons),
    buttons: Object.fromEntries(options.map(([value], i) => [value, buttons[i]])),
    update: (value) => options.forEach(([v], i) => attrs(buttons[i], { "aria-pressed": String(v === value) })),
  };
}

/** A label above what it names. */
export const labelled = (label, ...what) => h("div", { class: "field" }, h("span", { class: "name" }, label), ...what);

export function toggle({ label, testid, title, changed }) {
  const input = h("input", { type: "checkbox", testid, onchange: () => changed(input.checked) });
  return {
    element: h("label", { class: "toggle", title }, input, h("span", {}, label)),
    update: (on) => (input.checked = on),
  };
}

/** A button with a small panel beside it. As menus do, it closes by a press anywhere else, and by Esc.
 *  Returns the element, a <details>. */
export function menu(sign, testid, title, ...content) {
  const opener = h("summary", { testid, title, "aria-label": title }, sign);
  const element = h("details", { class: "menu" }, opener, h("div", { class: "stack" }, content));
  document.addEventListener("pointerdown", ({ target }) => element.contains(target) || (element.open = false), true);
  element.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    element.open = false;
    opener.focus();
  });
  return element;
}
