import assert from "node:assert/strict";
import { afterEach, beforeEach, test } from "node:test";

import { Editor, NOTHING_OPEN, shownVersion } from "../../../web/editor.js";
import { SceneMemory, Store } from "../../../web/store.js";
import { fetchFrom, memoryStorage, settle, SilentEvents } from "./stand_ins.mjs";

const CAMERA = { eye: [0, 0, -5], target: [0, 0, 0], up: [0, -1, 0], fov: 50, width: 400, height: 300 };
const SELECT = "POST /v1/scenes/s000001/versions/0/select";
const original = { fetch: globalThis.fetch, EventSource: globalThis.EventSource };
let service;
let editor;
let said;
let asked; // Selections that were posted, in order.
let storage;

const answer = (selection) => ({
  id: `q${selection.length}`,
  count: 100 * selection.length,
  bounds: { low: [0, 0, 0], high: [1, 1, 1] },
  centre: [0, 0, 0],
  undecided: 0,
  border: null,
  warnings: [],
});
const problem = (status, where) =>
  new Response(JSON.stringify({ detail: "no", where, code: "unprocessable" }), { status });

function open() {
  const store = new Store({ ...NOTHING_OPEN, info: null });
  editor = new Editor(store, new SceneMemory(storage), (message) => said.push(message));
  return editor.open("s000001");
}

beforeEach(async () => {
  said = [];
  asked = [];
  storage = memoryStorage();
  service = {
    "GET /v1/scenes/s000001": () => ({
      id: "s000001",
      created: "2026-01-01",
      up: null,
      centre: [0, 0, 0],
      radius: 2,
      dataset: null,
      versions: [{ version: 0, parent: null, gaussians: 1000 }],
    }),
    "GET /v1/scenes/s000001/views": () => ({ kind: "virtual", views: [] }),
    "GET /v1/edits?scene=s000001&limit=30": () => ({ edits: [] }),
    "POST /v1/scenes/s000001/versions/0/pick": (body) =>
      body.point
        ? { hit: true, gaussians_in_radius: 42 }
        : { hit: true, point: [body.x, body.y, 0], normal: [0, 0, -1] },
    [SELECT]: ({ selection }) => {
      asked.push(selection);
      return answer(selection);
    },
  };
  globalThis.fetch = fetchFrom(service);
  globalThis.EventSource = SilentEvents;
  await open();
});

afterEach(() => {
  editor.close();
  Object.assign(globalThis, original);
});

const { click, draw } = {
  click: (x, y, other) => editor.selecting.click(CAMERA, x, y, other),
  draw: (tool, points, other) => editor.selecting.draw(tool, CAMERA, points, other),
};

test("clicks grow one thing, and the service says what it holds", async () => {
  editor.selecting.use("grow");
  await click(1, 2);
  await click(3, 4, true);
  await settle();
  assert.deepEqual(editor.state.selection, [{ grow: { inside: [[1, 2, 0]], outside: [[3, 4, 0]] } }]);
  assert.equal(editor.state.selectionAnswer.count, 100);
  assert.equal(editor.state.selectionWaits, false);
  assert.equal(editor.selecting.idFor(0), "q1");
  assert.equal(editor.selecting.idFor(1), null, "it is of this version");
  editor.store.set({ clickKind: "outside" });
  await click(5, 6, true);
  assert.equal(editor.state.selection[0].grow.inside.length, 2, "the other of not it is on it");
  editor.store.set({ tinted: false });
  assert.equal(editor.selecting.idFor(0), null);
});

test("a click beside everything, and one that says only what is not meant, tell what to do", async () => {
  await click(1, 2, true);
  service["POST /v1/scenes/s000001/versions/0/pick"] = () => ({ hit: false, point: null });
  await click(1, 2);
  assert.deepEqual(editor.state.selection, []);
  assert.equal(said.length, 2);
});

