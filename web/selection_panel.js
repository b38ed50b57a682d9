// Selecting, for the eye and the hand: the row of tools above the picture, and in the panel what is selected.

import { attrs, button, byId, h, iconButton, keyedList, problemPlace, showProblem, text } from "./dom.js";
import { choice, segments, toggle } from "./fields.js";
import { count, gaussians } from "./format.js";
import { warnings } from "./request_panel.js";
import { describe, listOf, sentence, share } from "./selection.js";
import { isShape } from "./selecting.js";
import { shapeFields } from "./shapes.js";

const HANDS = [
  ["thing", "Drag", "Click a thing and drag it to where it should go (D)"],
  ["handle", "Handles", "Click to place a handle, drag its dot to where it should go (H)"],
  ["select", "Select", "Say what moves (S)"],
  ["heal", "Heal", "Say what a run makes anew: a stain, a shadow that stays behind (E)"],
];
export const SELECT_TOOLS = [
  ["grow", "Click", "Click a thing: it is selected up to its border (1)"],
  ["brush", "Brush", "Paint over what is meant (2)"],
  ["lasso", "Lasso", "Draw around what is meant (3)"],
  ["rectangle", "Frame", "Draw a rectangle around what is meant, from corner to corner (4)"],
  ["sphere", "Sphere", "Press where its middle is and draw it out; then pull its dot, or the gizmo (5)"],
  ["box", "Box", "Press where its middle is and draw it out; then pull its faces, or the gizmo (6)"],
];
const OPS = [
  ["add", "Add", "To what is selected"],
  ["subtract", "Subtract", "From what is selected. With Alt, the brush and the lasso do the opposite"],
  ["intersect", "Keep only", "What is selected and meant here; all else no longer is"],
];
const KINDS = [
  ["inside", "+ On it", "The next click is on the thing"],
  ["outside", "− Not it", "The next click is on what is not the thing. So is a right click, or one with Alt"],
];
const DEPTHS = [
  ["visible", "Visible", "Only the surface that is seen"],
  ["through", "Through", "All that is behind one another there"],
];
const BRUSH = { low: 3, high: 80 }; // Pixels.

const NOTHING = {
  move: "Nothing is selected: each handle moves the Gaussians in its sphere. Select, to say more exactly what moves.",
  heal: "Nothing is marked. What you mark goes in the next run, and the surface around it goes on over its place.",
};

/** The tools, above the picture. */
export function buildTools(editor) {
  const { store, selecting } = editor;
  const set = (name) => (value) => store.set({ [name]: value });
  const row = (label, testid, options, changed) => segments({ label, testid, options, changed });

  const hand = row("What the pointer does", "hand", HANDS, (value) =>
    ["select", "heal"].includes(value) ? selecting.start(value === "heal") : selecting.takeThings(value === "thing"),
  );
  const tool = row("Select by", "select-tool", SELECT_TOOLS, (value) => selecting.use(value));
  const op = choice({ label: "What is done with it", testid: "select-op", options: OPS, changed: set("selectOp") });
  const kind = row("A click is", "click-kind", KINDS, set("clickKind"));
  const next = button(
    "Next thing",
    "next-thing",
    () => store.set({ nextThing: !store.state.nextThing, clickKind: "inside" }),
    { title: "The next click begins another thing, instead of saying more of this one" },
  );
  const depth = row("How deep", "select-depth", DEPTHS, set("selectDepth"));
  const size = h("input", { type: "range", min: BRUSH.low, max: BRUSH.high, step: 1, testid: "brush-radius" });
  size.addEventListener("input", () => store.set({ brushRadius: size.valueAsNumber }));
  const brushSize = h("label", { class: "brush-size" }, h("span", {}, "Size"), size);
  const tools = h(
    "div",
    { class: "row wrap select-tools" },
    tool.element,
    op.element,
    kind.element,
    next,
    brushSize,
    depth.element,
  );
  // The panel may be scrolled, or folded away: who selects looks at the picture.
  const chip = h("span", { class: "chip", testid: "selected-chip", hidden: true });
  byId("chips").append(chip);
  store.watch(["selection", "heal", "healing", "selectMode", "selectionAnswer", "selectionWaits", "scene", "version"], (state) => {
    const line = state.selectMode && listOf(state).length > 0 ? countLine(state) : "";
    chip.hidden = line === "";
    text(chip, line);
  });
  const undo = iconButton("↶", "undo", "Undo (Ctrl + Z)", () => editor.undo());
  const redo = iconButton("↷", "redo", "Redo (Ctrl + Shift + Z)", () => editor.redo());
  byId("tools").append(hand.element, tools);
  byId("toolbar").append(h("div", { class: "row undo" }, undo, redo));

  const shown = ["healing", "selectMode", "thingMode", "selectTool", "selectOp", "clickKind", "nextThing", "selectDepth", "brushRadius"];
  const undone = ["version", "handles", "selection", "region", "mode", "preset", "params", "crumbs", "shadow", "settle", "heal"];
  store.watch([...shown, ...undone], (state) => {
    const { selectMode, selectTool } = state;
    hand.update(selectMode ? (state.healing ? "heal" : "select") : state.thingMode ? "thing" : "handle");
    tools.hidden = !selectMode;
    tool.update(selectTool);
    op.update(state.selectOp);
    kind.update(state.clickKind);
    depth.update(state.selectDepth);
    size.valueAsNumber = state.brushRadius;
    attrs(next, { "aria-pressed": String(state.nextThing) });
    next.disabled = !listOf(state).some((o) => o.grow);
    kind.element.hidden = next.hidden = selectTool !== "grow";
    depth.element.hidden = selectTool === "grow" || isShape(selectTool);
    brushSize.hidden = selectTool !== "brush";
    undo.disabled = !editor.canUndo;
    redo.disabled = !editor.canRedo;
  });
}

