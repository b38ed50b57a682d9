import assert from "node:assert/strict";
import { webcrypto } from "node:crypto";
import { afterEach, beforeEach, test } from "node:test";

import { Editor, NOTHING_OPEN, parentOf, shownVersion } from "../../../web/editor.js";
import { SceneMemory, Store } from "../../../web/store.js";
import { fetchFrom, memoryStorage, settle } from "./stand_ins.mjs";

globalThis.crypto ??= webcrypto; // a browser's global that Node 18 lacks

const CAMERA = { eye: [0, 0, -5], target: [0, 0, 0], up: [0, -1, 0], fov: 50, width: 400, height: 300 };
const original = { fetch: globalThis.fetch, EventSource: globalThis.EventSource };
let service;
let streams;
let editor;
let storage;
let said;
let offered; // By what was said.

const scene = () => ({
  id: "s000001",
  name: "chair",
  created: "2026-01-01",
  up: null,
  centre: [0, 0, 0],
  radius: 2,
  dataset: null,
  versions: [{ version: 0, parent: null }],
});

function open(items = storage) {
  const store = new Store({ ...NOTHING_OPEN, info: null });
  editor = new Editor(store, new SceneMemory(items), (message, { action } = {}) => {
    said.push(message);
    offered.push(action);
  });
  return editor.open("s000001");
}

beforeEach(async () => {
  [said, offered] = [[], []];
  streams = [];
  storage = memoryStorage();
  service = {
    "GET /v1/scenes/s000001": scene,
    "GET /v1/scenes/s000001/views": () => ({ kind: "virtual", views: [] }),
    "GET /v1/edits?scene=s000001&limit=30": () => ({ edits: [] }),
    "POST /v1/scenes/s000001/versions/0/pick": (body) =>
      body.point ? { hit: true, gaussians_in_radius: 42 } : { hit: true, point: [0.5, 0, 0], normal: [0, 0, -1] },
  };
  globalThis.fetch = fetchFrom(service);
  globalThis.EventSource = class extends EventTarget {
    constructor(url) {
      super();
      streams.push(Object.assign(this, { url }));
    }
    close() {
      this.closed = true;
    }
    send(data, name = "edit") {
      this.dispatchEvent(Object.assign(new Event(name), { data: JSON.stringify(data) }));
    }
  };
  await open();
});

afterEach(() => {
  editor.close();
  Object.assign(globalThis, original);
});

const problem = (where, status = 422) =>
  new Response(JSON.stringify({ detail: "no", where, code: "unprocessable" }), { status });
const edit = (patch) => ({
  id: "e000001",
  scene: "s000001",
  version: 0,
  state: "queued",
  progress: 0,
  finished_intervals: [],
  handles: [],
  request: { handles: [] },
  warnings: [],
  timings: [],
  result_version: null,
  error: null,
  ...patch,
});

test("what is on the screen: the version, its preview, or what it is compared with", () => {
  const two = {
    versions: [
      { version: 0, parent: null },
      { version: 1, parent: 0 },
      { version: 2, parent: 0 },
    ],
  };
  const state = { scene: two, version: 2, preview: null, comparing: false, compareWith: null };
  assert.equal(shownVersion(state), 2);
  assert.equal(shownVersion({ ...state, comparing: true }), 0);
  assert.equal(shownVersion({ ...state, comparing: true, compareWith: 1 }), 1);
  const previewing = { ...state, preview: { version: "p000001" } };
  assert.equal(shownVersion(previewing), "p000001");
  assert.equal(shownVersion({ ...previewing, comparing: true }), 2);
  assert.equal(shownVersion({ ...state, version: 0, comparing: true }), 0, "there is nothing before the first");
  assert.equal(parentOf(two, 1), 0);
});

test("a click places a handle on the surface, and a miss says so", async () => {
  await editor.place(CAMERA, 200, 150);
  const [handle] = editor.state.handles;
  assert.deepEqual(handle.source, [0.5, 0, 0]);
  assert.equal(handle.target, null);
  assert.ok(handle.radius > 0);
  assert.equal(editor.state.selected, handle.id);
  service["POST /v1/scenes/s000001/versions/0/pick"] = () => ({ hit: false, point: null });
  await editor.place(CAMERA, 1, 1);
  assert.equal(editor.state.handles.length, 1);
  assert.equal(said.length, 1);
});

