import assert from "node:assert/strict";
import { test } from "node:test";

import {
  isMoved,
  motionOf,
  moved,
  multiplied,
  quaternionOf,
  scaledAbout,
  shifted,
  turnedAbout,
  turnedBy,
  unmoved,
  vectorOf,
  withMotion,
} from "../../../web/motion.js";
import { distance, scale, turned, unit } from "../../../web/vectors.js";

const near = (a, b, message) => assert.ok(distance(a, b) < 1e-9, `${message ?? ""} ${a} is not ${b}`);
const handle = { source: [1, 0, 0], target: [2, 3, 4], rotation: quaternionOf([0.3, -0.5, 0.9]), scale: 1.7 };

test("a quaternion turns as its rotation vector says, and a product is one turn after the other", () => {
  const [a, b] = [[0.4, 0, 0.2], [0, -1.1, 0.3]];
  const v = [1, 2, 3];
  near(turnedBy(quaternionOf(a), v), turned(v, unit(a), Math.hypot(...a)));
  near(turnedBy(multiplied(quaternionOf(b), quaternionOf(a)), v), turnedBy(quaternionOf(b), turnedBy(quaternionOf(a), v)));
  for (const vector of [[0, 0, 0], [0.1, 0, 0], [0, 2, -1], [0, 0, 5]]) near(vectorOf(quaternionOf(vector)), vector);
});

test("the source goes to the target, and what has moved is found again", () => {
  near(moved(handle, handle.source), handle.target);
  for (const point of [[0, 0, 0], [4, -2, 1]]) near(unmoved(handle, moved(handle, point)), point);
  near(moved({ source: [1, 2, 3], target: null }, [4, 5, 6]), [4, 5, 6], "an anchor stays");
  assert.ok(!isMoved({ source: [0, 0, 0], target: null, rotation: null, scale: null }));
  assert.ok(isMoved({ source: [0, 0, 0], target: null, scale: 2 }));
});

test("what is moved on, turned on or scaled on is so about the place it is at, whatever was done before", () => {
  const pivot = [0, 1, 0];
  const place = moved(handle, pivot);
  const point = [0.5, 0.5, 0.5];
  const now = moved(handle, point);
  near(moved({ ...handle, ...shifted(handle, [1, 0, -1]) }, point), [now[0] + 1, now[1], now[2] - 1]);
  const after = { ...handle, ...turnedAbout(handle, place, [0, 0, 0.7]) };
  near(moved(after, pivot), place, "the pivot stays");
  const offset = [0, 1, 2].map((i) => now[i] - place[i]);
  near(moved(after, point), turned(offset, [0, 0, 1], 0.7).map((x, i) => x + place[i]));
  const grown = { ...handle, ...scaledAbout(handle, place, 2) };
  near(moved(grown, pivot), place);
  near(moved(grown, point), scale(offset, 2).map((x, i) => x + place[i]));
  assert.equal(scaledAbout({ source: [0, 0, 0], target: null, scale: 900 }, [0, 0, 0], 5).scale, 1000, "what is taken");
});

test("a turn by hand goes on beyond half a turn: the quaternion's w goes below 0", () => {
  let turning = { source: [0, 0, 0], target: null };
  for (let i = 0; i < 8; ++i) turning = { ...turning, ...turnedAbout(turning, [0, 0, 0], [0, 0.5, 0]) };
  assert.ok(turning.rotation[0] < 0);
  near(vectorOf(turning.rotation), [0, 4, 0]);
});

test("a motion in numbers is the handle's, and back", () => {
  const pivot = [3, 1, -2];
  const { shift, turn, size } = motionOf(handle, pivot);
  const again = { ...handle, ...withMotion(handle, pivot, { shift, turn, size }) };
  near(again.target, handle.target);
  near(vectorOf(again.rotation), [0.3, -0.5, 0.9]);
  assert.ok(Math.abs(again.scale - 1.7) < 1e-12);
  const still = withMotion(handle, pivot, { shift: [0, 0, 1], turn: [0, 0, 0], size: 1 });
  assert.deepEqual(still, { target: [1, 0, 1], rotation: null, scale: null }, "what is not asked for is left out");
});
