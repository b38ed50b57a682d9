// Selections in the form they have on the wire: a list of operations, carried out in order. Values are replaced, never
// changed in place. No elements and no requests here.

import { counted, gaussians } from "./format.js";

/** The operations that the tools work on now. */
export const listOf = ({ healing, heal, selection }) => (healing ? heal : selection);

/** What is done with what an operation names. */
export const opOf = (operation) => operation.op ?? "add";

/** An operation in which "add", the default, is left out. */
export const operation = (op, action) => (op === "add" ? action : { op, ...action });

/** Whether two numbers in a row of points are nearer than `apart` pixels. */
const near = (a, b, apart) => Math.hypot(a[0] - b[0], a[1] - b[1]) < apart;
const tenths = (points) => points.map((point) => point.map((x) => Math.round(x * 10) / 10));

/** A row of pixels without those that are nearer than `apart` to the last one kept. The first stays. */
export function thinned(points, apart) {
  const kept = [];
  for (const point of points) if (kept.length === 0 || !near(kept.at(-1), point, apart)) kept.push(point);
  return kept;
}

/** Whether an operation changes what all before it have selected: what one of those names is no longer what is seen. */
const changesAll = (step) => opOf(step) === "intersect" || Object.keys(step).some((name) => name in CHANGES);

/** A selection with one more click of click-to-grow. All clicks of one thing are one operation, whatever was brushed
 *  since: the last one that grows with this `op`, unless the selection was inverted, narrowed or the like since.
 *    kind   "inside": the point is on the thing; "outside": it is not
 *    fresh  this click begins another thing
 *  Returns null where "outside" has no thing to be outside of. */
export function withClick(selection, { op, kind, point, fresh = false }) {
  const isThis = (o) => Boolean(o.grow) && opOf(o) === op;
  const at = fresh ? -1 : selection.findLastIndex((o) => isThis(o) || changesAll(o));
  if (at < 0 || !isThis(selection[at])) {
    return kind === "inside" ? [...selection, operation(op, { grow: { inside: [point] } })] : null;
  }
  const { grow } = selection[at];
  const grown = { ...selection[at], grow: { ...grow, [kind]: [...(grow[kind] ?? []), point] } };
  return selection.map((o, i) => (i === at ? grown : o));
}

/** What one click proposes: the whole of the thing that the point is on. */
export const thingAt = (point) => [{ grow: { inside: [point], whole: true } }];

/** The grow of a selection that is such a proposal, widened or not; null for any other selection. */
export function proposalOf(selection) {
  const { op, grow } = selection[0] ?? {};
  return selection.length === 1 && op === undefined && grow?.whole && grow.inside.length === 1 ? grow : null;
}

/** A proposal with its border so many natural borders farther out (below 0: in) than the service says that it is. */
export function widened(selection, by, answer = null) {
  const { wider = 0, ...grow } = proposalOf(selection);
  const sum = (answer?.border?.wider ?? wider) + by;
  return [{ grow: sum === 0 ? grow : { ...grow, wider: sum } }];
}

/** On which sides of a proposal there is a further border: {more, less}. Both until the service has said otherwise. */
export const furtherBorders = (answer) => answer?.border ?? { more: true, less: true };

/** A line drawn with the brush.
 *    camera  as the service takes it; points and radius are pixels of it */
export function strokeOf({ op, camera, points, radius, depth }) {
  return operation(op, { stroke: { camera, points: tenths(thinned(points, Math.max(1, radius / 4))), radius, depth } });
}

/** What the lasso went round; null if that is no area. */
export function polygonOf({ op, camera, points, depth }) {
  const corners = tenths(thinned(points, 3));
  return corners.length < 3 ? null : operation(op, { polygon: { camera, points: corners, depth } });
}

/** What a rectangle between two corners shows; null if that is no area. */
export function rectangleOf({ points, ...drawn }) {
  const [[x0, y0], [x1, y1]] = [points[0], points.at(-1)];
  if (Math.min(Math.abs(x1 - x0), Math.abs(y1 - y0)) < 3) return null;
  const corners = [
    [x0, y0],
    [x1, y0],
    [x1, y1],
    [x0, y1],
  ];
  return polygonOf({ ...drawn, points: corners });
}

