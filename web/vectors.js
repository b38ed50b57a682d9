// Vectors of three numbers, as plain arrays: the form they have on the wire.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const addScaled = (a, b, s) => [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const distance = (a, b) => length(sub(a, b));

/** The unit vector along `a`; `otherwise` where `a` has no direction. */
export function unit(a, otherwise = [0, 0, 1]) {
  const n = length(a);
  return n > 0 && Number.isFinite(n) ? scale(a, 1 / n) : otherwise;
}

/** Some unit vector at right angles to `a`, always the same one for the same `a`. */
export function perpendicular(a) {
  const [x, y, z] = a.map(Math.abs);
  const least = x <= y && x <= z ? [1, 0, 0] : y <= z ? [0, 1, 0] : [0, 0, 1];
  return unit(cross(a, least));
}

/** `v` turned by `angle_rad` about the unit vector `axis`, counter-clockwise as seen from its tip (Rodrigues). */
export function turned(v, axis, angle_rad) {
  const c = Math.cos(angle_rad);
  const s = Math.sin(angle_rad);
  const along = dot(axis, v) * (1 - c);
  const side = cross(axis, v);
  return [0, 1, 2].map((i) => v[i] * c + side[i] * s + axis[i] * along);
}
