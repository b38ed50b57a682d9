// Selecting: clicks, strokes and lassos become operations, and the service says what they hold. No elements here.

import * as api from "./api.js";
import { unitsPerPixel, onTheWire } from "./camera.js";
import { FrameQueue } from "./frames.js";
import {
  furtherBorders,
  inverted,
  listOf,
  operation,
  polygonOf,
  proposalOf,
  rectangleOf,
  spread,
  strokeOf,
  thingAt,
  widened,
  withClick,
} from "./selection.js";
import { shapeAround } from "./shapes.js";

/** What there is before anything is selected. Tool, depth, radius and tint outlive a reload. */
export const NOTHING_SELECTED = {
  selection: [], // Operations, as on the wire.
  selectionAnswer: null, // {key, version, id, count, ...} or {key, version, error}: what the service last said.
  selectionWaits: false, // Whether that is of an earlier selection.
  thingMode: true, // The pointer takes hold of whole things; else it places and drags handles.
  selectMode: false, // The pointer selects, whatever it does else.
  healing: false, // It selects what a run makes anew (`heal`), not what moves.
  selectTool: "grow", // "grow", "brush", "lasso", "rectangle", "sphere" or "box"
  selectOp: "add",
  clickKind: "inside", // Of a click to grow: on the thing ("inside"), or not.
  nextThing: false, // The next click begins another thing.
  selectDepth: "visible",
  brushRadius: 18, // Pixels; a choice.
  tinted: true,
};

/** Whether a tool makes shapes, which have handles of their own. */
export const isShape = (tool) => tool === "sphere" || tool === "box";

const OPPOSITE = { add: "subtract", subtract: "add", intersect: "subtract" };
const PASSING = [0, 429, 503]; // The service is full, restarting, or loads the scene: it will answer later.

export class Selecting {
  #queue;
  #again = null;
  #proposing = null; // Ends the wait for where a thing was clicked.
  #lost = null; // Id of a selection that had to be posted again, until it has been seen.

