// Where things are in the pictures of a dataset's views. Pure.

import { focal } from "./camera.js";

const LEAST = 0.3; // Of a picture's width and height: closer, one does not see where it is. A choice, as the next.
const AROUND = 0.6; // Of what is framed, on each side.

/** Where the whole picture of a view lies in that of a camera that looks from it, pixels: {x, y, width, height}. */
export function pictureIn(camera, view) {
  const scale = focal(camera) / view.fy;
  return {
    x: camera.width / 2 - view.cx * scale,
    y: camera.height / 2 - view.cy * scale,
    width: view.width * scale,
    height: view.height * scale,
  };
}

/** The part of a view's picture in which points are, with room around them: {left, top, right, bottom}, fractions. All of it
 *  where one of them is behind the camera, or out of the picture. */
export function frameAround(view, points) {
  const whole = { left: 0, top: 0, right: 1, bottom: 1 };
  const seen = points.map((p) => {
    const [x, y, z] = view.cam_from_world.map(([a, b, c, d]) => a * p[0] + b * p[1] + c * p[2] + d);
    return z > 0 ? [(view.fx * x + view.cx * z) / (z * view.width), (view.fy * y + view.cy * z) / (z * view.height)] : null;
  });
  if (seen.length === 0 || seen.some((at) => !at || at.some((f) => !(f >= 0 && f <= 1)))) return whole;
  const range = [0, 1].map((axis) => [Math.min(...seen.map((at) => at[axis])), Math.max(...seen.map((at) => at[axis]))]);
  // The same part of both, so that the picture is not stretched.
  const size = Math.min(1, Math.max(LEAST, ...range.map(([low, high]) => (high - low) * (1 + 2 * AROUND))));
  const [left, top] = range.map(([low, high]) => Math.min(1 - size, Math.max(0, (low + high - size) / 2)));
  return { left, top, right: left + size, bottom: top + size };
}

/** The points that an edit is about: where its handles were, and where they went. */
export const pointsOf = ({ request: { handles } }) => handles.flatMap(({ source, target }) => (target ? [source, target] : [source]));

/** A frame as CSS has it: what is cut off an image on each side. */
export function insetOf({ left, top, right, bottom }) {
  const percent = [top, 1 - right, 1 - bottom, left].map((part) => `${Number((100 * part).toFixed(2))}%`);
  return `inset(${percent.join(" ")})`;
}
