// Drawn over the picture about what is held: the gizmo, where it would go, and the surface below it.

import { boxEdges, project, projectSegment, sphereOutline } from "./camera.js";
import { ARROWS, attrs, keyedList, s } from "./dom.js";
import { frameAxes, gizmoParts } from "./gizmo.js";
import { isMoved, moved, unmoved } from "./motion.js";
import { pathOf } from "./overlay.js";
import { add, addScaled, cross, distance, dot, perpendicular, scale, sub, unit } from "./vectors.js";

const STEP = 8; // Pixels, degrees or per cent that an arrow key means; with Shift 1.
const LIFTED = 0.5; // Of the way up to its middle, from where it looks down: what stands on a table has that below it.
const NEAREST = 0.25; // World units: what is as near as 0.2 to a camera, the service does not show.
const MARK = 0.25; // Of its height: the radius of the ring below it.
const NEAR_ENOUGH = 0.03; // Of the distance: a point this little behind a surface is on it.

const boxCorners = ({ low, high }) => Array.from({ length: 8 }, (_, i) => low.map((l, k) => ((i >> k) & 1 ? high[k] : l)));

/** The lesser radius of the ellipse that some pixels are in. */
const reachOf = (pixels) =>
  Math.min(...["x", "y"].map((k) => pixels.map((p) => p[k])).map((all) => (Math.max(...all) - Math.min(...all)) / 2));

/** Where what is held touches ground, and how it reaches down to there: {place, height}. `place`: of its pivot, now.
 *    bounds  of it at rest, {low, high}; null: what it is, is a point */
export function footOf({ handle, pivot }, bounds, up) {
  const place = moved(handle, pivot);
  if (!bounds) return { place, height: 0 };
  const lowest = Math.min(...boxCorners(bounds).map((corner) => dot(sub(moved(handle, corner), place), up)));
  return { place, height: Math.max(0, -lowest) };
}

/** A camera that looks along a direction, at the middle of whose picture is what lies there. */
export const lookingAlong = (eye, direction) => ({
  ...{ eye, target: add(eye, direction), up: perpendicular(direction), fov: 5, width: 9, height: 9 },
});

/** Where a point of what is on the screen is in the version that it was made of: `moves`, [{handle, holds(point)}], say
 *  what of that has moved. */
export const beforeMoves = (point, moves) => {
  for (const { handle, holds } of moves) {
    const from = unmoved(handle, point);
    if (holds(from)) return { point: from, moved: true };
  }
  return { point, moved: false };
};

/** Answers of the service, by key. What is drawn asks for them each time; `changed` is called when one has come. */
export class Answers {
  #known = new Map();
  #waiting = 0;

  constructor(changed, { atOnce = 2, limit = 100 } = {}) {
    Object.assign(this, { changed, atOnce, limit });
  }

