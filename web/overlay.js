// What is drawn over the picture: handles with their spheres and targets, the region, the points and lines that select.
// Geometry comes from camera.js.

import { boxEdges, project, projectSegment, sphereOutline } from "./camera.js";
import { attrs, keyedList, s } from "./dom.js";

const GROUP_COLOURS = 8;

/** The class that gives a group its colour. */
export const groupClass = (group) => `group-${group % GROUP_COLOURS}`;

/** A polyline as the `d` of a path. */
export const pathOf = (points, closed = false) =>
  points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("") + (closed ? "Z" : "");

const at = ({ x, y }) => `translate(${x.toFixed(2)} ${y.toFixed(2)})`;

/** The overlay.
 *    grab(id, event)          the pointer went down on a handle's dot
 *    nudge(id, event)         a key was pressed on it
 *    wheel(id, event)         the wheel turned over it
 *    focused(id)              it has the keyboard's focus */
export class Overlay {
  #camera = null;
  #svg;
  #region;
  #update;
  #updateClicks;
  #sketch;
  #cursor;
  #spheres = true;

  constructor(svg, { grab, nudge, wheel, focused }) {
    this.#svg = svg;
    this.#region = s("path", { class: "region", testid: "region-outline" });
    const handles = s("g");
    const clicks = s("g");
    this.#sketch = s("path", { class: "sketch", testid: "sketch" });
    this.#cursor = s("circle", { class: "brush-cursor", testid: "brush-cursor", display: "none" });
    svg.append(this.#region, this.#sketch, handles, clicks, this.#cursor);
    this.#updateClicks = keyedList(
      clicks,
      ({ key }) => key,
      ({ click }) => this.#click(click.kind),
    );
    this.#update = keyedList(
      handles,
      (item) => item.handle.id,
      ({ handle: { id } }) => {
        const sphere = s("path", { class: "sphere" });
        const line = s("path", { class: "motion" });
        const dot = (kind) =>
          s(
            "g",
            {
              class: `dot ${kind}`,
              tabindex: "0",
              role: "button",
              onpointerdown: (event) => grab(id, event),
              onkeydown: (event) => nudge(id, event),
              onwheel: (event) => wheel(id, event),
              onfocus: () => focused(id),
            },
            // The larger, invisible circle makes it easier to hit.
            s("circle", { class: "reach", r: 14 }),
            s("circle", { class: "mark", r: kind === "target" ? 7 : 5 }),
            kind === "source" ? s("text", { class: "label", x: 10, y: -9 }) : null,
          );
        const source = dot("source");
        const target = dot("target");
        const element = s("g", {}, sphere, line, source, target);
        return { element, update: (item, i) => this.#draw(item, i, { element, sphere, line, source, target }) };
      },
    );
  }

  /** Draws.
   *    camera   that of the picture on the screen, in CSS pixels
   *    items    [{handle, selected, bad, behind}]; behind: {source, target}, whether something is in front of them
   *    region   a box, or null
   *    clicks   [{point, kind}] of a selection
   *    spheres  whether it is their spheres that say what handles move */
  draw(camera, items, { region, clicks, spheres }) {
    this.#camera = camera;
    this.#spheres = spheres;
    attrs(this.#svg, { viewBox: `0 0 ${camera.width} ${camera.height}` });
    this.#update(items);
    this.#updateClicks(clicks.map((click, i) => ({ key: `${i}${click.kind}`, click })));
    const edges = region ? boxEdges(region.center, region.size) : [];
    const lines = edges.map(([a, b]) => projectSegment(camera, a, b)).filter(Boolean);
    attrs(this.#region, {
      d: lines
        .map(([a, b]) =>
          pathOf(
            [
              [a.x, a.y],
              [b.x, b.y],
            ],
            false,
          ),
        )
        .join(""),
    });
  }

  /** A point that was clicked: + on the thing, − not on it. */
  #click(kind) {
    const inside = kind === "inside";
    const element = s(
      "g",
      { class: `click ${kind}`, role: "img", "aria-label": inside ? "Point on the thing" : "Point that is not it" },
      s("circle", { r: 8.5 }),
      s("path", { d: inside ? "M-4.5 0H4.5M0 -4.5V4.5" : "M-4.5 0H4.5" }),
    );
    return {
      element,
      update: ({ click }, i) => {
        const seen = project(this.#camera, click.point);
        attrs(element, {
          transform: seen ? at(seen) : null,
          display: seen ? null : "none",
          "data-testid": `click-${i}`,
        });
      },
    };
  }

  /** Shows the line that is being drawn, {tool, points, radius, subtracts}; null: none. */
  sketch(line) {
    if (!line) return attrs(this.#sketch, { d: null });
    const { tool, points, radius, subtracts } = line;
    const brush = tool === "brush";
    const [[x0, y0], [x1, y1]] = [points[0], points.at(-1)];
    const box = (x, y, toX, toY) => [[x, y], [toX, y], [toX, toY], [x, toY]];
    const round = (k) => [x0 + radius * Math.cos((Math.PI * k) / 24), y0 + radius * Math.sin((Math.PI * k) / 24)];
    const drawn = {
      rectangle: () => box(x0, y0, x1, y1),
      box: () => box(x0 - radius, y0 - radius, x0 + radius, y0 + radius),
      sphere: () => Array.from({ length: 48 }, (_, k) => round(k)),
    }[tool]?.();
    attrs(this.#sketch, {
      class: `sketch ${brush ? "brush" : "lasso"}${subtracts ? " subtracts" : ""}`,
      // A dot is a line of no length.
      d: drawn ? pathOf(drawn, true) : pathOf(points.length > 1 ? points : [points[0], points[0]], !brush),
      "stroke-width": brush ? 2 * radius : 2,
    });
  }

  /** Shows the brush where the pointer is, {x, y}; null: nowhere. */
  cursor(place, radius = 0) {
    attrs(this.#cursor, place ? { cx: place.x, cy: place.y, r: radius, display: null } : { display: "none" });
  }

  #draw({ handle, selected, bad, behind }, i, { element, sphere, line, source, target }) {
    const camera = this.#camera;
    attrs(element, {
      class: `handle ${groupClass(handle.group)}${selected ? " selected" : ""}${bad ? " bad" : ""}`,
      "data-testid": `handle-${i}`,
    });
    const from = project(camera, handle.source);
    const to = handle.target ? project(camera, handle.target) : null;
    const outline = this.#spheres ? sphereOutline(camera, handle.source, handle.radius) : null;
    attrs(sphere, { d: outline ? pathOf(outline, true) : null });
    attrs(source, {
      transform: from ? at(from) : null,
      display: from ? null : "none",
      "data-testid": `handle-${i}-source`,
      "data-behind": behind.source,
      "aria-label": handle.target ? `Handle ${i + 1}` : `Handle ${i + 1}: drag to set its target`,
    });
    source.querySelector(".label").textContent = String(i + 1);
    attrs(target, {
      transform: to ? at(to) : null,
      display: to ? null : "none",
      "data-testid": `handle-${i}-target`,
      "data-behind": behind.target,
      "aria-label": `Target of handle ${i + 1}`,
    });
    const seen = handle.target ? projectSegment(camera, handle.source, handle.target) : null;
    attrs(line, {
      d: seen
        ? pathOf(
            seen.map(({ x, y }) => [x, y]),
            false,
          )
        : null,
    });
  }
}