test("a drag sets the target in the view plane, is one step of undo, and can be given up", async () => {
  await editor.place(CAMERA, 200, 150);
  const { id } = editor.state.handles[0];
  const drag = editor.dragTarget(id, CAMERA, { x: 230, y: 150 });
  drag.move(240, 140);
  drag.move(260, 120);
  drag.end();
  const { target } = editor.state.handles[0];
  assert.ok(target[0] > 0.5 && target[1] < 0 && Math.abs(target[2]) < 1e-9, String(target));
  const second = editor.dragTarget(id, CAMERA, { x: 0, y: 0 });
  second.move(50, 50);
  second.giveUp();
  assert.deepEqual(editor.state.handles[0].target, target);
  editor.undo();
  assert.equal(editor.state.handles[0].target, null);
  editor.redo();
  assert.deepEqual(editor.state.handles[0].target, target);
});

test("what the service refuses is kept until the request is another one", async () => {
  service["POST /v1/edits?validate_only=true"] = () => problem("handles[0].radius");
  await editor.place(CAMERA, 200, 150);
  await editor.estimate();
  assert.equal(editor.state.problem.error.where, "handles[0].radius");
  editor.change(editor.state.handles[0].id, { radius: 9 });
  await settle();
  assert.equal(editor.state.problem, null);
});

test("a submission whose answer was lost is repeated under the same key; another one gets another", async () => {
  const keys = [];
  let fails = true;
  service["POST /v1/edits"] = (body, headers) => {
    keys.push(headers["Idempotency-Key"]);
    return fails ? new TypeError("lost") : edit();
  };
  await editor.place(CAMERA, 200, 150);
  await editor.run();
  assert.equal(editor.state.problem.error.code, "unreachable");
  fails = false;
  await editor.run();
  assert.equal(editor.state.edits[0].id, "e000001");
  await editor.run();
  assert.equal(keys[0], keys[1]);
  assert.notEqual(keys[1], keys[2]);
  assert.match(keys[0], /^[0-9a-f]{32}$/);
});

test("when its edit is done, the page shows the result and the handles have done their work", async () => {
  service["POST /v1/edits"] = () => edit();
  await editor.place(CAMERA, 200, 150);
  await editor.run();
  streams[0].send(edit({ state: "running", progress: 0.5 }));
  assert.equal(editor.state.edits[0].progress, 0.5);
  service["GET /v1/scenes/s000001"] = () => ({
    ...scene(),
    versions: [...scene().versions, { version: 1, parent: 0 }],
  });
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1 }));
  await settle();
  assert.equal(editor.state.version, 1);
  assert.deepEqual(editor.state.handles, []);
  editor.showVersion(parentOf(editor.state.scene, 1));
  assert.equal(editor.state.version, 0);
});

/** From now on the scene has a version 1, made from 0. */
function versionComes() {
  service["GET /v1/scenes/s000001"] = () => ({
    ...scene(),
    versions: [...scene().versions, { version: 1, parent: 0 }],
  });
}

test("after a run, undo brings back the version together with what was placed on it", async () => {
  service["POST /v1/edits"] = () => edit();
  await editor.place(CAMERA, 200, 150);
  editor.settle({ region: { center: [0, 0, 0], size: [1, 1, 1] } });
  await editor.run();
  versionComes();
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1 }));
  await settle();
  assert.deepEqual([editor.state.version, editor.state.handles, editor.state.region], [1, [], null], "the box, too");
  editor.undo();
  assert.deepEqual([editor.state.version, editor.state.handles.length], [0, 1]);
  assert.ok(editor.state.region);
  editor.redo();
  assert.deepEqual([editor.state.version, editor.state.handles.length], [1, 0], "no old handle on the new version");
});

test("undo passes over what was placed on a version that is gone", async () => {
  versionComes();
  await editor.reloadScene();
  editor.showVersion(1);
  service["POST /v1/scenes/s000001/versions/1/pick"] = service["POST /v1/scenes/s000001/versions/0/pick"];
  await editor.place(CAMERA, 200, 150);
  await editor.place(CAMERA, 200, 150);
  editor.showVersion(0);
  service["GET /v1/scenes/s000001"] = scene;
  await editor.reloadScene();
  editor.undo();
  assert.equal(editor.state.version, 0);
  assert.equal(editor.canUndo, false);
  assert.equal(editor.canRedo, false, "there is nothing to do again either");
});

