// Where a handle carries what it holds: turned and scaled about its source, which goes to its target. Quaternions are
// (w, x, y, z), as on the wire; a rotation vector points along the axis and is as long as the angle, in radians.

import { add, addScaled, cross, dot, length, scale, sub } from "./vectors.js";

const STILL = [1, 0, 0, 0];

/** `q` after `p`. */
export function multiplied([a, ...u], [b, ...v]) {
  return [a * b - dot(u, v), ...add(addScaled(scale(v, a), u, b), cross(u, v))];
}

/** `v` turned by the unit quaternion. */
export function turnedBy([w, ...u], v) {
  const t = scale(cross(u, v), 2);
  return add(addScaled(v, t, w), cross(u, t));
}

export function quaternionOf(vector) {
  const angle = length(vector);
  return angle > 0 ? [Math.cos(angle / 2), ...scale(vector, Math.sin(angle / 2) / angle)] : STILL;
}

/** Up to a whole turn: with w below 0 a quaternion turns the long way. */
export function vectorOf([w, ...u]) {
  const n = length(u);
  return n > 0 ? scale(u, (2 * Math.atan2(n, w)) / n) : [0, 0, 0];
}

const inverse = ([w, ...u]) => [w, ...scale(u, -1)];
const parts = ({ source, target, rotation, scale: factor }) => ({
  source,
  target: target ?? source,
  rotation: rotation ?? STILL,
  factor: factor ?? 1,
});

/** Whether a handle asks for anything but to stay. */
export const isMoved = ({ target, rotation, scale: factor }) => !!(target || rotation || factor);

/** Where a point goes that moves with the handle as one piece. */
export function moved(handle, point) {
  const { source, target, rotation, factor } = parts(handle);
  return addScaled(target, turnedBy(rotation, sub(point, source)), factor);
}

/** Where a point that has moved came from. */
export function unmoved(handle, point) {
  const { source, target, rotation, factor } = parts(handle);
  return addScaled(source, turnedBy(inverse(rotation), sub(point, target)), 1 / factor);
}

/** What changes of a handle so that what it holds moves on by a vector. */
export const shifted = (handle, by) => ({ target: add(parts(handle).target, by) });

/** So that it turns on about a place where it is now. */
export function turnedAbout(handle, place, vector) {
  const { target, rotation } = parts(handle);
  const turn = quaternionOf(vector);
  const after = multiplied(turn, rotation);
  const n = Math.hypot(...after);
  return { target: add(place, turnedBy(turn, sub(target, place))), rotation: after.map((x) => x / n) };
}

/** So that it grows by a factor about such a place. */
export function scaledAbout(handle, place, by) {
  const { target, factor } = parts(handle);
  const after = Math.min(1000, Math.max(0.001, factor * by)); // what the service takes
  return { target: addScaled(place, sub(target, place), after / factor), scale: after };
}

/** How far a handle is from staying, in numbers: {shift, turn, size}; shift of the pivot, turn as a rotation vector.
 *    pivot  where it is at rest */
export function motionOf(handle, pivot) {
  const { rotation, factor } = parts(handle);
  return { shift: sub(moved(handle, pivot), pivot), turn: vectorOf(rotation), size: factor };
}

/** The handle that moves so: what motionOf() says of it, about the same pivot. */
export function withMotion({ source }, pivot, { shift, turn, size }) {
  const rotation = quaternionOf(turn);
  const target = addScaled(add(pivot, shift), turnedBy(rotation, sub(source, pivot)), size);
  return { target, rotation: length(turn) > 0 ? rotation : null, scale: size === 1 ? null : size };
}