  /** The answer to load(), if it is known; undefined until then. */
  get(key, load) {
    if (this.#known.has(key)) return this.#known.get(key);
    if (this.#waiting < this.atOnce) this.#ask(key, load);
    return undefined;
  }

  async #ask(key, load) {
    this.#waiting += 1;
    this.#known.set(key, undefined);
    if (this.#known.size > this.limit) this.#known.delete(this.#known.keys().next().value);
    try {
      this.#known.set(key, await load());
    } catch {
      // Nothing is known, then: nothing is drawn.
    }
    this.#waiting -= 1;
    this.changed();
  }
}

/** Whether a point lies behind what a camera shows there; picked: the service's answer for its pixel. */
export const isBehind = (camera, point, picked) =>
  !!picked?.hit && distance(camera.eye, picked.point) < (1 - NEAR_ENOUGH) * distance(camera.eye, point);

export class HeldView {
  #editor;
  #ghost = s("path", { class: "ghost", testid: "ghost" });
  #drop = s("path", { class: "drop", testid: "drop-line" });
  #gizmo = s("g", { class: "gizmo", testid: "gizmo" });
  #update;
  #part = new Map(); // By name, as last drawn.
  #answers;

  /**   take(event, begin)  the pointer takes hold of something: begin({x, y}) returns the drag
   *    redraw()            something to be drawn has become known */
  constructor(svg, editor, { take, redraw }) {
    this.#editor = editor;
    this.#answers = new Answers(redraw);
    svg.append(this.#ghost, this.#drop, this.#gizmo);
    this.#update = keyedList(
      this.#gizmo,
      ({ name }) => name,
      ({ name }) => {
        const reach = s("path", { class: "reach" });
        const near = s("path", {});
        const far = s("path", { class: "far" });
        const element = s(
          "g",
          {
            tabindex: "0",
            role: "button",
            testid: `gizmo-${name}`,
            onpointerdown: (event) =>
              take(event, ({ x, y }) => editor.dragHeld(this.#part.get(name).drag(x, y))),
            onkeydown: (event) => this.#key(name, event),
          },
          far,
          near,
          reach,
        );
        return {
          element,
          update: ({ axis, label, lines }) => {
            attrs(element, { class: `part axis-${"xyzv"[axis]}`, "aria-label": `${label}: arrow keys` });
            const d = (some) => some.map(({ points, closed }) => pathOf(points, closed)).join("");
            attrs(far, { d: d(lines.filter((line) => line.far)) });
            attrs(near, { d: d(lines.filter((line) => !line.far)) });
            attrs(reach, { d: d(lines) });
          },
        };
      },
    );
  }

  #key(name, event) {
    const arrow = ARROWS[event.key];
    if (!arrow || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    const step = event.shiftKey ? 1 : STEP;
    this.#editor.nudgeHeld(this.#part.get(name).nudge(step * arrow[0], step * arrow[1]));
  }

  draw(camera) {
    const editor = this.#editor;
    const { held, worldUp: up } = editor;
    const { gizmo, frame, dragging } = editor.state;
    if (!held) {
      this.#update([]);
      attrs(this.#ghost, { d: null });
      return attrs(this.#drop, { d: null });
    }
    const { place, height } = footOf(held, held.bounds, unit(up));
    const axes = frameAxes(frame, camera, { up: unit(up), normal: held.handle.normal });
    const { bounds, handle } = held;
    const corners = bounds && boxCorners(bounds).map((corner) => project(camera, moved(handle, corner)));
    const parts = gizmoParts(gizmo, axes, place, camera, corners?.every(Boolean) ? reachOf(corners) : 0);
    this.#part = new Map(parts.map((part) => [part.name, part]));
    // While a part is dragged, the hand has it: the others would only lie in the way.
    this.#update(parts);
    attrs(this.#gizmo, { class: `gizmo${dragging ? " dragging" : ""}` });
    attrs(this.#ghost, { d: isMoved(held.handle) ? this.#outline(camera, held) : null });
    attrs(this.#drop, { d: isMoved(held.handle) ? this.#dropLine(camera, place, height, unit(up)) : null });
  }

  /** What is held, where it would go. */
  #outline(camera, { handle, bounds }) {
    const round = bounds ? null : sphereOutline(camera, moved(handle, handle.source), handle.radius);
    if (!bounds) return round && pathOf(round, true);
    const [center, size] = [bounds.low.map((l, i) => (l + bounds.high[i]) / 2), sub(bounds.high, bounds.low)];
    return boxEdges(center, size)
      .map(([a, b]) => projectSegment(camera, moved(handle, a), moved(handle, b)))
      .filter(Boolean)
      .map(([a, b]) => pathOf([[a.x, a.y], [b.x, b.y]]))
      .join("");
  }

  /** From the middle of what is held down to the surface below, with a ring on that. */
  #dropLine(camera, place, height, up) {
    const eye = addScaled(place, up, Math.max(LIFTED * height, NEAREST) - height);
    const { scene, version } = this.#editor.state;
    const below = this.#answers.get(JSON.stringify([scene.id, version, eye]), () =>
      this.#editor.pick({ ...lookingAlong(eye, scale(up, -1)) }, 4.5, 4.5),
    );
    if (!below?.hit) return null;
    const line = projectSegment(camera, place, below.point);
    if (!line) return null;
    const u = perpendicular(up);
    const v = cross(up, u);
    const radius = MARK * (height || distance(place, below.point));
    const ring = Array.from({ length: 24 }, (_, k) => {
      const angle = (2 * Math.PI * k) / 24;
      return project(camera, addScaled(addScaled(below.point, u, radius * Math.cos(angle)), v, radius * Math.sin(angle)));
    });
    const ringPath = ring.every(Boolean) ? pathOf(ring.map(({ x, y }) => [x, y]), true) : "";
    return pathOf(line.map(({ x, y }) => [x, y])) + ringPath;
  }

  /** Whether a point lies behind what is on the screen; as far as that is known. */
  isHidden(camera, shown, point) {
    const seen = project(camera, point);
    if (!seen || seen.x < 0 || seen.y < 0 || seen.x > camera.width || seen.y > camera.height) return false;
    const key = JSON.stringify([this.#editor.state.scene.id, shown, camera.eye, camera.target, camera.up, point]);
    return isBehind(camera, point, this.#answers.get(key, () => this.#editor.pick(camera, seen.x, seen.y, shown)));
  }
}
