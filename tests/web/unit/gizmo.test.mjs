import assert from "node:assert/strict";
import { test } from "node:test";

import { axes, project } from "../../../web/camera.js";
import { FRAMES, frameAxes, gizmoParts, TOOLS } from "../../../web/gizmo.js";
import { add, addScaled, cross, distance, dot, length, turned, unit } from "../../../web/vectors.js";

const camera = { eye: [3, -2, -6], target: [0, 0, 0], up: [0, -1, 0], fov: 50, width: 800, height: 600 };
const up = [0, -1, 0];
const near = (a, b, apart = 1e-9) => assert.ok(distance(a, b) <= apart, `${a} is not ${b}`);
const partsOf = (tool, frame = "world", at = [0, 0, 0]) =>
  Object.fromEntries(gizmoParts(tool, frameAxes(frame, camera, { up, normal: null }), at, camera).map((p) => [p.name, p]));

test("every frame is right-handed, of unit length, and where it says", () => {
  for (const frame of FRAMES)
    for (const normal of [null, unit([1, -2, 0.5]), up]) {
      const [x, y, z] = frameAxes(frame, camera, { up, normal });
      near(cross(x, y), z);
      for (const axis of [x, y, z]) assert.ok(Math.abs(length(axis) - 1) < 1e-12);
    }
  near(frameAxes("view", camera, { up, normal: null })[1], axes(camera).down.map((v) => -v));
  const normal = unit([1, -2, 0.5]);
  const [x, , z] = frameAxes("surface", camera, { up, normal });
  near(z, normal);
  assert.ok(Math.abs(dot(x, up)) < 1e-12, "x is level");
});

test("an arrow that is pulled along itself moves along its axis, by what the picture says", () => {
  for (const frame of FRAMES) {
    const world = frameAxes(frame, camera, { up, normal: null });
    for (const [name, part] of Object.entries(partsOf("move", frame)).filter(([n]) => /-[xyz]$/.test(n))) {
      const axis = world[part.axis];
      const [from, to] = [0.4, 1.3].map((t) => project(camera, addScaled([0, 0, 0], axis, t)));
      const { shift } = part.drag(from.x, from.y)(to.x, to.y);
      near(shift, addScaled([0, 0, 0], axis, 0.9), 1e-6);
      assert.ok(name);
    }
  }
});

test("a square moves in its plane, and the hand stays on what it took", () => {
  const parts = partsOf("move");
  const [a, b] = [[0.2, 0.3, 0], [1, -0.5, 0]].map((p) => project(camera, p));
  near(parts["move-xy"].drag(a.x, a.y)(b.x, b.y).shift, [0.8, -0.8, 0], 1e-6);
  assert.ok(!parts["move-zx"], "a plane that is seen too flatly has no square");
});

test("a ring that is pulled turns what is seen with the hand, on and on", () => {
  for (const [name, axis] of [["turn-x", [1, 0, 0]], ["turn-y", [0, 1, 0]], ["turn-z", [0, 0, 1]]]) {
    const part = partsOf("turn")[name];
    // A point of the ring, and where a quarter of a turn takes it: an ellipse's angles are not the circle's, but over
    // whole turns they agree.
    const on = unit(cross(axis, [0.3, 0.5, 0.8]));
    const at = (angle) => project(camera, turned(on, axis, angle));
    const start = at(0);
    const moves = part.drag(start.x, start.y);
    let turn;
    for (let k = 1; k <= 80; ++k) {
      const { x, y } = at((2 * Math.PI * k) / 40);
      ({ turn } = moves(x, y));
    }
    near(turn, axis.map((x) => x * 4 * Math.PI), 1e-6);
  }
});

test("a ring seen edge-on turns by what the hand moves along it", () => {
  const flat = { ...camera, eye: [0, 0, -6] };
  const parts = gizmoParts("turn", frameAxes("world", flat, { up, normal: null }), [0, 0, 0], flat);
  const y = parts.find(({ name }) => name === "turn-y");
  // World y points down, towards the viewer is -z: what is in front moves from x to ... by the right hand's rule.
  const front = [0, 0, -1];
  const [a, b] = [project(flat, front), project(flat, turned(front, [0, 1, 0], 0.2))];
  const { turn } = y.drag(a.x, a.y)(b.x, b.y);
  assert.ok(turn[1] > 0.05 && turn[0] === 0 && turn[2] === 0, `${turn}`);
});

test("what is farther than the middle of a ring is told from what is nearer", () => {
  for (const [name, { lines }] of Object.entries(partsOf("turn")))
    assert.equal(lines.some(({ far }) => far), name !== "turn-view", name);
});

test("the size follows how far the hand is from the middle", () => {
  const { size } = partsOf("size");
  const { x, y } = project(camera, [0, 0, 0]);
  assert.ok(Math.abs(size.drag(x + 50, y)(x + 100, y).size - 2) < 1e-12);
  assert.ok(size.drag(x + 50, y)(x, y).size > 0, "never to nothing");
});

test("an axis that faces the camera has no arrow, and behind the camera there is no gizmo", () => {
  const front = { ...camera, eye: [0, 0, -6] };
  const names = gizmoParts("move", frameAxes("world", front, { up, normal: null }), [0, 0, 0], front).map(({ name }) => name);
  assert.deepEqual(names.sort(), ["move-x", "move-xy", "move-y"]);
  for (const tool of TOOLS) assert.deepEqual(gizmoParts(tool, frameAxes("world", camera, { up }), add(camera.eye, [3, -2, -6]), camera), []);
});

test("the arrow keys mean a step of each part, forwards and back", () => {
  for (const tool of TOOLS)
    for (const part of Object.values(partsOf(tool))) {
      const [there, back] = [part.nudge(8, 0), part.nudge(-8, 0)];
      const [kind] = Object.keys(there);
      if (kind === "size") assert.ok(Math.abs(there.size * back.size - 1) < 1e-12 && there.size > 1);
      else near(there[kind], back[kind].map((x) => -x));
    }
});
