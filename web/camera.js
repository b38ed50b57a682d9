// The viewer's camera and all its geometry: a pinhole camera with OpenCV axes (x right, y down, z forward), as the
// service renders it. Pure functions over plain values.
//
//   pose    {eye, target, up, fov}     world units; fov: vertical, degrees. `target` is also the pivot of an orbit.
//   camera  pose + {width, height}     pixels. A pixel's centre lies at +0.5; (0, 0) is the corner of the picture.

import { add, addScaled, cross, distance, dot, length, perpendicular, scale, sub, turned, unit } from "./vectors.js";

export const DEFAULT_UP = [0, -1, 0];
const DEFAULT_FOV = 50;

// An orbit stops this far from looking straight along the up axis, where left and right have no meaning.
const POLE_MARGIN = (3 * Math.PI) / 180;
// A plane whose angle to the ray to its middle has less than this sine is seen edge-on; choices, as the next two.
const EDGE_ON = 0.1;
const FARTHEST = 3; // Times the distance at which a drag began.
const FACES_CAMERA = 0.97; // Cosine of the angle between an axis and the way to the camera: 14 degrees.
// Nothing nearer than this fraction of the distance to the pivot is drawn over the picture.
const NEAR = 1e-4;

const radians = (degrees) => (degrees * Math.PI) / 180;
const degrees = (angle) => (angle * 180) / Math.PI;

/** The camera's axes in the world, unit vectors. An `up` along the view has no say in it: a fixed one is taken. */
export function axes({ eye, target, up }) {
  const forward = unit(sub(target, eye));
  const side = cross(forward, unit(up, DEFAULT_UP));
  const right = length(side) > 1e-9 ? unit(side) : perpendicular(forward);
  return { right, down: cross(forward, right), forward };
}

/** Focal length, pixels; the same for both axes. */
export function focal(camera) {
  return camera.height / 2 / Math.tan(radians(camera.fov) / 2);
}

/** The camera as the service takes it. */
export function onTheWire({ eye, target, up, fov, width, height }) {
  return { eye, target, up, fov_y_deg: fov, width, height };
}

function inCamera(camera, point) {
  const { right, down, forward } = axes(camera);
  const v = sub(point, camera.eye);
  return [dot(v, right), dot(v, down), dot(v, forward)];
}

const nearest = (pose) => NEAR * distance(pose.eye, pose.target);

function pixelOf(camera, [x, y, z]) {
  const f = focal(camera);
  return { x: (f * x) / z + camera.width / 2, y: (f * y) / z + camera.height / 2, depth: z };
}

/** Where a point of the world is in the picture, pixels, and its depth; null for one behind the camera. */
export function project(camera, point) {
  const p = inCamera(camera, point);
  return p[2] > nearest(camera) ? pixelOf(camera, p) : null;
}

/** The part of the segment a-b in front of the camera as two pixel positions; null if all of it is behind. */
export function projectSegment(camera, a, b) {
  let p = inCamera(camera, a);
  let q = inCamera(camera, b);
  const near = nearest(camera);
  if (p[2] <= near && q[2] <= near) return null;
  const cut = (from, to) => add(from, scale(sub(to, from), (2 * near - from[2]) / (to[2] - from[2])));
  if (p[2] <= near) p = cut(p, q);
  if (q[2] <= near) q = cut(q, p);
  return [pixelOf(camera, p), pixelOf(camera, q)];
}

/** The ray through a pixel position: {origin, direction}, direction of length 1. */
export function rayThrough(camera, x, y) {
  const { right, down, forward } = axes(camera);
  const f = focal(camera);
  const v = addScaled(addScaled(forward, right, (x - camera.width / 2) / f), down, (y - camera.height / 2) / f);
  return { origin: camera.eye, direction: unit(v) };
}

/** The point under a pixel position on the plane through `through` that faces the camera. */
export function onViewPlane(camera, x, y, through) {
  const { forward } = axes(camera);
  const { origin, direction } = rayThrough(camera, x, y);
  const depth = dot(sub(through, origin), forward);
  return addScaled(origin, direction, depth / dot(direction, forward));
}

/** The point of the line through `through` along the unit vector `axis` that comes nearest to a pixel's ray. `through`
 *  itself where the line runs (nearly) along the ray: a pixel then says nothing about a place on it. */
export function onLine(camera, x, y, through, axis) {
  const { origin, direction } = rayThrough(camera, x, y);
  const b = dot(axis, direction);
  const apart = 1 - b * b;
  if (apart < 1e-4) return through;
  const w = sub(through, origin);
  const along = (b * dot(direction, w) - dot(axis, w)) / apart;
  return addScaled(through, axis, along);
}

