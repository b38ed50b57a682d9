// The picture of the scene and the hand on it: asks the service for pictures, and turns pointer, wheel and keys into
// camera moves and drags.

import * as api from "./api.js";
import {
  centredOn,
  dollied,
  dragged,
  ellipseOf,
  flown,
  lookedAround,
  onTheWire,
  orbited,
  panned,
  pictureKey,
  pictureSize,
  placedIn,
  project,
  samePose,
  unitsPerPixel,
  zoomedAt,
} from "./camera.js";
import { ARROWS, attrs, byId, text } from "./dom.js";
import { shownVersion } from "./editor.js";
import { Flight } from "./fly.js";
import { AdaptiveSide, FrameQueue, Recent, serverTime } from "./frames.js";
import { HeldView } from "./held.js";
import { Overlay } from "./overlay.js";
import { partOf } from "./requests.js";
import { isShape } from "./selecting.js";
import { clicksOf, listOf, proposalOf, thinned } from "./selection.js";
import { lastShape, ShapeView } from "./shapes.js";
import { clickFloor } from "./up.js";
import { add, distance, scale, sub, unit } from "./vectors.js";

// All of these are choices, tried by hand.
const MAX_SIDE = 1600; // Pixels of the longer side of a picture at rest: sharp enough on a large window.
const STILL_AFTER_MS = 160; // Without a movement, before the picture is requested at its full size.
const DRAGGED_MS = 35; // Of the service, for a picture of what is dragged: its preview has taken as long before.
const PICTURES_AT_ONCE = 3; // While moving: what covers the way there and back of most networks.
const DOUBLE_CLICK_MS = 400; // A second click sooner than this, at the same place, is no click of its own.
const CLICK_PX = 4; // A pointer that moves less than this has clicked, not dragged.
const ORBIT_PER_PX = 0.0055; // Radians: half a turn across 570 pixels.
const TURN_STEP = 0.09; // Radians, of an arrow key or button.
const SLIDE_PX = 30; // Pixels, of the same when it slides.
const THING_PX = 14; // A thing is taken hold of within this of its middle, however small it is.
const CORNER_PX = 12; // A click this near to a corner is on it: a finger is no finer.
const SKETCH_PX = 2; // A line that is drawn has a corner this often at most.
const MAX_CACHED_PICTURES = 6; // Enough to go back and forth between two versions and three layers.
const DRAWING = ["brush", "lasso", "rectangle", "sphere", "box"]; // With the left button.
const SHAPE_PX = 50; // How far a sphere or a box goes that is clicked rather than drawn.
const CONTROLS = "button, a, input, select, summary, details, .toast, .end"; // What lies on the picture and is no part of it.
const THUMBNAIL = { width: 320, height: 200 };

/** How much a turn of the wheel multiplies by. */
function wheelFactor({ deltaY, deltaMode }) {
  // Lines and pages, where a browser counts in those.
  const pixels = deltaY * [1, 16, 400][deltaMode];
  return Math.exp(Math.max(-300, Math.min(300, pixels)) * 0.0015);
}

export class Viewer {
  #editor;
  #view = byId("view");
  #canvas = byId("picture");
  #overlay;
  #held;
  #shapes;
  #adaptive = { turning: new AdaptiveSide(), dragging: new AdaptiveSide({ goal: DRAGGED_MS }) };
  #recent = new Recent(MAX_CACHED_PICTURES);
  #displayed = null; // {picture, job}: what is on the canvas.
  #queue;
  #size = { width: 1, height: 1 };
  #pointers = new Map();
  #gesture = null;
  #pointerAt = null;
  #clicked = { at: -Infinity, x: 0, y: 0 };
  #corners = []; // [x, y] of a lasso or a rectangle that is clicked rather than drawn, so far.
  #movingUntil = 0;
  #stillTimer = null;
  #busyTimer = null;
  #thumbnailTimer = null;
  #flight = new Flight((step) => this.#fly(step));

