import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import {
  changesScene,
  impossibleWith,
  ImportError,
  isStated,
  labelOf,
  partOf,
  previewKey,
  readRequests,
  requestOf,
  usualValue,
} from "../../../web/requests.js";

const example = (name) => readFileSync(new URL(`../../../proto/examples/${name}`, import.meta.url), "utf8");
const only = (text) => {
  const requests = readRequests(text);
  assert.equal(requests.length, 1);
  return requests[0].request;
};
const refused = (document, where) =>
  assert.throws(
    () => readRequests(JSON.stringify(document)),
    (error) => {
      assert.ok(error instanceof ImportError, String(error));
      assert.equal(error.where, where, error.message);
      return true;
    },
  );

test("a released 3DGS-Drag configuration becomes a request", () => {
  const request = only(example("released_config.json"));
  assert.equal(request.mode, "move");
  assert.deepEqual(request.handles[0].source, [-1.22, -0.26, -0.42]);
  assert.deepEqual(request.handles[0].target, [-1.22 + -0.1, -0.26 + -0.2, -0.42 + 0.05]);
  assert.equal(request.handles[1].target, null, "no direction: an anchor");
  assert.deepEqual(
    request.handles.map((h) => h.group),
    [0, 0, 1],
  );
  assert.deepEqual(
    request.handles.map((h) => h.radius),
    [0.12, 0.12, 0.12],
  );
  assert.deepEqual(request.region, { center: [-0.6, -0.2, -0.5], size: [2, 1, 1] });
});

test("a removal has no targets, and with a selection no handles", () => {
  const selection = [{ sphere: { center: [0, 0, 0], radius: 1 } }];
  const heal = [{ box: { center: [0, 0, 0], size: [1, 1, 1] } }];
  const handle = { source: [1, 2, 3], target: [4, 5, 6], radius: 0.5, group: 0, rotation: [1, 0, 0, 0], scale: 2 };
  const asked = requestOf({ scene: "s1", version: 0, mode: "remove", handles: [handle], heal });
  assert.deepEqual(asked.handles, [{ source: [1, 2, 3], radius: 0.5, group: 0 }], "they stay for another mode");
  assert.deepEqual(asked.heal, heal);
  const state = { mode: "remove", handles: [], selection };
  assert.ok(isStated(state) && changesScene(state));
  assert.ok(!isStated({ ...state, selection: [] }) && !isStated({ ...state, mode: "move" }));
  assert.ok(changesScene({ mode: "remove", handles: [{ ...handle, target: null }] }));
  const anchor = { ...handle, target: null, rotation: null, scale: null };
  assert.ok(!changesScene({ mode: "move", handles: [anchor], selection }));
  assert.ok(changesScene({ mode: "move", handles: [{ ...anchor, scale: 2 }], selection }), "what grows in place changes, too");
  const read = only(JSON.stringify({ mode: "remove", selection, heal }));
  assert.deepEqual([read.mode, read.handles, read.selection, read.heal], ["remove", [], selection, heal]);
  refused({ mode: "move", selection }, "handles");
  refused({ mode: "remove", handles: [] }, "handles");
  refused({ mode: "take", selection }, "mode");
});

test("crumbs and what holds a part go with a selection, from files as from the screen", () => {
  const selection = [{ sphere: { center: [0, 0, 0], radius: 1 } }];
  const handle = { source: [1, 2, 3], target: [4, 5, 6], radius: 0.5, group: 0 };
  const state = { scene: "s1", version: 0, mode: "move", handles: [handle], selection, crumbs: "keep", attach: "held" };
  const asked = requestOf(state);
  assert.deepEqual([asked.crumbs, asked.attach], ["keep", "held"]);
  assert.equal(requestOf({ ...state, selection: [] }).crumbs, undefined, "without one there are none");
  assert.equal(requestOf({ ...state, crumbs: null }).crumbs, undefined, "the service's default");
  assert.equal(requestOf({ ...state, mode: "extend" }).crumbs, undefined, "nothing is left behind");
  assert.notEqual(previewKey(asked), previewKey({ ...asked, crumbs: "remove" }));
  const read = only(JSON.stringify(asked));
  assert.deepEqual([read.crumbs, read.attach], ["keep", "held"]);
  assert.deepEqual(partOf("crumbs"), { part: "crumbs" });
  const unsettled = requestOf({ ...state, settle: "off" });
  assert.equal(unsettled.settle, "off");
  assert.notEqual(previewKey(unsettled), previewKey(asked), "a preview shows it");
  assert.equal(requestOf({ ...state, settle: "off", mode: "remove" }).settle, undefined, "it arrives nowhere");
  assert.deepEqual(partOf("settle"), { part: "settle" });
  refused({ ...asked, crumbs: "eat" }, "crumbs");
  refused({ ...asked, attach: "glued" }, "attach");
});

