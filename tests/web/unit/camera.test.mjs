import assert from "node:assert/strict";
import { test } from "node:test";

import {
  axes,
  boxEdges,
  centredOn,
  dollied,
  dragged,
  ellipseOf,
  firstPose,
  flown,
  focal,
  isPose,
  lookedAround,
  onLine,
  onTheWire,
  onViewPlane,
  orbited,
  panned,
  pictureKey,
  pictureSize,
  placedIn,
  pivotedAt,
  poseOfView,
  project,
  projectSegment,
  rayThrough,
  samePose,
  sphereOutline,
  unitsPerPixel,
  upOf,
  zoomedAt,
} from "../../../web/camera.js";
import { add, cross, distance, dot, length, scale, sub, unit } from "../../../web/vectors.js";

const pose = { eye: [1, -2, -5], target: [0.5, 0, 1], up: [0.1, -1, 0.05], fov: 50 };
const camera = { ...pose, width: 640, height: 400 };

function near(actual, expected, tolerance = 1e-9) {
  const a = [actual].flat();
  const e = [expected].flat();
  assert.equal(a.length, e.length);
  a.forEach((value, i) => assert.ok(Math.abs(value - e[i]) <= tolerance, `[${i}]: ${value} is not ${e[i]}`));
}

test("the axes are those of OpenCV: x right, y down, z forward, right-handed", () => {
  const { right, down, forward } = axes({ eye: [0, 0, 0], target: [0, 0, 3], up: [0, -1, 0] });
  near(right, [1, 0, 0]);
  near(down, [0, 1, 0]);
  near(forward, [0, 0, 1]);
  const tilted = axes(pose);
  near(cross(tilted.right, tilted.down), tilted.forward);
  assert.ok(dot(tilted.down, pose.up) < 0);
});

test("an up vector along the view, or none, still gives axes", () => {
  for (const up of [
    [0, 0, 1],
    [0, 0, -2],
    [0, 0, 0],
  ]) {
    const { right, down, forward } = axes({ eye: [0, 0, 0], target: [0, 0, 2], up });
    for (const axis of [right, down, forward]) near(length(axis), 1);
    near(cross(right, down), forward);
  }
});

test("the target is in the middle of the picture, and a point above it is above the middle", () => {
  near([project(camera, pose.target).x, project(camera, pose.target).y], [320, 200]);
  const above = project(camera, add(pose.target, scale(pose.up, 0.3)));
  assert.ok(above.y < 200);
});

test("projection is that of a pinhole camera in closed form", () => {
  const straight = { eye: [0, 0, 0], target: [0, 0, 1], up: [0, -1, 0], fov: 90, width: 200, height: 100 };
  near(focal(straight), 50);
  const { x, y, depth } = project(straight, [1, -0.5, 2]);
  near([x, y, depth], [100 + 50 * 0.5, 50 - 50 * 0.25, 2]);
});

test("the vertical field of view spans the height of the picture", () => {
  const { down, forward } = axes(pose);
  const half = (25 * Math.PI) / 180;
  const edge = add(pose.eye, add(scale(forward, Math.cos(half)), scale(down, Math.sin(half))));
  near(project(camera, edge).y, 400);
});

test("what is behind the camera has no place in the picture", () => {
  const { forward } = axes(pose);
  assert.equal(project(camera, sub(pose.eye, forward)), null);
  assert.equal(project(camera, pose.eye), null);
});

test("a segment that passes the camera is drawn as far as it is in front", () => {
  const straight = { eye: [0, 0, 0], target: [0, 0, 1], up: [0, -1, 0], fov: 90, width: 100, height: 100 };
  const [a, b] = projectSegment(straight, [0.5, 0, 1], [0.5, 0, -1]);
  near([a.x, a.y], [75, 50]);
  assert.ok(b.x > 1000 && Number.isFinite(b.x));
  assert.equal(projectSegment(straight, [0, 0, -1], [1, 0, -2]), null);
});

test("a ray through a pixel meets what projects there", () => {
  for (const [x, y] of [
    [0, 0],
    [320, 200],
    [639.5, 12.25],
  ]) {
    const { origin, direction } = rayThrough(camera, x, y);
    near(length(direction), 1);
    const seen = project(camera, add(origin, scale(direction, 3.7)));
    near([seen.x, seen.y], [x, y], 1e-8);
  }
});