  constructor(editor) {
    this.#editor = editor;
    this.#queue = new FrameQueue({
      load: (job, signal) => this.#load(job, signal),
      onPicture: (picture, job) => this.#arrived(picture, job),
      onError: (error, job) => this.#failed(error, job),
      atOnce: PICTURES_AT_ONCE,
    });
    this.#overlay = new Overlay(byId("overlay"), {
      grab: (id, event) => this.#grab(id, event),
      nudge: (id, event) => this.#nudge(id, event),
      wheel: (id, event) => this.#resize(id, event),
      focused: (id) => editor.select(id),
    });
    this.#held = new HeldView(byId("overlay"), editor, {
      take: (event, begin) => this.#take(event, begin),
      redraw: () => this.#drawOverlay(),
    });
    this.#shapes = new ShapeView(byId("overlay"), editor, { take: (event, begin) => this.#take(event, begin) });
    this.#listen();
    const { store } = editor;
    // The next preview of what is dragged is being made: a full picture of this one would take its time from it.
    store.watch(["preview"], ({ dragging }) => dragging && this.#isMoving());
    store.watch(
      ["pose", "layer", "version", "preview", "comparing", "compareWith", "selectMode", "selectionAnswer", "tinted"],
      () => this.refresh(),
    );
    store.watch(["scene"], ({ scene }) => this.#sceneChanged(scene));
    store.watch(
      [
        ...["handles", "selected", "selection", "selectionAnswer", "selectionWaits", "selectMode", "thingMode", "mode"],
        ...["region", "problem", "pose", "floorClicks", "gizmo", "frame", "dragging", "comparing", "scene", "selectTool"],
        ...["heal", "healing"],
      ],
      () => this.#drawOverlay(),
    );
    store.watch(["selectMode", "selectTool", "thingMode", "brushRadius", "floorClicks"], () => this.#toolChanged());
    // Corners are of one picture.
    store.watch(["pose", "scene", "version", "selectMode", "selectTool"], () => this.#dropCorners());
    new ResizeObserver(() => this.#resized()).observe(this.#view);
  }

  get #state() {
    return this.#editor.state;
  }

  /** The camera of the picture on the screen, in CSS pixels: what the user sees is what they point at. */
  get camera() {
    const { pose } = this.#state;
    const displayed = this.#displayed?.job;
    const shownPose = displayed && displayed.scene === this.#state.scene?.id ? displayed.pose : pose;
    return shownPose && { ...shownPose, ...this.#size };
  }

  #sceneChanged(scene) {
    if (this.#displayed && this.#displayed.job.scene !== scene?.id) {
      this.#queue.clear();
      this.#recent.clear();
      this.#displayed = null;
      this.#canvas.getContext("2d").clearRect(0, 0, this.#canvas.width, this.#canvas.height);
      this.#message("");
    }
    this.refresh();
  }

  #resized() {
    const { clientWidth: width, clientHeight: height } = this.#view;
    if (!width || !height) return;
    this.#size = { width, height };
    this.#editor.aspect = width / height;
    const density = Math.min(window.devicePixelRatio || 1, MAX_SIDE / Math.max(width, height));
    Object.assign(this.#canvas, pictureSize(width * Math.max(density, 0.5), height * Math.max(density, 0.5), MAX_SIDE));
    this.#paint();
    this.refresh();
  }

  // --- pictures --------------------------------------------------------------------------------------------------

  #job(large) {
    const { scene, pose, layer } = this.#state;
    const limit = Math.min(MAX_SIDE, this.#state.info?.limits?.render_side ?? MAX_SIDE);
    const { width, height } = this.#size;
    const density = window.devicePixelRatio || 1;
    const full = pictureSize(width * density, height * density, limit);
    const adaptive = this.#adaptive[this.#state.dragging ? "dragging" : "turning"];
    const size = large ? full : pictureSize(full.width, full.height, adaptive.side);
    const version = shownVersion(this.#state);
    const selection = this.#editor.selecting.idFor(version);
    const key = JSON.stringify([scene.id, version, layer, selection, pictureKey(pose), size]);
    // On a fast service, pictures while moving are as large as any.
    const complete = size.width === full.width && size.height === full.height;
    return { key, large, complete, adaptive, scene: scene.id, version, layer, selection, pose, size };
  }

  /** Asks for what the state says should be on the screen: a small picture at once, the full one when it is still. */
  refresh() {
    const { scene, pose } = this.#state;
    if (!scene || !pose || this.#size.width <= 1) return;
    const full = this.#job(true);
    if (this.#displayed?.job.key === full.key) return this.#queue.clear();
    clearTimeout(this.#stillTimer);
    const cached = this.#recent.get(full.key);
    if (cached) {
      this.#queue.clear();
      return this.#show(cached, full);
    }
    const small = this.#job(false);
    if (!this.#shows(small)) this.#queue.request(small);
    const { dragging, previewing } = this.#state;
    const remaining = dragging && previewing ? STILL_AFTER_MS : this.#movingUntil - performance.now();
    if (remaining > 0) this.#stillTimer = setTimeout(() => this.refresh(), remaining);
    else this.#queue.request(full);
    this.#busySoon();
  }

  /** Whether the picture on the screen is the one asked for, of whatever size. */
  #shows(job) {
    const displayed = this.#displayed?.job;
    return (
      !!displayed &&
      displayed.version === job.version &&
      displayed.layer === job.layer &&
      displayed.selection === job.selection &&
      pictureKey(displayed.pose) === pictureKey(job.pose)
    );
  }

  async #load(job, signal) {
    const requestedAt = performance.now();
    const before = this.#queue.underWay;
    const { blob, timing } = await api.render(
      job.scene,
      job.version,
      {
        camera: onTheWire({ ...job.pose, ...job.size }),
        what: job.layer,
        ...(job.selection ? { selection: job.selection } : {}),
        format: "jpeg",
        quality: job.complete ? 92 : 75,
      },
      signal,
    );
    // As many as shared the service with this one, on the way from its first moment to its last.
    const atOnce = (before + this.#queue.underWay) / 2;
    const picture = await createImageBitmap(blob);
    if (!job.large) job.adaptive.record(serverTime(timing) ?? performance.now() - requestedAt, atOnce);
    return { picture, ms: performance.now() - requestedAt };
  }

  #arrived({ picture, ms }, job) {
    if (job.scene !== this.#state.scene?.id) return;
    if (job.complete) {
      this.#recent.put(job.key, picture);
      this.#thumbnailSoon();
    }
    if (job.selection) this.#editor.selecting.seen(job.selection);
    this.#message("");
    this.#show(picture, job, ms);
  }

  #show(picture, job, ms = null) {
    this.#displayed = { picture, job };
    this.#paint();
    this.#drawOverlay();
    this.#notBusy();
    attrs(this.#view, {
      "data-version": job.version,
      "data-layer": job.layer,
      "data-selection": job.selection,
      "data-quality": job.complete ? "full" : "moving",
    });
    this.#view.dispatchEvent(new CustomEvent("shown", { detail: job }));
    const time = ms === null ? "" : ` · ${Math.round(ms)} ms`;
    text(byId("picture-size"), `${job.size.width} × ${job.size.height}${time}`);
  }

  #paint() {
    if (!this.#displayed) return;
    const context = this.#canvas.getContext("2d");
    context.imageSmoothingQuality = "high";
    const { x, y, width, height } = placedIn(this.#displayed.picture, this.#canvas);
    if (x > 0) context.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    context.drawImage(this.#displayed.picture, x, y, width, height);
  }

  #failed(error, job) {
    this.#notBusy();
    if (job.scene !== this.#state.scene?.id) return;
    if (error.status === 404 && job.selection && error.where === "selection")
      return this.#editor.selecting.lost(job.selection);
    if (error.status === 404 && String(job.version).startsWith("p")) return this.#editor.previewExpired(job.version);
    this.#message(`No picture: ${error.detail ?? error.message}`);
    // The service is full, restarting, or loads the scene: it will answer later. Anything else stays as it is.
    if ([0, 429, 503].includes(error.status)) {
      clearTimeout(this.#stillTimer);
      this.#stillTimer = setTimeout(() => this.refresh(), 1000 * (error.retryAfter ?? 2));
    }
  }

  #message(message) {
    const place = byId("view-message");
    place.hidden = !message;
    text(place, message);
  }

  #busySoon() {
    this.#busyTimer ??= setTimeout(() => (byId("busy").hidden = false), 500);
  }

  #notBusy() {
    if (this.#queue.busy) return;
    clearTimeout(this.#busyTimer);
    this.#busyTimer = null;
    byId("busy").hidden = true;
  }

  #thumbnailSoon() {
    clearTimeout(this.#thumbnailTimer);
    this.#thumbnailTimer = setTimeout(() => {
      if (this.#displayed?.job.layer !== "color" || this.#displayed.job.selection) return;
      if (String(this.#displayed.job.version).startsWith("p")) return; // nothing that anybody has kept
      if (this.#displayed.job.scene !== this.#state.scene?.id) return;
      const small = Object.assign(document.createElement("canvas"), THUMBNAIL);
      const { width, height } = this.#displayed.picture;
      const factor = Math.max(THUMBNAIL.width / width, THUMBNAIL.height / height);
      const [w, h] = [width * factor, height * factor];
      const context = small.getContext("2d");
      context.drawImage(this.#displayed.picture, (THUMBNAIL.width - w) / 2, (THUMBNAIL.height - h) / 2, w, h);
      this.#editor.keepThumbnail(small.toDataURL("image/jpeg", 0.75));
    }, 1500);
  }

  #drawOverlay() {
    const { camera } = this;
    if (!camera) return;
    const { handles, selected, problem, region, selection, selectMode, floorClicks } = this.#state;
    const at = problem ? partOf(problem.error.where) : {};
    // While the view moves, nobody asks what is in front.
    const still = this.#displayed?.job.complete && !this.#state.dragging ? this.#displayed.job : null;
    const behind = (point) => !!still && !!point && this.#held.isHidden(camera, still.version, point);
    const items = handles.map((handle, i) => ({
      handle,
      selected: handle.id === selected,
      bad: at.part === "handle" && at.index === i,
      behind: { source: behind(handle.source), target: behind(handle.target) },
    }));
    this.#overlay.draw(camera, items, {
      region,
      clicks: floorClicks?.map((point) => ({ point, kind: "inside" })) ?? (selectMode ? clicksOf(listOf(this.#state)) : []),
      spheres: selection.length === 0,
    });
    this.#held.draw(camera);
    const { held } = this.#editor;
    this.#shapes.draw(camera, {
      shapes: selectMode ? selection.map((o) => lastShape([o])).filter(Boolean) : [],
      held: held?.shape ?? null,
      perPixel: held ? unitsPerPixel(camera, held.pivot) : 0,
    });
  }

  #toolChanged() {
    const { tool } = this;
    attrs(this.#view, { "data-tool": tool });
    if (tool !== "brush") this.#overlay.cursor(null);
    if (this.#gesture?.kind === "draw") this.giveUpDrag();
  }

  /** What the pointer does: "floor", "thing", "handle", "grow", "brush", "lasso" or "rectangle". */
  get tool() {
    const { selectMode, selectTool, thingMode, floorClicks } = this.#state;
    if (floorClicks) return "floor";
    return selectMode ? selectTool : thingMode ? "thing" : "handle";
  }

  /** Is a place of the picture on what is selected, where that is seen now? As far as its bounds tell. */
  #onThing({ x, y }) {
    const { selection, selectionAnswer: answer, selectionWaits, handles, comparing } = this.#state;
    const { camera } = this;
    if (selection.length === 0 || comparing || !camera) return false;
    const handle = handles.at(-1);
    const shift = handle?.target ? sub(handle.target, handle.source) : [0, 0, 0];
    // The service may still be looking for the border of what was clicked on: that point is on it.
    const inside = proposalOf(selection)?.inside[0];
    const clicked = inside && project(camera, add(inside, shift));
    if (clicked && Math.hypot(clicked.x - x, clicked.y - y) <= THING_PX) return true;
    if (!answer?.count || selectionWaits) return false;
    const { low, high } = answer.bounds;
    const seen = ellipseOf(camera, { low: add(low, shift), high: add(high, shift) });
    if (!seen) return false;
    const [rx, ry] = [Math.max(seen.rx, THING_PX), Math.max(seen.ry, THING_PX)];
    return ((x - seen.x) / rx) ** 2 + ((y - seen.y) / ry) ** 2 <= 1;
  }

  // --- the hand --------------------------------------------------------------------------------------------------

  #listen() {
    const view = this.#view;
    const on = (name, fn, options) => view.addEventListener(name, fn, options);
    on("pointerdown", (event) => this.#down(event));
    on("pointermove", (event) => this.#move(event));
    on("pointerup", (event) => this.#up(event));
    on("pointercancel", (event) => this.#cancel(event));
    on("pointerleave", () => {
      this.#pointerAt = null;
      this.#overlay.cursor(null);
    });
    on("contextmenu", (event) => event.preventDefault());
    on("wheel", (event) => this.#wheel(event), { passive: false });
    on("dblclick", (event) => {
      if (event.target.closest(CONTROLS)) return;
      this.#pointerAt = this.#place(event);
      this.focusHere();
    });
    on("keydown", (event) => this.#key(event));
    // A key or a button between two clicks makes the second one a click of its own, however quick the hand is.
    const between = ({ type, target }) => {
      if (type === "keydown" || target.closest?.(CONTROLS)) this.#clicked.at = -Infinity;
    };
    for (const name of ["keydown", "pointerdown"]) document.addEventListener(name, between, true);
  }

  #place(event) {
    const box = this.#view.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  #down(event) {
    if (event.target.closest(CONTROLS) || !this.camera) return;
    this.#view.focus({ preventScroll: true });
    this.#view.classList.remove("by-keyboard");
    this.#pointers.set(event.pointerId, this.#place(event));
    this.#view.setPointerCapture(event.pointerId);
    if (this.#pointers.size === 2) {
      this.#gesture?.drag?.giveUp();
      this.#gesture = { kind: "pinch", ...this.#pinch() };
    } else if (this.#pointers.size === 1 && !this.#gesture) {
      const from = this.#place(event);
      this.#gesture = { kind: this.#kindOf(event), from, button: event.button, other: event.altKey };
      const takes = this.tool === "thing" && event.button === 0 && !event.shiftKey && this.#onThing(from);
      if (takes) Object.assign(this.#gesture, { kind: "thing", drag: this.#editor.dragThing(this.camera, from) });
      if (this.#gesture.kind === "draw") this.#gesture.drag = this.#sketch(from, event.altKey);
    }
  }

  /** What a pointer that goes down on the picture begins. Where the left button draws, the right one orbits. */
  #kindOf({ button, shiftKey }) {
    const draws = DRAWING.includes(this.tool);
    if (button === 1 || shiftKey) return "pan";
    if (draws) return button === 2 ? "orbit" : "draw";
    return button === 2 ? "pan" : "orbit";
  }

  /** A stroke, a lasso or a rectangle that is being drawn. Returns {move(x, y), end(), giveUp()}. */
  #sketch({ x, y }, other) {
    const { tool, camera } = this;
    const selecting = this.#editor.selecting;
    let points = [[x, y]];
    const reach = () => {
      const r = Math.hypot(points.at(-1)[0] - x, points.at(-1)[1] - y);
      return r < CLICK_PX ? SHAPE_PX : r;
    };
    const show = () =>
      this.#overlay.sketch({
        tool,
        points: [...this.#corners, ...points],
        radius: isShape(tool) ? reach() : this.#state.brushRadius,
        subtracts: selecting.subtracts(other),
      });
    show();
    return {
      move: (toX, toY) => {
        this.#corners = [];
        points = tool === "rectangle" || isShape(tool) ? [points[0], [toX, toY]] : thinned([...points, [toX, toY]], SKETCH_PX);
        show();
      },
      end: () => {
        this.#overlay.sketch(null);
        if (isShape(tool)) selecting.drawShape(tool, camera, { x, y }, reach(), unit(this.#editor.worldUp), other);
        else if (tool !== "brush" && points.length === 1) this.#corner(points[0], other);
        else selecting.draw(tool, camera, points, other);
      },
      giveUp: () => this.#overlay.sketch(null),
    };
  }

  /** One more corner, clicked by who does not draw. A rectangle has two; a lasso ends where it began. */
  #corner(place, other) {
    const { tool, camera } = this;
    const corners = this.#corners;
    const isOn = (corner) => !!corner && Math.hypot(corner[0] - place[0], corner[1] - place[1]) < CORNER_PX;
    const ends = tool === "rectangle" ? corners.length === 1 && !isOn(corners[0]) : corners.length > 2 && isOn(corners[0]);
    if (ends) {
      this.#dropCorners();
      return this.#editor.selecting.draw(tool, camera, tool === "rectangle" ? [...corners, place] : corners, other);
    }
    if (!isOn(corners.at(-1))) this.#corners = [...corners, place];
    this.#showCorners(place);
  }

  /** Shows the corners so far, and a line from the last to where the pointer is. */
  #showCorners(place) {
    const { tool } = this;
    this.#overlay.sketch({ tool, points: [...this.#corners, place], subtracts: this.#editor.selecting.subtracts(false) });
  }

  #dropCorners() {
    if (this.#corners.length === 0) return;
    this.#corners = [];
    this.#overlay.sketch(null);
  }

  /** The pointer took hold of a handle's dot. */
  #grab(id, event) {
    this.#take(event, (from) => this.#editor.dragTarget(id, this.camera, from));
  }

  /** The pointer takes hold of something that is drawn over the picture: begin({x, y}) returns the drag. */
  #take(event, begin) {
    if (event.button !== 0 || event.shiftKey || !this.camera) return;
    event.stopPropagation();
    event.preventDefault();
    event.currentTarget.focus({ preventScroll: true });
    this.#pointers.set(event.pointerId, this.#place(event));
    this.#view.setPointerCapture(event.pointerId);
    const from = this.#place(event);
    this.#gesture = { kind: "drag", from, drag: begin(from) };
  }

  #pinch() {
    const [a, b] = [...this.#pointers.values()];
    return { centre: { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 }, apart: Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)) };
  }

  #move(event) {
    const to = this.#place(event);
    this.#pointerAt = to;
    if (this.tool === "brush" && event.pointerType !== "touch") this.#overlay.cursor(to, this.#state.brushRadius);
    if (!this.#gesture && this.#corners.length > 0) this.#showCorners([to.x, to.y]);
    if (!this.#gesture) attrs(this.#view, { "data-over": this.tool === "thing" && this.#onThing(to) ? "thing" : null });
    const from = this.#pointers.get(event.pointerId);
    const gesture = this.#gesture;
    if (!from || !gesture) return;
    if (gesture.kind === "pinch") {
      this.#pointers.set(event.pointerId, to);
      const now = this.#pinch();
      this.#turn((pose) => {
        const moved = panned(
          { ...pose, ...this.#size },
          now.centre.x - gesture.centre.x,
          now.centre.y - gesture.centre.y,
        );
        return this.#approached(moved, gesture.apart / now.apart);
      });
      Object.assign(gesture, now);
      return;
    }
    if (!gesture.started) {
      if (Math.hypot(to.x - gesture.from.x, to.y - gesture.from.y) < CLICK_PX) return;
      gesture.started = true;
    }
    this.#pointers.set(event.pointerId, to);
    if (gesture.drag) return gesture.drag.move(to.x, to.y);
    const [dx, dy] = [to.x - from.x, to.y - from.y];
    if (gesture.kind === "orbit")
      this.#turn((pose) => this.#turned()(pose, dx * ORBIT_PER_PX, dy * ORBIT_PER_PX, this.#editor.worldUp));
    else this.#turn((pose) => panned({ ...pose, ...this.#size }, dx, dy));
  }

  #up(event) {
    const gesture = this.#gesture;
    if (!this.#pointers.delete(event.pointerId) || !gesture) return;
    if (gesture.kind === "pinch" && this.#pointers.size > 0) {
      // One finger is left: it turns the scene on.
      if (this.#pointers.size === 1) this.#gesture = { kind: "orbit", started: true };
      return;
    }
    this.#gesture = null;
    // What was taken hold of and not moved was clicked on.
    if (gesture.drag && (gesture.started || gesture.kind !== "thing")) return gesture.drag.end();
    if (gesture.started) return;
    const { kind, button, from, other } = gesture;
    const { at, x, y } = this.#clicked;
    const again = performance.now() - at < DOUBLE_CLICK_MS && Math.hypot(from.x - x, from.y - y) < 2 * CLICK_PX;
    this.#clicked = { at: performance.now(), ...from };
    // The first of two clicks has done what a click does.
    if (again && button === 0) return;
    if ((kind === "orbit" || kind === "thing") && button === 0) this.#click(from, other);
    else if (this.tool === "grow" && button === 2) this.#click(from, true);
  }

  #cancel(event) {
    this.#pointers.delete(event.pointerId);
    this.#gesture?.drag?.giveUp();
    this.#gesture = null;
  }

  /** A click, or Enter in the middle.
   *    other  with Alt, or the right button: takes away where it would add, and the other way round */
  #click({ x, y }, other = false) {
    const { tool, camera } = this;
    const { selecting } = this.#editor;
    if (tool === "floor") clickFloor(this.#editor, camera, x, y);
    else if (tool === "handle") this.#editor.place(camera, x, y);
    else if (tool === "thing") {
      // What has been moved is not where the version has it: a click on it says nothing new.
      const moved = this.#state.handles.some((handle) => handle.target);
      if (!moved || !this.#onThing({ x, y })) selecting.propose(camera, x, y);
    }
    else if (tool === "grow") selecting.click(camera, x, y, other);
    else if (tool === "brush") selecting.draw("brush", camera, [[x, y]], other);
    else if (isShape(tool)) selecting.drawShape(tool, camera, { x, y }, SHAPE_PX, unit(this.#editor.worldUp), other);
  }

  #turn(change) {
    const { pose } = this.#state;
    const next = change(pose);
    if (samePose(pose, next)) return;
    this.#isMoving();
    this.#editor.setPose(next);
  }

  #isMoving() {
    this.#movingUntil = performance.now() + STILL_AFTER_MS;
  }

  /** A step of a key or a button, [x, y] with y down: turns the view as a drag would, or slides it. */
  step([x, y], slides = false) {
    if (!this.#state.pose) return;
    if (slides) this.#turn((pose) => panned({ ...pose, ...this.#size }, -SLIDE_PX * x, -SLIDE_PX * y));
    else this.#turn((pose) => this.#turned()(pose, TURN_STEP * x, TURN_STEP * y, this.#editor.worldUp));
  }

  /** Nearer to what the view turns about (below 1), or farther. */
  approach(factor) {
    if (this.#state.pose) this.#turn((pose) => this.#approached(pose, factor));
  }

  /** What a drag beside everything does to the view. */
  #turned() {
    return this.#state.flying ? lookedAround : orbited;
  }

  #nearest() {
    return (this.#state.scene.radius || 1) * 1e-3;
  }

  /** Comes nearer to the pivot; who flies takes the pivot along. */
  #approached(pose, factor) {
    if (!this.#state.flying) return dollied(pose, factor, this.#nearest());
    return flown(pose, [0, 0, (1 - factor) * distance(pose.eye, pose.target)], this.#editor.worldUp);
  }

  #fly(step) {
    if (!this.#state.flying || !this.#state.pose) return this.#flight.stop();
    this.#turn((pose) => flown(pose, scale(step, distance(pose.eye, pose.target)), this.#editor.worldUp));
  }

  /** A key went down somewhere on the page. Returns whether it flies. */
  flyBy(event) {
    const key = event.key.toLowerCase();
    // Arrow keys are those of whatever has the focus.
    if (!this.#state.flying || (key.startsWith("arrow") && event.target !== this.#view)) return false;
    const flies = this.#flight.press(key, event.shiftKey);
    if (flies) event.preventDefault();
    return flies;
  }

  /** A key was let go; null: all of them. */
  endFlyingBy(key) {
    if (key === null) this.#flight.stop();
    else this.#flight.release(key.toLowerCase());
  }

  #wheel(event) {
    event.preventDefault();
    if (!this.camera) return;
    const { x, y } = this.#place(event);
    const factor = wheelFactor(event);
    if (this.#state.flying) this.#turn((pose) => this.#approached(pose, factor));
    else this.#turn((pose) => zoomedAt({ ...pose, ...this.#size }, x, y, factor, this.#nearest()));
  }

  /** The wheel turned over a handle's dot: towards the user, a larger sphere. */
  #resize(id, event) {
    // With a selection, there is no sphere to resize.
    if (this.#state.selection.length > 0) return;
    event.preventDefault();
    event.stopPropagation();
    const { radius } = this.#state.handles.find((h) => h.id === id);
    this.#editor.select(id);
    this.#editor.change(id, { radius: Number((radius * wheelFactor(event)).toPrecision(4)) });
  }

  // --- the keyboard ----------------------------------------------------------------------------------------------

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.target !== this.#view || !this.camera) return;
    if (event.altKey && event.key !== "Enter") return;
    const arrow = ARROWS[event.key];
    if (arrow && this.#state.flying) return; // flyBy() sees them.
    if (arrow) this.step(arrow, event.shiftKey);
    else if (event.key === "+" || event.key === "=") this.approach(0.9);
    else if (event.key === "-" || event.key === "_") this.approach(1 / 0.9);
    else if (event.key === "Enter") this.#click({ x: this.#size.width / 2, y: this.#size.height / 2 }, event.altKey);
    else return;
    // Only who works by keyboard needs to see where the middle is.
    this.#view.classList.add("by-keyboard");
    event.preventDefault();
  }

  /** Arrow keys on a handle's dot move its target by some pixels, as a drag would. */
  #nudge(id, event) {
    const arrow = ARROWS[event.key];
    if (!arrow || event.ctrlKey || event.metaKey || !this.camera) return;
    event.preventDefault();
    event.stopPropagation();
    const handle = this.#state.handles.find((h) => h.id === id);
    const from = handle.target ?? handle.source;
    const seen = project(this.camera, from);
    const step = event.shiftKey ? 1 : 8;
    if (seen)
      this.#editor.change(id, {
        target: dragged(
          this.camera,
          from,
          seen.x + step * arrow[0],
          seen.y + step * arrow[1],
          this.#state.constraint,
          { normal: handle.normal, up: this.#editor.worldUp },
        ),
      });
  }

  /** Gives up the drag under way, if there is one. */
  giveUpDrag() {
    if (this.#corners.length > 0) {
      this.#dropCorners();
      return true;
    }
    if (!this.#gesture?.drag) return false;
    this.#gesture.drag.giveUp();
    this.#gesture = null;
    this.#pointers.clear();
    return true;
  }

  /** Turns about the point under the pointer from now on (the middle of the picture, without a pointer). */
  async focusHere() {
    const { camera } = this;
    if (!camera) return;
    const { x, y } = this.#pointerAt ?? { x: camera.width / 2, y: camera.height / 2 };
    try {
      const point = await this.#editor.surfaceAt(camera, x, y);
      if (!point) return this.#editor.say("There is nothing here to turn about.", { seconds: 3 });
      this.#editor.setPose(centredOn(this.#state.pose, point));
    } catch (error) {
      this.#editor.say(error.message, { kind: "bad" });
    }
  }
}
