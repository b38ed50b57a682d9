// The page: builds its parts once, and shows what the address asks for: #/ the scenes, #/scenes/{id} one of them.
// README.md beside this file lists the ids and test ids of its elements.

import * as api from "./api.js";
import { say, showHelp, signIn } from "./dialogs.js";
import { attrs, byId, h, problemText, showProblem, text } from "./dom.js";
import { buildCompare, nextWay } from "./compare.js";
import { buildEdits } from "./edits.js";
import { Editor, NOTHING_OPEN } from "./editor.js";
import { counted } from "./format.js";
import { buildGizmoPanel, next } from "./gizmo_panel.js";
import { HandleList } from "./handles.js";
import { buildNotes } from "./notes.js";
import { buildPhoto } from "./photo.js";
import { buildRequestPanel, importFile } from "./request_panel.js";
import { buildScenes, SCENE_FILES } from "./scenes.js";
import { buildSelectionPanel, buildTools, SELECT_TOOLS } from "./selection_panel.js";
import { SceneMemory, Store } from "./store.js";
import { buildThingBar } from "./thing_bar.js";
import { buildToolbar } from "./toolbar.js";
import { buildUp } from "./up.js";
import { buildVersions } from "./versions.js";
import { Viewer } from "./viewer.js";
import { hasEnded } from "./watch.js";

const TABS = [
  ["drag", "Drag"],
  ["edits", "Edits"],
  ["scene", "Scene"],
];

const store = new Store({ ...NOTHING_OPEN, info: null, scenes: null });
const memory = new SceneMemory(browserStorage());
const editor = new Editor(store, memory, say);
api.onUnauthorized(signIn);

const goTo = (id) => (location.hash = id ? `#/scenes/${id}` : "#/");
const scenes = buildScenes(byId("home"), { store, memory, open: goTo });
const viewer = new Viewer(editor);
buildToolbar(editor, viewer);
buildTools(editor);
buildThingBar(editor);
buildUp(editor);
buildCompare(editor);
buildPhoto(editor, viewer);
buildNotes(editor, viewer);
const run = buildRequestPanel(editor);
const versions = buildVersions(editor);
byId("tab-drag").append(
  h(
    "div",
    { class: "scroll" },
    buildSelectionPanel(editor),
    buildGizmoPanel(editor, () => viewer.camera),
    new HandleList(editor).element,
    run.element,
  ),
  run.footer,
);
byId("tab-edits").append(h("div", { class: "scroll" }, buildEdits(editor)));
byId("tab-scene").append(h("div", { class: "scroll" }, versions.element));
buildTabs();
listenToKeys();
listenToDrops();

byId("help").addEventListener("click", help);
byId("sign-out").addEventListener("click", async () => {
  await api.deleteSession().catch(() => {});
  location.reload();
});
window.addEventListener("hashchange", route);
window.addEventListener("pagehide", () => editor.flush());
document.addEventListener("visibilitychange", () => {
  if (document.visibilityState === "hidden") {
    editor.flush();
    editor.unfollow();
  } else if (!byId("home").hidden) scenes.refresh();
  else editor.follow();
});
store.watch(["answering"], ({ answering }) => {
  byId("away").hidden = answering;
});
store.watch(["gone"], ({ gone }) => {
  if (!gone) return;
  say("This scene has been deleted.", { kind: "bad" });
  goTo(null);
});
store.watch(["scene"], ({ scene }) => {
  text(byId("scene-title"), scene?.name ?? "");
  byId("scene-title").hidden = !scene;
  document.title = scene ? `${scene.name} · splatdrag` : "splatdrag";
});
store.watch(["info"], ({ info }) => {
  if (!info) return;
  text(byId("service"), `${info.version} · ${info.simd?.target ?? "scalar"} · ${counted(info.threads, "thread")}`);
  byId("sign-out").hidden = !info.token_required;
});

start();

function help() {
  showHelp({ letterKeys: memory.letterKeys, setLetterKeys: (on) => (memory.letterKeys = on) });
}

async function start() {
  try {
    store.set({ info: await api.info() });
  } catch (error) {
    // Without a session there is nothing to show; anything else may concern this one question only.
    if (error.status === 401)
      return showProblem(byId("fatal"), { detail: "Not signed in. Reload the page to enter the token." });
    say(error.message, { kind: "bad" });
  }
  route();
}

/** The browser's storage; one that forgets at once where the browser forbids it. */
function browserStorage() {
  try {
    return window.localStorage;
  } catch {
    return { getItem: () => null, setItem: () => {}, removeItem: () => {} };
  }
}

async function route() {
  const id = /^#\/scenes\/([\w-]+)$/.exec(location.hash)?.[1];
  showProblem(byId("fatal"), null);
  show(id);
  if (!id) {
    editor.close();
    return scenes.refresh();
  }
  if (store.state.scene?.id === id) return;
  try {
    await editor.open(id);
  } catch (error) {
    show(null);
    showProblem(byId("fatal"), error.status === 404 ? { detail: `There is no scene ${id} any more.` } : error);
    scenes.refresh();
  }
}

/** Shows a scene, or the list of them. Messages lie on what there is to see. */
function show(id) {
  byId("workspace").hidden = !id;
  byId("home").hidden = !!id;
  (id ? byId("view") : document.body).append(byId("toasts"));
}

