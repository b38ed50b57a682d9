// The fields for an edit's parameters, made from what the service says about them (`parameters` of /v1/info).

import { attrs, h } from "./dom.js";
import { choice, labelled, numberField, toggle } from "./fields.js";
import { labelOf, usualValue } from "./requests.js";

/** Which values of a parameter this service can use: [{name, available, reason}], for those it says so of. */
const partsOf = (info, name) => ({ corrector: info.correctors, perceptual: info.perceptual })[name] ?? [];

/** A field for one parameter: {element, update(value, usual)}; null for a kind that has none. `changed` gets null for
 *  what is left to the preset. */
function fieldFor(parameter, info, changed) {
  const { name, type, minimum, maximum, values, unit, description } = parameter;
  const label = labelOf(name) + (unit ? `, ${unit}` : "");
  const testid = `param-${name.replaceAll("_", "-")}`;
  const titled = (element) => {
    attrs(element, { title: description });
    return element;
  };
  if (type === "integer" || type === "number") {
    const whole = type === "integer";
    const field = numberField({ label, testid, min: minimum, max: maximum, whole, optional: true, changed });
    return {
      element: titled(labelled(label, field.element)),
      update(value, usual) {
        attrs(field.element, { placeholder: usual ?? "auto" });
        field.update(value, String(value));
      },
    };
  }
  if (type === "string") {
    const parts = partsOf(info, name);
    const options = values.map((value) => {
      const part = parts.find((p) => p.name === value);
      return [value, value.replaceAll("_", " "), part?.reason ?? undefined, part?.available === false];
    });
    const field = choice({ label, testid, options: [["", "default"], ...options], changed: (v) => changed(v || null) });
    return { element: titled(labelled(label, field.element)), update: (value) => field.update(value ?? "") };
  }
  if (type === "boolean") {
    let byItself = false;
    const field = toggle({ label, testid, title: description, changed: (on) => changed(on === byItself ? null : on) });
    return {
      element: field.element,
      update(value, usual) {
        byItself = usual;
        field.update(value ?? usual);
      },
    };
  }
  return null;
}

/** Can this service's edits be repainted by a diffusion model? */
export const hasDiffusion = (info) => partsOf(info ?? {}, "corrector").some((p) => p.name === "sd" && p.available);

/** All fields. changed(name, value) is called with null for what is left to the preset.
 *    returns  {element, update(info, params, preset), shows(name)} */
export function paramFields(changed) {
  const element = h("div", { class: "params" });
  let fields = {};
  let known = null;
  const build = (info) => {
    const offered = (info?.parameters ?? []).filter(({ part }) => part !== "diffusion" || hasDiffusion(info));
    const entries = offered.map((parameter) => [
      parameter,
      fieldFor(parameter, info, (value) => changed(parameter.name, value)),
    ]);
    const shown = entries.filter(([, field]) => field !== null);
    fields = Object.fromEntries(shown.map(([parameter, field]) => [parameter.name, { parameter, field }]));
    const elements = (toggles) =>
      shown.filter(([p]) => (p.type === "boolean") === toggles).map(([, field]) => field.element);
    const missing = ["corrector", "perceptual"].flatMap((name) =>
      partsOf(info ?? {}, name).filter((part) => !part.available),
    );
    const note = missing.map(({ name, reason }) => `${name}: ${reason ?? "not available"}`).join(" · ");
    element.replaceChildren(
      h("div", { class: "grid2" }, elements(false)),
      ...(note ? [h("p", { class: "note" }, note)] : []),
      ...elements(true),
    );
  };
  return {
    element,
    shows: (name) => name in fields,
    update(info, params, preset) {
      if (info !== known) build(info);
      known = info;
      for (const [name, { parameter, field }] of Object.entries(fields))
        field.update(params[name], usualValue(parameter, preset));
    },
  };
}