test("a released configuration needs neither cluster nor mask nor mode", () => {
  const request = only('{"start": [[1, 2, 3]], "direction": [[0, 0, 1]], "voxel_size": 0.5}');
  assert.deepEqual(request.handles, [{ source: [1, 2, 3], target: [1, 2, 4], radius: 0.5, group: 0 }]);
  assert.equal(request.region, null);
  assert.equal(request.mode, "move");
});

test("a request with every parameter is kept whole", () => {
  const text = example("move_ball.json");
  const request = only(text);
  assert.deepEqual(request.params, JSON.parse(text).params);
  assert.equal(request.preset, "paper");
  assert.deepEqual(request.region, JSON.parse(text).region);
});

test("what is exported can be imported again", () => {
  for (const name of ["move_ball.json", "stretch_apple.json", "released_config.json"]) {
    const request = only(example(name));
    const exported = requestOf({ ...request, scene: "s000001", version: 2 });
    assert.deepEqual(only(JSON.stringify(exported)), request);
  }
  const handle = { source: [0, 0, 0], target: [1, 0, 0], radius: 1, group: 0, rotation: [0.5, 0.5, 0.5, 0.5], scale: 2 };
  const asked = requestOf({ ...only(JSON.stringify({ handles: [handle] })), scene: "s000001", version: 0 });
  assert.deepEqual(asked.handles, [handle], "turned and scaled, too");
  refused({ handles: [{ ...handle, rotation: [0, 0, 0, 0] }] }, "handles[0].rotation");
  refused({ handles: [{ ...handle, scale: 0 }] }, "handles[0].scale");
});

test("a request with a selection needs no radius, and keeps one that it has", () => {
  const { selection } = JSON.parse(example("selection.json"));
  const document = { handles: [{ source: [0, 0, 0] }, { source: [1, 0, 0], radius: 0.5 }], selection };
  const request = only(JSON.stringify(document));
  assert.deepEqual(request.selection, selection);
  const exported = requestOf({ ...request, scene: "s000001", version: 0 });
  assert.deepEqual(
    exported.handles.map((h) => h.radius),
    [undefined, 0.5],
  );
  assert.deepEqual(only(JSON.stringify(exported)), request);
  refused({ handles: [{ source: [0, 0, 0] }] }, "handles[0].radius");
  refused({ handles: [{ source: [0, 0, 0] }], selection: [] }, "handles[0].radius");
  refused({ handles: [{ source: [0, 0, 0] }], selection: [3] }, "selection[0]");
  refused({ handles: [{ source: [0, 0, 0] }], selection: {} }, "selection");
});

test("a file of several requests keeps their names and drops comments", () => {
  const requests = readRequests(example("named_requests.json"));
  assert.deepEqual(
    requests.map((r) => r.name),
    ["ball_right", "apple_up"],
  );
  assert.equal(requests[1].request.handles[0].radius, 0.2);
});

test("what is wrong in a file is named", () => {
  const released = (patch) => ({ start: [[1, 2, 3]], direction: [[0, 0, 1]], voxel_size: 0.5, ...patch });
  refused(released({ start: [] }), "start");
  refused(released({ start: [[1, 2]] }), "start[0]");
  refused(
    released({
      direction: [
        [0, 0, 1],
        [1, 0, 0],
      ],
    }),
    "direction",
  );
  refused(released({ direction: [[0, "1", 1]] }), "direction[0]");
  refused(released({ voxel_size: 0 }), "voxel_size");
  refused(released({ cluster: [-1] }), "cluster[0]");
  refused(released({ local_mask: { center: [0, 0, 0], xyz: [1, 0, 1] } }), "local_mask.xyz[1]");
  refused(released({ local_mask: { center: [0, 0, 0], size: [1, 1, 1] } }), "local_mask.size");
  refused(released({ mode: "copy" }), "mode");
  refused(released({ radius: 1 }), "radius");
  refused({ handles: [{ source: [0, 0, 0], radius: -1 }] }, "handles[0].radius");
  refused({ handles: [{ source: [0, 0, 0], radius: 1, group: 1.5 }] }, "handles[0].group");
  refused({ handles: [{ source: [0, 0, 0], radius: 1, target: null }] }, "handles[0].target");
  refused({ handles: [{ source: [0, 0, 0], radius: 1 }], extra: 1 }, "extra");
  refused({ named: { handles: [] } }, "named.handles");
  refused([1], "");
  refused({ hello: 1 }, "");
  assert.throws(() => readRequests("{"), ImportError);
});