test("a drag in the view plane keeps the depth and lands under the pointer", () => {
  const from = [0.2, 0.4, 2];
  const moved = onViewPlane(camera, 100, 333, from);
  const { forward } = axes(pose);
  near(dot(sub(moved, from), forward), 0);
  const seen = project(camera, moved);
  near([seen.x, seen.y], [100, 333], 1e-8);
});

test("a drag that ends where it began moves nothing", () => {
  const from = [0.2, 0.4, 2];
  const { x, y } = project(camera, from);
  for (const constraint of ["view", "level", "x", "y", "z", "normal"])
    near(dragged(camera, from, x, y, constraint, { normal: [0.3, -0.2, 0.9] }), from, 1e-9);
});

test("a drag along an axis stays on it and follows the pointer", () => {
  const from = [0.2, 0.4, 2];
  for (const [constraint, axis] of [
    ["x", [1, 0, 0]],
    ["y", [0, 1, 0]],
    ["z", [0, 0, 1]],
    ["normal", unit([1, 2, -1])],
  ]) {
    const wanted = add(from, scale(axis, 0.7));
    const { x, y } = project(camera, wanted);
    near(dragged(camera, from, x, y, constraint, { normal: [1, 2, -1] }), wanted, 1e-8);
    const off = dragged(camera, from, x + 9, y - 7, constraint, { normal: [1, 2, -1] });
    near(length(cross(sub(off, from), axis)), 0, 1e-9);
  }
});

test("a handle without a normal is dragged in the view plane instead", () => {
  const from = [0.2, 0.4, 2];
  near(dragged(camera, from, 50, 60, "normal", { normal: null }), dragged(camera, from, 50, 60, "view"));
});

test("a drag along an axis that faces the camera does not jump", () => {
  const from = [0.2, 0.4, 2];
  const { x, y } = project(camera, from);
  const { direction } = rayThrough(camera, x, y);
  for (const tilt of [0, 0.02, 0.2]) {
    const normal = unit(add(scale(direction, -1), [0, tilt, 0]));
    for (const pixels of [1, 5, 40]) {
      const moved = dragged(camera, from, x, y - pixels, "normal", { normal });
      near(length(cross(sub(moved, from), normal)), 0, 1e-9);
      near(dot(sub(moved, from), normal), pixels * unitsPerPixel(camera, from), 1e-9);
    }
  }
});

test("a level drag stays at its height, follows the pointer, and does not run away to the horizon", () => {
  const up = [0, -1, 0];
  const from = [0.2, 0.4, 2];
  const above = { ...camera, eye: [0, -3, -3], target: from, up };
  for (const [dx, dy] of [[60, 20], [-90, -40]]) {
    const { x, y } = project(above, from);
    const moved = dragged(above, from, x + dx, y + dy, "level", { up });
    near(moved[1], from[1], 1e-9);
    const seen = project(above, moved);
    near([seen.x, seen.y], [x + dx, y + dy], 1e-6);
  }
  const flat = { ...camera, eye: [0.2, 0.4, -3], target: from, up };
  for (const y of [0, 100, 149, 151, 299]) {
    const moved = dragged(flat, from, 250, y, "level", { up });
    near(moved[1], from[1], 1e-9);
    assert.ok(length(sub(moved, from)) < 20, `${moved} at ${y}`);
  }
});

test("a level drag never jumps and never turns back, from the lowest row of the picture to the highest", () => {
  const up = [0, -1, 0];
  const from = [0, 0, 0];
  for (const height of [0, 0.05, 0.29, 0.31, 0.6, 1.5, 4]) {
    const above = { ...camera, eye: [0, -height, -3], target: from, up, width: 600, height: 400 };
    let last = null;
    for (let y = 399.5; y > 0; --y) {
      const moved = dragged(above, from, 300, y, "level", { up });
      near(moved[1], 0, 1e-9);
      const { eye } = above;
      assert.ok(distance(moved, eye) < 3.0001 * distance(from, eye), `${moved} at ${y}, ${height} above`);
      if (last) {
        assert.ok(moved[2] >= last[2] - 1e-9, `back to ${moved} from ${last} at ${y}, ${height} above`);
        const most = 0.25 * distance(from, eye);
        assert.ok(distance(moved, last) < most, `a step to ${moved} from ${last} at ${y}, ${height} above`);
      }
      last = moved;
    }
  }
});