function buildTabs() {
  const badge = h("span", { class: "badge", hidden: true, testid: "edits-badge" });
  const buttons = TABS.map(([name, label]) =>
    h(
      "button",
      {
        type: "button",
        role: "tab",
        id: `tab-button-${name}`,
        "aria-controls": `tab-${name}`,
        testid: `tab-button-${name}`,
        onclick: () => store.set({ tab: name, sheet: true }),
        onkeydown: (event) => {
          const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
          if (!step) return;
          const at = TABS.findIndex(([n]) => n === store.state.tab);
          const [next] = TABS[(at + step + TABS.length) % TABS.length];
          store.set({ tab: next });
          byId(`tab-button-${next}`).focus();
        },
      },
      label,
      name === "edits" ? badge : null,
    ),
  );
  byId("tabs").append(...buttons);
  byId("fold").addEventListener("click", () => store.set({ sheet: !store.state.sheet }));
  store.watch(["sheet"], ({ sheet }) => {
    byId("panel").classList.toggle("folded", !sheet);
    const label = sheet ? "Fold the panel away" : "Open the panel";
    attrs(byId("fold"), { "aria-expanded": String(sheet), "aria-label": label, title: label });
    text(byId("fold"), sheet ? "⌄" : "⌃");
  });
  store.watch(["tab"], ({ tab }) => {
    TABS.forEach(([name], i) => {
      attrs(buttons[i], { "aria-selected": String(name === tab), tabindex: name === tab ? "0" : "-1" });
      byId(`tab-${name}`).hidden = name !== tab;
    });
  });
  store.watch(["edits"], ({ edits }) => {
    const open = edits.filter((edit) => !hasEnded(edit)).length;
    badge.hidden = open === 0;
    text(badge, String(open));
  });
}

/** Keys that work wherever the focus is, but in fields and dialogs. */
function listenToKeys() {
  const busy = (event) =>
    event.target.closest?.("input, select, textarea, dialog") ||
    document.querySelector("dialog[open]") ||
    byId("workspace").hidden;
  const constraints = { v: "view", u: "surface", l: "level", x: "x", y: "y", z: "z", n: "normal" };
  const plain = {
    "[": () => editor.stepView(-1),
    "]": () => editor.stepView(1),
    r: () => editor.home(),
    f: () => viewer.focusHere(),
    t: () => editor.fly(),
    p: () => editor.preview(),
    g: () => next(store, "gizmo"),
    w: () => next(store, "frame"),
    d: () => editor.selecting.takeThings(true),
    h: () => editor.selecting.takeThings(false),
    ".": () => editor.selecting.widen(1),
    ",": () => editor.selecting.widen(-1),
    s: () => editor.selecting.toggle(),
    ...Object.fromEntries(SELECT_TOOLS.map(([tool], i) => [String(i + 1), () => editor.selecting.use(tool)])),
    delete: () => editor.state.selected !== null && editor.remove(editor.state.selected),
    backspace: () => editor.state.selected !== null && editor.remove(editor.state.selected),
    escape: () =>
      viewer.giveUpDrag() ||
      (store.state.flying && (editor.fly(false), true)) ||
      (store.state.floorClicks && (store.set({ floorClicks: null }), true)) ||
      (editor.state.selectMode
        ? editor.selecting.use(null)
        : editor.state.thingMode && editor.state.handles.length === 0
          ? editor.selecting.clear()
          : editor.select(null)),
    b: () => store.set({ comparing: true }),
    c: () => store.set({ contrast: nextWay(store.state.contrast) }),
    o: () => editor.togglePhoto(),
    e: () => editor.selecting.start(true),
  };
  document.addEventListener("keydown", (event) => {
    // Who dictates, or brushes against keys, turns single characters off (WCAG 2.1.4); keys with a name stay.
    const character = event.key.length === 1 && !event.ctrlKey && !event.metaKey;
    if (character && !memory.letterKeys) return;
    if (event.key === "?" && !event.target.closest?.("input, dialog")) return help();
    if (busy(event)) return;
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && key === "z") {
      event.preventDefault();
      return event.shiftKey ? editor.redo() : editor.undo();
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (viewer.flyBy(event)) return;
    if (constraints[key]) return store.set({ constraint: constraints[key] });
    plain[key]?.();
  });
  document.addEventListener("keyup", (event) => {
    if (event.key.toLowerCase() === "b") store.set({ comparing: false });
    viewer.endFlyingBy(event.key);
  });
  window.addEventListener("blur", () => {
    store.set({ comparing: false });
    viewer.endFlyingBy(null);
  });
}

/** A file dropped anywhere goes where it belongs: scenes to the list, a zip to the open scene, JSON to its handles. */
function listenToDrops() {
  const veil = byId("drop");
  const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  const inScene = () => store.state.scene !== null;
  document.addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    veil.hidden = false;
    text(
      veil.firstElementChild,
      inScene() ? "Drop a dataset (.zip), a request (.json), or another scene" : "Drop a scene to upload it",
    );
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) veil.hidden = true;
  });
  document.addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    veil.hidden = true;
    const files = [...event.dataTransfer.files];
    const found = files.filter((file) => SCENE_FILES.test(file.name));
    if (found.length) {
      goTo(null);
      return scenes.upload(found);
    }
    const [file] = files;
    if (inScene() && /\.zip$/i.test(file.name)) {
      store.set({ tab: "scene" });
      return versions.uploadDataset(file);
    }
    if (inScene() && /\.json$/i.test(file.name)) {
      store.set({ tab: "drag" });
      return importFile(editor, file, document.querySelector("[data-testid=import-problem]"));
    }
    say(`${file?.name ?? "This"} is none of: .ply, .splat, .spz, .sog, .glb${inScene() ? ", .zip, .json" : ""}.`, { kind: "bad" });
  });
}

window.addEventListener("unhandledrejection", ({ reason }) => say(problemText(reason), { kind: "bad" }));
