// What comes after a drag: comparing, drafts and versions, notes, frames, curves, steps. (All pure.)
import assert from "node:assert/strict";
import { test } from "node:test";

import { differences, nextWay } from "../../../web/compare.js";
import { superseded, treeOf } from "../../../web/drafts.js";
import { frameAround, insetOf, pictureIn, pointsOf } from "../../../web/framing.js";
import { curveOf, withLoss } from "../../../web/loss_curve.js";
import { notesOn } from "../../../web/notes.js";
import { changesScene, isStated, requestOf } from "../../../web/requests.js";
import { stepsOf } from "../../../web/scrubber.js";
import { listOf, whatMoves } from "../../../web/selection.js";

test("where two pictures differ, the difference is four times as bright, and counted", () => {
  const a = Uint8ClampedArray.from([10, 20, 30, 255, 0, 0, 0, 255, 200, 0, 0, 255, 5, 5, 5, 255]);
  const b = Uint8ClampedArray.from([10, 20, 30, 255, 0, 10, 0, 255, 0, 0, 0, 255, 9, 5, 5, 255]);
  const out = new Uint8ClampedArray(16);
  assert.equal(differences(a, b, out), 0.5, "four of 255 are not seen");
  assert.deepEqual([...out], [0, 0, 0, 255, 0, 40, 0, 255, 255, 0, 0, 255, 16, 0, 0, 255]);
  assert.equal(differences(out, out, out), 0, "and it may be made in place");
});

test("the key to compare goes through all ways and ends with none", () => {
  assert.equal(nextWay(null), "slider");
  assert.equal(nextWay("slider"), "blink");
  assert.equal(nextWay("difference"), null);
});

const versions = [
  { version: 0, parent: null },
  { version: 1, parent: 0 },
  { version: 2, parent: 0 },
  { version: 3, parent: 1 },
  { version: 5, parent: 0, name: "mine" },
];

test("versions are a tree, of one parent the youngest first", () => {
  assert.deepEqual(
    treeOf(versions).map(({ version: { version }, depth }) => [version, depth]),
    [
      [0, 0],
      [5, 1],
      [2, 1],
      [1, 1],
      [3, 2],
    ],
  );
});

test("a draft is replaced by what is made of the same version, unless somebody has a use for it", () => {
  const drafts = [1, 2, 3, 4, 5].map((version) => ({ version, base: version === 3 ? 1 : 0 }));
  const made = { version: 6, base: 0 };
  // 1 was gone on from, 3 is of another version, 4 is not there any more, 5 has a name.
  assert.deepEqual(superseded(drafts, made, versions, 6), [2]);
  assert.deepEqual(superseded(drafts, made, versions, 2), [], "nor one that is looked at");
  assert.deepEqual(superseded(drafts, { version: 2, base: 0 }, versions, 2), [], "nor what is there now");
});

const view = {
  ...{ name: "a", width: 400, height: 300, fx: 200, fy: 200, cx: 190, cy: 160 },
  cam_from_world: [
    [1, 0, 0, 0],
    [0, 1, 0, 0],
    [0, 0, 1, 4],
  ],
};

test("a photo lies where its camera sees what the camera on the screen sees", () => {
  // The camera on the screen looks along the same axis: what is on it is in the middle, and at (cx, cy) of the photo.
  const camera = { width: 800, height: 450, fov: 2 * Math.atan(225 / 300) * (180 / Math.PI) };
  const { x, y, width, height } = pictureIn(camera, view);
  assert.ok(Math.abs(width - 600) < 1e-9 && Math.abs(height - 450) < 1e-9);
  assert.ok(Math.abs(x + 1.5 * 190 - 400) < 1e-9 && Math.abs(y + 1.5 * 160 - 225) < 1e-9);
});

test("a frame holds what an edit is about, within the picture, and all of it where that is not to be seen", () => {
  const near = frameAround(view, [
    [0, 0, 0],
    [0.5, 0, 0],
  ]);
  for (const point of [190, 215]) assert.ok(near.left < point / 400 && point / 400 < near.right, JSON.stringify(near));
  assert.ok(Math.abs(near.right - near.left - (near.bottom - near.top)) < 1e-9, "not stretched");
  assert.ok(near.right - near.left < 0.5);
  const edge = frameAround(view, [[3.9, 2.5, 0]]);
  assert.deepEqual([edge.right, edge.bottom], [1, 1], "no farther than the picture goes");
  const whole = { left: 0, top: 0, right: 1, bottom: 1 };
  assert.deepEqual(frameAround(view, [[0, 0, -9]]), whole);
  assert.deepEqual(frameAround(view, []), whole);
  assert.equal(insetOf({ left: 0.1, top: 0.2, right: 0.6, bottom: 0.7 }), "inset(20% 40% 30% 10%)");
  const request = { handles: [{ source: [0, 0, 0], target: [1, 0, 0] }, { source: [2, 0, 0] }] };
  assert.deepEqual(pointsOf({ request }), [
    [0, 0, 0],
    [1, 0, 0],
    [2, 0, 0],
  ]);
});