test("strokes and lassos carry their camera, Alt turns adding round, and who begins anew adds", async () => {
  draw("brush", [
    [10, 10],
    [60, 10],
  ]);
  draw("brush", [[10, 10]], true);
  editor.store.set({ selectOp: "intersect", selectDepth: "through" });
  draw("lasso", [
    [0, 0],
    [50, 0],
    [50, 50],
  ]);
  const [added, taken, kept] = editor.state.selection;
  assert.equal(added.op, undefined);
  assert.equal(added.stroke.camera.fov_y_deg, 50);
  assert.equal(added.stroke.depth, "visible");
  assert.equal(taken.op, "subtract");
  assert.deepEqual([kept.op, kept.polygon.depth], ["intersect", "through"]);
  draw("lasso", [[0, 0]]);
  assert.equal(editor.state.selection.length, 3);
  editor.selecting.clear();
  await settle();
  assert.equal(editor.state.selectOp, "add", "there is nothing left to keep a part of");
});

test("one question at a time, and the newest selection wins", async () => {
  const waiting = [];
  service[SELECT] = ({ selection }) => new Promise((resolve) => waiting.push(() => resolve(answer(selection))));
  for (let i = 0; i < 4; ++i) {
    draw("brush", [[i, 0]]);
    await settle();
  }
  assert.equal(waiting.length, 1);
  assert.equal(editor.state.selectionWaits, true);
  waiting[0]();
  await settle();
  assert.equal(editor.state.selectionAnswer.count, 100, "what is known is shown meanwhile");
  assert.equal(waiting.length, 2);
  waiting[1]();
  await settle();
  assert.equal(editor.state.selectionAnswer.count, 400);
  assert.equal(editor.state.selectionWaits, false);
  editor.selecting.clear();
  await settle();
  assert.equal(editor.state.selectionAnswer, null);
  assert.equal(waiting.length, 2, "nothing needs no question");
});

test("undo and redo go through handles and selection in the order they were made", async () => {
  draw("brush", [[1, 1]]);
  await editor.place(CAMERA, 200, 150);
  draw("brush", [[2, 2]]);
  editor.undo();
  assert.deepEqual([editor.state.selection.length, editor.state.handles.length], [1, 1]);
  editor.undo();
  assert.deepEqual([editor.state.selection.length, editor.state.handles.length], [1, 0]);
  editor.undo();
  assert.deepEqual([editor.state.selection.length, editor.canUndo], [0, false]);
  for (let i = 0; i < 3; ++i) editor.redo();
  assert.deepEqual([editor.state.selection.length, editor.state.handles.length], [2, 1]);
  editor.selecting.remove(0);
  editor.selecting.invert();
  assert.deepEqual(Object.keys(editor.state.selection[1]), ["invert"]);
});

test("a selection that the service forgot is posted again; one that it cannot keep is not asked for for ever", async () => {
  draw("brush", [[1, 1]]);
  await settle();
  editor.selecting.lost("q1");
  await settle();
  assert.equal(asked.length, 2);
  assert.deepEqual(asked[0], asked[1]);
  assert.equal(editor.selecting.idFor(0), "q1");
  editor.selecting.seen("q1");
  editor.selecting.lost("q1");
  await settle();
  assert.equal(asked.length, 3);
  editor.selecting.lost("q1");
  await settle();
  assert.equal(asked.length, 3);
  assert.equal(editor.selecting.idFor(0), null);
  assert.deepEqual(said, []);
});

test("what the service refuses is kept with the selection it is about", async () => {
  service[SELECT] = () => problem(422, "selection[0].stroke.radius");
  draw("brush", [[1, 1]]);
  await settle();
  assert.equal(editor.state.selectionAnswer.error.where, "selection[0].stroke.radius");
  assert.equal(editor.selecting.idFor(0), null);
  service[SELECT] = ({ selection }) => answer(selection);
  draw("brush", [[2, 2]]);
  await settle();
  assert.equal(editor.state.selectionAnswer.error, undefined);
  assert.equal(editor.state.selectionAnswer.count, 200);
});

