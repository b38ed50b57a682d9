// Moving, turning and scaling what is held: which part of the gizmo is in the picture, its frame, and all of it in numbers.

import { onTheWire } from "./camera.js";
import { attrs, byId, h, iconButton, text } from "./dom.js";
import { labelled, numberField, pointField, segments } from "./fields.js";
import { FRAMES, frameAxes, TOOLS } from "./gizmo.js";
import { motionOf } from "./motion.js";
import { addScaled, dot, scale, unit } from "./vectors.js";

const ICONS = {
  move: ["✥", "Move along axes and planes (G)"],
  turn: ["⟳", "Turn (G)"],
  size: ["⤢", "Size (G)"],
};
const NAMED = {
  world: ["World", "The axes of the scene's file (W)"],
  view: ["View", "Right, up, and towards you (W)"],
  surface: ["Surface", "z is the normal of the surface where it was clicked on (W)"],
};
const ATTACHED = [
  ["auto", "As it looks", "Held where its surface goes on into what stays, unless it goes far"],
  ["held", "Held", "It stays joined to what it grows out of, and bends towards there"],
  ["free", "Comes off", "It goes as one piece"],
];
const HOW = { held: "Held", drawn_out: "Drawn out", continued: "Drawn out" };
const DEGREES = 180 / Math.PI;

/** Takes the next of the tools, or of the frames. */
export const next = (store, name) => {
  const all = name === "gizmo" ? TOOLS : FRAMES;
  store.set({ [name]: all[(all.indexOf(store.state[name]) + 1) % all.length] });
};

/** The section of the panel. camera(): that of the picture. */
export function buildGizmoPanel(editor, camera) {
  const { store } = editor;
  const tools = TOOLS.map((tool) => {
    const [sign, title] = ICONS[tool];
    return iconButton(sign, `gizmo-tool-${tool}`, title, () => store.set({ gizmo: tool }));
  });
  const inPicture = h("div", { id: "gizmo-tools", role: "group", "aria-label": "Move, turn or size" }, tools);
  byId("view-tools").append(inPicture);

  const frame = segments({
    label: "Axes",
    testid: "frame",
    options: FRAMES.map((name) => [name, ...NAMED[name]]),
    changed: (value) => store.set({ frame: value }),
  });
  const axes = () =>
    frameAxes(store.state.frame, camera() ?? onTheWire(store.state.pose), {
      up: unit(editor.worldUp),
      normal: editor.held.handle.normal,
    });
  const inFrame = (v) => axes().map((axis) => dot(v, axis));
  const inWorld = (v) => axes().reduce((sum, axis, i) => addScaled(sum, axis, v[i]), [0, 0, 0]);
  const set = (patch) => editor.held && editor.setHeld({ ...motionOf(editor.held.handle, editor.held.pivot), ...patch });
  const shift = pointField({ label: "Moved by", testid: "shift", changed: (v) => set({ shift: inWorld(v) }) });
  const turn = pointField({
    label: "Turned by, degrees",
    testid: "turn",
    changed: (v) => set({ turn: scale(inWorld(v), 1 / DEGREES) }),
  });
  const size = numberField({ label: "Size", testid: "size", min: 0.001, max: 1000, changed: (v) => set({ size: v }) });
  const attach = segments({
    label: "Its border",
    testid: "attach",
    options: ATTACHED,
    changed: (value) => editor.settle({ attach: value === "auto" ? null : value }),
  });
  const held = h("p", { class: "note", testid: "attach-answer" });
  const border = h("div", { class: "field" }, h("span", { class: "name" }, "Its border"), attach.element, held);
  const element = h(
    "section",
    { testid: "held", "aria-label": "Move, turn and size" },
    h("h2", {}, "Move, turn, size"),
    labelled("Axes", frame.element),
    labelled("Moved by", shift.element),
    labelled("Turned by (degrees about each axis)", turn.element),
    labelled("Size (factor)", size.element),
    border,
  );
  store.watch(
    [
      ...["thingMode", "selectMode", "selection", "selectionAnswer", "selectionWaits", "handles", "selected", "comparing"],
      ...["mode", "gizmo", "frame", "pose", "scene", "selectTool"],
    ],
    (state) => {
      const { held } = editor;
      inPicture.hidden = !held || !state.pose;
      element.hidden = inPicture.hidden || !!held.shape;
      if (inPicture.hidden) return;
      TOOLS.forEach((tool, i) => attrs(tools[i], { "aria-pressed": String(tool === state.gizmo) }));
      frame.update(state.frame);
      if (held.shape) return;
      const motion = motionOf(held.handle, held.pivot);
      shift.update(inFrame(motion.shift).map(exact(motion.shift)));
      turn.update(inFrame(scale(motion.turn, DEGREES)).map(exact([180])));
      size.update(motion.size);
    },
  );
  store.watch(["selection", "attach", "preview", "handles"], (state) => {
    border.hidden = state.selection.length === 0;
    attach.update(state.attach ?? "auto");
    const [part] = (editor.previewIsCurrent && state.preview.parts) || [];
    const how = part && `${HOW[part.how] ?? "Comes off"}: ${part.why}.`;
    text(held, part ? how + (part.settled > 0 ? " Its handles miss what it stands on by a little: it is set down." : "") : "");
  });
  return element;
}

/** Rounds away what turning between frames has added: 12 digits of the largest. */
const exact = (of) => {
  const unit = 1e-12 * Math.max(...of.map(Math.abs), 1e-12);
  return (x) => (Math.abs(x) < unit ? 0 : Number(x.toPrecision(12)));
};
