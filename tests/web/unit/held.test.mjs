import assert from "node:assert/strict";
import { test } from "node:test";

import { onTheWire, project } from "../../../web/camera.js";
import { Answers, beforeMoves, footOf, isBehind, lookingAlong } from "../../../web/held.js";
import { quaternionOf } from "../../../web/motion.js";
import { slider } from "../../../web/surface.js";
import { distance } from "../../../web/vectors.js";
import { settle } from "./stand_ins.mjs";

const up = [0, -1, 0];
const near = (a, b, apart = 1e-9) => assert.ok(distance(a, b) <= apart, `${a} is not ${b}`);
const bounds = { low: [-1, -2, -1], high: [1, 0, 1] };
const at = (target, more = {}) => ({ handle: { source: [0, -1, 0], target, ...more }, pivot: [0, -1, 0] });

test("a thing reaches down to the lowest of its box, turned and scaled as it is", () => {
  assert.deepEqual(footOf(at(null), bounds, up), { place: [0, -1, 0], height: 1 });
  const { place, height } = footOf(at([5, -1, 0], { scale: 2 }), bounds, up);
  near([...place.slice(0, 2), height], [5, -1, 2]);
  const tilted = footOf(at(null, { rotation: quaternionOf([0, 0, Math.PI / 4]) }), bounds, up);
  assert.ok(Math.abs(tilted.height - Math.SQRT2) < 1e-9);
  assert.equal(footOf(at(null), null, up).height, 0, "a point has none");
});

test("what is seen on a preview is told as of the version", () => {
  const holds = ([x]) => Math.abs(x) <= 1;
  const moves = [{ handle: { source: [0, 0, 0], target: [5, 0, 0] }, holds }];
  assert.deepEqual(beforeMoves([5.5, 0, 0], moves), { point: [0.5, 0, 0], moved: true });
  assert.deepEqual(beforeMoves([3, 0, 0], moves), { point: [3, 0, 0], moved: false }, "what stays is where it was");
});

test("a point behind what a camera shows is hidden; on it, or before nothing, it is not", () => {
  const camera = { eye: [0, 0, -10] };
  assert.ok(isBehind(camera, [0, 0, 0], { hit: true, point: [0, 0, -5] }));
  assert.ok(!isBehind(camera, [0, 0, 0], { hit: true, point: [0, 0, -0.1] }));
  assert.ok(!isBehind(camera, [0, 0, 0], { hit: false, point: null }));
  assert.ok(!isBehind(camera, [0, 0, 0], undefined), "nobody has said so yet");
});

test("what looks down from a thing has what lies below it in the middle of its picture", () => {
  const camera = lookingAlong([1, -2, 3], [0, 1, 0]);
  const { x, y } = project(camera, [1, 7, 3]);
  near([x, y, 0], [4.5, 4.5, 0]);
  assert.ok(onTheWire(camera).width === 9);
});

test("an answer is asked for once, a few at a time, and what is drawn hears of it", async () => {
  let changes = 0;
  const asked = [];
  const answers = new Answers(() => (changes += 1), { atOnce: 1 });
  const get = (key) => answers.get(key, async () => (asked.push(key), key === "bad" ? Promise.reject(new Error("no")) : key.toUpperCase()));
  assert.equal(get("a"), undefined);
  assert.equal(get("a"), undefined);
  assert.equal(get("b"), undefined, "one at a time");
  await settle();
  assert.deepEqual([get("a"), changes, asked], ["A", 1, ["a"]]);
  get("bad");
  await settle();
  assert.equal(get("bad"), undefined);
  assert.deepEqual(asked, ["a", "bad"], "what failed is not asked for again and again");
});

/** A thing of height 2 that stands on a floor at y = 0, dragged on it. */
const camera = { eye: [0, -6, -12], target: [0, 0, 0], up, fov: 50, width: 800, height: 600 };
function sliding(pick) {
  const held = { ...at(null), bounds };
  const start = project(camera, [0, -1, 0]);
  const puts = [];
  const mover = slider({ held, camera, at: start, up, pick });
  return { puts, mover, drag: (x, y) => mover.at(x, y, (patch) => puts.push(patch.target)), start };
}

test("a thing slides on the floor and stands on it, wherever it was taken hold of", async () => {
  const floor = async (x, y) => {
    // Where the ray meets the floor.
    const { x: x0, y: y0 } = project(camera, [0, 0, 0]);
    return { hit: true, point: [(x - x0) / 50, 0, -(y - y0) / 50], normal: [0, -1, 0] };
  };
  const { puts, mover, drag, start } = sliding(floor);
  drag(start.x + 300, start.y);
  await mover.settled();
  near([puts.at(-1)[0], puts.at(-1)[1], 0], [6, -1, 0], 1e-6);
  drag(start.x + 1, start.y);
  const target = puts.at(-1);
  assert.ok(Math.abs(target[1] + 1) < 1e-9 && Math.abs(target[0]) < 0.1, "over itself it stays level, and nobody is asked");
});

test("it leans against a wall, and of places asked for meanwhile only the newest counts", async () => {
  const asked = [];
  const { puts, mover, drag, start } = sliding(async (x) => {
    asked.push(Math.round(x - start.x));
    return { hit: true, point: [4, -1, 0], normal: [-1, 0, 0] };
  });
  for (const far of [200, 220, 240]) drag(start.x + far, start.y);
  await mover.settled();
  assert.deepEqual(asked, [200, 240]);
  near(puts.at(-1), [3, -1, 0]);
});

test("where nothing is, it stays where it was put last", async () => {
  const { puts, mover, drag, start } = sliding(async () => ({ hit: false, point: null, normal: null }));
  drag(start.x + 300, start.y);
  await mover.settled();
  assert.deepEqual(puts, []);
});