test("zooming keeps what is under the pointer where it is", () => {
  const under = onViewPlane(camera, 500, 90, camera.target);
  const nearer = zoomedAt(camera, 500, 90, 0.4, 1e-3);
  const seen = project({ ...nearer, width: camera.width, height: camera.height }, under);
  near([seen.x, seen.y], [500, 90], 1e-6);
  near(distance(nearer.eye, nearer.target), 0.4 * distance(camera.eye, camera.target));
  const least = zoomedAt(camera, 500, 90, 1e-9, 0.5);
  near(distance(least.eye, least.target), 0.5);
});

test("a box fills an ellipse of the picture; one that is partly behind the camera none", () => {
  const seen = ellipseOf(camera, { low: [-0.1, -0.2, 1.9], high: [0.3, 0.2, 2.1] });
  const middle = project(camera, [0.1, 0, 2]);
  assert.ok(Math.hypot(seen.x - middle.x, seen.y - middle.y) < 10);
  assert.ok(seen.rx > 5 && seen.ry > 5);
  assert.equal(ellipseOf(camera, { low: [-100, -100, -100], high: [100, 100, 100] }), null);
});

test("along the line of sight a pixel says nothing, so nothing moves", () => {
  const { direction } = rayThrough(camera, 111, 222);
  const through = add(pose.eye, scale(direction, 4));
  near(onLine(camera, 111, 222, through, direction), through);
});

test("a pixel is as large as the projection says", () => {
  const point = [0.2, 0.4, 2];
  const { right } = axes(pose);
  const a = project(camera, point);
  const b = project(camera, add(point, scale(right, unitsPerPixel(camera, point))));
  near(b.x - a.x, 1, 1e-9);
});

test("the outline of a sphere touches it: every ray through it is a tangent", () => {
  const centre = [0.9, 0.8, 1.5];
  const outline = sphereOutline(camera, centre, 0.6);
  assert.equal(outline.length, 48);
  for (const [x, y] of outline) {
    const { origin, direction } = rayThrough(camera, x, y);
    near(length(cross(sub(centre, origin), direction)), 0.6, 1e-9);
  }
});

test("a sphere around the camera, or partly behind it, has no outline", () => {
  assert.equal(sphereOutline(camera, pose.eye, 1), null);
  const { right } = axes(pose);
  assert.equal(sphereOutline(camera, add(pose.eye, right), 0.9), null);
});

test("an orbit keeps the distance, the target and the shape of the camera", () => {
  let turned = pose;
  for (let i = 0; i < 500; ++i) turned = orbited(turned, 0.13, i % 2 ? 0.4 : -0.2, [0, -1, 0]);
  near(distance(turned.eye, turned.target), distance(pose.eye, pose.target), 1e-9);
  assert.equal(turned.target, pose.target);
  near(length(turned.up), length(pose.up), 1e-9);
});

test("an orbit moves what faces the camera with the hand", () => {
  const straight = { eye: [0, 0, -5], target: [0, 0, 0], up: [0, -1, 0], fov: 50, width: 400, height: 400 };
  const front = [0, 0, -1];
  const before = project(straight, front);
  const right = project({ ...straight, ...orbited(straight, 0.1, 0, [0, -1, 0]) }, front);
  assert.ok(right.x > before.x + 1);
  near(right.y, before.y, 1e-9);
  const downwards = project({ ...straight, ...orbited(straight, 0, 0.1, [0, -1, 0]) }, front);
  assert.ok(downwards.y > before.y + 1);
});

test("an orbit does not go over the pole", () => {
  for (const pitch of [0.7, -0.7]) {
    let turned = { ...pose, up: [0, -1, 0] };
    for (let i = 0; i < 50; ++i) turned = orbited(turned, 0, pitch, [0, -1, 0]);
    const { forward, down } = axes(turned);
    assert.ok(Math.abs(dot(forward, [0, -1, 0])) < Math.cos((2 * Math.PI) / 180));
    assert.ok(dot(down, [0, -1, 0]) < 0, "still the right way up");
  }
});