/** The point under a pixel position on the plane through `through` at right angles to the unit vector `normal`. Towards
 *  the horizon, where the plane runs away from under the hand, and beyond, no farther from the camera than FARTHEST. Of a
 *  plane that is seen nearly edge-on a pixel says nothing: the point under it on the plane that faces the camera, moved
 *  along `normal` into the plane. Which of the two depends on camera and plane alone: no drag jumps between them. */
export function onPlane(camera, x, y, through, normal) {
  const { origin, direction } = rayThrough(camera, x, y);
  const away = distance(through, origin);
  const height = dot(sub(through, origin), normal);
  if (Math.abs(height) < EDGE_ON * away) {
    const point = onViewPlane(camera, x, y, through);
    return addScaled(point, normal, height - dot(sub(point, origin), normal));
  }
  const facing = dot(direction, normal);
  const along = height / facing;
  const farthest = FARTHEST * away;
  if (along > 0 && along < farthest) return addScaled(origin, direction, along);
  // As far out as that in the ray's bearing: where the ray meets the plane so far away, this is the same point.
  const bearing = unit(addScaled(direction, normal, -facing));
  return addScaled(addScaled(origin, normal, height), bearing, Math.sqrt(farthest ** 2 - height ** 2));
}

/** Where a point goes that is dragged along the unit vector `axis`. One that nearly faces the camera says nothing about
 *  where a pixel is on it: there it goes by as much as the hand moves up (towards the camera) or down. */
export function draggedAlong(camera, from, x, y, axis) {
  const towards = dot(axis, unit(sub(camera.eye, from)));
  if (Math.abs(towards) < FACES_CAMERA) return onLine(camera, x, y, from, axis);
  const seen = project(camera, from);
  const up_px = seen ? seen.y - y : 0;
  return addScaled(from, axis, Math.sign(towards) * up_px * unitsPerPixel(camera, from));
}

/** Where a dragged point goes.
 *    from        where it was when the drag began
 *    x, y        where it is asked to be, pixels
 *    constraint  "view" (the plane that faces the camera), "level" (the plane at right angles to `up`), "x", "y", "z", or
 *                "normal" (along `normal`, if there is one) */
export function dragged(camera, from, x, y, constraint, { normal = null, up = DEFAULT_UP } = {}) {
  if (constraint === "level") return onPlane(camera, x, y, from, unit(up, DEFAULT_UP));
  const axis = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1], normal: normal && unit(normal) }[constraint];
  return axis ? draggedAlong(camera, from, x, y, axis) : onViewPlane(camera, x, y, from);
}

/** World units that a pixel covers at the depth of a point; 0 behind the camera. */
export function unitsPerPixel(camera, point) {
  const depth = inCamera(camera, point)[2];
  return depth > 0 ? depth / focal(camera) : 0;
}

/** The outline of a sphere as a closed polygon of pixel positions: its exact silhouette, an ellipse. Null where it has
 *  none: the camera is inside, or part of it is behind. */
export function sphereOutline(camera, centre, radius, corners = 48) {
  const c = inCamera(camera, centre);
  const d = length(c);
  if (d <= radius) return null;
  // The cone that touches the sphere does so on a circle, nearer than the centre.
  const k = 1 - (radius / d) ** 2;
  const middle = scale(c, k);
  const r = radius * Math.sqrt(k);
  const a = perpendicular(c);
  const b = unit(cross(c, a));
  const near = nearest(camera);
  const outline = [];
  for (let i = 0; i < corners; ++i) {
    const angle = (2 * Math.PI * i) / corners;
    const p = addScaled(addScaled(middle, a, r * Math.cos(angle)), b, r * Math.sin(angle));
    if (p[2] <= near) return null;
    const { x, y } = pixelOf(camera, p);
    outline.push([x, y]);
  }
  return outline;
}

/** The twelve edges of a box, as pairs of points. */
export function boxEdges(center, size) {
  const corner = (i) => center.map((c, axis) => c + ((i >> axis) & 1 ? 0.5 : -0.5) * size[axis]);
  const edges = [];
  for (let i = 0; i < 8; ++i)
    for (let axis = 0; axis < 3; ++axis) if (!((i >> axis) & 1)) edges.push([corner(i), corner(i | (1 << axis))]);
  return edges;
}

/** The ellipse that a box fills in the picture, {x, y, rx, ry}: within the rectangle around its corners. Null if some of
 *  it is behind the camera. */
export function ellipseOf(camera, { low, high }) {
  const corners = boxEdges(
    low.map((l, i) => (l + high[i]) / 2),
    low.map((l, i) => high[i] - l),
  ).map(([corner]) => project(camera, corner));
  if (corners.some((corner) => !corner)) return null;
  const [left, right] = [Math.min, Math.max].map((of) => of(...corners.map(({ x }) => x)));
  const [top, bottom] = [Math.min, Math.max].map((of) => of(...corners.map(({ y }) => y)));
  return { x: (left + right) / 2, y: (top + bottom) / 2, rx: (right - left) / 2, ry: (bottom - top) / 2 };
}

