// The gizmo's shape in the picture, and what a drag of its parts means. Pure functions over plain values.

import { axes, draggedAlong, onPlane, project, projectSegment, unitsPerPixel } from "./camera.js";
import { addScaled, cross, dot, length, perpendicular, scale, sub, unit } from "./vectors.js";

// Choices, in pixels.
const ARM = 62; // Of an arrow, from where it begins.
const FREE = { least: 24, most: 90 }; // Around the middle, where what is held is itself taken hold of: as far as that goes.
const HEAD = 11;
const SHORT = 26; // An axis that is shorter in the picture faces the camera: it has no arrow.
const CORNERS = 64; // Of a ring.
const EDGE_ON = 0.25; // Cosine: a ring seen flatter than this turns by what the hand moves along it.
const NAMES = ["x", "y", "z"];

export const TOOLS = ["move", "turn", "size"];
export const FRAMES = ["world", "view", "surface"];

/** The three axes of a frame. That of a surface has its normal as z, and x level; without a normal, up for one. */
export function frameAxes(frame, camera, { up, normal }) {
  if (frame === "view") {
    const { right, down, forward } = axes(camera);
    return [right, scale(down, -1), scale(forward, -1)];
  }
  if (frame === "world") return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const z = unit(normal ?? up);
  const level = cross(up, z);
  const x = length(level) > 0.05 ? unit(level) : perpendicular(z);
  return [x, cross(z, x), z];
}

/** The parts of a tool: [{name, axis, label, lines, closed, drag, nudge}]. `axis`: 0 to 2, or 3: that of the view.
 *    lines            polylines, pixels; {points, far} of which far ones lie behind the middle
 *    drag(x, y)       begun there: the function (x, y) -> what it means, {shift} | {turn} | {size}
 *    nudge(dx, dy)    what a step of the arrow keys means
 *  What it means adds to where it was when the drag began.
 *    frame  frameAxes()
 *    at     the middle, world units; behind the camera there is nothing
 *    reach  how far what is held goes from there in the picture */
export function gizmoParts(tool, frame, at, camera, reach = 0) {
  const middle = project(camera, at);
  if (!middle) return [];
  const px = unitsPerPixel(camera, at);
  const free = Math.min(FREE.most, Math.max(FREE.least, reach));
  return { move, turn, size }[tool](frame, at, camera, { middle, px, free, arm: free + ARM });
}

const seen = (camera, points) => points.map((point) => project(camera, point)).filter(Boolean).map(({ x, y }) => [x, y]);

function move(frame, at, camera, { middle, px, free, arm }) {
  const arrows = frame.map((axis, i) => {
    const tip = project(camera, addScaled(at, axis, arm * px));
    const long = tip ? Math.hypot(tip.x - middle.x, tip.y - middle.y) : 0;
    if (long < SHORT) return null;
    const [ux, uy] = [(tip.x - middle.x) / long, (tip.y - middle.y) / long];
    const place = (along, aside) => [middle.x + ux * along - uy * aside, middle.y + uy * along + ux * aside];
    const on = (x, y) => draggedAlong(camera, at, x, y, axis);
    return {
      name: `move-${NAMES[i]}`,
      axis: i,
      label: `Move along ${NAMES[i]}`,
      lines: [
        { points: [place(Math.min(free, 0.5 * long), 0), place(long - HEAD, 0)] },
        { points: [place(long, 0), place(long - HEAD, 0.5 * HEAD), place(long - HEAD, -0.5 * HEAD)], closed: true },
      ],
      drag: (x0, y0) => {
        const from = on(x0, y0);
        return (x, y) => ({ shift: sub(on(x, y), from) });
      },
      nudge: (dx, dy) => ({ shift: scale(axis, (dx - dy) * px) }),
    };
  });
  const planes = frame.map((normal, i) => {
    const [u, v] = [frame[(i + 1) % 3], frame[(i + 2) % 3]];
    if (Math.abs(dot(normal, unit(sub(camera.eye, at)))) < 0.3) return null;
    const [near, far] = [0.71 * free + 17, 0.71 * free + 36].map((x) => x * px);
    const corner = (a, b) => addScaled(addScaled(at, u, a), v, b);
    const on = (x, y) => onPlane(camera, x, y, at, normal);
    return {
      name: `move-${NAMES[(i + 1) % 3]}${NAMES[(i + 2) % 3]}`,
      axis: i,
      label: `Move in the plane of ${NAMES[(i + 1) % 3]} and ${NAMES[(i + 2) % 3]}`,
      lines: [{ points: seen(camera, [corner(near, near), corner(far, near), corner(far, far), corner(near, far)]), closed: true }],
      drag: (x0, y0) => {
        const from = on(x0, y0);
        return (x, y) => ({ shift: sub(on(x, y), from) });
      },
      nudge: (dx, dy) => ({ shift: addScaled(scale(u, dx * px), v, -dy * px) }),
    };
  });
  return [...planes, ...arrows].filter(Boolean);
}

