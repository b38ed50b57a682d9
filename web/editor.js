// What can be done with a scene, and the state it leaves. No elements here: the panels watch the store.

import * as api from "./api.js";
import {
  DEFAULT_UP,
  dragged,
  firstPose,
  isPose,
  levelled,
  onTheWire,
  pivotedAt,
  poseOfView,
  project,
  upOfViews,
} from "./camera.js";
import { superseded } from "./drafts.js";
import { fittedPose, looksAt } from "./fit.js";
import { History } from "./history.js";
import { beforeMoves } from "./held.js";
import { isMoved, moved, scaledAbout, shifted, turnedAbout, withMotion } from "./motion.js";
import { changesScene, previewKey, requestOf } from "./requests.js";
import { proposalOf } from "./selection.js";
import { centreOf, changedShape, lastShape, withShape } from "./shapes.js";
import { slider } from "./surface.js";
import { isShape, NOTHING_SELECTED, Selecting } from "./selecting.js";
import { distance } from "./vectors.js";
import { followScene, hasEnded, merged } from "./watch.js";

// Choices: how long after the last change of a handle or of the request something is done about it.
const COUNT_DELAY_MS = 150; // Counting the Gaussians of handles: cheap.
const PREVIEW_DELAY_MS = 300; // A preview: it costs the service a second or so.
const SAVE_DELAY_MS = 400; // Writing to the browser's storage: nobody waits for it.
const ANSWER_MS = 2000; // An answer about the scene that takes longer is none.

/** What there is before a scene is open. */
export const NOTHING_OPEN = {
  scene: null,
  views: [],
  viewsKind: null,
  clickedOn: null, // {point, normal} of the surface where a thing was clicked on.
  floorClicks: null, // Points of the floor that were clicked on to say which way is up; null: nobody is about to.
  viewName: null, // The view that the pose was taken from; null once it has been moved.
  pose: null,
  version: 0, // The version that is looked at and edited.
  layer: "color",
  comparing: false,
  contrast: null, // How two versions are compared beside each other: "slider", "blink", "difference".
  photoOn: false, // The dataset's photo lies over the picture.
  flying: false, // Keys move the camera, and a drag looks around.
  compareWith: null, // A version; null: the one before.
  ...NOTHING_SELECTED,
  handles: [], // {id, source, normal, target, rotation, scale, radius, grip, group}; grip: the radius with a selection, or null
  selected: null, // Id of a handle.
  dragging: false,
  constraint: "view",
  gizmo: "move", // "move", "turn" or "size"
  frame: "world", // Of the gizmo: "world", "view" or "surface".
  counts: {}, // By handle id: {key, gaussians, error}
  region: null,
  mode: "move",
  preset: "",
  prompt: null,
  negative_prompt: null,
  lora: null, // The adapter that the diffusion model paints with.
  allow_slow: false, // Networks may work for hours.
  attach: null,
  crumbs: null, // What becomes of what the selection has left out; null: it goes along.
  shadow: null, // What becomes of the shadow of the selection; null: it goes along.
  settle: null, // "off": the selection goes where its handles say, and is not set down on what it stands on.
  heal: [], // Operations: what a run makes anew.
  params: {},
  autoPreview: true,
  preview: null, // What the service answered, and `key`: of what it is a preview.
  previewing: false,
  problem: null, // {error, key, from: "preview" | "run"}: what the service refused.
  estimate: null, // {key, ...}: what the service expects of a run.
  submitting: false,
  draftOnRelease: true, // A thing that was dragged is repaired as a draft as soon as it is let go.
  draft: null, // {id, body} of the draft that is under way: id null until the service has it, and what it was made of.
  drafts: [], // {version, base} of drafts that nobody has said to keep.
  // {version, base, request, placed, edit, better}: what the last draft made, of which version, of which request, of
  // what was placed; the ids of its edit, and of the one that runs the same well, if that was asked for.
  drafted: null,
  edits: [],
  asked: null, // Id of the last edit that was asked for from the panel.
  answering: true, // Whether the service answers.
  gone: false, // Whether somebody has deleted the scene.
  tab: "drag",
  sheet: false, // Where there is no room beside the picture, the panel is a sheet over its foot: whether that is open.
};

/** What undo brings back, all at once: a drag is meant on a version, in a mode, with settings. */
const PLACED_KEYS = [
  ...["version", "handles", "selection", "region", "mode", "preset", "prompt", "params", "heal", "attach", "crumbs", "shadow", "settle"],
  ...["negative_prompt", "lora", "allow_slow"],
];
/** What goes from the screen when another version comes. */
const OF_THE_VERSION = { comparing: false, compareWith: null, preview: null, problem: null, estimate: null };

// What outlives a reload: as it is; and all, of which open() puts back what still fits the scene.
const LASTING_KEYS = [
  ...["region", "mode", "preset", "crumbs", "shadow", "prompt", "negative_prompt", "lora", "params", "autoPreview", "layer", "tab"],
  ...["constraint", "gizmo", "frame", "thingMode", "selectTool", "selectDepth", "brushRadius", "tinted", "draftOnRelease", "drafts"],
];
const STORED_KEYS = ["pose", "version", "handles", "selection", "viewName", ...LASTING_KEYS];

/** How one compares: where there are no keys, by the button. */
const HOLD = globalThis.matchMedia?.("(hover: none)").matches ? "Hold the button" : "Hold B";

/** The members of an object that have these names, as far as it has them. */
const only = (names, from) =>
  Object.fromEntries(names.filter((name) => from[name] !== undefined).map((name) => [name, from[name]]));

/** The number of the version before another one; null for the first. */
export function parentOf(scene, version) {
  return scene?.versions.find((v) => v.version === version)?.parent ?? null;
}