test("undo takes the prompt of an imported request back with the request", () => {
  editor.load({ handles: [{ source: [0, 0, 0] }], prompt: "a red ball" });
  assert.equal(editor.request().prompt, "a red ball");
  editor.undo();
  assert.equal(editor.request().prompt, undefined);
});

test("undo covers mode, preset and parameters as it covers handles", () => {
  editor.settle({ mode: "extend" });
  editor.settle({ preset: "draft", params: { views: 4 } });
  editor.undo();
  assert.deepEqual([editor.state.mode, editor.state.preset, editor.state.params], ["extend", "", {}]);
  editor.undo();
  assert.equal(editor.state.mode, "move");
  editor.redo();
  assert.equal(editor.state.mode, "extend");
});

/** A thing that is taken, as a click takes it. */
async function take() {
  service["POST /v1/scenes/s000001/versions/0/select"] = () => ({
    id: "q000001",
    count: 7,
    bounds: { low: [0, 0, 0], high: [1, 1, 1] },
    centre: [0.5, 0.5, 0.5],
    undecided: 0,
    border: null,
    warnings: [],
  });
  service["POST /v1/previews"] = () => ({ version: "p000001", handles: [{ gaussians: 7 }], gaussians: { crumbs: 0 } });
  await editor.selecting.propose(CAMERA, 200, 150);
  await settle();
}

/** Drags it to the right by so many pixels, and lets go. */
function dragBy(pixels) {
  const drag = editor.dragThing(CAMERA, { x: 230, y: 150 });
  drag.move(230 + pixels, 150);
  drag.end();
}

test("a thing that is dragged and let go is repaired as a draft, and its result shown", async () => {
  const asked = [];
  service["POST /v1/edits"] = (body) => (asked.push(body), edit());
  await take();
  assert.deepEqual(editor.state.selection, [{ grow: { inside: [[0.5, 0, 0]], whole: true } }]);
  dragBy(30);
  await settle();
  assert.equal(asked.length, 1);
  assert.deepEqual([asked[0].preset, asked[0].mode, asked[0].handles.length], ["draft", "move", 1]);
  assert.deepEqual(asked[0].handles[0].source, [0.5, 0, 0], "by the point that was clicked on");
  assert.ok(asked[0].handles[0].target[0] > 0.5);
  assert.equal(editor.state.draft.id, "e000001");
  versionComes();
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1, request: asked[0] }));
  await settle();
  assert.deepEqual([editor.state.version, editor.state.draft, editor.state.selection], [1, null, []]);
  await editor.runBetter();
  assert.deepEqual([asked[1].preset, asked[1].version], ["standard", 0], "the same drag, on the version before");
  assert.deepEqual(asked[1].handles, asked[0].handles);
});

/** A thing was dragged, let go and repaired as a draft, which is version 1. Returns what is asked of the service. */
async function drafted() {
  const asked = [];
  service["POST /v1/edits"] = (body) => (asked.push(body), edit({ id: `e00000${asked.length}` }));
  await take();
  dragBy(30);
  await settle();
  versionComes();
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1, request: asked[0] }));
  await settle();
  return asked;
}

test("what a draft has bent comes off by one press, and the next thing is judged anew", async () => {
  const asked = await drafted();
  editor.takeOff();
  await settle();
  assert.deepEqual([asked.length, asked[0].attach, asked[1].attach], [2, undefined, "free"]);
  assert.deepEqual([asked[1].version, asked[1].handles], [0, asked[0].handles], "the same drag of the same version");
  editor.letGo();
  await take();
  assert.equal(editor.state.attach, null);
});

test("what comes off after a draft was dragged as it was, whatever has been set since: one step of undo", async () => {
  const asked = await drafted();
  editor.settle({ preset: "standard" });
  editor.settle({ mode: "extend" });
  await settle();
  editor.takeOff();
  await settle();
  assert.deepEqual(asked[1], { ...asked[0], attach: "free" }, "the same drag of the same version");
  assert.equal(editor.state.draft.id, "e000002");
  cancels("e000002");
  editor.undo();
  assert.deepEqual([editor.state.version, editor.state.mode, editor.state.preset], [1, "extend", "standard"]);
});

