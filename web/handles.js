// The list of handles: coordinates, radius, group, and how many Gaussians each holds.

import { attrs, button, h, iconButton, keyedList, problemPlace, showProblem, text } from "./dom.js";
import { labelled, numberField, pointField } from "./fields.js";
import { coordinate, count, gaussians } from "./format.js";
import { groupClass } from "./overlay.js";
import { partOf } from "./requests.js";
import { distance } from "./vectors.js";

// The radius slider covers this range around the scene's radius, on a logarithmic scale of this many steps.
const SLIDER = { low: 1e-3, high: 2, steps: 400 };

const NO_HANDLES = {
  spheres: "No handles yet. Click a part of the scene to take hold of it, then drag the dot to where it should go.",
  selection:
    "Drag what is selected to where it should go. Or take “Handles”: each click on it places one, whose dot you drag.",
  removal: "What is selected will be removed. It needs no handle.",
};

function sliderOf(radius, sceneRadius) {
  const { low, high, steps } = SLIDER;
  return Math.round((steps * Math.log(radius / (low * sceneRadius))) / Math.log(high / low));
}

function radiusOf(slider, sceneRadius) {
  const { low, high, steps } = SLIDER;
  return Number((low * sceneRadius * (high / low) ** (slider / steps)).toPrecision(3));
}

export class HandleList {
  #editor;
  #update;

