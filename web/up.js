// Which way is up: the axes in the corner of the picture, to look along, and the menu of the scene's up direction.

import { axes, seenFrom, upOf } from "./camera.js";
import { attrs, button, byId, h, problemText, s } from "./dom.js";
import { menu } from "./fields.js";
import { cross, dot, scale, sub, unit } from "./vectors.js";

const ARM = 28; // Pixels from the middle of the axes to their ends.
const AXES = ["x", "y", "z"].flatMap((name, i) =>
  [1, -1].map((sign) => ({ name, sign, direction: [0, 1, 2].map((k) => (k === i ? sign : 0)) })),
);

/** The direction at right angles to three points of a floor, on the side that it is seen from. Null where they are in
 *  line: of such there is none. */
export function upOfFloor([a, b, c], eye) {
  const [u, v] = [sub(b, a), sub(c, a)];
  const normal = cross(unit(u), unit(v));
  if (Math.hypot(...normal) < 0.05) return null;
  const up = unit(normal);
  return dot(up, sub(eye, a)) > 0 ? up : scale(up, -1);
}

/** One more of the three clicks on the floor. */
export async function clickFloor(editor, camera, x, y) {
  const point = await editor.surfaceAt(camera, x, y);
  const { floorClicks } = editor.state;
  if (!floorClicks) return;
  if (!point) return editor.say("There is nothing here.", { seconds: 3 });
  const clicks = [...floorClicks, point];
  editor.store.set({ floorClicks: clicks.length < 3 ? clicks : null });
  if (clicks.length < 3) return;
  const up = upOfFloor(clicks, camera.eye);
  if (!up) return editor.say("These three are in line: they could lie on many floors.", { seconds: 4 });
  await editor.setUp(up);
}

export function buildUp(editor) {
  const { store } = editor;
  const choose = (label, testid, title, up) =>
    button(
      label,
      testid,
      async () => {
        ways.open = false;
        await Promise.resolve(up()).catch((error) => editor.say(problemText(error), { kind: "bad" }));
      },
      { title },
    );
  const reset = choose("Default", "reset-up", "As the cameras of the dataset were held; without one, −y", () => editor.setUp(null));
  const ways = menu(
    "↥",
    "up-menu",
    "Which way is up",
    choose("Upside down: flip", "flip-up", "The opposite of what is up now", () => editor.setUp(scale(editor.worldUp, -1))),
    choose("Click the floor", "floor-up", "Three clicks on a floor say what is up", () =>
      store.set({ floorClicks: [], selectMode: false }),
    ),
    choose("As on the screen", "set-up", "The top of the picture is up: orbits turn about it. The scene's data stays as it is.", () =>
      editor.setUp(upOf(store.state.pose)),
    ),
    reset,
  );
  byId("view-tools").append(ways);

  const ends = AXES.map(({ name, sign, direction }) => {
    const look = () => editor.setPose(seenFrom(store.state.pose, direction, editor.worldUp));
    const line = sign > 0 ? s("path", {}) : null;
    const end = s(
      "g",
      {
        class: "end",
        tabindex: "0",
        role: "button",
        testid: `look-${sign > 0 ? "" : "minus-"}${name}`,
        "aria-label": `Look from ${sign > 0 ? "" : "minus "}${name}`,
        onclick: look,
        onkeydown: (event) => ["Enter", " "].includes(event.key) && (event.preventDefault(), look()),
      },
      s("circle", { class: "reach", r: 12 }),
      s("circle", { class: "mark", r: sign > 0 ? 8 : 5 }),
      sign > 0 ? s("text", { "text-anchor": "middle", y: 4 }, name.toUpperCase()) : null,
    );
    return { direction, line, end, element: s("g", { class: `axis-${name}${sign > 0 ? "" : " minus"}` }, line, end) };
  });
  const widget = s("svg", { id: "axes", viewBox: "-44 -44 88 88", testid: "axes", "aria-label": "Axes" });
  widget.append(...ends.map(({ element }) => element));
  byId("view").append(widget);
  store.watch(["pose", "scene", "viewsKind"], ({ pose, scene }) => {
    if (!pose || !scene) return;
    reset.disabled = scene.up === null;
    const { right, down, forward } = axes(pose);
    for (const { direction, line, end } of ends) {
      const [x, y] = [ARM * dot(direction, right), ARM * dot(direction, down)];
      attrs(end, { transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})` });
      if (line) attrs(line, { d: `M0 0L${x.toFixed(1)} ${y.toFixed(1)}` });
    }
    // What is nearer lies on what is farther; elements are moved only where the order is another one: focus stays.
    const order = [...ends].sort((a, b) => dot(b.direction, forward) - dot(a.direction, forward));
    if (order.some(({ element }, i) => widget.children[i] !== element)) {
      const focused = document.activeElement;
      widget.append(...order.map(({ element }) => element));
      if (widget.contains(focused)) focused.focus();
    }
  });
}
