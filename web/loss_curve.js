// How the loss of an edit falls while it optimises: what this page has heard of it, and what finished intervals tell.

import { attrs, s } from "./dom.js";
import { loss } from "./format.js";

const SIZE = { width: 200, height: 36 }; // Units of the drawing.
const MOST = 400; // Points of a curve; every other one goes when there are more.

/** Points [{at, loss}] with what an edit tells now; `at`: iterations since the edit began. The same list if that is no news. */
export function withLoss(points, { interval, iteration, iterations, loss: now, finished_intervals: finished }) {
  // An interval that nobody watched has left its end.
  const ends = finished.filter((u) => typeof u.loss === "number").map((u) => ({ at: u.interval * iterations, loss: u.loss }));
  const missed = ends.filter(({ at }) => !points.some((p) => Math.abs(p.at - at) < 0.5 * iterations && p.at <= at));
  const at = (interval - 1) * iterations + iteration;
  const heard = typeof now === "number" && iteration > 0 && at > (points.at(-1)?.at ?? 0) ? [{ at, loss: now }] : [];
  if (missed.length + heard.length === 0) return points;
  const all = [...points, ...missed, ...heard].sort((a, b) => a.at - b.at);
  return all.length > MOST ? all.filter((_, i) => i % 2 === 0 || i === all.length - 1) : all;
}

/** A path through the points, on a logarithmic scale from top to bottom. */
export function curveOf(points, { width, height } = SIZE) {
  const logs = points.map(({ loss: value }) => Math.log(Math.max(value, 1e-12)));
  const [low, high] = [Math.min(...logs), Math.max(...logs)];
  const last = points.at(-1).at || 1;
  const y = (value) => (high > low ? (height - 4) * ((high - value) / (high - low)) + 2 : height / 2);
  return points.map(({ at }, i) => `${i ? "L" : "M"}${((width * at) / last).toFixed(1)} ${y(logs[i]).toFixed(1)}`).join("");
}

/** A small drawing: {element, update(edit)}. */
export function lossCurve() {
  const line = s("path", {});
  const element = s(
    "svg",
    { class: "loss-curve", role: "img", viewBox: `0 0 ${SIZE.width} ${SIZE.height}`, preserveAspectRatio: "none", "data-testid": "loss-curve" },
    line,
  );
  let points = [];
  return {
    element,
    update(edit) {
      points = withLoss(points, edit);
      attrs(element, {
        display: points.length > 1 ? null : "none",
        "aria-label": points.length > 1 ? `The loss, from ${loss(points[0].loss)} to ${loss(points.at(-1).loss)}` : null,
      });
      if (points.length > 1) attrs(line, { d: curveOf(points) });
    },
  };
}