function turn(frame, at, camera, { middle, px, arm }) {
  const towards = unit(sub(camera.eye, at));
  const ring = (axis, i, radius) => {
    const u = perpendicular(axis);
    const v = cross(axis, u);
    const on = (k) => {
      const angle = (2 * Math.PI * k) / CORNERS;
      return addScaled(addScaled(at, u, radius * Math.cos(angle)), v, radius * Math.sin(angle));
    };
    // The half that is farther than the middle is drawn as what is hidden is.
    const lines = [];
    for (let k = 0; k < CORNERS; ++k) {
      const segment = projectSegment(camera, on(k), on(k + 1));
      if (!segment) continue;
      const far = i < 3 && dot(sub(on(k + 0.5), at), towards) < -1e-6;
      const [a, b] = segment.map(({ x, y }) => [x, y]);
      if (lines.at(-1)?.far === far) lines.at(-1).points.push(b);
      else lines.push({ points: [a, b], far });
    }
    const facing = dot(axis, towards);
    const tip = project(camera, addScaled(at, axis, arm * px)) ?? middle;
    return {
      name: i < 3 ? `turn-${NAMES[i]}` : "turn-view",
      axis: i,
      label: i < 3 ? `Turn about ${NAMES[i]}` : "Turn in the picture",
      lines,
      drag: (x0, y0) => {
        let [angle, last] = [0, Math.atan2(y0 - middle.y, x0 - middle.x)];
        const aside = unit([tip.y - middle.y, middle.x - tip.x, 0]);
        return (x, y) => {
          if (Math.abs(facing) < EDGE_ON) {
            // What is in front of the axis goes with the hand: a ring's radius is a radian.
            angle = ((x - x0) * aside[0] + (y - y0) * aside[1]) / arm;
            return { turn: scale(axis, -angle) };
          }
          const now = Math.atan2(y - middle.y, x - middle.x);
          const step = now - last;
          angle += step - 2 * Math.PI * Math.round(step / (2 * Math.PI));
          last = now;
          // y points down in the picture: the other way round.
          return { turn: scale(axis, -angle * Math.sign(facing)) };
        };
      },
      nudge: (dx, dy) => ({ turn: scale(axis, ((dx - dy) * Math.PI) / 180) }),
    };
  };
  return [ring(towards, 3, (arm + 10) * px), ...frame.map((axis, i) => ring(axis, i, (arm - 6) * px))];
}

function size(frame, at, camera, { middle, free, arm }) {
  const place = (along) => [middle.x + along * 0.71, middle.y - along * 0.71];
  const box = (r) => [[-r, -r], [r, -r], [r, r], [-r, r]].map(([x, y]) => [place(arm)[0] + x, place(arm)[1] + y]);
  const away = (x, y) => Math.max(4, Math.hypot(x - middle.x, y - middle.y));
  return [
    {
      name: "size",
      axis: 3,
      label: "Size",
      lines: [{ points: [place(free), place(arm - 8)] }, { points: box(8), closed: true }],
      drag: (x0, y0) => (x, y) => ({ size: away(x, y) / away(x0, y0) }),
      nudge: (dx, dy) => ({ size: 1.01 ** (dx - dy) }),
    },
  ];
}
