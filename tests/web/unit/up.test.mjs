import assert from "node:assert/strict";
import { test } from "node:test";

import { axes, seenFrom, upOfViews } from "../../../web/camera.js";
import { clickFloor, upOfFloor } from "../../../web/up.js";
import { distance, dot } from "../../../web/vectors.js";

const near = (a, b) => assert.ok(distance(a, b) < 1e-9, `${a} is not ${b}`);
const view = (down) => ({ cam_from_world: [[1, 0, 0, 0], [...down, 0], [0, 0, 1, 0]] });

test("cameras were held upright on the whole, or say nothing", () => {
  near(upOfViews([view([0, 0, 1]), view([0, 0, 1])]), [0, 0, -1]);
  const [x, y, z] = upOfViews([view([0.6, 0.8, 0]), view([-0.6, 0.8, 0])]);
  near([x, y, z], [0, -1, 0]);
  near(upOfViews([view([1, 0, 0]), view([-1, 0, 0])]), [0, -1, 0]);
  // Cameras around a thing, on one side of it, that all look down by 30 degrees.
  const around = [-0.6, -0.2, 0.1, 0.7].map((angle) => {
    const pose = { eye: [4 * Math.sin(angle), -4 * Math.tan(Math.PI / 6), -4 * Math.cos(angle)], target: [0, 0, 0], up: [0, -1, 0] };
    const { right, down, forward } = axes(pose);
    return { cam_from_world: [[...right, 1], [...down, 2], [...forward, 3]] };
  });
  assert.ok(distance(upOfViews(around), [0, -1, 0]) < 1e-3, `${upOfViews(around)}`);
  near(upOfViews([]), [0, -1, 0]);
});

test("three points of a floor say what is up: towards who sees it from above", () => {
  const floor = [[0, 1, 0], [1, 1, 0], [0, 1, 2]];
  near(upOfFloor(floor, [0, -5, 0]), [0, -1, 0]);
  near(upOfFloor([...floor].reverse(), [0, -5, 0]), [0, -1, 0]);
  near(upOfFloor(floor, [0, 5, 0]), [0, 1, 0]);
  assert.equal(upOfFloor([[0, 0, 0], [1, 0, 0], [2, 1e-3, 0]], [0, -5, 0]), null, "in line");
});

test("the third click declares it, and one that meets nothing counts for nothing", async () => {
  const points = [[0, 1, 0], null, [1, 1, 0], [0, 1, 1]];
  const state = { floorClicks: [] };
  const declared = [];
  const editor = {
    state,
    store: { set: (patch) => Object.assign(state, patch) },
    surfaceAt: async () => points.shift(),
    setUp: async (up) => declared.push(up),
    say: () => {},
  };
  for (let i = 0; i < 3; ++i) await clickFloor(editor, { eye: [0, -3, 0] }, 1, 1);
  assert.equal(state.floorClicks.length, 2);
  await clickFloor(editor, { eye: [0, -3, 0] }, 1, 1);
  assert.equal(state.floorClicks, null);
  assert.equal(declared.length, 1);
  near(declared[0], [0, -1, 0]);
});

test("looking along an axis keeps what is looked at, its distance, and stays upright", () => {
  const pose = { eye: [0, -1, -4], target: [1, 2, 3], up: [0, -1, 0], fov: 50 };
  for (const direction of [[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]]) {
    const turned = seenFrom(pose, direction, [0, -1, 0]);
    near(turned.target, pose.target);
    assert.ok(Math.abs(distance(turned.eye, turned.target) - distance(pose.eye, pose.target)) < 1e-9);
    const { forward, right, down } = axes(turned);
    near(forward, direction.map((x) => (x === 0 ? 0 : -x)));
    if (direction[1] === 0) near(down, [0, 1, 0]);
    // From above, what was to the right is to the right.
    else assert.ok(dot(right, axes(pose).right) > 0.9, `${direction}`);
  }
});