test("what is being run well is given up when it comes off", async () => {
  const asked = await drafted();
  const cancelled = cancels("e000002");
  await editor.runBetter();
  // It has ended, and the scene with its result is on its way.
  streams[0].send(edit({ id: "e000002", state: "succeeded", progress: 1, result_version: 2, request: asked[1] }));
  editor.takeOff();
  await settle();
  assert.deepEqual([cancelled, asked.length, asked[2].attach], [["e000002"], 3, "free"]);
  assert.deepEqual([editor.state.version, editor.state.draft.id, editor.state.handles.length], [0, "e000003", 1]);
});

test("what was drafted on a version that is gone stays as it is, and that is said", async () => {
  const asked = await drafted();
  editor.store.set({ scene: { ...scene(), versions: [{ version: 1, parent: null }] } });
  editor.takeOff();
  await settle();
  assert.deepEqual([editor.state.version, asked.length], [1, 1]);
  assert.match(said.at(-1), /^Version 0, .* deleted\.$/);
});

test("what only was dragged comes off without being repaired unasked", async () => {
  await take();
  editor.store.set({ draftOnRelease: false });
  dragBy(30);
  editor.takeOff();
  await settle();
  assert.deepEqual([editor.request().attach, editor.state.draft], ["free", null]);
  editor.undo();
  assert.equal(editor.request().attach, undefined);
});

test("what is held is moved on, turned and sized about its centre, each as one step of undo", async () => {
  await take();
  const { pivot, bounds } = editor.held;
  assert.deepEqual([pivot, bounds.high, editor.state.handles], [[0.5, 0.5, 0.5], [1, 1, 1], []]);
  editor.nudgeHeld({ shift: [1, 0, 0] });
  editor.nudgeHeld({ turn: [0, 0, Math.PI] });
  editor.nudgeHeld({ size: 2 });
  const [{ source, target, rotation, scale }] = editor.request().handles;
  // The source [0.5, 0, 0] hangs half a unit off the centre, which is at [1.5, 0.5, 0.5] by now.
  assert.deepEqual(source, [0.5, 0, 0]);
  assert.ok([1.5, 1.5, -0.5].every((x, i) => Math.abs(target[i] - x) < 1e-9), `${target}`);
  assert.ok(Math.abs(rotation[3] - 1) < 1e-9 && scale === 2, `${rotation}`);
  editor.undo();
  assert.equal(editor.request().handles[0].scale, undefined);
  editor.setHeld({ shift: [0, 0, 0.25], turn: [0, 0, 0], size: 1 });
  const [{ id, ...handle }] = editor.state.handles;
  assert.deepEqual([handle.target, handle.rotation, handle.scale], [[0.5, 0, 0.25], null, null]);
  for (let i = 0; i < 3; ++i) editor.undo();
  assert.deepEqual(editor.state.handles, [], "three steps, and none of them is left");
});

test("a part of the gizmo that is pulled and let go repairs the thing, as a drag of it does", async () => {
  const asked = [];
  service["POST /v1/edits"] = (body) => (asked.push(body), edit());
  await take();
  const drag = editor.dragHeld((x) => ({ shift: [x, 0, 0] }));
  drag.move(1, 0);
  drag.move(2, 0);
  drag.end();
  await settle();
  assert.deepEqual(asked.map(({ handles }) => handles[0].target), [[2.5, 0, 0]], "from where the drag began");
  assert.equal(editor.state.draft.id, "e000001");
});

test("what is dragged on a surface goes where the service says that is, and is repaired only then", async () => {
  const asked = [];
  service["POST /v1/edits"] = (body) => (asked.push(body), edit());
  await take();
  editor.store.set({ constraint: "surface", thingMode: true });
  let answer;
  service["POST /v1/scenes/s000001/versions/0/pick"] = () =>
    new Promise((resolve) => (answer = () => resolve({ hit: true, point: [4, 1, 0.5], normal: [0, -1, 0] })));
  const drag = editor.dragThing(CAMERA, { x: 230, y: 150 });
  drag.move(390, 150);
  drag.end();
  await settle();
  assert.deepEqual(asked, [], "it is still being asked");
  answer();
  while (asked.length === 0) await settle();
  assert.deepEqual(asked[0].handles[0].target, [4, 0, 0], "its box is half a unit high, and stands on the point");
});