/** How directions turn when a camera is turned by `yaw` about the world's up axis and by `pitch` about its own horizontal,
 *  radians, as far as it does not look straight along the up axis. */
function turnOf(pose, yaw, pitch, worldUp) {
  const up = unit(worldUp, DEFAULT_UP);
  const { right, forward } = axes(pose);
  const elevation = Math.acos(Math.min(1, Math.max(-1, dot(forward, up))));
  const allowed = Math.min(Math.PI - POLE_MARGIN, Math.max(POLE_MARGIN, elevation + pitch)) - elevation;
  return (v) => turned(turned(v, right, -allowed), up, -yaw);
}

/** Turns the camera about its target: `yaw` about the world's up axis, `pitch` about its own horizontal, radians.
 *  Positive values move the scene right and down, as a hand on it would. */
export function orbited(pose, yaw, pitch, worldUp) {
  const turn = turnOf(pose, yaw, pitch, worldUp);
  return { ...pose, eye: add(pose.target, turn(sub(pose.eye, pose.target))), up: turn(pose.up) };
}

/** Turns the camera about itself. Positive values turn it left and up: the scene moves right and down, as a hand on it
 *  would. */
export function lookedAround(pose, yaw, pitch, worldUp) {
  const turn = turnOf(pose, -yaw, -pitch, worldUp);
  return { ...pose, target: add(pose.eye, turn(sub(pose.target, pose.eye))), up: turn(pose.up) };
}

/** Moves the camera, and its pivot with it, to its right, along the world's up and ahead: [right, up, ahead] in world
 *  units. */
export function flown(pose, [aside, upwards, ahead], worldUp) {
  const { right, forward } = axes(pose);
  const shift = [[right, aside], [unit(worldUp, DEFAULT_UP), upwards], [forward, ahead]].reduce(
    (sum, [axis, by]) => addScaled(sum, axis, by),
    [0, 0, 0],
  );
  return { ...pose, eye: add(pose.eye, shift), target: add(pose.target, shift) };
}

/** Moves the camera sideways so that what is at the target's depth follows a hand that moves by (dx, dy) pixels. */
export function panned(camera, dx, dy) {
  const { right, down } = axes(camera);
  const step = distance(camera.eye, camera.target) / focal(camera);
  const shift = addScaled(scale(right, -dx * step), down, -dy * step);
  const { width, height, ...pose } = camera;
  return { ...pose, eye: add(pose.eye, shift), target: add(pose.target, shift) };
}

/** Moves the camera to `factor` times its distance from the target, but no nearer than `least`. */
export function dollied(pose, factor, least) {
  const back = sub(pose.eye, pose.target);
  const wanted = Math.max(length(back) * factor, least);
  return { ...pose, eye: addScaled(pose.target, unit(back), wanted) };
}

/** Moves the camera to `factor` times its distance from what is at the pivot's depth under a pixel position, which stays
 *  where it is in the picture; but no nearer to the pivot than `least`. */
export function zoomedAt(camera, x, y, factor, least) {
  const { width, height, ...pose } = camera;
  const point = onViewPlane(camera, x, y, pose.target);
  const allowed = Math.max(factor, Math.min(1, least / distance(pose.eye, pose.target)));
  const scaled = (p) => addScaled(point, sub(p, point), allowed);
  return { ...pose, eye: scaled(pose.eye), target: scaled(pose.target) };
}

/** Moves camera and pivot so that `point` is the pivot, seen from the same direction and distance. */
export function centredOn(pose, point) {
  return { ...pose, eye: add(pose.eye, sub(point, pose.target)), target: point };
}

/** Takes the roll out of the camera. */
export const levelled = (pose, worldUp) => ({ ...pose, up: worldUp });

/** The camera's own up direction: what the person in front of the screen calls up. */
export const upOf = (pose) => scale(axes(pose).down, -1);

/** What the people who held the cameras of a dataset would call up: as nearly at right angles to all their right axes as
 *  can be. Their own up would be tilted as far as they look down. */
export function upOfViews(views) {
  const axis = (view, row) => view.cam_from_world[row].slice(0, 3);
  const sum = views.reduce((up, view) => sub(up, axis(view, 1)), [0, 0, 0]);
  // Held every way, they say nothing.
  if (length(sum) < 0.3 * views.length || views.length === 0) return DEFAULT_UP;
  // The eigenvector of sum r r^T with the least value, by powers of n - sum r r^T; where all look one way, the nearest
  // of many to the mean.
  const rights = views.map((view) => axis(view, 0));
  let up = unit(sum);
  for (let i = 0; i < 100; ++i)
    up = unit(rights.reduce((rest, right) => addScaled(rest, right, -dot(right, up)), scale(up, views.length)));
  return up;
}

