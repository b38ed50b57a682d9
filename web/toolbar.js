// Above the picture: versions, views, layers, the comparison. On it: what it shows. Below it: what it took.

import { attrs, BY_TOUCH, button, byId, h, iconButton, text } from "./dom.js";
import { parentOf, shownVersion } from "./editor.js";
import { choice, menu, segments } from "./fields.js";
import { gaussians } from "./format.js";
import { isStated } from "./requests.js";
import { listOf } from "./selection.js";

const LAYERS = [
  ["color", "Colour", "The scene"],
  ["depth", "Depth", "How far it is"],
  ["mask", "Changed", "White: what differs from version 0"],
];

/** What to do first with each tool, and what the pointer does. */
const HINTS = {
  thing: [
    "Click a thing, then drag it",
    "All of it is found, tinted, and goes where you drag it. Let go: the hole is repaired.",
    "Click: take a thing · Drag it: move · Drag beside: orbit · Wheel: nearer",
  ],
  handle: [
    "Click the part you want to move",
    "A handle takes hold of it. Then drag its dot to where it should go.",
    "Drag: orbit · Right drag: move · Wheel: nearer · Click: place a handle",
  ],
  grow: [
    "Click the thing you mean",
    "It is selected up to its border. Right-click what was taken along by mistake.",
    "Click: on the thing · Right click: not it · Drag: orbit · Wheel: nearer",
  ],
  brush: [
    "Paint over what you mean",
    "Drag with the left button; with the right one you look around.",
    "Drag: paint · Alt + drag: the opposite · Right drag: orbit · Wheel: nearer",
  ],
  lasso: [
    "Draw around what you mean",
    "Drag with the left button, or click its corners; with the right button you look around.",
    "Drag, or click the corners: draw · Alt + drag: the opposite · Right drag: orbit · Wheel: nearer",
  ],
};

HINTS.sphere = [
  "Press in the middle of what you mean, and draw",
  "All within is selected. Pull the dots and the arrows until it fits.",
  "Drag: draw · Alt + drag: the opposite · Right drag: orbit · Wheel: nearer",
];
HINTS.box = HINTS.sphere;
HINTS.floor = [
  "Click three places on the floor",
  "What is at right angles to them is up.",
  "Click: on the floor · Drag: orbit · Wheel: nearer · Esc: give up",
];
/** The same for fingers, where it is not: what to do first, and what else. */
const TOUCH_HINTS = {
  thing: ["Tap a thing, then drag it", HINTS.thing[1]],
  handle: ["Tap the part you want to move", HINTS.handle[1]],
  grow: ["Tap the thing you mean", "It is selected up to its border. With “− Not it”, tap what was taken along by mistake."],
  brush: ["Paint over what you mean", "Two fingers move the view; lift one, and the other turns it."],
  lasso: ["Draw around what you mean, or tap its corners", "A lasso ends where it began. Two fingers move the view."],
  rectangle: ["Draw a rectangle, or tap two corners", "Two fingers move the view; lift one, and the other turns it."],
  sphere: HINTS.sphere,
  box: HINTS.box,
  floor: ["Tap three places on the floor", HINTS.floor[1]],
};
/** What the pointer and the keys do while the camera flies, whatever the tool. */
const FLYING = "W, A, S, D: fly · E, Q: up, down · Shift: faster · Drag: look around · Esc: end";
HINTS.rectangle = HINTS.lasso.map((text) => text.replace("Draw around", "Draw a rectangle around"));