test("a click on a preview asks what that shows, told as of the version", async () => {
  await take();
  editor.nudgeHeld({ shift: [3, 0, 0] });
  await editor.preview();
  const asked = [];
  const shows = (point) => {
    service["POST /v1/scenes/s000001/versions/p000001/pick"] = () => (asked.push(point), { hit: true, point, normal: [0, -1, 0] });
    return editor.pickSeen(CAMERA, 1, 1);
  };
  const moved = await shows([3.5, 0.5, 0.5]);
  assert.deepEqual([moved.point, moved.moved], [[0.5, 0.5, 0.5], true]);
  const other = await shows([8, 0, 0]);
  assert.deepEqual([other.point, other.moved], [[8, 0, 0], false]);
  assert.equal(asked.length, 2);
});

test("a shape that selects is what the gizmo has while its tool is in hand; a drag of it is one step", async () => {
  editor.selecting.use("sphere");
  const select = "POST /v1/scenes/s000001/versions/0/select";
  service[select] = () => ({ id: "q1", count: 1, bounds: { low: [0, 0, 0], high: [1, 1, 1] }, centre: [0, 0, 0], border: null, warnings: [] });
  await editor.selecting.drawShape("sphere", CAMERA, { x: 200, y: 150 }, 30, [0, -1, 0]);
  const drawn = editor.held.shape.sphere;
  assert.deepEqual(drawn.center, [0.5, 0, 0]);
  const drag = editor.dragHeld((x) => ({ size: x }));
  drag.move(2);
  drag.move(3);
  drag.end();
  assert.ok(Math.abs(editor.held.shape.sphere.radius - 3 * drawn.radius) < 1e-12);
  editor.undo();
  assert.deepEqual(editor.held.shape.sphere, drawn);
  editor.nudgeHeld({ shift: [0, 1, 0] });
  assert.deepEqual(editor.state.selection.at(-1).sphere.center, [0.5, 1, 0]);
  editor.selecting.use("grow");
  assert.equal(editor.held, null);
});

test("a draft is given up when the thing is dragged on, and never takes the screen", async () => {
  let n = 0;
  const cancelled = [];
  for (const id of ["e000001", "e000002"])
    service[`POST /v1/edits/${id}/cancel`] = () => (cancelled.push(id), edit({ id, state: "cancel_requested" }));
  service["POST /v1/edits"] = () => edit({ id: `e00000${++n}` });
  await take();
  dragBy(30);
  await settle();
  dragBy(60);
  await settle();
  assert.deepEqual(cancelled, ["e000001"]);
  assert.equal(editor.state.draft.id, "e000002");
  assert.deepEqual(
    editor.state.edits.map((e) => e.id),
    ["e000002"],
  );
  streams[0].send(edit({ id: "e000001", state: "succeeded", progress: 1, result_version: 1 }));
  await settle();
  assert.equal(editor.state.version, 0);
  editor.undo();
  editor.undo();
  await settle();
  assert.deepEqual(cancelled, ["e000001", "e000002"], "undone, it is not wanted either");
});

test("a draft whose request is still on its way when it is given up is cancelled when it is there", async () => {
  let answer;
  const cancelled = [];
  service["POST /v1/edits"] = () => new Promise((resolve) => (answer = () => resolve(edit())));
  service["POST /v1/edits/e000001/cancel"] = () => (cancelled.push(1), edit({ state: "cancelled" }));
  await take();
  dragBy(30);
  await settle();
  editor.letGo();
  await settle();
  answer();
  await settle();
  assert.equal(cancelled.length, 1);
  assert.deepEqual([editor.state.draft, editor.state.edits], [null, []]);
});

/** From now on edits can be cancelled. Returns the ids of those that were. */
function cancels(...ids) {
  const cancelled = [];
  for (const id of ids)
    service[`POST /v1/edits/${id}/cancel`] = () => (cancelled.push(id), edit({ id, state: "cancel_requested" }));
  return cancelled;
}

test("a draft that is given up while its scene is on its way does not take the screen", async () => {
  const cancelled = cancels("e000001");
  service["POST /v1/edits"] = () => edit();
  await take();
  dragBy(30);
  await settle();
  versionComes();
  const fresh = service["GET /v1/scenes/s000001"];
  let arrive;
  service["GET /v1/scenes/s000001"] = () => new Promise((resolve) => (arrive = () => resolve(fresh())));
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1 }));
  await settle();
  const drag = editor.dragThing(CAMERA, { x: 260, y: 150 });
  drag.move(290, 150);
  await settle();
  arrive();
  await settle();
  assert.deepEqual([editor.state.version, editor.state.drafted], [0, null]);
  const { handles, selection } = editor.state;
  assert.deepEqual([handles.length, selection.length], [1, 1], "nothing is taken from the hand");
  assert.deepEqual(cancelled, ["e000001"]);
  drag.giveUp();
});