  /**   place(patch)            puts a selection on the screen, and more of what is placed; can be undone
   *    say(message, options)   a short message to the user
   *    pickSeen(camera, x, y)  Editor.pickSeen() */
  constructor(store, { place, say, pickSeen }) {
    Object.assign(this, { store, place, say, pickSeen });
    // Of the selections made while one is being asked about, only the latest is asked about next.
    this.#queue = new FrameQueue({
      load: ({ scene, version, selection }, signal) => api.select(scene, version, selection, signal),
      onPicture: (answer, { key, version }) => this.#answered({ ...answer, key, version }),
      onError: (error, { key, version }) => this.#failed({ key, version, error }),
    });
    store.watch(["selection", "heal", "healing", "version", "scene"], () => this.#changed());
  }

  get #state() {
    return this.store.state;
  }

  /** What the tools work on: the operations that say what moves, or what is healed. */
  get #list() {
    return listOf(this.#state);
  }

  #put(list) {
    this.place({ [this.#state.healing ? "heal" : "selection"]: list });
  }

  // --- what it holds ---------------------------------------------------------------------------------------------

  #job() {
    const { scene, version } = this.#state;
    const selection = this.#list;
    return { key: JSON.stringify([scene.id, version, selection]), scene: scene.id, version, selection };
  }

  #changed() {
    clearTimeout(this.#again);
    const { scene, selectionAnswer } = this.#state;
    if (!scene || this.#list.length === 0) {
      this.#queue.clear();
      // What was to be taken from the last selection, or kept of it, says nothing of the next one.
      return this.store.set({ selectionAnswer: null, selectionWaits: false, selectOp: "add" });
    }
    const job = this.#job();
    const known = selectionAnswer?.key === job.key && !selectionAnswer.error;
    if (known && !this.#queue.busy) return;
    this.store.set({ selectionWaits: true });
    this.#queue.request(job);
  }

  #answered(answer) {
    if (!this.#state.scene) return;
    this.store.set({ selectionAnswer: answer, selectionWaits: answer.key !== this.#job().key });
  }

  #failed(answer) {
    this.#answered(answer);
    const { status, retryAfter } = answer.error;
    if (PASSING.includes(status)) this.#again = setTimeout(() => this.#changed(), 1000 * (retryAfter ?? 2));
  }

  /** The selection that pictures of a version are to tint; null if there is none. */
  idFor(version) {
    const { selectionAnswer, tinted, layer } = this.#state;
    const shows = tinted && layer === "color" && selectionAnswer?.version === version && selectionAnswer.count > 0;
    return shows ? selectionAnswer.id : null;
  }

  /** The service has forgotten a selection: it is posted again, and nobody notices. One that is lost at once when it
   *  was posted again is shown without tint, rather than asked for without end. */
  lost(id) {
    const { selectionAnswer } = this.#state;
    if (selectionAnswer?.id !== id) return;
    if (this.#lost === id) return this.store.set({ selectionAnswer: { ...selectionAnswer, id: null } });
    this.#lost = id;
    this.#queue.request(this.#job());
  }

  /** A picture has shown the selection. */
  seen(id) {
    if (this.#lost === id) this.#lost = null;
  }

  // --- making it -------------------------------------------------------------------------------------------------

  /** A click to grow.
   *    other  the other kind of point than the one that is switched on */
  async click(camera, x, y, other = false) {
    const { clickKind } = this.#state;
    const kind = (clickKind === "outside") !== other ? "outside" : "inside";
    const picked = await this.#pick(camera, x, y);
    if (!picked) return;
    const { selectOp: op, nextThing: fresh } = this.#state;
    if (!picked.hit) return this.say("There is nothing here to select.", { seconds: 3 });
    const next = withClick(this.#list, { op, kind, point: picked.point, fresh });
    if (!next) return this.say("First click the thing itself, then what is not part of it.", { seconds: 4 });
    this.store.set({ nextThing: false, tab: "drag" });
    this.#put(next);
  }

  /** What is seen there, as the editor picks it; null where it does not say, or nobody wants to know any
   *  more. */
  async #pick(camera, x, y, signal = undefined) {
    const { scene, version } = this.#state;
    let picked;
    try {
      picked = await this.pickSeen(camera, x, y, signal);
    } catch (error) {
      if (!api.wasGivenUp(error)) this.say(`Nothing could be selected: ${error.message}`, { kind: "bad" });
      return null;
    }
    const { scene: present, version: shown } = this.#state;
    if (signal?.aborted) return null;
    return present?.id === scene.id && shown === version ? picked : null;
  }

  /** A click that takes the whole thing under it, in place of one that was; where nothing is, lets go. What somebody
   *  has made by hand is not lost to a click that went astray: it stays, and that is said. */
  async propose(camera, x, y) {
    this.#proposing?.abort();
    const abort = (this.#proposing = new AbortController());
    const picked = await this.#pick(camera, x, y, abort.signal);
    const { thingMode, selectMode, dragging, selection, handles } = this.#state;
    // Somebody who has taken something in hand meanwhile has it there.
    if (!picked || !thingMode || selectMode || dragging) return;
    // Of a thing that one click took, the one handle came with dragging it.
    const came = proposalOf(selection) && handles.every(({ target }) => target) ? 1 : 0;
    const clicked = came || selection.length === 0;
    if (!clicked || handles.length > came)
      return this.say("What you have placed stays.", {
        seconds: 6,
        action: { label: "Let go of it", run: () => this.place({ selection: [], handles: [] }) },
      });
    // What has been moved is not where the version has it: a click on it says nothing new.
    if (picked.moved) return;
    this.store.set({ tab: "drag", nextThing: false, clickedOn: picked.hit ? picked : null });
    // Whether the one before came off says nothing of this one.
    this.place({ selection: picked.hit ? thingAt(picked.point) : [], handles: [], attach: null });
  }

  /** More of the proposed thing (1), or less (-1): the next border. */
  widen(by) {
    const { selection, selectionAnswer, selectionWaits } = this.#state;
    if (!proposalOf(selection) || selectionWaits) return;
    const { more, less } = furtherBorders(selectionAnswer);
    if (by > 0 ? more : less) this.place({ selection: widened(selection, by, selectionAnswer) });
  }

  /** A stroke of the brush, a lasso, or a rectangle.
   *    points  [x, y], pixels of the camera
   *    other   subtracts where adding is switched on, and the other way round */
  draw(tool, camera, points, other = false) {
    const { selectOp, selectDepth: depth, brushRadius: radius } = this.#state;
    const drawn = { op: other ? OPPOSITE[selectOp] : selectOp, camera: onTheWire(camera), points, radius, depth };
    const made = { brush: strokeOf, lasso: polygonOf, rectangle: rectangleOf }[tool](drawn);
    if (!made) return this.say(`Draw the ${tool} around what you mean.`, { seconds: 3 });
    this.store.set({ tab: "drag" });
    this.#put([...this.#list, made]);
  }

  /** A sphere or a box around what is seen at a place.
   *    reach  how far it goes from there, pixels */
  async drawShape(tool, camera, { x, y }, reach, up, other = false) {
    const picked = await this.#pick(camera, x, y);
    if (!picked) return;
    if (!picked.hit) return this.say("There is nothing here to select.", { seconds: 3 });
    const { selectOp } = this.#state;
    const op = other ? OPPOSITE[selectOp] : selectOp;
    const shape = shapeAround(tool, picked.point, reach * unitsPerPixel(camera, picked.point), up);
    this.store.set({ tab: "drag" });
    this.#put([...this.#list, operation(op, shape)]);
  }

  /** Whether the next stroke or lasso takes away. */
  subtracts(other) {
    return (other ? OPPOSITE[this.#state.selectOp] : this.#state.selectOp) === "subtract";
  }

  remove(index) {
    this.#put(this.#list.filter((_, i) => i !== index));
  }

  /** Wider (1) or narrower (-1) all around. */
  spread(by) {
    const { selectionAnswer: answer, selectionWaits } = this.#state;
    if (answer?.count > 0 && !selectionWaits) this.#put(spread(this.#list, by, answer));
  }

  invert() {
    this.#put(inverted(this.#list));
  }

  clear() {
    if (this.#list.length) this.#put([]);
  }

  // --- tools -----------------------------------------------------------------------------------------------------

  /** Takes whole things in hand, or handles. */
  takeThings(things) {
    this.store.set({ thingMode: things, selectMode: false, healing: false, floorClicks: null });
  }

  /** Takes a tool in hand; null: whatever it was before, things or handles. */
  use(tool) {
    if (!tool) return this.store.set({ selectMode: false, healing: false });
    // Depth and changes have no tint: what is selected has to be seen.
    this.store.set({ selectMode: true, selectTool: tool, layer: "color", comparing: false, selected: null, floorClicks: null });
  }

  /** The same tools say what moves, or what is healed. */
  start(healing) {
    this.store.set({ healing });
    this.use(this.#state.selectTool);
  }

  toggle() {
    const { selectMode, healing } = this.#state;
    if (selectMode && !healing) this.use(null);
    else this.start(false);
  }
}
