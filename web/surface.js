// Sliding on surfaces: what is dragged goes where the pointer meets one, and stands on it.

import { ellipseOf, onPlane, project } from "./camera.js";
import { FrameQueue } from "./frames.js";
import { footOf } from "./held.js";
import { shifted } from "./motion.js";
import { addScaled, dot, sub, unit } from "./vectors.js";

const LEVEL = 0.5; // Cosine: what slopes less is ground, on which things stand upright.

/** A mover for Editor.drag(): at(x, y, put) puts what changes of the handle, as soon as the service has said where that
 *  is; of the places asked for meanwhile only the newest counts. settled() waits for the last.
 *    held  {handle, pivot, bounds}; bounds: of a thing, null: of a point that lies on the surface itself
 *    at    {x, y} where the pointer took hold
 *    pick  (x, y) -> what the version shows there */
export function slider({ held, camera, at, up, pick }) {
  const { handle, pivot, bounds } = held;
  const upright = unit(up);
  const { place, height } = footOf(held, bounds, upright);
  const foot = addScaled(place, upright, -height);
  const seen = project(camera, foot) ?? at;
  const [gripX, gripY] = [seen.x - at.x, seen.y - at.y];
  // Where the version shows the thing itself, at rest, what is under the pointer is not what it would stand on.
  const own = bounds && ellipseOf(camera, bounds);
  const isOwn = (x, y) => own && ((x - own.x) / own.rx) ** 2 + ((y - own.y) / own.ry) ** 2 < 1;
  let put = () => {};
  let running = Promise.resolve();
  const standOn = (point, normal) => {
    const n = !bounds || !normal || dot(normal, upright) > LEVEL ? upright : normal;
    const reach = footOf({ handle, pivot }, bounds, n).height;
    put(shifted(handle, sub(addScaled(point, n, reach), place)));
  };
  const queue = new FrameQueue({
    load: ({ x, y }) => (running = pick(x, y)),
    onPicture: ({ hit, point, normal }) => hit && standOn(point, normal),
    onError: () => {}, // It stays where it was put last.
  });
  return {
    at: (x, y, putNow) => {
      put = putNow;
      const [toX, toY] = [x + gripX, y + gripY];
      if (!isOwn(toX, toY)) return queue.request({ key: `${toX},${toY}`, x: toX, y: toY });
      queue.clear();
      standOn(onPlane(camera, toX, toY, foot, upright), upright);
    },
    settled: async () => {
      while (queue.busy) {
        await running.catch(() => {});
        await new Promise((done) => setTimeout(done));
      }
    },
    giveUp: () => queue.clear(),
  };
}