for (const [what, change] of [
  ["a brush stroke", () => editor.selecting.draw("brush", CAMERA, [[1, 1]])],
  ["a number in the panel", () => editor.change(editor.state.handles[0].id, { target: [2, 0, 0] })],
  ["a parameter", () => editor.settle({ params: { views: 4 } })],
  ["a box", () => editor.settle({ region: { center: [0, 0, 0], size: [1, 1, 1] } })],
  ["another version", () => editor.showVersion(1)],
])
  test(`a draft is given up for ${what}: its result would throw that away`, async () => {
    const cancelled = cancels("e000001");
    service["POST /v1/edits"] = () => edit();
    await take();
    versionComes();
    await editor.reloadScene();
    dragBy(30);
    await settle();
    change();
    await settle();
    assert.deepEqual([editor.state.draft, cancelled], [null, ["e000001"]]);
  });

test("a draft goes on whatever is the preset: it has its own", async () => {
  service["POST /v1/edits"] = () => edit();
  await take();
  dragBy(30);
  await settle();
  editor.settle({ preset: "standard" });
  await settle();
  assert.equal(editor.state.draft.id, "e000001");
});

test("a draft whose answer was lost is asked for again under its key", async () => {
  const keys = [];
  service["POST /v1/edits"] = (body, headers) => (
    keys.push(headers["Idempotency-Key"]), keys.length === 1 ? new TypeError("lost") : edit()
  );
  await take();
  dragBy(30);
  await settle();
  assert.deepEqual([editor.state.draft, editor.state.problem.error.code], [null, "unreachable"]);
  await editor.runDraft();
  assert.equal(editor.state.draft.id, "e000001");
  assert.equal(keys[0], keys[1]);
  await editor.runDraft();
  assert.notEqual(keys[1], keys[2]);
});

test("a result that is undone while it is asked to be run well stays undone", async () => {
  let answer;
  service["POST /v1/edits"] = () => edit();
  await take();
  dragBy(30);
  await settle();
  versionComes();
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1 }));
  await settle();
  service["POST /v1/edits"] = () => new Promise((resolve) => (answer = () => resolve(edit({ id: "e000002" }))));
  const asked = editor.runBetter();
  await settle();
  editor.undo();
  await settle();
  answer();
  await asked;
  assert.equal(editor.state.drafted, null);
  assert.deepEqual(
    editor.state.edits.map((e) => e.id),
    ["e000002", "e000001"],
  );
  service["GET /v1/scenes/s000001"] = () => ({ ...scene(), versions: [0, 1, 2].map((version) => ({ version, parent: version ? 0 : null })) });
  streams[0].send(edit({ id: "e000002", state: "succeeded", progress: 1, result_version: 2 }));
  await settle();
  assert.deepEqual([editor.state.version, editor.state.handles.length], [0, 1], "and what is placed stays, too");
  assert.equal(said.at(-1), "Version 2 is ready.");
  offered.at(-1).run();
  assert.equal(editor.state.version, 2);
});

test("a thing is removed by one press, and what is taken next is to be moved again", async () => {
  const asked = [];
  service["POST /v1/edits"] = (body) => (asked.push(body), edit());
  await take();
  await editor.removeThing();
  await settle();
  assert.deepEqual([asked[0].mode, asked[0].preset, asked[0].handles], ["remove", "draft", []]);
  assert.equal(editor.state.draft.id, "e000001", "it is not outdated for want of a handle");
  versionComes();
  streams[0].send(edit({ state: "succeeded", progress: 1, result_version: 1, request: asked[0] }));
  await settle();
  assert.deepEqual([editor.state.version, editor.state.mode], [1, "move"]);
  editor.undo();
  assert.deepEqual([editor.state.version, editor.state.mode, editor.state.selection.length], [0, "remove", 1]);
});

test("who drags a thing has changed their mind about removing it", async () => {
  service["POST /v1/edits"] = () => edit();
  editor.settle({ mode: "remove" });
  await take();
  dragBy(30);
  assert.equal(editor.state.mode, "move");
  editor.undo();
  assert.equal(editor.state.mode, "remove");
});