test("with a selection, requests carry it, and leave the radius of handles to the service", async () => {
  await editor.place(CAMERA, 200, 150);
  assert.ok(editor.request().handles[0].radius > 0);
  assert.equal(editor.request().selection, undefined);
  draw("brush", [[1, 1]]);
  assert.equal(editor.request().handles[0].radius, undefined);
  assert.equal(editor.request().selection.length, 1);
  editor.change(editor.state.handles[0].id, { grip: 0.4 });
  assert.equal(editor.request().handles[0].radius, 0.4);
  editor.selecting.clear();
  assert.notEqual(editor.request().handles[0].radius, 0.4);
});

test("the request of an earlier edit brings its selection back, and so does a reload", async () => {
  const request = {
    scene: "s000001",
    version: 0,
    mode: "move",
    handles: [{ source: [0, 0, 0], target: [1, 0, 0], radius: 0.25, group: 0 }],
    selection: [{ sphere: { center: [0, 0, 0], radius: 1 } }],
  };
  editor.load(request);
  assert.deepEqual(editor.request(), request, "it is that very request");
  editor.flush();
  editor.close();
  await open();
  await settle();
  assert.deepEqual(editor.state.selection, request.selection);
  assert.equal(editor.state.selectionAnswer.count, 100);
  assert.deepEqual(editor.request(), request);
  editor.load({ ...request, selection: undefined });
  assert.deepEqual(editor.state.selection, []);
});

test("while selecting, the version itself is on the screen, and no preview is made", async () => {
  const state = { version: 2, preview: { version: "p000001" }, comparing: false, selectMode: true };
  assert.equal(shownVersion(state), 2);
  editor.store.set({ layer: "depth" });
  editor.selecting.toggle();
  assert.deepEqual([editor.state.selectMode, editor.state.layer], [true, "color"]);
  editor.selecting.toggle();
  assert.equal(editor.state.selectMode, false);
});

test("of two clicks on things the later one counts, in whatever order the service answers", async () => {
  const answers = [];
  service["POST /v1/scenes/s000001/versions/0/pick"] = (body) =>
    new Promise((resolve) => answers.push(() => resolve({ hit: true, point: [body.x, body.y, 0] })));
  const first = editor.selecting.propose(CAMERA, 1, 2);
  const second = editor.selecting.propose(CAMERA, 3, 4);
  answers[1]();
  await second;
  answers[0]();
  await first;
  assert.deepEqual(editor.state.selection, [{ grow: { inside: [[3, 4, 0]], whole: true } }]);
  const third = editor.selecting.propose(CAMERA, 5, 6);
  editor.selecting.use("brush");
  answers[2]();
  await third;
  assert.deepEqual(editor.state.selection[0].grow.inside, [[3, 4, 0]], "who took the brush keeps what is there");
  assert.deepEqual(said, []);
});

test("a click that went astray takes nothing that was placed by hand", async () => {
  const [miss, hit] = [() => ({ hit: false, point: null }), service["POST /v1/scenes/s000001/versions/0/pick"]];
  const clickAt = (answers) => {
    service["POST /v1/scenes/s000001/versions/0/pick"] = answers;
    return editor.selecting.propose(CAMERA, 7, 8);
  };
  await clickAt(hit);
  draw("brush", [[1, 1]]);
  for (const answers of [miss, hit]) await clickAt(answers);
  assert.equal(editor.state.selection.length, 2);
  assert.equal(said.length, 2);
  editor.selecting.clear();
  await editor.place(CAMERA, 200, 150);
  await clickAt(miss);
  assert.equal(editor.state.handles.length, 1);
  editor.letGo();
  await clickAt(hit);
  await clickAt(miss);
  assert.deepEqual(editor.state.selection, [], "what one click took, another lets go");
  assert.equal(said.length, 3);
});