  constructor(editor) {
    this.#editor = editor;
    const list = h("ol", { class: "handles", testid: "handles" });
    this.#update = keyedList(
      list,
      (handle) => handle.id,
      (handle) => this.#card(handle.id),
    );
    const clear = button("Clear", "clear-handles", () => editor.removeAll());
    const empty = h("p", { class: "empty", testid: "no-handles" });
    this.element = h("section", {}, h("div", { class: "row between" }, h("h2", {}, "Handles"), clear), empty, list);
    editor.store.watch(
      ["handles", "selection", "selected", "counts", "preview", "problem", "scene", "version", "mode"],
      ({ handles, selection, mode }) => {
        empty.hidden = handles.length > 0;
        const meant = selection.length === 0 ? "spheres" : mode === "remove" ? "removal" : "selection";
        text(empty, NO_HANDLES[meant]);
        clear.disabled = handles.length === 0;
        this.#update(handles);
      },
    );
  }

  #card(id) {
    const editor = this.#editor;
    const change = (patch) => editor.change(id, patch);
    const current = () => editor.state.handles.find((handle) => handle.id === id);

    const swatch = h("span", { class: "swatch", "aria-hidden": "true" });
    const name = h("span", { class: "handle-name" });
    const kind = h("span", { class: "kind", title: "How far its target is" });
    const held = h("span", { class: "held" });
    const head = h(
      "button",
      { type: "button", class: "handle-head", onclick: () => editor.select(editor.state.selected === id ? null : id) },
      swatch,
      name,
      kind,
      held,
    );
    const remove = iconButton("✕", null, "Remove (Del)", () => editor.remove(id));

    const source = pointField({
      label: "Source",
      testid: "source",
      changed: (p) => change({ source: p, normal: null }),
    });
    const target = pointField({ label: "Target", testid: "target", changed: (p) => change({ target: p }) });
    const anchor = button(
      "Make anchor",
      "make-anchor",
      () => change({ target: null, rotation: null, scale: null }),
      { title: "Without a target, what the handle holds stays where it is" },
    );
    const release = button("Give it a target", "add-target", () => change({ target: current().source }));
    const targetRow = h(
      "div",
      { class: "field" },
      h("div", { class: "row between" }, h("span", { class: "name" }, "Target"), anchor),
      target.element,
    );
    const anchorRow = h(
      "div",
      { class: "field" },
      h("div", { class: "row between" }, h("span", { class: "name" }, "Anchor: what it holds stays"), release),
    );

    const radius = numberField({
      label: "Radius",
      testid: "radius",
      min: 0,
      changed: (r) => r > 0 && change({ radius: r }),
    });
    const slider = h("input", {
      type: "range",
      min: 0,
      max: SLIDER.steps,
      step: 1,
      "aria-label": "Radius, logarithmic",
      testid: "radius-slider",
    });
    let noted = false;
    slider.addEventListener("input", () => {
      // One step of undo for one pull of the slider.
      editor.change(id, { radius: radiusOf(slider.valueAsNumber, editor.state.scene.radius || 1) }, !noted);
      noted = true;
    });
    slider.addEventListener("change", () => (noted = false));
    const grip = numberField({
      label: "Radius",
      testid: "grip",
      min: 0,
      optional: true,
      placeholder: "from the selection",
      changed: (r) => r !== 0 && change({ grip: r }),
    });
    const radiusRow = h("div", { class: "row" }, slider, radius.element, grip.element);
    const group = numberField({
      label: "Group",
      testid: "group",
      min: 0,
      max: 255,
      whole: true,
      changed: (g) => change({ group: g }),
    });
    const note = h("p", { class: "note", hidden: true });
    const problem = problemPlace();

    const body = h(
      "div",
      { class: "handle-body" },
      labelled("Source", source.element),
      targetRow,
      anchorRow,
      h(
        "div",
        { class: "radius-row" },
        labelled("Radius", radiusRow),
        h(
          "div",
          {
            class: "field narrow",
            title: "Handles of one group turn together; those of different groups do not know of one another",
          },
          h("span", { class: "name" }, "Group"),
          group.element,
        ),
      ),
      note,
    );
    const element = h("li", { class: "handle-card" }, h("div", { class: "row" }, head, remove), problem, body);

    return {
      element,
      update: (handle, i) => {
        const selected = editor.state.selected === id;
        attrs(element, {
          class: `handle-card ${groupClass(handle.group)}${selected ? " selected" : ""}`,
          "data-testid": `handle-card-${i}`,
        });
        attrs(head, { "aria-expanded": String(selected), "data-testid": `handle-head-${i}` });
        attrs(held, { "data-testid": `handle-count-${i}` });
        attrs(remove, { "aria-label": `Remove handle ${i + 1}`, "data-testid": `handle-remove-${i}` });
        attrs(problem, { "data-testid": `handle-problem-${i}` });
        text(name, `Handle ${i + 1}`);
        text(
          kind,
          handle.target ? `→ ${coordinate(Number(distance(handle.source, handle.target).toPrecision(3)))}` : "anchor",
        );
        body.hidden = !selected;
        targetRow.hidden = !handle.target;
        anchorRow.hidden = !!handle.target;
        source.update(handle.source);
        if (handle.target) target.update(handle.target);
        const bySphere = editor.state.selection.length === 0;
        slider.hidden = radius.element.hidden = !bySphere;
        grip.element.hidden = bySphere;
        attrs(radiusRow, { class: bySphere ? "row" : "row wide" });
        radius.update(handle.radius);
        grip.update(handle.grip ?? null);
        const sceneRadius = editor.state.scene?.radius || 1;
        if (document.activeElement !== slider || !noted) slider.valueAsNumber = sliderOf(handle.radius, sceneRadius);
        group.update(handle.group);
        this.#counts(handle, i, held, note);
        this.#problem(handle, i, problem);
        attrs(element, { "data-bad": !problem.hidden });
      },
    };
  }

  #counts(handle, i, held, note) {
    const answer = this.#editor.countOf(handle);
    const preview = this.#editor.previewIsCurrent ? this.#editor.state.preview : null;
    const own = preview?.handles[i]?.gaussians;
    if (this.#editor.state.selection.length > 0) {
      // What each handle moves is what of the selection is nearest to it: only the service tells.
      text(held, own === undefined ? "by selection" : gaussians(own));
      attrs(held, { "data-empty": own === 0 });
      note.hidden = true;
      return;
    }
    text(held, answer === null ? "…" : answer.gaussians === null ? "?" : gaussians(answer.gaussians));
    attrs(held, { "data-empty": answer?.gaussians === 0 });
    const shares = own !== undefined && answer?.gaussians > own;
    note.hidden = !shares;
    if (shares)
      text(note, `Moves ${count(own)} of them; the others are nearer to another handle, or outside of the region.`);
  }

  #problem(handle, i, place) {
    const { problem } = this.#editor.state;
    const at = problem ? partOf(problem.error.where) : {};
    if (at.part === "handle" && at.index === i) return showProblem(place, problem.error);
    const answer = this.#editor.countOf(handle);
    if (answer?.error) return showProblem(place, answer.error);
    showProblem(
      place,
      answer?.gaussians === 0
        ? { detail: "There is no Gaussian within the radius: raise it, or move the handle." }
        : null,
    );
  }
}
