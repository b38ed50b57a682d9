import assert from "node:assert/strict";
import { test } from "node:test";

import { project } from "../../../web/camera.js";
import { quaternionOf, turnedBy } from "../../../web/motion.js";
import { changedShape, lastShape, outlineOf, shapeAround, shapeHandles, withShape } from "../../../web/shapes.js";
import { addScaled, distance, dot, unit } from "../../../web/vectors.js";

const camera = { eye: [3, -2, -6], target: [0, 0, 0], up: [0, -1, 0], fov: 50, width: 800, height: 600 };
const near = (a, b, apart = 1e-6) => assert.ok(distance(a, b) <= apart, `${a} is not ${b}`);
const pixels = (point) => project(camera, point);
const box = { center: [0.2, 0, 0], size: [1, 2, 0.5], rotation: quaternionOf([0.3, 0.2, -0.4]) };

test("the shape that selects last is the last operation's, whatever that does", () => {
  const sphere = { center: [0, 0, 0], radius: 1 };
  assert.deepEqual(lastShape([{ box }, { op: "subtract", sphere }]), { sphere });
  assert.equal(lastShape([{ sphere }, { invert: true }]), null);
  assert.equal(lastShape([]), null);
  const other = { ...sphere, radius: 2 };
  assert.deepEqual(withShape([{ box }, { op: "subtract", sphere }], { sphere: other }), [{ box }, { op: "subtract", sphere: other }]);
});

test("a box stands upright in its scene, and one along the axes has no turn", () => {
  for (const up of [[0, -1, 0], [0, 1, 0]]) assert.equal(shapeAround("box", [1, 2, 3], 0.5, up).box.rotation, undefined);
  for (const up of [unit([0.2, -1, 0.3]), [0, 0, 1], unit([0, 1, 1])]) {
    const { rotation, size } = shapeAround("box", [1, 2, 3], 0.5, up).box;
    assert.ok(Math.abs(dot(turnedBy(rotation, [0, 1, 0]), up)) > 1 - 1e-9, `${up}`);
    assert.deepEqual(size, [1, 1, 1]);
  }
  assert.deepEqual(shapeAround("sphere", [1, 2, 3], 0.5, [0, -1, 0]), { sphere: { center: [1, 2, 3], radius: 0.5 } });
});

test("a face that is pulled goes where the hand does, and the one opposite stays", () => {
  const handles = shapeHandles({ box }, camera);
  assert.equal(handles.length, 6);
  for (const [i, handle] of handles.entries()) {
    const axis = turnedBy(box.rotation, [0, 1, 2].map((k) => (k === i >> 1 ? 1 - 2 * (i & 1) : 0)));
    const to = addScaled(handle.at, axis, 0.3);
    const after = handle.drag(pixels(handle.at).x, pixels(handle.at).y)(pixels(to).x, pixels(to).y);
    const again = shapeHandles(after, camera);
    near(again[i].at, to);
    near(again[i ^ 1].at, handles[i ^ 1].at);
    assert.deepEqual(after.box.rotation, box.rotation);
    const pushed = handle.nudge(-100).box;
    assert.ok(pushed.size.every((edge) => edge > 0), "never through the other side");
    near(shapeHandles({ box: pushed }, camera)[i ^ 1].at, handles[i ^ 1].at);
  }
});

test("the dot of a sphere sets its radius", () => {
  const sphere = { center: [0, 0, 0], radius: 1 };
  const [handle] = shapeHandles({ sphere }, camera);
  const to = pixels(addScaled([0, 0, 0], handle.at, 1.8));
  assert.ok(Math.abs(handle.drag(0, 0)(to.x, to.y).sphere.radius - 1.8) < 1e-6);
  const { x, y } = pixels([0, 0, 0]);
  assert.ok(handle.drag(0, 0)(x, y).sphere.radius > 0);
  assert.ok(Math.abs(handle.nudge(0.5).sphere.radius - 1.5) < 1e-12);
});

test("the gizmo moves, turns and sizes a shape; a ball looks the same however it is turned", () => {
  const sphere = { center: [1, 0, 0], radius: 1 };
  assert.deepEqual(changedShape({ sphere }, { shift: [0, 1, 0] }).sphere.center, [1, 1, 0]);
  assert.deepEqual(changedShape({ sphere }, { turn: [0, 1, 0] }), { sphere });
  assert.equal(changedShape({ sphere }, { size: 2 }).sphere.radius, 2);
  assert.deepEqual(changedShape({ box }, { size: 2 }).box.size, [2, 4, 1]);
  const turned = changedShape({ box: { center: [0, 0, 0], size: [1, 1, 1] } }, { turn: [0, 0, Math.PI / 2] }).box;
  near(turnedBy(turned.rotation, [1, 0, 0]), [0, 1, 0]);
});

test("an outline is drawn of what is in front of the camera", () => {
  assert.equal(outlineOf({ box }, camera).match(/M/g).length, 12);
  assert.match(outlineOf({ sphere: { center: [0, 0, 0], radius: 1 } }, camera), /^M.*Z$/);
  const behind = addScaled(camera.eye, camera.eye, 1);
  assert.equal(outlineOf({ box: { center: behind, size: [1, 1, 1] } }, camera), "");
  assert.equal(outlineOf({ sphere: { center: camera.eye, radius: 1 } }, camera), "", "nor from within");
});