/** What is selected, in the panel. */
export function buildSelectionPanel(editor) {
  const { store, selecting } = editor;
  const press = (label, testid, title, onclick) => button(label, testid, onclick, { title });
  const invert = press("Invert", "invert-selection", "Select all that is not selected now", () => selecting.invert());
  const wider = press("Wider", "expand-selection", "Take along what is next to it, all around", () => selecting.spread(1));
  const narrower = press("Narrower", "shrink-selection", "Leave out what is at its edge, all around", () =>
    selecting.spread(-1),
  );
  const clear = press("Clear", "clear-selection", "Select nothing", () => selecting.clear());
  const tinted = toggle({
    label: "Tint",
    testid: "tinted",
    title: "Show in the picture what is selected",
    changed: (on) => store.set({ tinted: on }),
  });
  const held = h("p", { class: "selected-count", role: "status", testid: "selection-count" });
  const notes = h("div", { class: "stack", testid: "selection-warnings" });
  const problem = problemPlace("selection-problem");
  const heading = h("h2", {});
  const empty = h("p", { class: "note", testid: "no-selection" });
  const list = h("ol", {
    class: "steps-of-selection",
    testid: "selection-steps",
    "aria-label": "Steps of the selection",
  });
  const update = keyedList(
    list,
    ({ i }) => i,
    () => stepRow(selecting),
  );
  const tools = h("div", { class: "row" }, tinted.element, clear);
  const changes = h("div", { class: "row wrap" }, invert, wider, narrower);
  const element = h(
    "section",
    { class: "selection", "aria-label": "Selection" },
    h("div", { class: "row between" }, heading, tools),
    ...[empty, held, problem, notes, list, shapeFields(editor), changes],
  );

  store.watch(["selection", "heal", "healing", "selectionAnswer", "selectionWaits", "tinted", "scene", "version"], (state) => {
    const { selectionAnswer: answer, healing } = state;
    const selection = listOf(state);
    text(heading, healing ? "What is healed" : "Selection");
    text(empty, NOTHING[healing ? "heal" : "move"]);
    empty.hidden = selection.length > 0;
    for (const part of [tools, held, list, changes]) part.hidden = selection.length === 0;
    wider.disabled = narrower.disabled = state.selectionWaits || !answer?.count;
    tinted.update(state.tinted);
    text(held, countLine(state));
    attrs(held, { "data-waits": state.selectionWaits, "data-count": answer?.count ?? null });
    showProblem(problem, answer?.error ? { detail: sentence(answer.error.detail), where: stepOf(answer.error) } : null);
    notes.replaceChildren(...warnings((answer?.warnings ?? []).map(sentence)));
    notes.hidden = !answer?.warnings?.length;
    update(selection.map((operation, i) => ({ operation, i })));
  });
  return element;
}

/** "Step 3" for an error of the third operation; else its address as it is. */
function stepOf({ where }) {
  const [, index] = /^selection\[(\d+)\]/.exec(where ?? "") ?? [];
  return index === undefined ? where : `Step ${Number(index) + 1}`;
}

function countLine({ scene, version, selectionAnswer: answer, selectionWaits }) {
  if (!answer || answer.error) return selectionWaits ? "Selecting…" : "";
  const whole = scene?.versions.find((v) => v.version === version)?.gaussians ?? 0;
  const part = whole > 0 ? ` (${share(answer.count, whole)})` : "";
  return `${gaussians(answer.count)} selected${part}${selectionWaits ? " …" : ""}`;
}

function stepRow(selecting) {
  let index = 0;
  const name = h("span", {});
  const remove = h("button", { type: "button", class: "icon", onclick: () => selecting.remove(index) }, "✕");
  return {
    element: h("li", { class: "row between" }, name, remove),
    update: ({ operation, i }) => {
      index = i;
      text(name, `${count(i + 1)}. ${describe(operation)}`);
      attrs(remove, {
        title: "Remove this step",
        "aria-label": `Remove step ${i + 1}`,
        "data-testid": `selection-remove-${i}`,
      });
    },
  };
}
