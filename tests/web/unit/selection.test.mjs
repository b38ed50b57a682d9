import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import {
  clicksOf,
  describe,
  furtherBorders,
  inverted,
  polygonOf,
  proposalOf,
  rectangleOf,
  sentence,
  share,
  spread,
  strokeOf,
  thingAt,
  thinned,
  whatMoves,
  widened,
  withClick,
} from "../../../web/selection.js";

const CAMERA = { eye: [0, 0, -5], target: [0, 0, 0], up: [0, -1, 0], fov_y_deg: 50, width: 400, height: 300 };
const click = (selection, kind, point, more = {}) => withClick(selection, { op: "add", kind, point, ...more });

test("the clicks of one thing are one operation", () => {
  const one = click([], "inside", [1, 0, 0]);
  assert.deepEqual(one, [{ grow: { inside: [[1, 0, 0]] } }]);
  const three = click(click(one, "outside", [2, 0, 0]), "inside", [3, 0, 0]);
  const grow = {
    inside: [
      [1, 0, 0],
      [3, 0, 0],
    ],
    outside: [[2, 0, 0]],
  };
  assert.deepEqual(three, [{ grow }]);
  assert.deepEqual(one, [{ grow: { inside: [[1, 0, 0]] } }], "values are never changed in place");
  assert.deepEqual(
    clicksOf(three).map(({ kind, point }) => [kind, point[0]]),
    [
      ["inside", 1],
      ["inside", 3],
      ["outside", 2],
    ],
  );
});

test("a click after a stroke still belongs to the thing, and another thing begins when it is said to", () => {
  const stroke = { op: "subtract", stroke: { camera: CAMERA, points: [[1, 1]], radius: 3, depth: "visible" } };
  const before = [...click([], "inside", [1, 0, 0]), stroke];
  assert.deepEqual(click(before, "outside", [2, 0, 0])[0].grow.outside, [[2, 0, 0]]);
  const next = click(before, "inside", [5, 0, 0], { fresh: true });
  assert.equal(next.length, 3);
  assert.deepEqual(click(next, "inside", [6, 0, 0])[2].grow.inside, [
    [5, 0, 0],
    [6, 0, 0],
  ]);
  assert.equal(next[0], before[0]);
});

test("a click begins another thing where the selection was inverted or cut since", () => {
  const grown = click([], "inside", [1, 0, 0]);
  const lasso = { op: "intersect", polygon: { camera: CAMERA, points: [[1, 1], [9, 1], [9, 9]], depth: "visible" } };
  for (const change of [{ invert: true }, { shrink: 0.1 }, { largest: 1 }, lasso, { ...grown[0], op: "intersect" }]) {
    const next = click([...grown, change], "inside", [2, 0, 0]);
    assert.deepEqual(next, [...grown, change, { grow: { inside: [[2, 0, 0]] } }]);
    assert.deepEqual(click(next, "outside", [3, 0, 0])[2].grow.outside, [[3, 0, 0]]);
    assert.equal(click([...grown, change], "outside", [2, 0, 0]), null);
  }
  const kept = click(grown, "inside", [2, 0, 0], { op: "intersect" });
  assert.equal(click(kept, "inside", [3, 0, 0], { op: "intersect" }).length, 2);
});

test("what is taken away grows apart from what is added", () => {
  const added = click([], "inside", [1, 0, 0]);
  const taken = click(added, "inside", [2, 0, 0], { op: "subtract" });
  assert.deepEqual(taken[1], { op: "subtract", grow: { inside: [[2, 0, 0]] } });
  assert.deepEqual(click(taken, "inside", [3, 0, 0])[0].grow.inside, [
    [1, 0, 0],
    [3, 0, 0],
  ]);
  assert.equal(click([], "outside", [1, 0, 0]), null, "not it: but not what?");
  assert.equal(click(added, "outside", [1, 0, 0], { fresh: true }), null);
});

test("strokes and lassos keep as many points as say where they went", () => {
  const points = Array.from({ length: 100 }, (_, i) => [i * 0.512345, 10]);
  const { stroke } = strokeOf({ op: "add", camera: CAMERA, points, radius: 20, depth: "visible" });
  assert.ok(stroke.points.length < 15, `${stroke.points.length}`);
  assert.deepEqual(stroke.points[1], [5.1, 10], "to a tenth of a pixel");
  assert.deepEqual({ ...stroke, points: 0 }, { camera: CAMERA, points: 0, radius: 20, depth: "visible" });
  const dot = strokeOf({ op: "subtract", camera: CAMERA, points: [[3, 4]], radius: 5, depth: "through" });
  assert.deepEqual([dot.op, dot.stroke.points], ["subtract", [[3, 4]]]);
  const around = [
    [0, 0],
    [50, 0],
    [50, 1],
    [50, 50],
    [0, 50],
  ];
  const lasso = polygonOf({ op: "intersect", camera: CAMERA, points: around, depth: "through" });
  assert.deepEqual(lasso.polygon.points, [
    [0, 0],
    [50, 0],
    [50, 50],
    [0, 50],
  ]);
  assert.equal(lasso.op, "intersect");
  assert.equal(polygonOf({ op: "add", camera: CAMERA, points: around.slice(0, 2), depth: "visible" }), null);
  assert.deepEqual(thinned([], 2), []);
});