/** A selection made wider (1) or narrower (-1) all around, by about two Gaussians: as far as they would be from each
 *  other if they covered a square as long as its bounds. */
export function spread(selection, by, { count, bounds: { low, high } }) {
  const longest = Math.max(...low.map((l, i) => high[i] - l));
  const distance = Number(((2 * longest) / Math.sqrt(count)).toPrecision(3));
  return distance > 0 ? [...selection, by > 0 ? { expand: distance } : { shrink: distance }] : selection;
}

/** The other way round. Twice is as it was. */
export function inverted(selection) {
  return selection.at(-1)?.invert ? selection.slice(0, -1) : [...selection, { invert: true }];
}

/** Every point that was clicked: [{point, kind}]. */
export function clicksOf(selection) {
  const of = (kind) => (o) => (o.grow?.[kind] ?? []).map((point) => ({ point, kind }));
  return selection.flatMap((o) => [...of("inside")(o), ...of("outside")(o)]);
}

const OPS = { add: "Add", subtract: "Subtract", intersect: "Keep only" };
const NAMES = {
  grow: ({ inside, outside = [], whole = false, wider = 0 }) =>
    `a ${whole ? "whole thing" : "thing"}: ${counted(inside.length, "point")} on it${outside.length ? `, ${outside.length} not` : ""}` +
    (wider ? `, ${counted(Math.abs(wider), "border")} ${wider > 0 ? "wider" : "narrower"}` : ""),
  stroke: ({ depth }) => `a brush stroke${depth === "through" ? ", through" : ""}`,
  polygon: ({ depth }) => `a lasso${depth === "through" ? ", through" : ""}`,
  sphere: () => "a sphere",
  box: () => "a box",
  plane: () => "one side of a plane",
  masks: (masks) => `what ${counted(masks.length, "mask")} show`,
  rows: (ranges) => counted(ranges.length, "range") + " of rows",
};
const CHANGES = {
  expand: (d) => `Widen by ${d}`,
  shrink: (d) => `Narrow by ${d}`,
  largest: (n) => `Keep the ${n === 1 ? "largest piece" : `${n} largest pieces`}`,
  invert: () => "Invert",
};

/** What an operation does, in words: "Subtract a brush stroke". */
export function describe(step) {
  const [action, value] = Object.entries(step).find(([name]) => name !== "op") ?? ["", null];
  if (CHANGES[action]) return CHANGES[action](value);
  return `${OPS[opOf(step)]} ${NAMES[action]?.(value) ?? action}`;
}

/** A sentence of the service about a selection, as a person reads it: its "selection[2]" is the third step. */
export function sentence(warning) {
  const [, index, rest] = /^selection\[(\d+)\][^:]*: (.*)$/s.exec(warning) ?? [];
  if (rest !== undefined) return `Step ${Number(index) + 1}: ${rest}.`;
  return `${warning[0].toUpperCase()}${warning.slice(1)}.`;
}

/** What says what moves, for the panel of the request. */
export function whatMoves({ healing, heal = [], ...state }) {
  const answer = healing ? null : state.selectionAnswer;
  return `${moves(state.selection, answer)}${heal.length > 0 ? " A run also heals what you have marked." : ""}`;
}

function moves(selection, answer) {
  if (selection.length === 0) return "What moves: the Gaussians in the handles' spheres.";
  if (!answer) return "What moves: what is selected.";
  if (answer.error) return "What moves: the selection, but the service could not carry it out: see there.";
  return `What moves: the ${gaussians(answer.count)} that are selected.`;
}

/** How much of a scene that is: "3.1 %". */
export function share(part, whole) {
  const percent = (100 * part) / Math.max(1, whole);
  return percent > 0 && percent < 0.1 ? "less than 0.1 %" : `${Number(percent.toFixed(percent < 10 ? 1 : 0))} %`;
}