test("a request leaves to the service what nobody chose", () => {
  const request = requestOf({
    scene: "s000001",
    version: 0,
    mode: "move",
    preset: "",
    prompt: null,
    region: null,
    handles: [{ id: 7, source: [0, 0, 0], target: null, radius: 1, group: 0, count: 12 }],
    params: { intervals: null, seed: 0, rotation: "" },
  });
  assert.deepEqual(request, {
    scene: "s000001",
    version: 0,
    mode: "move",
    handles: [{ source: [0, 0, 0], radius: 1, group: 0 }],
    params: { seed: 0 },
  });
});

test("a preview is stale when what it shows has changed, and only then", () => {
  const base = {
    scene: "s",
    version: 0,
    mode: "move",
    handles: [{ source: [0, 0, 0], radius: 1, group: 0 }],
    params: {},
  };
  const parameters = [
    { name: "intervals", part: "motion" },
    { name: "rotation", part: "motion" },
    { name: "views", part: "views" },
    { name: "seed", part: "optimisation" },
  ];
  const key = (change) => previewKey({ ...base, ...change }, parameters);
  assert.equal(key({}), key({ params: { views: 10, seed: 4 } }));
  assert.notEqual(key({}), key({ mode: "extend" }));
  assert.notEqual(key({}), key({ params: { intervals: 3 } }));
  assert.equal(
    key({ params: { intervals: 3, rotation: "none" } }),
    key({ params: { rotation: "none", intervals: 3 } }),
    "in whatever order they were chosen",
  );
  assert.notEqual(key({}), key({ params: { unheard_of: 1 } }), "it might be of the motion");
  assert.notEqual(key({}), key({ handles: [{ ...base.handles[0], radius: 2 }] }));
  assert.notEqual(key({}), key({ selection: [{ invert: true }] }));
});

test("a preset that cannot turn things is not asked what it would take", () => {
  const info = { parameters: [{ name: "interpolation", defaults: { draft: "rigid", paper: "paper" } }] };
  const request = (patch = {}, params = {}) => ({ handles: [{ source: [0, 0, 0], ...patch }], params });
  const turned = { rotation: [0, 1, 0, 0] };
  assert.equal(impossibleWith("paper", request(), info), null);
  assert.equal(impossibleWith("draft", request(turned), info), null);
  assert.match(impossibleWith("paper", request(turned), info), /“paper”/);
  assert.match(impossibleWith("paper", request({ scale: 2 }), info), /turn or size/);
  assert.match(impossibleWith("paper", { ...request(), attach: "held" }, info), /^What holds a part .* “paper”/);
  assert.match(impossibleWith("paper", { ...request(turned), attach: "held" }, info), /turn or size/);
  assert.equal(impossibleWith("draft", { ...request(), attach: "held" }, info), null);
  assert.equal(impossibleWith("paper", request(turned, { interpolation: "arap" }), info), null);
  assert.match(impossibleWith("draft", request(turned, { interpolation: "smooth" }), info), /“smooth”/);
});

test("a parameter is named for people, and its default is that of the preset", () => {
  assert.equal(labelOf("max_image_side"), "Max image side");
  const views = { name: "views", defaults: { preview: 50, draft: 24, standard: 50, paper: 50 } };
  assert.equal(usualValue(views, "draft"), 24);
  assert.equal(usualValue(views, ""), 50, "no preset is standard");
  assert.equal(usualValue({ name: "intervals", defaults: { standard: null } }, ""), null, "as the drag asks for");
  assert.equal(usualValue({ name: "rotate_sh", defaults: { standard: false } }, null), false);
});

test("an error's address leads to the part of the page it is about", () => {
  assert.deepEqual(partOf("handles[2].radius"), { part: "handle", index: 2, field: "radius" });
  assert.deepEqual(partOf("handles[0].source[1]"), { part: "handle", index: 0, field: "source" });
  assert.deepEqual(partOf("handles[1]"), { part: "handle", index: 1, field: "" });
  assert.deepEqual(partOf("params.views"), { part: "param", name: "views" });
  assert.deepEqual(partOf("region.size[0]"), { part: "region" });
  assert.deepEqual(partOf("mode"), { part: "mode" });
  assert.deepEqual(partOf("version"), { part: "request" });
  assert.deepEqual(partOf(undefined), { part: "request" });
});