test("a result of another version than the one looked at does not take the screen", async () => {
  service["POST /v1/edits"] = () => edit({ version: 3 });
  await editor.place(CAMERA, 200, 150);
  await editor.run();
  service["GET /v1/scenes/s000001"] = () => ({
    ...scene(),
    versions: [...scene().versions, { version: 4, parent: 3 }],
  });
  streams[0].send(edit({ version: 3, state: "succeeded", progress: 1, result_version: 4 }));
  await settle();
  assert.equal(editor.state.version, 0);
  assert.equal(editor.state.handles.length, 1);
});

test("a preview that is gone is taken off the screen, and said to be", async () => {
  service["POST /v1/previews"] = () => ({
    version: "p000001",
    parent: 0,
    handles: [{ gaussians: 42 }],
    gaussians: { changeable: 84 },
  });
  await editor.place(CAMERA, 200, 150);
  editor.change(editor.state.handles[0].id, { target: [1, 0, 0] });
  await editor.preview();
  assert.ok(editor.previewIsCurrent);
  editor.change(editor.state.handles[0].id, { target: [2, 0, 0] });
  assert.ok(!editor.previewIsCurrent);
  editor.previewExpired("p000001");
  assert.equal(editor.state.preview, null);
  assert.match(said.at(-1), /expired/);
});

test("what is selected follows the mouse, a preview at a time", async () => {
  const asked = [];
  let answer;
  service["POST /v1/previews"] = (body) => {
    asked.push(body.handles[0].target[0]);
    return new Promise((resolve) => {
      answer = () => resolve({ version: `p00000${asked.length}`, parent: 0, handles: [], gaussians: {} });
    });
  };
  const settled = () => new Promise((resolve) => setTimeout(resolve, 5));
  await editor.place(CAMERA, 200, 150);
  const { id } = editor.state.handles[0];
  editor.store.set({ selection: [{ id: 1, action: { rows: [[0, 9]] } }], autoPreview: true });
  const dragTo = (x) => {
    editor.store.set({ dragging: true });
    editor.change(id, { target: [x, 0, 0] }, false);
  };
  dragTo(1);
  await settled();
  dragTo(2);
  await settled();
  dragTo(3);
  await settled();
  assert.deepEqual(asked, [1], "the others wait for the first one");
  answer();
  await settled();
  assert.equal(editor.state.preview.version, "p000001", "seen while the mouse goes on");
  assert.deepEqual(asked, [1, 3], "then where the mouse is now");
  answer();
  await settled();
  assert.deepEqual(asked, [1, 3], "and no more of what is on the screen already");
  assert.ok(editor.previewIsCurrent);
});

test("what spheres hold waits for the mouse to be let go", async () => {
  let asked = 0;
  service["POST /v1/previews"] = () => ({ version: `p00000${++asked}`, parent: 0, handles: [], gaussians: {} });
  await editor.place(CAMERA, 200, 150);
  editor.store.set({ dragging: true, autoPreview: true });
  editor.change(editor.state.handles[0].id, { target: [1, 0, 0] }, false);
  await new Promise((resolve) => setTimeout(resolve, 5));
  assert.equal(asked, 0);
});

test("handles, version and camera survive a reload, and a running edit is followed again", async () => {
  await editor.place(CAMERA, 200, 150);
  editor.setPose({ eye: [1, 2, 3], target: [0, 0, 0], up: [0, -1, 0], fov: 40 });
  editor.store.set({ mode: "extend" });
  editor.flush();
  service["GET /v1/edits?scene=s000001&limit=30"] = () => ({ edits: [edit({ state: "running", progress: 0.3 })] });
  editor.close();
  await open();
  assert.equal(editor.state.handles.length, 1);
  assert.deepEqual(editor.state.pose.eye, [1, 2, 3]);
  assert.equal(editor.state.mode, "extend");
  assert.equal(streams.at(-1).url, "/v1/scenes/s000001/events");
  const { id } = editor.state.handles[0];
  await editor.place(CAMERA, 200, 150);
  assert.notEqual(editor.state.handles[1].id, id);
});

