// Spheres and boxes that select, as things in the picture: their outlines, and what a drag of their handles makes of them.

import { boxEdges, draggedAlong, onViewPlane, project, projectSegment, sphereOutline, upOf } from "./camera.js";
import { attrs, h, keyedList, s } from "./dom.js";
import { labelled, numberField, pointField } from "./fields.js";
import { multiplied, quaternionOf, turnedBy, vectorOf } from "./motion.js";
import { pathOf } from "./overlay.js";
import { add, addScaled, cross, distance, dot, length, scale, sub, unit } from "./vectors.js";

const UNTURNED = [1, 0, 0, 0];
const THINNEST = 0.01; // Of its longest edge, or its radius: a shape is never dragged to nothing.
const DEGREES = 180 / Math.PI;

/** The sphere or box of the last operation, {sphere} or {box}; null where that is neither. */
export function lastShape(selection) {
  const { sphere, box } = selection.at(-1) ?? {};
  return sphere ? { sphere } : box ? { box } : null;
}

/** A selection with another shape in place of its last one. */
export const withShape = (selection, shape) => [...selection.slice(0, -1), { ...selection.at(-1), ...shape }];

/** A sphere, or a box that stands upright, around a point. */
export function shapeAround(tool, center, radius, up) {
  if (tool === "sphere") return { sphere: { center, radius } };
  // Boxes of the contract stand along y; the least turn takes that to the scene's up, or to its opposite, as is nearer.
  const y = up[1] < 0 ? scale(up, -1) : up;
  const axis = cross([0, 1, 0], y);
  const turn = scale(unit(axis), Math.asin(Math.min(1, length(axis))));
  const box = { center, size: [2 * radius, 2 * radius, 2 * radius] };
  return { box: length(axis) > 1e-6 ? { ...box, rotation: quaternionOf(turn) } : box };
}

export const centreOf = ({ sphere, box }) => (sphere ?? box).center;

const axesOf = ({ rotation = UNTURNED }) => [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => turnedBy(rotation, axis));

/** A shape as a part of the gizmo changes it: {shift} | {turn} | {size}. */
export function changedShape(shape, { shift, turn, size }) {
  const [name] = Object.keys(shape);
  const one = shape[name];
  if (shift) return { [name]: { ...one, center: add(one.center, shift) } };
  if (turn) return name === "box" ? { box: { ...one, rotation: multiplied(quaternionOf(turn), one.rotation ?? UNTURNED) } } : shape;
  return name === "box" ? { box: { ...one, size: scale(one.size, size) } } : { sphere: { ...one, radius: one.radius * size } };
}

/** The handles that a shape has besides the gizmo: [{name, label, at, drag(x, y), nudge(step)}]. `at`: world units; drag
 *  begun there returns (x, y) -> the shape; nudge by so many pixels outwards. */
export function shapeHandles(shape, camera) {
  const { sphere, box } = shape;
  if (sphere) {
    const { center, radius } = sphere;
    const up = upOf(camera);
    const at = addScaled(center, up, radius);
    const sized = (r) => ({ sphere: { center, radius: Math.max(r, THINNEST * radius) } });
    const drag = () => (x, y) => sized(distance(onViewPlane(camera, x, y, center), center));
    return [{ name: "radius", label: "Radius", at, drag, nudge: (world) => sized(radius + world) }];
  }
  const { center, size } = box;
  const least = THINNEST * Math.max(...size);
  return axesOf(box).flatMap((axis, i) =>
    [1, -1].map((sign) => {
      const outwards = scale(axis, sign);
      const at = addScaled(center, outwards, size[i] / 2);
      // The face opposite stays where it is.
      const pulled = (by) => {
        const edge = Math.max(size[i] + by, least);
        const moved = addScaled(center, outwards, (edge - size[i]) / 2);
        return { box: { ...box, center: moved, size: size.map((e, k) => (k === i ? edge : e)) } };
      };
      const drag = (x0, y0) => {
        const from = draggedAlong(camera, at, x0, y0, outwards);
        return (x, y) => pulled(dot(sub(draggedAlong(camera, at, x, y, outwards), from), outwards));
      };
      const name = `${sign > 0 ? "" : "minus-"}${"xyz"[i]}`;
      return { name, label: `Face ${sign > 0 ? "" : "minus "}${"xyz"[i]}`, at, drag, nudge: pulled };
    }),
  );
}