test("looking around stays where it is, moves all that is seen with the hand, and does not go over the pole", () => {
  const straight = { eye: [0, 0, -5], target: [0, 0, 0], up: [0, -1, 0], fov: 50, width: 400, height: 400 };
  for (const point of [[0, 0, -4], [0, 0, 90]]) {
    const before = project(straight, point);
    const right = { ...straight, ...lookedAround(straight, 0.1, 0, [0, -1, 0]) };
    assert.equal(right.eye, straight.eye);
    near(distance(right.eye, right.target), 5);
    assert.ok(project(right, point).x > before.x + 1);
    const downwards = { ...straight, ...lookedAround(straight, 0, 0.1, [0, -1, 0]) };
    assert.ok(project(downwards, point).y > before.y + 1);
  }
  for (const pitch of [0.7, -0.7]) {
    let turned = { ...pose, up: [0, -1, 0] };
    for (let i = 0; i < 50; ++i) turned = lookedAround(turned, 0, pitch, [0, -1, 0]);
    const { forward, down } = axes(turned);
    assert.ok(Math.abs(dot(forward, [0, -1, 0])) < Math.cos((2 * Math.PI) / 180));
    assert.ok(dot(down, [0, -1, 0]) < 0, "still the right way up");
  }
});

test("who flies goes aside, up and ahead, and takes the pivot along", () => {
  const straight = { eye: [0, 0, -5], target: [0, 0, 0], up: [0, -1, 0], fov: 50 };
  const gone = flown(straight, [1, 2, 3], [0, -2, 0]);
  near(gone.eye, [1, -2, -2]);
  near(gone.target, [1, -2, 3]);
  // Up is the world's, wherever the camera looks.
  near(sub(flown(pose, [0, 1, 0], [0, -1, 0]).eye, pose.eye), [0, -1, 0]);
});

test("panning by a pixel moves the target's surroundings by a pixel", () => {
  const moved = { ...camera, ...panned(camera, 30, -12) };
  const seen = project(moved, pose.target);
  near([seen.x, seen.y], [350, 188], 1e-9);
});

test("a dolly changes the distance only, and stops before the target", () => {
  near(distance(dollied(pose, 0.5, 0).eye, pose.target), distance(pose.eye, pose.target) / 2);
  near(distance(dollied(pose, 1e-9, 0.25).eye, pose.target), 0.25);
  near(axes(dollied(pose, 3, 0)).forward, axes(pose).forward);
});

test("centring keeps direction and distance", () => {
  const centred = centredOn(pose, [7, 8, 9]);
  near(axes(centred).forward, axes(pose).forward);
  near(distance(centred.eye, [7, 8, 9]), distance(pose.eye, pose.target));
});

test("the first look at a scene shows its centre, upright, from outside", () => {
  for (const up of [null, [0, -1, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]]) {
    const first = firstPose({ centre: [3, -2, 8], radius: 2, up });
    assert.ok(isPose(first));
    near(first.target, [3, -2, 8]);
    assert.ok(distance(first.eye, first.target) > 4);
    assert.ok(dot(upOf(first), unit(up ?? [0, -1, 0])) > 0.5);
  }
  assert.ok(isPose(firstPose({ centre: [0, 0, 0], radius: 0, up: null })), "even of a single point");
});

test("a dataset view becomes a pose that sees the same", () => {
  const truth = { eye: [1, 2, 3], target: [4, 1, 9], up: unit([0.3, -1, 0.1]), fov: 40, width: 300, height: 200 };
  const { right, down, forward } = axes(truth);
  const rows = [right, down, forward].map((axis) => [...axis, -dot(axis, truth.eye)]);
  const f = focal(truth);
  const view = { width: 300, height: 200, fx: f, fy: f, cx: 150, cy: 100, cam_from_world: rows };
  const seen = poseOfView(view, { centre: [5, 0, 12], radius: 3 }, 1.5);
  const point = [3.5, 1.1, 8];
  const a = project(truth, point);
  const b = project({ ...seen, width: 300, height: 200 }, point);
  near([b.x, b.y, b.depth], [a.x, a.y, a.depth], 1e-9);
  near(dot(sub(seen.target, [5, 0, 12]), forward), 0, 1e-9);
});