test("one stream tells of the scene and of all its edits, also of those made elsewhere", async () => {
  assert.deepEqual(
    streams.map(({ url }) => url),
    ["/v1/scenes/s000001/events"],
  );
  streams[0].send(edit({ id: "e000007", state: "running" }));
  const versions = [...scene().versions, { version: 1, parent: 0 }];
  service["GET /v1/scenes/s000001"] = () => ({ ...scene(), name: "table", versions });
  streams[0].send({ ...scene(), name: "table", versions }, "scene");
  streams[0].send(edit({ id: "e000007", state: "succeeded", result_version: 1 }));
  await settle();
  assert.equal(editor.state.scene.name, "table");
  assert.equal(editor.state.edits[0].state, "succeeded");
  assert.equal(editor.state.version, 0, "it does not take the screen");
  assert.deepEqual(said, ["Version 1 is ready, made elsewhere."]);
});

test("the last edit that was asked for from the panel is known, whatever is made elsewhere", async () => {
  service["POST /v1/edits"] = () => edit();
  assert.equal(editor.state.asked, null);
  await editor.place(CAMERA, 200, 150);
  await editor.run();
  streams[0].send(edit({ id: "e000007" }));
  await settle();
  assert.deepEqual([editor.state.edits[0].id, editor.state.asked, editor.state.tab], ["e000007", "e000001", "edits"]);
});

test("a version that somebody else deletes leaves the screen", async () => {
  const versions = [...scene().versions, { version: 1, parent: 0 }];
  streams[0].send({ ...scene(), versions }, "scene");
  editor.showVersion(1);
  streams[0].send(scene(), "scene");
  assert.equal(editor.state.version, 0);
  assert.deepEqual(said, ["Version 1 has been deleted."]);
});

test("a draft that another page has replaced leaves the screen for what it was made from, and says what is there instead", async () => {
  const version = (number, parent) => ({ version: number, parent, edit: `e00000${number}` });
  streams[0].send(edit({ id: "e000002", state: "succeeded", result_version: 2, request: { handles: [], preset: "draft" } }));
  const { versions } = scene();
  streams[0].send({ ...scene(), versions: [...versions, version(1, 0), version(2, 0)] }, "scene");
  editor.showVersion(2);
  streams[0].send({ ...scene(), versions: [...versions, version(1, 0), version(3, 0)] }, "scene");
  assert.equal(editor.state.version, 0);
  assert.match(said.at(-1), /Version 2 was a draft, and is gone: version 3 is newer\.$/);
  streams[0].send({ ...scene(), versions: [...versions, version(1, 0)] }, "scene");
  offered.at(-1).run();
  assert.equal(editor.state.version, 0, "nor is what was offered there any more");
});

test("who deletes a version is not told so by the stream that is the first to know", async () => {
  const { versions } = scene();
  const made = { version: 1, parent: 0 };
  streams[0].send({ ...scene(), versions: [...versions, made] }, "scene");
  editor.showVersion(1);
  service["DELETE /v1/scenes/s000001/versions/1"] = () => {
    streams[0].send(scene(), "scene");
    return {};
  };
  await editor.deleteVersion(1);
  assert.deepEqual([editor.state.version, said], [0, []]);
});

test("a version whose parent has gone with it leaves the screen for what is left", async () => {
  const { versions } = scene();
  streams[0].send({ ...scene(), versions: [...versions, { version: 1, parent: 0 }, { version: 2, parent: 1 }] }, "scene");
  editor.showVersion(2);
  streams[0].send(scene(), "scene");
  assert.equal(editor.state.version, 0);
});

test("an edit that ends before its submission is answered is one of ours", async () => {
  service["POST /v1/edits"] = () => {
    streams[0].send(edit({ state: "succeeded", result_version: 1 }));
    return edit({ state: "queued" });
  };
  service["GET /v1/scenes/s000001"] = () => ({ ...scene(), versions: [...scene().versions, { version: 1, parent: 0 }] });
  await editor.place(CAMERA, 200, 150);
  await editor.run();
  await new Promise((resolve) => setTimeout(resolve, 5));
  await settle();
  assert.equal(editor.state.version, 1);
});

test("the views of a dataset that comes at once are not overtaken by the virtual ones from before it", async () => {
  const answers = [];
  service["GET /v1/scenes/s000001/views"] = () => new Promise((resolve) => answers.push(resolve));
  editor.close();
  const opening = open();
  await settle();
  const changed = editor.datasetChanged({ ...scene(), dataset: { kind: "colmap", views: 1, photos: 0 } });
  await settle();
  answers[1]({ kind: "dataset", views: [] });
  await settle();
  answers[0]({ kind: "virtual", views: [] });
  await Promise.all([opening, changed]);
  assert.equal(editor.state.viewsKind, "dataset");
});