/** Which version is on the screen: a number, or the id of a preview. */
export function shownVersion({ scene, version, preview: made, comparing, compareWith, selectMode }) {
  // What is selected is selected on the version, not on what a preview has made of it.
  const preview = selectMode ? null : made;
  if (!comparing) return preview ? preview.version : version;
  if (compareWith !== null) return compareWith;
  return preview ? version : (parentOf(scene, version) ?? version);
}

export class Editor {
  #history = new History();
  #placed = null;
  #timers = new Map();
  #unfollow = () => {};
  #submitting = 0; // How many submissions are on their way.
  #early = []; // Edits that ended meanwhile.
  #mine = new Set(); // Ids of edits that were asked for here, or were there when the scene was opened.
  #better = new Set(); // Of these, the ids of those that run a draft well: without their draft they take no screen.
  #counting = null;
  #previewing = null;
  #placing = null;
  #nextId = 1;
  #lost = null; // {body, key} of a submission whose answer never came.
  #deleting = new Set(); // Versions whose deletion was asked for here and is under way.
  #abandoned = new Set(); // Ids of edits that were begun and that nobody wants to hear of.
  #opened = 0;
  #lastView = null;
  #upOf = null; // {views, up}: worked out once.
  #viewsAsked = 0;

  /**   say(message, options)  a short message to the user */
  constructor(store, memory, say) {
    Object.assign(this, { store, memory, say });
    this.selecting = new Selecting(store, {
      place: (patch) => this.#place(patch),
      say,
      pickSeen: (...what) => this.pickSeen(...what),
    });
    store.watch(["handles", "selection", "version", "scene", "dragging"], () => this.#countSoon());
    store.watch(["layer", "version", "preview"], ({ layer, version, preview }) => {
      // Version 0 does not differ from itself.
      if (layer === "mask" && version === 0 && !preview) store.set({ layer: "color" });
    });
    const ofRequest = PLACED_KEYS.filter((key) => key !== "heal");
    store.watch([...ofRequest, "autoPreview", "dragging", "selectMode"], () => this.#requestChanged());
    store.watch([...PLACED_KEYS], () => this.#draftOutdated());
    store.watch(STORED_KEYS, () => this.#saveSoon());
  }

  get state() {
    return this.store.state;
  }

  // --- opening ---------------------------------------------------------------------------------------------------

  /** Opens a scene where it was left. Throws what the service answers if there is no such scene. */
  async open(id) {
    this.close();
    const opening = this.#opened;
    const scene = await api.scene(id);
    if (opening !== this.#opened) return;
    const stored = this.memory.load(scene) ?? {};
    const version = scene.versions.some((v) => v.version === stored.version)
      ? stored.version
      : scene.versions.at(-1).version;
    const placed = (list) => (stored.version === version && Array.isArray(list) ? list : []);
    const handles = placed(stored.handles);
    this.#nextId = Math.max(0, ...handles.map((h) => h.id)) + 1;
    const pose = isPose(stored.pose) ? stored.pose : null;
    this.#lastView = stored.viewName ?? null;
    this.store.set({
      ...only(LASTING_KEYS, stored),
      scene,
      version,
      handles,
      selection: placed(stored.selection),
      pose,
      viewName: pose ? (stored.viewName ?? null) : null,
    });
    await Promise.allSettled([this.#loadViews(opening), this.#loadEdits(opening)]);
    if (opening === this.#opened) this.follow();
  }

  close() {
    this.#opened += 1;
    for (const timer of this.#timers.values()) clearTimeout(timer);
    this.#timers.clear();
    this.#unfollow();
    this.#mine.clear();
    this.#better.clear();
    this.#early = [];
    for (const abort of [this.#counting, this.#previewing, this.#placing]) abort?.abort();
    this.#previewing = null;
    this.#lost = null;
    this.#abandoned.clear();
    this.#history.clear();
    if (this.state.scene) this.#save();
    this.store.set({ ...NOTHING_OPEN });
  }

  async #loadViews(opening) {
    const asked = (this.#viewsAsked += 1); // Those of a dataset may overtake the virtual ones from before it.
    const outdated = () => opening !== this.#opened || asked !== this.#viewsAsked;
    if (this.state.pose === null && !this.state.scene.dataset) this.#lookAtAll();
    try {
      const { views, kind } = await api.views(this.state.scene.id);
      if (outdated()) return;
      this.store.set({ views, viewsKind: kind });
      if (this.state.pose === null && this.state.scene.dataset) this.home();
    } catch (error) {
      if (outdated()) return;
      this.store.set({ pose: this.state.pose ?? firstPose(this.state.scene) });
      this.say(`The views of this scene could not be listed: ${error.message}`, { kind: "bad" });
    }
  }

  /** From where all of the scene shows, unless there is a pose already when that is known. */
  async #lookAtAll() {
    const { scene, version, pose: before } = this.state;
    const opening = this.#opened;
    // Without pictures of it, from where captures mostly look.
    const pose = await fittedPose(scene, () => this.aspect, looksAt(scene.id, version)).catch(() => firstPose(scene));
    if (opening === this.#opened && this.state.pose === before) this.store.set({ pose, viewName: null });
  }

  async reloadScene() {
    const { scene } = this.state;
    if (!scene) return;
    const opening = this.#opened;
    const fresh = await api.scene(scene.id);
    if (opening === this.#opened) this.store.set({ scene: fresh });
  }

  /** After a new dataset: its views, and its first one to look from. */
  async datasetChanged(scene) {
    this.store.set({ scene, pose: null, viewName: null });
    await this.#loadViews(this.#opened);
  }

  // --- looking ---------------------------------------------------------------------------------------------------

  /** The scene's up direction: as it was declared, or as its cameras were held. */
  get worldUp() {
    const { scene, views, viewsKind } = this.state;
    if (this.#upOf?.views !== views) this.#upOf = { views, up: viewsKind === "dataset" ? upOfViews(views) : DEFAULT_UP };
    return scene?.up ?? this.#upOf.up;
  }

  setPose(pose) {
    this.store.set({ pose, viewName: null });
  }

  /** Keys move the camera, or do not any more. */
  fly(on = !this.state.flying) {
    this.store.set({ flying: on });
  }

  togglePhoto() {
    this.store.set({ photoOn: !this.state.photoOn });
  }

  /** Width / height of the picture; told by the viewer. */
  aspect = 1.5;

  lookFrom(name) {
    const view = this.state.views.find((v) => v.name === name);
    if (!view) return;
    this.#lastView = name;
    const pose = poseOfView(view, this.state.scene, this.aspect);
    this.store.set({ pose, viewName: name });
    this.#pivotOnSurface(pose);
  }

  /** Puts the pivot of a pose onto what is in the middle of its picture: an orbit then turns about that. */
  async #pivotOnSurface(pose) {
    const { scene, version } = this.state;
    const camera = onTheWire({ ...pose, width: 200, height: 200 });
    try {
      const picked = await api.pick(scene.id, version, { camera, x: 100, y: 100 });
      if (picked.hit && this.state.pose === pose) this.store.set({ pose: pivotedAt(pose, picked.point) });
    } catch {
      // The pivot stays near the scene's centre: good enough, and not worth a message.
    }
  }

  /** The next view of the list (step 1), the one before (-1). */
  stepView(step) {
    const { views } = this.state;
    if (views.length === 0) return;
    const at = views.findIndex((v) => v.name === this.#lastView);
    const next = at < 0 ? (step > 0 ? 0 : views.length - 1) : (at + step + views.length) % views.length;
    this.lookFrom(views[next].name);
  }

  home() {
    const { scene, views } = this.state;
    if (scene?.dataset && views.length) this.lookFrom(views[0].name);
    else if (scene) this.#lookAtAll();
  }

  /** Declares the scene's up direction; null: as its cameras were held, or the default. */
  async setUp(up) {
    const scene = await api.patchScene(this.state.scene.id, { up });
    this.store.set({ scene });
    if (this.state.pose) this.setPose(levelled(this.state.pose, this.worldUp));
  }

  async rename(name) {
    this.store.set({ scene: await api.patchScene(this.state.scene.id, { name }) });
  }

  /** Looks at, and from now on edits, another version. Handles were placed on the old one: they stay, since versions
   *  share the frame, and can be undone. */
  showVersion(version) {
    this.store.set({ version, ...OF_THE_VERSION });
  }

  // --- what is placed: handles, the selection, and how they are meant ----------------------------------------------

  /** What undo brings back; the same object as long as all of it is. */
  #present() {
    const present = only(PLACED_KEYS, this.state);
    if (PLACED_KEYS.some((key) => this.#placed?.[key] !== present[key])) this.#placed = present;
    return this.#placed;
  }

  /** Puts something in place of what is there. */
  #place(patch, note = true) {
    if (note) this.#history.note(this.#present());
    const { selected, version } = this.state;
    const { handles = this.state.handles } = patch;
    const moves = patch.version !== undefined && patch.version !== version;
    this.store.set({
      ...patch,
      selected: handles.some((h) => h.id === selected) ? selected : null,
      ...(moves ? OF_THE_VERSION : {}),
    });
  }

  /** Changes how the drag is meant: mode, preset, params, region and the like. */
  settle(patch) {
    this.#place(patch);
  }

  undo() {
    this.#step(this.#history.undo(this.#present(), this.#isThere));
  }

  redo() {
    this.#step(this.#history.redo(this.#present(), this.#isThere));
  }

  #step(placed) {
    if (placed) this.#place(placed, false);
  }

  /** Is what was placed on a version that has not been deleted since? */
  #isThere = ({ version }) => !this.state.scene || this.state.scene.versions.some((v) => v.version === version);

  get canUndo() {
    return this.#history.canUndo;
  }

  get canRedo() {
    return this.#history.canRedo;
  }

  #defaultRadius() {
    const last = this.state.handles.at(-1);
    return last ? last.radius : Number(((this.state.scene.radius || 1) * 0.12).toPrecision(3));
  }

  /** Places a handle on the surface under a pixel of a camera. */
  async place(camera, x, y) {
    this.#placing?.abort();
    const abort = (this.#placing = new AbortController());
    try {
      const picked = await this.pickSeen(camera, x, y, abort.signal);
      if (abort.signal.aborted) return;
      if (!picked.hit) return this.say("There is nothing here to take hold of.", { seconds: 3 });
      const handle = this.#newHandle(picked.point, picked.normal);
      this.#place({ handles: [...this.state.handles, handle] });
      // The handle is on the version, not on what a preview has made of it.
      this.store.set({ selected: handle.id, tab: "drag" });
    } catch (error) {
      if (!api.wasGivenUp(error)) this.say(`No handle could be placed: ${error.message}`, { kind: "bad" });
    }
  }

  /** What a version shows under a pixel, as the service picks it: {hit, point, normal, ...}. */
  pick(camera, x, y, version = this.state.version, signal = undefined) {
    return api.pick(this.state.scene.id, version, { camera: onTheWire(camera), x, y }, signal);
  }

  /** What is seen under a pixel: on a preview, too, but told as of the version that it was made of. `moved`: it is part
   *  of what the preview has moved. */
  async pickSeen(camera, x, y, signal) {
    const shown = shownVersion(this.state);
    const { handles, selection, selectionAnswer: answer, comparing } = this.state;
    const picked = await this.pick(camera, x, y, comparing ? undefined : shown, signal);
    if (!picked.hit || comparing || !String(shown).startsWith("p")) return picked;
    const holds = (handle) =>
      selection.length > 0 ? within(answer?.bounds) : (point) => distance(point, handle.source) <= handle.radius;
    return { ...picked, ...beforeMoves(picked.point, handles.filter(isMoved).map((handle) => ({ handle, holds: holds(handle) }))) };
  }

  #newHandle(source, normal = null) {
    return {
      id: this.#nextId++,
      source,
      normal,
      target: null,
      radius: this.#defaultRadius(),
      grip: null,
      group: this.state.handles.at(-1)?.group ?? 0,
    };
  }

  /** The point of the surface under a pixel; null if there is none. */
  async surfaceAt(camera, x, y) {
    const picked = await this.pickSeen(camera, x, y);
    return picked.hit ? picked.point : null;
  }

  /** Changes a handle. `note`: can be undone (not each step of a drag). */
  change(id, patch, note = true) {
    this.#place({ handles: this.state.handles.map((h) => (h.id === id ? { ...h, ...patch } : h)) }, note);
  }

  remove(id) {
    this.#place({ handles: this.state.handles.filter((h) => h.id !== id) });
  }

  removeAll() {
    if (this.state.handles.length) this.#place({ handles: [] });
  }

  select(id) {
    this.store.set({ selected: id });
  }

  /** Drags the target of a handle from where it is (its source, if it has none yet).
   *    at  {x, y} where the pointer took hold, pixels
   *  Returns {move(x, y), end(), giveUp()}. */
  dragTarget(id, camera, at) {
    const handle = this.state.handles.find((h) => h.id === id);
    return this.#drag(handle, this.#byPointer({ handle, pivot: handle.source, bounds: null }, camera, at));
  }

  /** What is held, for a gizmo: {handle, pivot, bounds}, and while selecting `shape`: the sphere or box that selects last. A handle, or of a thing that was just taken the source of the one
   *  that would come; what is turned about, at rest; the box of it, null of a sphere. Null: nothing is held. */
  get held() {
    const { selection, selectionAnswer: answer, selectionWaits, handles, selected } = this.state;
    const { selectMode, thingMode, comparing, mode } = this.state;
    if (comparing) return null;
    if (selectMode) {
      const shape = isShape(this.state.selectTool) ? lastShape(selection) : null;
      const centre = shape && centreOf(shape);
      return shape && { shape, handle: { source: centre }, pivot: centre, bounds: null };
    }
    if (!thingMode) {
      const handle = handles.find(({ id }) => id === selected);
      return handle && mode !== "remove" ? { handle, pivot: handle.source, bounds: null } : null;
    }
    if (selection.length === 0 || selectionWaits || !answer?.count) return null;
    const { clickedOn } = this.state;
    const source = proposalOf(selection)?.inside[0] ?? answer.centre;
    const normal = clickedOn?.point === source ? clickedOn.normal : null;
    return { handle: handles.at(-1) ?? { source, normal }, pivot: answer.centre, bounds: answer.bounds };
  }

  /** What is held with a handle of its own. */
  #taken() {
    const { held } = this;
    const { source, normal, id } = held.handle;
    return id === undefined ? { ...held, handle: this.#newHandle(source, normal) } : held;
  }

  /** Drags by a part of the gizmo, which means(x, y): as gizmo.js. Letting go of a thing repairs it. */
  dragHeld(means) {
    const { shape } = this.held;
    if (shape) return this.dragShape((x, y) => changedShape(shape, means(x, y)));
    const held = this.#taken();
    const at = (x, y, put) => put(changedBy(held, means(x, y)));
    return this.#drag(held.handle, { at, ...this.#ofThing() });
  }

  /** Moves, turns or scales what is held by so much, as one step. */
  nudgeHeld(meant) {
    const { shape } = this.held;
    if (shape) return this.changeShape(changedShape(shape, meant));
    const held = this.#taken();
    this.#changeHeld(held, changedBy(held, meant));
  }

  /** Puts another shape in place of the one that selects last. `note`: can be undone. */
  changeShape(shape, note = true) {
    this.#place({ selection: withShape(this.state.selection, shape) }, note);
  }

  /** Drags that shape: by(x, y) is what becomes of it. */
  dragShape(by) {
    let begun = false;
    return {
      move: (x, y) => {
        this.changeShape(by(x, y), !begun);
        begun = true;
      },
      end: () => {},
      giveUp: () => begun && this.undo(),
    };
  }

  /** Puts what is held where motion.js would say {shift, turn, size} of it. */
  setHeld(motion) {
    const held = this.#taken();
    this.#changeHeld(held, withMotion(held.handle, held.pivot, motion));
  }

  #changeHeld({ handle }, patch) {
    const { handles, mode } = this.state;
    const others = handles.filter(({ id }) => id !== handle.id);
    this.#place({ handles: [...others, { ...handle, ...patch }], mode: mode === "remove" ? "move" : mode });
    this.store.set({ selected: handle.id });
  }

  /** How a drag of a whole thing differs from one of a handle's target. */
  #ofThing() {
    const { thingMode, mode } = this.state;
    return {
      // What is removed goes nowhere: who drags has changed their mind.
      settings: mode === "remove" ? { mode: "move" } : {},
      ended: () => thingMode && this.state.draftOnRelease && this.runDraft(),
    };
  }

  /** A mover that follows the pointer as the constraint says. */
  #byPointer(held, camera, at) {
    const { handle } = held;
    const { constraint, version } = this.state;
    const up = this.worldUp;
    if (constraint === "surface") return slider({ held, camera, at, up, pick: (x, y) => this.pick(camera, x, y, version) });
    const from = handle.target ?? handle.source;
    const seen = project(camera, from) ?? at;
    const [gripX, gripY] = [seen.x - at.x, seen.y - at.y];
    const axes = { normal: handle.normal, up };
    return { at: (x, y, put) => put({ target: dragged(camera, from, x + gripX, y + gripY, this.state.constraint, axes) }) };
  }

  /** Drags what is selected as a body, by the handle that is there or one that comes with the first movement; letting
   *  go repairs it as a draft, if that is wished. As dragTarget(). */
  dragThing(camera, at) {
    const { held } = this;
    // The service may still be looking for the thing's border: then a handle where it was clicked on is all there is.
    const { handles, selection } = this.state;
    const handle = held ? this.#taken().handle : (handles.at(-1) ?? this.#newHandle(proposalOf(selection).inside[0]));
    const mover = this.#byPointer({ pivot: handle.source, bounds: null, ...held, handle }, camera, at);
    return this.#drag(handle, { ...mover, ...this.#ofThing() });
  }

  /** Takes away what is selected, for good. */
  removeThing() {
    this.#place({ mode: "remove", handles: [] });
    return this.runDraft();
  }

  /** Lets go of what is selected, wherever it was dragged. */
  letGo() {
    this.#place({ handles: [], selection: [] });
  }

  /** Where what is selected would be held: a handle there, to be moved by keys or numbers. */
  holdThing() {
    const { handles, selection, selectionAnswer } = this.state;
    if (handles.length > 0) return this.select(handles.at(-1).id);
    const source = proposalOf(selection)?.inside[0] ?? selectionAnswer?.centre;
    if (!source) return;
    const handle = this.#newHandle(source);
    this.#place({ handles: [{ ...handle, target: source }] });
    this.store.set({ selected: handle.id });
  }

  /**   at(x, y, put)  puts what changes of the handle when the pointer is there, at once or later
   *    settled()      waits for the last of it */
  #drag(handle, { at, settled = null, giveUp = () => {}, settings = {}, ended = () => {} }) {
    const before = this.#present();
    const { id } = handle;
    let begun = false;
    let over = false;
    this.store.set({ selected: id });
    const put = (patch) => {
      if (!over) this.change(id, patch, false);
    };
    const end = () => {
      over = true;
      this.store.set({ dragging: false });
      if (begun) ended();
    };
    return {
      move: (x, y) => {
        if (!begun) {
          this.#giveUpDraft();
          this.#history.note(before);
          const there = this.state.handles.some((h) => h.id === id);
          this.#place({ ...settings, handles: there ? this.state.handles : [...this.state.handles, handle] }, false);
        }
        begun = true;
        this.store.set({ dragging: true, selected: id });
        at(x, y, put);
      },
      end: () => (settled ? settled().then(end) : end()),
      giveUp: () => {
        giveUp();
        over = true;
        if (begun) this.undo();
        this.store.set({ dragging: false });
      },
    };
  }

  // --- counts ----------------------------------------------------------------------------------------------------

  #later(name, ms, fn) {
    clearTimeout(this.#timers.get(name));
    this.#timers.set(name, setTimeout(fn, ms));
  }

  #countKey({ source, radius }) {
    return JSON.stringify([this.state.version, source, radius]);
  }

  #countSoon() {
    const { scene, selection } = this.state;
    // With a selection, it is not their spheres that say what handles move.
    this.#later("count", COUNT_DELAY_MS, () => scene && selection.length === 0 && this.#count());
  }

  async #count() {
    this.#counting?.abort();
    const abort = (this.#counting = new AbortController());
    const { scene, version } = this.state;
    for (const handle of this.state.handles) {
      const key = this.#countKey(handle);
      if (this.state.counts[handle.id]?.key === key) continue;
      let count;
      try {
        const picked = await api.pick(scene.id, version, { point: handle.source, radius: handle.radius }, abort.signal);
        count = { key, gaussians: picked.gaussians_in_radius ?? 0 };
      } catch (error) {
        if (api.wasGivenUp(error)) return;
        count = { key, gaussians: null, error };
      }
      if (abort.signal.aborted) return;
      this.store.set({ counts: { ...this.state.counts, [handle.id]: count } });
    }
  }

  /** How many Gaussians lie within a handle's radius: {gaussians, error}; null while that is not known, and where a
   *  selection says what moves. */
  countOf(handle) {
    if (this.state.selection.length > 0) return null;
    const count = this.state.counts[handle.id];
    return count?.key === this.#countKey(handle) ? count : null;
  }

  // --- requests --------------------------------------------------------------------------------------------------

  request() {
    return requestOf({ ...this.state, scene: this.state.scene.id });
  }

  #requestChanged() {
    const { scene, selection, preview, problem, autoPreview, dragging, selectMode } = this.state;
    if (!scene) return;
    const request = this.request();
    const key = previewKey(request, this.state.info?.parameters);
    if (problem && problem.key !== JSON.stringify(request)) this.store.set({ problem: null });
    if (!changesScene(this.state)) {
      this.#later("preview", 0, () => {});
      this.#previewing?.abort();
      if (preview) this.store.set({ preview: null });
      return;
    }
    // While somebody selects, a preview is not on the screen: it can wait.
    if (!autoPreview || selectMode || preview?.key === key || this.state.problem !== null) return;
    if (!dragging) this.#later("preview", PREVIEW_DELAY_MS, () => !this.state.selectMode && this.preview());
    // What is selected follows the mouse, a preview at a time: the service keeps all of it that stays the same.
    else if (selection.length > 0 && !this.#previewing) this.preview();
  }

  /** Whether the preview on the screen shows what is asked for now. */
  get previewIsCurrent() {
    const { preview } = this.state;
    return preview !== null && preview.key === previewKey(this.request(), this.state.info?.parameters);
  }

  async preview() {
    if (!this.state.scene || !changesScene(this.state)) return;
    this.selecting.use(null);
    this.#previewing?.abort();
    const abort = (this.#previewing = new AbortController());
    const request = this.request();
    const key = previewKey(request, this.state.info?.parameters);
    this.store.set({ previewing: true });
    try {
      const preview = await api.createPreview(request, abort.signal);
      if (!abort.signal.aborted) this.store.set({ preview: { ...preview, key }, problem: null });
    } catch (error) {
      if (!api.wasGivenUp(error) && !abort.signal.aborted)
        this.store.set({ preview: null, problem: { error, key: JSON.stringify(request), from: "preview" } });
    }
    if (this.#previewing === abort) {
      this.#previewing = null;
      this.store.set({ previewing: false });
      if (this.state.dragging) this.#requestChanged();
    }
  }

  dropPreview() {
    this.store.set({ preview: null });
  }

  /** The service has forgotten the preview on the screen. */
  previewExpired(version) {
    if (this.state.preview?.version !== version) return;
    this.store.set({ preview: null });
    this.say("The preview has expired.", { action: { label: "Preview again", run: () => this.preview() } });
  }

  async estimate() {
    const request = this.request();
    const key = JSON.stringify(request);
    this.store.set({ submitting: true });
    try {
      this.store.set({ estimate: { ...(await api.estimateEdit(request)), key }, problem: null });
    } catch (error) {
      this.store.set({ estimate: null, problem: { error, key, from: "run" } });
    }
    this.store.set({ submitting: false });
  }

  /** Posts an edit. One whose answer was lost goes under the same key when it is posted again: it is answered, not
   *  queued twice. Only then: one that is given up on its way and asked for anew is another one. */
  async #submit(request) {
    const body = JSON.stringify(request);
    const key = this.#lost?.body === body ? this.#lost.key : freshKey();
    this.#lost = null;
    this.#submitting += 1;
    try {
      const edit = await api.createEdit(request, key);
      this.#mine.add(edit.id);
      return edit;
    } catch (error) {
      if (!(error.status > 0)) this.#lost = { body, key };
      throw error;
    } finally {
      this.#submitting -= 1;
      setTimeout(() => this.#submitting || this.#early.splice(0).forEach((edit) => this.#editEnded(edit)));
    }
  }

  async run() {
    const request = this.request();
    this.store.set({ submitting: true });
    try {
      const edit = await this.#submit(request);
      this.store.set({ edits: merged(this.state.edits, edit), asked: edit.id, tab: "edits", problem: null });
    } catch (error) {
      this.store.set({ problem: { error, key: JSON.stringify(request), from: "run" } });
    }
    this.store.set({ submitting: false });
  }

  /** What a draft of the screen would be asked for with. */
  #draftRequest() {
    return requestOf({ ...this.state, scene: this.state.scene.id, preset: "draft" });
  }

  /** Repairs what is on the screen as a draft. Its result is shown when it is there. */
  async runDraft() {
    this.#giveUpDraft();
    const request = this.#draftRequest();
    const draft = { id: null, body: JSON.stringify(request) };
    this.store.set({ draft, drafted: null });
    try {
      const edit = await this.#submit(request);
      if (this.state.draft !== draft) return this.#abandon(edit.id);
      this.store.set({ draft: { ...draft, id: edit.id }, edits: merged(this.state.edits, edit) });
    } catch (error) {
      if (this.state.draft !== draft) return;
      this.store.set({ draft: null, problem: { error, key: JSON.stringify(this.request()), from: "run" } });
    }
  }

  /** What was dragged comes off what it is held by, as one piece; after a draft of it, by another draft. */
  takeOff() {
    const { drafted } = this.state;
    if (!drafted) return this.settle({ attach: "free" });
    const { placed, base, better } = drafted;
    if (!this.#isThere(placed)) return this.say(`Version ${base}, which the draft was made of, has been deleted.`);
    // It would be of what is bent, and take the screen.
    if (better) this.#abandon(better);
    this.#place({ ...placed, attach: "free" });
    this.runDraft();
  }

  /** Ends the draft under way, which nobody waits for any more. */
  #giveUpDraft() {
    const { draft } = this.state;
    if (!draft) return;
    this.store.set({ draft: null });
    if (draft.id) this.#abandon(draft.id);
  }

  cancelDraft() {
    this.#giveUpDraft();
  }

  /** The service need not go on with an edit, and nobody wants to hear of it. It may have ended meanwhile. */
  #abandon(id) {
    this.#abandoned.add(id);
    this.store.set({ edits: this.state.edits.filter((e) => e.id !== id) });
    api.cancelEdit(id).catch(() => {});
  }

  /** What a draft was made of has been changed, or undone: its result would throw that away. */
  #draftOutdated() {
    const { draft, drafted, version } = this.state;
    if (draft && JSON.stringify(this.#draftRequest()) !== draft.body) this.#giveUpDraft();
    if (drafted && version !== drafted.version) this.store.set({ drafted: null });
  }

  /** Runs what the last draft was made of once more, on the same version, as well as it can be done. */
  async runBetter() {
    const { drafted } = this.state;
    if (!drafted) return;
    const { request, base } = drafted;
    const opening = this.#opened;
    this.store.set({ submitting: true });
    try {
      const edit = await this.#submit({ ...request, scene: this.state.scene.id, version: base, preset: "standard" });
      if (opening !== this.#opened) return;
      this.#better.add(edit.id);
      if (this.state.drafted === drafted) this.store.set({ drafted: { ...drafted, better: edit.id } });
      this.store.set({ edits: merged(this.state.edits, edit) });
    } catch (error) {
      this.say(`It could not be run: ${error.detail ?? error.message}`, { kind: "bad" });
    }
    this.store.set({ submitting: false });
  }

  /** Puts a request on the screen, in place of what is there. */
  load(request) {
    const { selection = [] } = request;
    const handles = request.handles.map((handle) => ({
      id: this.#nextId++,
      source: handle.source,
      normal: null,
      target: handle.target ?? null,
      radius: handle.radius ?? this.#defaultRadius(),
      grip: selection.length ? (handle.grip ?? handle.radius ?? null) : null,
      group: handle.group ?? 0,
      rotation: handle.rotation ?? null,
      scale: handle.scale ?? null,
    }));
    this.#place({
      handles,
      selection,
      attach: request.attach ?? null,
      crumbs: request.crumbs ?? null,
      shadow: request.shadow ?? null,
      settle: request.settle ?? null,
      heal: request.heal ?? [],
      mode: request.mode ?? "move",
      preset: request.preset ?? "",
      prompt: request.prompt ?? null,
      negative_prompt: request.negative_prompt ?? null,
      lora: request.lora ?? null,
      allow_slow: request.allow_slow ?? false,
      region: request.region ?? null,
      params: request.params ?? {},
    });
    this.store.set({ selectMode: false, selected: null, problem: null, tab: "drag" });
  }

  // --- edits -----------------------------------------------------------------------------------------------------

  async #loadEdits(opening) {
    try {
      const edits = await api.edits(this.state.scene.id);
      if (opening !== this.#opened) return;
      for (const { id } of edits) this.#mine.add(id);
      this.store.set({ edits });
    } catch (error) {
      if (opening === this.#opened)
        this.say(`The edits of this scene could not be listed: ${error.message}`, { kind: "bad" });
    }
  }

  /** Listens to what happens to the scene, here and elsewhere. */
  follow() {
    const { scene } = this.state;
    if (!scene) return;
    this.#unfollow();
    const opening = this.#opened;
    this.#unfollow = followScene({
      events: () => api.sceneEvents(scene.id),
      ask: async () => {
        const signal = AbortSignal.timeout(ANSWER_MS);
        const [fresh, edits] = await Promise.all([api.scene(scene.id, signal), api.edits(scene.id, signal)]);
        return { scene: fresh, edits };
      },
      onScene: (fresh) => this.#sceneTold(fresh),
      onEdit: (edit) => this.#editUpdated(edit),
      onGone: () => opening === this.#opened && this.store.set({ gone: true }),
      onAnswering: (answering) => this.store.set({ answering }),
    });
  }

  /** Nobody looks: the browser has few connections, and those who do need them. */
  unfollow() {
    this.#unfollow();
  }

  #sceneTold(scene) {
    const { version, scene: before } = this.state;
    const dataset = ({ dataset: d }) => d && [d.kind, d.views, d.photos].join();
    this.store.set({ scene });
    // Somebody else has deleted what is looked at.
    const isShown = (v) => v.version === version;
    if (!scene.versions.some(isShown)) this.#leave(before.versions.find(isShown) ?? { version, parent: 0 });
    if (dataset(scene) !== dataset(before)) this.#loadViews(this.#opened);
  }

  /** The version on the screen is gone, deleted elsewhere: what it was made from is shown, or what is left of that. A
   *  draft mostly went for a newer result, which is offered. */
  #leave({ version, parent, edit }) {
    const { versions } = this.state.scene;
    const wasDraft = this.state.edits.find(({ id }) => id === edit)?.request.preset === "draft";
    const newer = wasDraft ? versions.findLast((v) => v.parent === parent && v.version > version)?.version : undefined;
    const left = this.#isThere({ version: parent }) ? parent : versions.findLast((v) => v.version < version).version;
    this.showVersion(left);
    if (this.#deleting.has(version)) return; // Here, by a press, and the stream was the first to tell.
    if (newer === undefined) return this.say(`Version ${version} has been deleted.`);
    this.say(`Version ${version} was a draft, and is gone: version ${newer} is newer.`, {
      seconds: 12,
      action: { label: "Show", run: () => this.#isThere({ version: newer }) && this.showVersion(newer) },
    });
  }

  #editUpdated(edit) {
    if (this.#abandoned.has(edit.id)) return;
    const before = this.state.edits.find((e) => e.id === edit.id);
    this.store.set({ edits: merged(this.state.edits, edit) });
    if (!hasEnded(edit) || (before && hasEnded(before))) return;
    // It may be the very one that is being submitted: whose it is shows when the answer is there.
    if (this.#submitting > 0) this.#early.push(edit);
    else if (before || this.#mine.has(edit.id)) this.#editEnded(edit);
  }

  async #editEnded(edit) {
    const { draft } = this.state;
    const isDraft = draft?.id === edit.id;
    if (isDraft && (edit.state !== "succeeded" || edit.result_version === null)) this.store.set({ draft: null });
    if (edit.state === "failed") {
      this.say(`The edit failed: ${edit.error?.detail ?? "no reason was given"}`, { kind: "bad", seconds: 12 });
      return;
    }
    if (edit.state !== "succeeded" || edit.result_version === null) return;
    const opening = this.#opened;
    try {
      await this.reloadScene();
    } catch (error) {
      if (isDraft && this.state.draft?.id === edit.id) this.store.set({ draft: null });
      return this.say(`The result is version ${edit.result_version}, but: ${error.message}`, { kind: "bad" });
    }
    if (opening !== this.#opened || this.#abandoned.has(edit.id)) return;
    const say = (text, action) => this.say(text, { kind: "good", seconds: 10, action });
    if (isDraft) {
      // Given up while the scene was on its way, it does not take the screen from what is done there now.
      if (this.state.draft?.id !== edit.id) return;
      const placed = this.#present();
      this.#finish(edit);
      const [made, base] = [edit.result_version, edit.version];
      const drafted = { version: made, base, request: edit.request, placed, edit: edit.id };
      this.store.set({ draft: null, drafted, drafts: [...this.state.drafts, { version: made, base }] });
      return this.#dropDrafts(drafted);
    }
    const { drafted, version, dragging } = this.state;
    if (drafted?.better === edit.id && version === drafted.version) {
      this.showVersion(edit.result_version);
      this.#dropDrafts({ version: edit.result_version, base: edit.version });
      return say(`Version ${edit.result_version} is what the draft was for. ${HOLD} to compare.`);
    }
    // What ran a draft well that has been undone is offered: what is placed now is somebody's next step.
    if (version !== edit.version || dragging || this.#better.has(edit.id) || !this.#mine.has(edit.id))
      return say(`Version ${edit.result_version} is ready${this.#mine.has(edit.id) ? "" : ", made elsewhere"}.`, {
        label: "Show",
        run: () => this.showVersion(edit.result_version),
      });
    this.#finish(edit);
    this.#dropDrafts({ version: edit.result_version, base: edit.version });
    say(`Version ${edit.result_version} is ready. ${HOLD} to compare it with version ${edit.version}.`);
  }

  /** Deletes the drafts that a result has replaced. One that cannot be deleted stays: nothing is lost by that. */
  async #dropDrafts(made) {
    const { scene, drafts, version: shown } = this.state;
    const gone = superseded(drafts, made, scene.versions, shown);
    this.store.set({ drafts: drafts.filter(({ version }) => !gone.includes(version)) });
    for (const version of gone) await this.deleteVersion(version).catch(() => {});
  }

  /** A draft is not deleted for a better one any more. */
  keep(version) {
    this.store.set({ drafts: this.state.drafts.filter((draft) => draft.version !== version) });
  }

  async nameVersion(version, name) {
    const named = await api.renameVersion(this.state.scene.id, version, name || null);
    this.#versionsAre((versions) => versions.map((v) => (v.version === version ? named : v)));
  }

  /** Deletes a version for good; the one it was made from is shown in its place. */
  async deleteVersion(version) {
    const { scene } = this.state;
    const parent = parentOf(scene, version);
    this.#deleting.add(version);
    await api.deleteVersion(scene.id, version).finally(() => this.#deleting.delete(version));
    if (this.state.scene?.id !== scene.id) return;
    if (this.state.version === version) this.showVersion(parent);
    this.keep(version);
    const below = (v) => (v.parent === version ? { ...v, parent } : v);
    this.#versionsAre((versions) => versions.filter((v) => v.version !== version).map(below));
  }

  #versionsAre(change) {
    const { scene } = this.state;
    this.store.set({ scene: { ...scene, versions: change(scene.versions) } });
  }

  /** Shows what an edit has made of the version on the screen. What was dragged is where it should be: handles, selection
   *  and the box have done their work. Undo brings them back, and the version that they were on. */
  #finish(edit) {
    // Removing is no habit: what is taken next is to be moved.
    const mode = this.state.mode === "remove" ? "move" : this.state.mode;
    this.#place({ handles: [], selection: [], region: null, heal: [], attach: null, mode, version: edit.result_version });
    this.selecting.use(null);
  }

  async stopEdit(id) {
    this.#editUpdated(await api.stopEdit(id));
  }

  async cancelEdit(id) {
    this.#editUpdated(await api.cancelEdit(id));
  }

  async deleteEdit(id) {
    await api.deleteEdit(id);
    this.store.set({ edits: this.state.edits.filter((e) => e.id !== id) });
  }

  // --- remembering -----------------------------------------------------------------------------------------------

  #saveSoon() {
    if (this.state.scene) this.#later("save", SAVE_DELAY_MS, () => this.#save());
  }

  #save() {
    const { scene } = this.state;
    const { thumbnail } = this.memory.load(scene) ?? {};
    this.memory.save(scene, { ...only(STORED_KEYS, this.state), thumbnail });
  }

  /** Keeps a small picture of the scene, for the list of scenes. */
  keepThumbnail(url) {
    const { scene } = this.state;
    if (scene) this.memory.save(scene, { ...(this.memory.load(scene) ?? {}), thumbnail: url });
  }

  /** What is not saved yet is saved now: the page is about to go. */
  flush() {
    if (this.state.scene) this.#save();
  }
}

/** What changes of a held handle by what a part of the gizmo means. */
function changedBy({ handle, pivot }, { shift, turn, size }) {
  if (shift) return shifted(handle, shift);
  const place = moved(handle, pivot);
  return turn ? turnedAbout(handle, place, turn) : scaledAbout(handle, place, size);
}

/** Whether a point is in a box, or just beside it. */
const within = (bounds) => (point) =>
  !!bounds && point.every((x, i) => Math.abs(2 * x - bounds.low[i] - bounds.high[i]) <= 1.1 * (bounds.high[i] - bounds.low[i]));

/** 128 random bits. crypto.randomUUID() is not there on a page without TLS that is not on this machine. */
function freshKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
}