test("inverting twice is nothing", () => {
  const selection = [{ sphere: { center: [0, 0, 0], radius: 1 } }];
  assert.deepEqual(inverted(selection).at(-1), { invert: true });
  assert.deepEqual(inverted(inverted(selection)), selection);
});

test("every operation of the contract has a name for people", () => {
  const { selection } = JSON.parse(
    readFileSync(new URL("../../../proto/examples/selection.json", import.meta.url), "utf8"),
  );
  for (const step of selection) assert.match(describe(step), /^[A-Z][^{}]+$/, JSON.stringify(step));
  assert.equal(describe(selection[0]), "Add a whole thing: 2 points on it, 1 not, 1 border wider");
  assert.equal(describe({ op: "subtract", rows: [[0, 1]] }), "Subtract 1 range of rows");
  assert.equal(describe({ largest: 1 }), "Keep the largest piece");
});

test("one click proposes the whole thing, which can be made more or less of, border by border", () => {
  const thing = thingAt([1, 2, 3]);
  assert.deepEqual(thing, [{ grow: { inside: [[1, 2, 3]], whole: true } }]);
  assert.equal(widened(thing, 1)[0].grow.wider, 1);
  assert.deepEqual(widened(widened(thing, 1), -1), thing, "back where it was, the same text");
  assert.equal(widened(widened(thing, -1), -1)[0].grow.wider, -2);
  const last = { border: { wider: 2, more: false, less: true } };
  assert.equal(widened(widened(thing, 3), -1, last)[0].grow.wider, 1, "from the last one that there is");
  const { more, less } = furtherBorders(last);
  assert.deepEqual({ more, less }, { more: false, less: true });
  assert.deepEqual(furtherBorders(null), { more: true, less: true });
});

test("a rectangle is a polygon of four corners, whichever way it was drawn; a line is none", () => {
  const drawn = { op: "add", camera: CAMERA, depth: "through" };
  const { polygon } = rectangleOf({ ...drawn, points: [[90, 80], [50, 50], [10, 20]] });
  assert.deepEqual(polygon.points, [[90, 80], [10, 80], [10, 20], [90, 20]]);
  assert.equal(polygon.depth, "through");
  assert.equal(rectangleOf({ ...drawn, points: [[90, 80], [10, 81]] }), null);
  assert.equal(rectangleOf({ ...drawn, points: [[90, 80]] }), null);
});

test("a selection is made wider and narrower in proportion to its size", () => {
  const answer = { count: 1600, bounds: { low: [0, 0, 0], high: [1, 4, 2] } };
  assert.deepEqual(spread(thingAt([0, 0, 0]), 1, answer).at(-1), { expand: 0.2 });
  assert.deepEqual(spread(thingAt([0, 0, 0]), -1, answer).at(-1), { shrink: 0.2 });
  const point = { count: 3, bounds: { low: [1, 1, 1], high: [1, 1, 1] } };
  assert.equal(spread(thingAt([0, 0, 0]), 1, point).length, 1, "what has no size has nothing to go by");
});

test("a selection made by hand is no proposal", () => {
  assert.ok(proposalOf(thingAt([0, 0, 0])));
  assert.ok(proposalOf(widened(thingAt([0, 0, 0]), 2)));
  for (const selection of [
    [],
    [{ grow: { inside: [[0, 0, 0]] } }],
    [...thingAt([0, 0, 0]), { expand: 0.1 }],
    [{ op: "subtract", ...thingAt([0, 0, 0])[0] }],
  ])
    assert.equal(proposalOf(selection), null, JSON.stringify(selection));
});

test("what the service says of a selection is a sentence", () => {
  assert.equal(sentence("nothing is selected"), "Nothing is selected.");
  assert.equal(sentence("selection[2].sphere: the sphere names no Gaussian"), "Step 3: the sphere names no Gaussian.");
  assert.equal(share(579, 20076), "2.9 %");
  assert.equal(share(1, 1e6), "less than 0.1 %");
  assert.equal(share(0, 10), "0 %");
  const moves = (selection, selectionAnswer = null) => whatMoves({ selection, selectionAnswer });
  assert.match(moves([]), /spheres/);
  assert.match(moves([{ invert: true }], { count: 1234 }), /1,234 Gaussians/);
  assert.match(moves([{ invert: true }], { error: {} }), /could not/);
});