/** The lines of a shape in the picture, as the `d` of a path. */
export function outlineOf({ sphere, box }, camera) {
  const round = sphere && sphereOutline(camera, sphere.center, sphere.radius);
  if (sphere) return round ? pathOf(round, true) : "";
  const around = (point) => add(box.center, turnedBy(box.rotation ?? UNTURNED, point));
  return boxEdges([0, 0, 0], box.size)
    .map((edge) => projectSegment(camera, ...edge.map(around)))
    .filter(Boolean)
    .map((edge) => pathOf(edge.map(({ x, y }) => [x, y])))
    .join("");
}

/** Shapes over the picture. */
export class ShapeView {
  #outline = s("path", { class: "shape", testid: "shape-outline" });
  #update;
  #handles = new Map();
  #perPixel = 0;

  /** take(event, begin) as HeldView */
  constructor(svg, editor, { take }) {
    const group = s("g");
    svg.append(this.#outline, group);
    this.#update = keyedList(
      group,
      ({ name }) => name,
      ({ name }) => {
        const element = s(
          "g",
          {
            class: "face",
            tabindex: "0",
            role: "button",
            testid: name === "radius" ? "shape-radius-dot" : `shape-${name}`,
            onpointerdown: (event) => take(event, ({ x, y }) => editor.dragShape(this.#handles.get(name).drag(x, y))),
            onkeydown: (event) => {
              const step = { ArrowUp: 8, ArrowRight: 8, ArrowDown: -8, ArrowLeft: -8 }[event.key];
              if (!step) return;
              event.preventDefault();
              event.stopPropagation();
              editor.changeShape(this.#handles.get(name).nudge((event.shiftKey ? step / 8 : step) * this.#perPixel));
            },
          },
          s("circle", { class: "reach", r: 14 }),
          s("circle", { class: "mark", r: 6 }),
        );
        return {
          element,
          update: ({ label, seen }) =>
            attrs(element, { "aria-label": `${label}: arrow keys`, transform: `translate(${seen.x.toFixed(1)} ${seen.y.toFixed(1)})` }),
        };
      },
    );
  }

  /**   shapes    all that are drawn
   *    held      the one with handles, or null
   *    perPixel  world units of a pixel there */
  draw(camera, { shapes, held, perPixel }) {
    this.#perPixel = perPixel;
    attrs(this.#outline, { d: shapes.map((shape) => outlineOf(shape, camera)).join("") || null });
    const handles = held ? shapeHandles(held, camera) : [];
    this.#handles = new Map(handles.map((handle) => [handle.name, handle]));
    this.#update(handles.map((handle) => ({ ...handle, seen: project(camera, handle.at) })).filter(({ seen }) => seen));
  }
}

/** The numbers of the last shape, for the panel. */
export function shapeFields(editor) {
  const { store } = editor;
  const change = (patch) => {
    const shape = lastShape(store.state.selection);
    const [name] = Object.keys(shape);
    editor.changeShape({ [name]: { ...shape[name], ...patch } });
  };
  const centre = pointField({ label: "Centre of the shape", testid: "shape-center", changed: (center) => change({ center }) });
  const radius = numberField({ label: "Radius of the sphere", testid: "shape-radius", min: 0, changed: (r) => r > 0 && change({ radius: r }) });
  const size = pointField({ label: "Size of the box", testid: "shape-size", min: 0, changed: (p) => p.every((e) => e > 0) && change({ size: p }) });
  const turn = pointField({
    label: "Turn of the box, degrees",
    testid: "shape-turn",
    changed: (v) => change({ rotation: quaternionOf(scale(v, 1 / DEGREES)) }),
  });
  const radiusRow = labelled("Radius", radius.element);
  const boxRows = h("div", { class: "stack" }, labelled("Size", size.element), labelled("Turned by (degrees)", turn.element));
  const element = h("div", { class: "stack", testid: "shape-fields" }, labelled("Centre", centre.element), radiusRow, boxRows);
  store.watch(["selection"], ({ selection }) => {
    const shape = lastShape(selection);
    element.hidden = !shape;
    if (!shape) return;
    centre.update(centreOf(shape));
    radiusRow.hidden = !shape.sphere;
    boxRows.hidden = !shape.box;
    if (shape.sphere) radius.update(shape.sphere.radius);
    else {
      size.update(shape.box.size);
      turn.update(scale(vectorOf(shape.box.rotation ?? UNTURNED), DEGREES));
    }
  });
  return element;
}