/** The pose that looks at the same from another direction, of length 1: from where it points. */
export function seenFrom(pose, direction, worldUp) {
  const above = dot(direction, unit(worldUp, DEFAULT_UP));
  const eye = addScaled(pose.target, direction, distance(pose.eye, pose.target));
  if (Math.abs(above) < Math.cos(POLE_MARGIN)) return { ...pose, eye, up: worldUp };
  // From straight above, what was ahead is up; from below it is down: right stays right.
  const { forward } = axes(pose);
  return { ...pose, eye, up: Math.abs(dot(forward, direction)) > 0.99 ? pose.up : scale(forward, Math.sign(above)) };
}

/** Where to start looking at a scene of which nothing is known but where it lies. */
export function firstPose({ centre, radius, up }) {
  const worldUp = unit(up ?? DEFAULT_UP, DEFAULT_UP);
  // Captures mostly look along +z of their frame.
  const flat = (v) => sub(v, scale(worldUp, dot(v, worldUp)));
  const ahead = unit(length(flat([0, 0, 1])) > 0.1 ? flat([0, 0, 1]) : flat([0, 1, 0]));
  // Half of the Gaussians are within the radius: twice of it holds most of the scene.
  const away = (2 * (radius || 1)) / Math.sin(radians(DEFAULT_FOV / 2));
  const eye = addScaled(addScaled(centre, ahead, -0.94 * away), worldUp, 0.34 * away);
  return { eye, target: centre, up: worldUp, fov: DEFAULT_FOV };
}

/** The camera of a dataset view, seen whole in a picture of that aspect (width / height). The pivot is put where its
 *  axis passes the scene's centre. */
export function poseOfView(view, scene, aspect) {
  const rows = view.cam_from_world;
  const axis = (i) => rows[i].slice(0, 3);
  // eye = -R^T t
  const eye = [0, 1, 2].map((i) => -(rows[0][i] * rows[0][3] + rows[1][i] * rows[1][3] + rows[2][i] * rows[2][3]));
  const forward = unit(axis(2));
  const ahead = dot(sub(scene.centre, eye), forward);
  const depth = ahead > 0.1 * scene.radius ? ahead : scene.radius || 1;
  const halfHeight = view.height / 2 / view.fy;
  const halfWidth = view.width / 2 / view.fx;
  const fov = degrees(2 * Math.atan(Math.max(halfHeight, halfWidth / aspect)));
  return { eye, target: addScaled(eye, forward, depth), up: scale(unit(axis(1)), -1), fov };
}

/** Moves the pivot, along the view, to the depth of a point; the picture stays. A point behind the camera has no say. */
export function pivotedAt(pose, point) {
  const { forward } = axes(pose);
  const depth = dot(sub(point, pose.eye), forward);
  return depth > 0 ? { ...pose, target: addScaled(pose.eye, forward, depth) } : pose;
}

/** A text that is equal for poses that give the same picture, wherever on the view axis their pivots are. */
export function pictureKey(pose) {
  const { right, forward } = axes(pose);
  const digits = (v) => v.map((x) => x.toFixed(7)).join();
  return `${pose.eye.join()}|${digits(forward)}|${digits(right)}|${pose.fov}`;
}

/** Whether two poses are the same in every number. */
export function samePose(a, b) {
  if (!a || !b) return a === b;
  return a.fov === b.fov && ["eye", "target", "up"].every((k) => a[k].every((value, i) => value === b[k][i]));
}

/** Whether this is a pose at all: for what comes out of storage. */
export function isPose(value) {
  const point = (v) => Array.isArray(v) && v.length === 3 && v.every(Number.isFinite);
  return (
    !!value &&
    point(value.eye) &&
    point(value.target) &&
    point(value.up) &&
    value.fov > 0 &&
    value.fov < 180 &&
    distance(value.eye, value.target) > 0
  );
}

/** Where a picture lies on a canvas of another shape until there is one of that: {x, y, width, height}. Cameras keep their
 *  vertical field of view, so that it is as high as the canvas. One that differs by rounding alone fills it. */
export function placedIn(picture, { width, height }) {
  const wide = (picture.width / picture.height) * height;
  if (Math.abs(wide - width) < 0.01 * width) return { x: 0, y: 0, width, height };
  return { x: (width - wide) / 2, y: 0, width: wide, height };
}

/** Width and height of a picture of that aspect whose longer side is `side`; whole pixels. */
export function pictureSize(width, height, side) {
  const factor = Math.min(1, side / Math.max(width, height));
  return { width: Math.max(1, Math.round(width * factor)), height: Math.max(1, Math.round(height * factor)) };
}