test("a curve of the loss grows with what is heard, and knows the ends of intervals that nobody watched", () => {
  const edit = { interval: 2, iteration: 10, iterations: 100, loss: 0.2, finished_intervals: [{ interval: 1, loss: 0.4 }] };
  let points = withLoss([], edit);
  assert.deepEqual(points, [
    { at: 100, loss: 0.4 },
    { at: 110, loss: 0.2 },
  ]);
  assert.equal(withLoss(points, edit), points, "no news");
  points = withLoss(points, { ...edit, iteration: 20, loss: 0.1 });
  assert.equal(points.length, 3);
  assert.equal(withLoss(points, { ...edit, iteration: 0, loss: null }), points);
  assert.match(curveOf(points, { width: 120, height: 24 }), /^M100\.0 2\.0L110\.0 [\d.]+L120\.0 22\.0$/);
  for (let i = 21; i < 2000; ++i) points = withLoss(points, { ...edit, iterations: 4000, iteration: i, loss: 1 / i });
  assert.ok(points.length <= 401, `${points.length} points`);
});

test("notes are of what is on the screen: before a run of the preview, after it of the edit that made the version", () => {
  const edits = [
    {
      id: "e1",
      warnings: ["torn here"],
      uncovered: [
        { view: "a", area: 0.1, open: 0.01, open_box: [0, 0, 1, 1] },
        { view: "b", area: 0.1, open: 0.05, open_box: [0, 0, 1, 1] },
        { view: "c", area: 0.1, open: 0, open_box: null },
      ],
    },
  ];
  const scene = { versions: [{ version: 0 }, { version: 1, edit: "e1" }] };
  const state = { scene, version: 1, preview: null, selectMode: false, edits, problem: null };
  const after = notesOn(state);
  assert.deepEqual(after.notes, ["torn here"]);
  assert.deepEqual(
    after.open.map(({ view: name, share }) => [name, Number(share.toFixed(6))]),
    [
      ["b", 0.5],
      ["a", 0.1],
    ],
    "the worst first",
  );
  assert.deepEqual(notesOn({ ...state, version: 0 }), { notes: [], open: [], refused: null });
  const preview = { warnings: ["it will tear"] };
  assert.deepEqual(notesOn({ ...state, preview, previewIsCurrent: true }).notes, ["it will tear"]);
  assert.deepEqual(notesOn({ ...state, preview, previewIsCurrent: false }).notes, []);
  const error = { detail: "no", where: "region" };
  assert.equal(notesOn({ ...state, preview, problem: { error } }).refused, error);
});

test("the steps of an edit begin with how it found the scene, once", () => {
  const renders = (u) => [{ view: "a", stages: { optimised: `o${u}`, before: `b${u}`, deformed: `d${u}` } }];
  const edit = { finished_intervals: [1, 2].map((interval) => ({ interval, renders: renders(interval) })) };
  assert.deepEqual(
    stepsOf(edit, "a").map(({ url }) => url),
    ["b1", "d1", "o1", "d2", "o2"],
  );
  assert.deepEqual(stepsOf(edit, "z"), []);
});

test("what is healed goes along with a drag; alone it is removed and healed", () => {
  const heal = [{ stroke: {} }];
  const state = { scene: "s", version: 0, mode: "move", handles: [], selection: [], heal, params: {} };
  assert.ok(isStated(state) && changesScene(state));
  assert.deepEqual(requestOf(state), { scene: "s", version: 0, mode: "remove", handles: [], selection: heal, heal });
  const handles = [{ source: [0, 0, 0], target: [1, 0, 0], radius: 1, group: 0 }];
  const both = requestOf({ ...state, handles });
  assert.deepEqual([both.mode, both.heal, both.selection], ["move", heal, undefined]);
  assert.ok(!changesScene({ ...state, heal: [] }));
  assert.equal(listOf({ ...state, healing: true }), heal);
  assert.equal(listOf({ ...state, healing: false }), state.selection);
  assert.match(whatMoves({ ...state, selectionAnswer: null }), /A run also heals what you have marked\.$/);
});
