// Where to begin to look at a scene that has no cameras: so that all of it shows, unless one stands amid it.

import * as api from "./api.js";
import { axes, dollied, firstPose, onTheWire } from "./camera.js";
import { addScaled, distance } from "./vectors.js";

// Choices, tried on single things and on rooms.
const SIDE = 96; // Pixels of the pictures that are looked at for it.
const FARTHER = [1, 1.6, 2.5, 4]; // Times the distance of a first look, until the rim is clear.
const COVERED = 128; // Of 255: a pixel that something is in.
const ROOM = 0.5; // Where this much of the rim is covered, one stands in it, or before a wall.
const MARGIN = 1.2; // Of the picture's side to the thing's.
const BELOW = 0.2; // Of the thing's height, besides: there, bars lie on the picture.

/** What of a square picture shows something: {rim, box}; the share of the rim, and [left, top, right, bottom] from -1 to
 *  1, null where nothing shows.
 *    alpha  [side * side] 0 to 255 */
export function coverage(alpha, side) {
  const columns = new Array(side).fill(0);
  const rows = new Array(side).fill(0);
  let rim = 0;
  for (let y = 0; y < side; ++y)
    for (let x = 0; x < side; ++x) {
      if (alpha[y * side + x] < COVERED) continue;
      columns[x] += 1;
      rows[y] += 1;
      if (x === 0 || y === 0 || x === side - 1 || y === side - 1) rim += 1;
    }
  const shown = (counts) => [counts.findIndex((n) => n > 0), counts.findLastIndex((n) => n > 0) + 1];
  const [left, right] = shown(columns);
  const [top, bottom] = shown(rows);
  const at = (x) => (2 * x) / side - 1;
  return { rim: rim / (4 * side - 4), box: left < 0 ? null : [left, top, right, bottom].map(at) };
}

/** The pose moved sideways and back so that what fills `box` in a square picture fills one of that aspect. */
export function framed(pose, [left, top, right, low], aspect) {
  const bottom = low + BELOW * (low - top);
  const { right: x, down: y } = axes(pose);
  const reach = distance(pose.eye, pose.target) * Math.tan((pose.fov * Math.PI) / 360);
  const by = (point) => addScaled(addScaled(point, x, (reach * (left + right)) / 2), y, (reach * (top + bottom)) / 2);
  const factor = MARGIN * Math.max((bottom - top) / 2, (right - left) / 2 / aspect);
  return dollied({ ...pose, eye: by(pose.eye), target: by(pose.target) }, factor, 0);
}

/** The first look at a version.
 *    aspect()    width by height of the picture; asked for when it is needed: the page may just be laid out
 *    look(pose)  {rim, box} of what a pose shows */
export async function fittedPose(scene, aspect, look) {
  const first = firstPose(scene);
  let seen = await look(first);
  if (!seen.box || seen.rim > ROOM) return first;
  for (const factor of FARTHER) {
    const pose = dollied(first, factor, 0);
    if (factor > 1) seen = await look(pose);
    if (seen.rim > 0) continue;
    const fitted = framed(pose, seen.box, aspect());
    // What is nearer than the middle is larger than it was from farther away, so its box is taken once more.
    const { box, rim } = await look(fitted);
    return box && rim === 0 ? framed(fitted, box, aspect()) : fitted;
  }
  return first;
}

/** A look() that asks the service. */
export const looksAt = (scene, version) => async (pose) => {
  const camera = onTheWire({ ...pose, width: SIDE, height: SIDE });
  const { blob } = await api.render(scene, version, { camera, what: "alpha", format: "png" });
  const picture = await createImageBitmap(blob);
  const context = new OffscreenCanvas(SIDE, SIDE).getContext("2d");
  context.drawImage(picture, 0, 0);
  const { data } = context.getImageData(0, 0, SIDE, SIDE);
  return coverage(data.filter((_, i) => i % 4 === 0), SIDE);
};
