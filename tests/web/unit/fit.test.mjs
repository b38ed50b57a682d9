import assert from "node:assert/strict";
import { test } from "node:test";

import { firstPose, project } from "../../../web/camera.js";
import { coverage, fittedPose } from "../../../web/fit.js";

const SIDE = 96;

/** What a pose shows of points, each as large as a pixel. */
const lookAt = (points, asked = []) => async (pose) => {
  asked.push(pose);
  const alpha = new Uint8ClampedArray(SIDE * SIDE);
  for (const point of points) {
    const seen = project({ ...pose, width: SIDE, height: SIDE }, point);
    if (seen && seen.x >= 0 && seen.x < SIDE && seen.y >= 0 && seen.y < SIDE)
      alpha[Math.floor(seen.y) * SIDE + Math.floor(seen.x)] = 255;
  }
  return coverage(alpha, SIDE);
};

/** Points of a box. */
const boxOf = ([w, h, d], [x, y, z]) =>
  Array.from({ length: 21 ** 3 }, (_, i) => [
    x + w * ((i % 21) / 20 - 0.5),
    y + h * ((Math.floor(i / 21) % 21) / 20 - 0.5),
    z + d * (Math.floor(i / 441) / 20 - 0.5),
  ]);

test("what a picture shows is told by its rim and its box", () => {
  const alpha = new Uint8ClampedArray(SIDE * SIDE);
  assert.deepEqual(coverage(alpha, SIDE), { rim: 0, box: null });
  alpha[24 * SIDE + 48] = 255;
  alpha[71 * SIDE + 71] = 255;
  alpha[10 * SIDE + 10] = 100;
  assert.deepEqual(coverage(alpha, SIDE), { rim: 0, box: [0, -0.5, 0.5, 0.5] });
  assert.equal(coverage(new Uint8ClampedArray(SIDE * SIDE).fill(255), SIDE).rim, 1);
});

test("a thing taller, wider or farther aside than a first look is seen whole, and large", async () => {
  for (const [size, at, aspect] of [
    [[1, 3.2, 1], [0, -1.6, 0], 1.6],
    [[1, 3.2, 1], [0, -1.6, 0], 0.6],
    [[6, 0.4, 0.4], [2, 0, 0], 1.6],
    [[0.2, 0.2, 0.2], [0, 0, 0], 1.6],
  ]) {
    const points = boxOf(size, at);
    const scene = { centre: at, radius: 0.7, up: null };
    const pose = await fittedPose(scene, () => aspect, lookAt(points));
    const camera = { ...pose, width: 1000 * aspect, height: 1000 };
    const seen = points.map((point) => project(camera, point));
    const [x, y] = ["x", "y"].map((axis) => seen.map((p) => p[axis]));
    const margins = [Math.min(...x), camera.width - Math.max(...x), Math.min(...y), camera.height - Math.max(...y)];
    assert.ok(margins.every((margin) => margin > 20), `${size}: ${margins}`);
    const filled = Math.max((Math.max(...x) - Math.min(...x)) / camera.width, (Math.max(...y) - Math.min(...y)) / 1000);
    assert.ok(filled > 0.55, `${size}: ${filled} of the picture`);
    assert.ok(camera.height - Math.max(...y) > Math.min(...y), "more room below, where bars are");
  }
});

test("who stands in a room stays there", async () => {
  const room = boxOf([9, 9, 9], [0, 0, 0]);
  const asked = [];
  const scene = { centre: [0, 0, 0], radius: 1, up: null };
  // A wall so near that its points would have gaps between them: shown as one.
  const look = lookAt(room, asked);
  const filled = async (pose) => ({ ...(await look(pose)), rim: 0.9 });
  assert.deepEqual(await fittedPose(scene, () => 1.5, filled), firstPose(scene));
  assert.equal(asked.length, 1);
  assert.deepEqual(await fittedPose(scene, () => 1.5, lookAt([])), firstPose(scene), "nor is there anything to fit");
});