test("a dataset view is seen whole in a narrow picture", () => {
  const rows = [
    [1, 0, 0, 0],
    [0, 1, 0, 0],
    [0, 0, 1, 0],
  ];
  const view = { width: 400, height: 200, fx: 200, fy: 200, cx: 200, cy: 100, cam_from_world: rows };
  const seen = { ...poseOfView(view, { centre: [0, 0, 5], radius: 1 }, 1), width: 300, height: 300 };
  near(project(seen, [1, 0, 1]).x, 300, 1e-9);
});

test("a view that looks away from the scene still has a pivot in front of it", () => {
  const rows = [
    [1, 0, 0, 0],
    [0, 1, 0, 0],
    [0, 0, 1, 0],
  ];
  const view = { width: 400, height: 200, fx: 200, fy: 200, cx: 200, cy: 100, cam_from_world: rows };
  const seen = poseOfView(view, { centre: [0, 0, -5], radius: 2 }, 2);
  near(seen.target, [0, 0, 2]);
});

test("moving the pivot along the view changes the orbit, not the picture", () => {
  const point = [0.9, 0.3, 2];
  const moved = pivotedAt(pose, point);
  near(project({ ...moved, width: 640, height: 400 }, moved.target).depth, project(camera, point).depth);
  assert.equal(pictureKey(moved), pictureKey(pose));
  assert.ok(!samePose(moved, pose));
  assert.notEqual(pictureKey(orbited(pose, 0.001, 0, [0, -1, 0])), pictureKey(pose));
  assert.notEqual(pictureKey({ ...pose, fov: 51 }), pictureKey(pose));
  assert.equal(pivotedAt(pose, [1, -2, -9]), pose, "a point behind the camera has no say");
});

test("what comes out of storage is a pose or is refused", () => {
  assert.ok(isPose(JSON.parse(JSON.stringify(pose))));
  for (const bad of [
    null,
    {},
    { ...pose, eye: [1, 2] },
    { ...pose, fov: 0 },
    { ...pose, up: [1, NaN, 0] },
    { ...pose, eye: pose.target },
  ])
    assert.ok(!isPose(bad));
});

test("poses are the same only if every number is", () => {
  assert.ok(samePose(pose, structuredClone(pose)));
  assert.ok(!samePose(pose, { ...pose, eye: [1, -2, -5.000001] }));
  assert.ok(!samePose(pose, null));
});

test("the wire has the contract's names", () => {
  assert.deepEqual(Object.keys(onTheWire(camera)).sort(), ["eye", "fov_y_deg", "height", "target", "up", "width"]);
});

test("a picture keeps its shape on a canvas of another one, as high as that", () => {
  const canvas = { width: 400, height: 300 };
  assert.deepEqual(placedIn({ width: 160, height: 120 }, canvas), { x: 0, y: 0, ...canvas });
  assert.deepEqual(placedIn({ width: 161, height: 120 }, canvas), { x: 0, y: 0, ...canvas }, "rounding");
  assert.deepEqual(placedIn({ width: 120, height: 120 }, canvas), { x: 50, y: 0, width: 300, height: 300 });
  assert.deepEqual(placedIn({ width: 240, height: 120 }, canvas), { x: -100, y: 0, width: 600, height: 300 });
});

test("pictures are made smaller, never larger, and keep their shape", () => {
  assert.deepEqual(pictureSize(1200, 800, 400), { width: 400, height: 267 });
  assert.deepEqual(pictureSize(300, 200, 400), { width: 300, height: 200 });
  assert.deepEqual(pictureSize(4000, 1, 100), { width: 100, height: 1 });
});

test("a box has twelve edges, as long as its sides", () => {
  const edges = boxEdges([1, 2, 3], [2, 4, 6]);
  assert.equal(edges.length, 12);
  const lengths = edges.map(([a, b]) => distance(a, b)).sort();
  assert.deepEqual(lengths, [2, 2, 2, 2, 4, 4, 4, 4, 6, 6, 6, 6]);
});