export function buildToolbar(editor, viewer) {
  const { store } = editor;
  const version = choice({
    label: "Version",
    testid: "version-select",
    options: [],
    changed: (value) => editor.showVersion(Number(value)),
  });
  const view = choice({
    label: "View to look from",
    testid: "view-select",
    options: [],
    changed: (value) => value && editor.lookFrom(value),
  });
  const previous = iconButton("‹", "view-previous", "Previous view ([)", () => editor.stepView(-1));
  const next = iconButton("›", "view-next", "Next view (])", () => editor.stepView(1));
  const layer = segments({
    label: "Layer",
    testid: "layer",
    options: LAYERS,
    changed: (value) => store.set({ layer: value }),
  });
  const compareWith = choice({
    label: "Compare with",
    testid: "compare-with",
    options: [],
    changed: (value) => store.set({ compareWith: value === "" ? null : Number(value) }),
  });
  const compare = h(
    "button",
    { type: "button", class: "small hold", testid: "compare", title: "Hold to see the scene before (B)" },
    "Hold to compare",
  );
  const hold = (on) => () => store.set({ comparing: on });
  compare.addEventListener("pointerdown", (event) => {
    compare.setPointerCapture(event.pointerId);
    hold(true)();
  });
  for (const name of ["pointerup", "pointercancel", "blur"]) compare.addEventListener(name, hold(false));
  const pressed = (on) => (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    hold(on)();
  };
  compare.addEventListener("keydown", pressed(true));
  compare.addEventListener("keyup", pressed(false));

  byId("toolbar").append(
    version.element,
    h("div", { class: "row tight" }, previous, view.element, next),
    layer.element,
    h("div", { class: "row tight" }, compare, compareWith.element),
  );
  const fly = iconButton("➤", "fly", "Fly (T)", () => editor.fly());
  byId("view-tools").append(
    iconButton("⊕", "focus", "Turn about the point under the pointer (F); here: about the middle", () => viewer.focusHere()),
    iconButton("⌂", "reset-view", "Back to the start (R)", () => editor.home()),
    fly,
    menu("✢", "turn-menu", "Turn and move the view by buttons", ...turnPad(viewer)),
  );

  const chip = h("span", { class: "chip", testid: "shown-chip" });
  const back = button("End preview", "drop-preview", () => editor.dropPreview());
  byId("chips").append(chip, back);

  const keysLine = h("span", { class: "muted keys-line" });
  byId("status").append(
    h("span", { id: "picture-size", testid: "picture-size" }),
    h("span", { class: "spacer" }),
    keysLine,
  );

  const hint = h("strong", {});
  const hintMore = h("span", {});
  byId("hint").append(hint, hintMore);
  store.watch(["selectMode", "selectTool", "thingMode", "floorClicks", "flying"], ({ floorClicks, flying }) => {
    const keys = HINTS[viewer.tool][2];
    const [lead, more] = (BY_TOUCH ? TOUCH_HINTS : HINTS)[viewer.tool];
    text(hint, lead + (floorClicks?.length ? `: ${3 - floorClicks.length} more` : ""));
    text(hintMore, more);
    text(keysLine, flying ? FLYING : keys);
    attrs(fly, { "aria-pressed": String(flying) });
  });

  store.watch(
    [
      ...["scene", "version", "views", "viewName", "viewsKind", "layer", "comparing", "compareWith", "preview"],
      ...["handles", "selection", "mode", "selectMode", "thingMode", "floorClicks", "heal", "healing"],
    ],
    (state) => {
      const { scene } = state;
      if (!scene) return;
      const numbers = scene.versions.map((v) => v.version);
      version.options([...numbers].reverse().map(named));
      version.update(String(state.version));
      const kind = state.viewsKind === "dataset" ? "Views" : "Virtual views";
      view.options([
        ["", state.views.length ? `${kind} (${state.views.length})` : "No views"],
        ...state.views.map((v) => [v.name, v.name]),
      ]);
      view.update(state.viewName ?? "");
      previous.disabled = next.disabled = state.views.length === 0;
      layer.update(state.layer);
      layer.buttons.mask.disabled = state.version === 0 && !state.preview;

      const before = state.preview ? state.version : parentOf(scene, state.version);
      compare.disabled = before === null && state.compareWith === null;
      compareWith.options([
        ["", before === null ? "before" : `version ${before}`],
        ...numbers.filter((n) => n !== before).map((n) => [String(n), `version ${n}`]),
      ]);
      compareWith.update(state.compareWith === null ? "" : String(state.compareWith));
      compareWith.element.hidden = numbers.length < 2;
      attrs(compare, { "aria-pressed": String(state.comparing) });

      const shown = shownVersion(state);
      const previewing = String(shown).startsWith("p");
      const inVersion = scene.versions.find((v) => v.version === shown);
      text(
        chip,
        previewing
          ? `Preview of version ${state.version}`
          : `Version ${shown}${inVersion ? ` · ${gaussians(inVersion.gaussians)}` : ""}`,
      );
      attrs(chip, { class: previewing ? "chip preview" : state.comparing ? "chip compare" : "chip" });
      back.hidden = !previewing;
      const begun = isStated(state) || scene.versions.length > 1;
      byId("hint").hidden = !state.floorClicks && (listOf(state).length > 0 || (!state.selectMode && begun));
    },
  );
}

/** For who does not drag, and for who has one finger: the view turned, moved sideways, and brought nearer, by presses. */
function turnPad(viewer) {
  let slides = false;
  const way = segments({
    label: "What the arrows do",
    testid: "turn-way",
    options: [
      ["turn", "Turn"],
      ["slide", "Move"],
    ],
    changed: (value) => {
      slides = value === "slide";
      way.update(value);
    },
  });
  way.update("turn");
  const press = (sign, title, fn) => iconButton(sign, `turn-${title.toLowerCase()}`, title, fn);
  const arrow = (sign, title, to) => press(sign, title, () => viewer.step(to, slides));
  const near = (sign, title, factor) => press(sign, title, () => viewer.approach(factor));
  const blank = () => h("span", {});
  return [
    way.element,
    h(
      "div",
      { class: "pad" },
      ...[near("+", "Nearer", 0.8), arrow("↑", "Up", [0, -1]), near("−", "Farther", 1.25)],
      ...[arrow("←", "Left", [-1, 0]), blank(), arrow("→", "Right", [1, 0])],
      ...[blank(), arrow("↓", "Down", [0, 1])],
    ),
  ];
}

const named = (number) => [String(number), `Version ${number}`];
