// A made-up service behind the page: the shapes of the contract over a scene of coloured points, without the engine.
// For work on the page, and for looking at it. Not a model of the real service beyond those shapes.
//
//   node tests/web/fake_server.mjs [--port 8090] [--token secret] [--slow MS] [--empty]

import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { deflateSync } from "node:zlib";

import { axes, focal, onViewPlane, project, rayThrough } from "../../web/camera.js";
import { add, addScaled, distance, dot, scale, sub, unit } from "../../web/vectors.js";

const WEB = fileURLToPath(new URL("../../web/", import.meta.url));
const TYPES = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
};
const CSP =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; " +
  "form-action 'none'; base-uri 'none'; frame-ancestors 'none'";

// --- parameters: some of each kind, as /v1/info describes them ------------------------------------------------------

const parameter = (name, type, part, usual, more) => ({
  name,
  type,
  minimum: null,
  maximum: null,
  values: null,
  unit: null,
  part,
  defaults: { preview: usual, draft: usual, standard: usual, paper: usual },
  description: `${name}, made up.`,
  ...more,
});
const PARAMETERS = [
  parameter("intervals", "integer", "motion", null, { minimum: 1, maximum: 20 }),
  parameter("strength_final", "number", "correction", 0.3, { minimum: 0, maximum: 1 }),
  parameter("views", "integer", "views", 50, { minimum: 1, maximum: 1000 }),
  parameter("exclude_views", "array", "views", [], { minimum: 0, maximum: 1000 }),
  parameter("max_image_side", "integer", "views", 512, { minimum: 16, maximum: 16384, unit: "pixels" }),
  parameter("corrector", "string", "correction", "scene", { values: ["none", "scene", "sd"] }),
  parameter("interpolation", "string", "motion", "rigid", { values: ["paper", "smooth", "rigid"] }),
  parameter("rotate_sh", "boolean", "motion", true),
  parameter("seed", "integer", "optimisation", 0, { minimum: 0, maximum: 2 ** 64 }),
];

// --- a scene of points --------------------------------------------------------------------------------------------

/** Points {p, c, n}: a chequered floor, a large ball and two small ones. y points down. */
function madeUpPoints() {
  const points = [];
  for (let x = -3; x <= 3; x += 0.025)
    for (let z = -3; z <= 3; z += 0.025) {
      const light = (Math.floor(x * 2) + Math.floor(z * 2)) & 1;
      points.push({ p: [x, 0.6, z], c: light ? [150, 146, 138] : [88, 92, 100] });
    }
  const ball = (centre, radius, colour, n) => {
    for (let i = 0; i < n; ++i) {
      // Fibonacci's sphere: even, and the same every time.
      const y = 1 - (2 * (i + 0.5)) / n;
      const ring = Math.sqrt(1 - y * y);
      const angle = i * 2.399963;
      const normal = [ring * Math.cos(angle), y, ring * Math.sin(angle)];
      const shade = 0.45 + 0.55 * Math.max(0, dot(normal, unit([-0.5, -0.8, -0.4])));
      points.push({ p: addScaled(centre, normal, radius), c: colour.map((v) => v * shade) });
    }
  };
  ball([0, 0, 0], 0.6, [222, 96, 70], 16000);
  ball([-1.2, 0.25, -0.4], 0.35, [80, 150, 230], 8000);
  ball([1.1, 0.35, 0.5], 0.25, [110, 200, 120], 5000);
  return points;
}

/** Which handle a point follows, as a function: the nearest one within whose radius it is; with a selection, the nearest. */
function follows(points, { handles, selection }) {
  if (!selection) return ({ p }) => nearestHandle(p, handles);
  const held = selected(points, selection);
  const endless = handles.map((handle) => ({ ...handle, radius: Infinity }));
  return (point) => (held.has(point) ? nearestHandle(point.p, endless) : -1);
}

/** What the drag does here: everything within a radius, or selected, follows its handle. */
function dragged(points, { handles, mode, selection }) {
  const out = [];
  const handleOf = follows(points, { handles, selection });
  for (const point of points) {
    const i = handleOf(point);
    const handle = handles[i];
    if (!handle?.target) {
      out.push(point);
      continue;
    }
    out.push({ ...point, p: add(point.p, sub(handle.target, handle.source)), moved: true });
    if (mode === "extend") out.push(point);
  }
  return out;
}

/** Which points a selection holds here: balls of a fixed size around what was clicked, and what is drawn on. */
function selected(points, selection) {
  const held = new Set();
  for (const step of selection) {
    const named = points.filter((point) => names(step, point));
    if (step.invert) points.forEach((point) => (held.has(point) ? held.delete(point) : held.add(point)));
    else if (step.op === "intersect") for (const point of held) named.includes(point) || held.delete(point);
    else for (const point of named) step.op === "subtract" ? held.delete(point) : held.add(point);
  }
  return held;
}

function names({ grow, stroke, polygon }, { p }) {
  const nearest = (centres) => Math.min(Infinity, ...centres.map((centre) => distance(p, centre)));
  if (grow) return nearest(grow.inside) < Math.min(0.5, nearest(grow.outside ?? []));
  const drawn = stroke ?? polygon;
  const seen = drawn && project({ ...drawn.camera, fov: drawn.camera.fov_y_deg }, p);
  if (!seen) return false;
  const apart = ([x, y]) => Math.hypot(seen.x - x, seen.y - y);
  return stroke ? drawn.points.some((at) => apart(at) < drawn.radius) : encloses(drawn.points, seen);
}

/** Whether a polygon encloses a pixel: it is crossed an odd number of times on the way to the right. */
function encloses(corners, { x, y }) {
  const crossed = corners.filter(([bx, by], i) => {
    const [ax, ay] = corners.at(i - 1);
    return ay > y !== by > y && x < ax + ((y - ay) * (bx - ax)) / (by - ay);
  });
  return crossed.length % 2 === 1;
}

function nearestHandle(p, handles) {
  let best = -1;
  let least = Infinity;
  handles.forEach((handle, i) => {
    const d = distance(p, handle.source);
    if (d < handle.radius && d < least) [best, least] = [i, d];
  });
  return best;
}

function draw(points, camera, what, tinted = new Set()) {
  const { width, height } = camera;
  const pixels = Buffer.alloc(width * height * 3, 0);
  const depths = new Float32Array(width * height).fill(Infinity);
  const { right, down, forward } = axes(camera);
  const f = focal(camera);
  for (const point of points) {
    const { p, c, moved } = point;
    const v = sub(p, camera.eye);
    const z = dot(v, forward);
    if (z < 0.05) continue;
    const x = (f * dot(v, right)) / z + width / 2;
    const y = (f * dot(v, down)) / z + height / 2;
    const r = Math.min(12, Math.max(0.5, (0.018 * f) / z));
    for (let j = Math.max(0, Math.round(y - r)); j < Math.min(height, Math.round(y + r)); ++j)
      for (let i = Math.max(0, Math.round(x - r)); i < Math.min(width, Math.round(x + r)); ++i) {
        const k = j * width + i;
        if (z >= depths[k]) continue;
        depths[k] = z;
        const g = what === "depth" ? Math.max(0, 255 - z * 25) : moved ? 255 : 0;
        const plain = what === "color" ? c : [g, g, g];
        const [red, green, blue] = tinted.has(point) ? plain.map((x, n) => (x + [255, 26, 153][n]) / 2) : plain;
        pixels[3 * k] = red;
        pixels[3 * k + 1] = green;
        pixels[3 * k + 2] = blue;
      }
  }
  return { pixels, depths };
}

const CRC = Int32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; ++k) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n;
});

function png(pixels, width, height) {
  const chunk = (type, data) => {
    const body = Buffer.concat([Buffer.from(type), data]);
    let crc = -1;
    for (const byte of body) crc = CRC[(crc ^ byte) & 255] ^ (crc >>> 8);
    const out = Buffer.alloc(body.length + 8);
    out.writeUInt32BE(data.length, 0);
    body.copy(out, 4);
    out.writeInt32BE(~crc, body.length + 4);
    return out;
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 2, 0, 0, 0], 8);
  const rows = Buffer.alloc(height * (1 + 3 * width));
  for (let y = 0; y < height; ++y) pixels.copy(rows, y * (1 + 3 * width) + 1, y * 3 * width, (y + 1) * 3 * width);
  return Buffer.concat([
    Buffer.from("\x89PNG\r\n\x1a\n", "latin1"),
    chunk("IHDR", header),
    chunk("IDAT", deflateSync(rows, { level: 1 })),
    chunk("IEND", Buffer.alloc(0)),
  ]);
}

// --- the service --------------------------------------------------------------------------------------------------

class Problem extends Error {
  constructor(status, code, detail, where = "") {
    super(detail);
    Object.assign(this, { status, code, detail, where });
  }
}

const id = (letter, n) => letter + String(n).padStart(6, "0");
const now = () => new Date().toISOString();

function ringOfViews(n) {
  return Array.from({ length: n }, (_, i) => {
    const angle = (2 * Math.PI * i) / n - Math.PI / 2;
    const camera = {
      eye: [4 * Math.cos(angle), -1.6, 4 * Math.sin(angle)],
      target: [0, 0.1, 0],
      up: [0, -1, 0],
      fov: 45,
      width: 800,
      height: 600,
    };
    const { right, down, forward } = axes(camera);
    const f = focal(camera);
    return {
      name: `${String(i + 1).padStart(4, "0")}.jpg`,
      width: 800,
      height: 600,
      fx: f,
      fy: f,
      cx: 400,
      cy: 300,
      cam_from_world: [right, down, forward].map((axis) => [...axis, -dot(axis, camera.eye)]),
      photo: true,
    };
  });
}

/** Starts the service; returns {port, close()}. */
export function start({ port = 0, token = null, slow = 0, empty = false, tick = 350 } = {}) {
  const scenes = new Map();
  const edits = new Map();
  const listeners = new Set();
  const sessions = new Set();
  let made = { scene: 0, edit: 0, preview: 0 };

  const addScene = (name, { dataset = null } = {}) => {
    const sceneId = id("s", ++made.scene);
    const points = madeUpPoints();
    const scene = {
      id: sceneId,
      name,
      created: now(),
      format: "ply",
      sh_degree: 3,
      up: null,
      dataset,
      versions: [{ version: 0, parent: null, edit: null, name: null, created: now(), points }],
      previews: new Map(),
      selections: new Map(),
    };
    scenes.set(sceneId, scene);
    return scene;
  };
  if (!empty) {
    addScene("three balls");
    addScene("garden", {
      dataset: {
        kind: "colmap",
        views: 24,
        photos: 24,
        psnr_mean_db: 27.4,
        psnr_worst_db: 22.1,
        psnr_worst_view: "0007.jpg",
        warnings: [],
      },
    });
  }

  const sceneJson = (scene) => ({
    id: scene.id,
    name: scene.name,
    created: scene.created,
    format: scene.format,
    gaussians: scene.versions[0].points.length,
    sh_degree: scene.sh_degree,
    bounds: { low: [-3, -0.6, -3], high: [3, 0.6, 3] },
    centre: [0, 0.2, 0],
    radius: 1.9,
    up: scene.up,
    disk_bytes: 14_700_000,
    memory_bytes: 15_200_000,
    views: scene.dataset?.views ?? 50,
    dataset: scene.dataset,
    versions: scene.versions.map(({ points, ...v }) => ({
      ...v,
      gaussians: points.length,
      disk_bytes: v.version ? 210_000 : 14_700_000,
      links: { render: `/v1/scenes/${scene.id}/versions/${v.version}/render`, pick: "", file: "" },
    })),
    links: { self: `/v1/scenes/${scene.id}`, views: `/v1/scenes/${scene.id}/views`, dataset: "" },
  });
  const findScene = (sceneId) =>
    scenes.get(sceneId) ?? fail(404, "not_found", `there is no scene "${sceneId}"`, "scene");
  const fail = (...args) => {
    throw new Problem(...args);
  };
  const findPoints = (scene, version) =>
    scene.versions.find((v) => String(v.version) === String(version))?.points ??
    scene.previews.get(version) ??
    fail(404, "not_found", `there is no version "${version}"`, "version");
  const cameraOf = ({ eye, target, up, fov_y_deg, width, height }) => ({
    eye,
    target,
    up,
    fov: fov_y_deg ?? 50,
    width,
    height,
  });

  function check(request) {
    const scene = findScene(request.scene);
    const points = findPoints(scene, request.version ?? 0);
    if (!request.handles?.length) fail(400, "invalid_argument", "expected 1 to 256 handles", "handles");
    const counts = request.handles.map(() => 0);
    const handleOf = follows(points, request);
    for (const point of points) {
      const i = handleOf(point);
      if (i >= 0) counts[i] += 1;
    }
    counts.forEach((n, i) => {
      if (n > 0) return;
      const least = Math.min(...points.map(({ p }) => distance(p, request.handles[i].source)));
      fail(
        422,
        "unprocessable",
        `0 Gaussians within ${request.handles[i].radius} of handle ${i + 1}; the nearest is ${least.toPrecision(3)} away: move the handle's source there, or raise the radius`,
        `handles[${i}].radius`,
      );
    });
    if (request.params?.corrector === "sd")
      fail(
        422,
        "unsupported",
        'this build has no corrector "sd"; available: "scene", which is the default, and "none"',
        "params.corrector",
      );
    const intervals =
      request.params?.intervals ??
      Math.min(
        20,
        Math.max(
          1,
          ...request.handles.map((h) => (h.target ? Math.ceil(distance(h.source, h.target) / (h.radius ?? 1)) : 1)),
        ),
      );
    return { scene, points, counts: counts.map((gaussians) => ({ gaussians })), intervals };
  }

  const told = (edit) => {
    for (const listener of listeners) if ([edit.id, edit.scene].includes(listener.id)) listener.send(edit);
  };
  const editJson = ({ picture, wanted, ...edit }) => edit;

  /** Carries out one edit after the other, one step per tick. */
  const timer = setInterval(() => {
    const waiting = [...edits.values()].filter((e) => e.state === "queued");
    waiting.forEach((e, i) => (e.queue_position = i + 1));
    let edit = [...edits.values()].find((e) => ["running", "stop_requested", "cancel_requested"].includes(e.state));
    if (!edit) {
      edit = waiting[0];
      if (!edit) return;
      Object.assign(edit, {
        state: "running",
        queue_position: null,
        started: now(),
        stage: "assign",
        interval: 0,
        simd: "AVX2",
      });
      return told(edit);
    }
    if (edit.state === "cancel_requested") {
      Object.assign(edit, { state: "cancelled", ended: now(), stage: null });
      return told(edit);
    }
    const stages = ["deform", "mask", "relocate"];
    const at = stages.indexOf(edit.stage);
    if (at < 0 || at === 2) {
      if (at === 2) {
        const u = edit.interval;
        const part = (k) => ({
          ...edit.request,
          handles: edit.request.handles.map((h) =>
            h.target ? { ...h, target: addScaled(h.source, sub(h.target, h.source), k / edit.intervals) } : h,
          ),
        });
        const stagesOf = (k) => ({
          before: `/v1/edits/${edit.id}/intervals/${u}/renders/${k}?stage=before`,
          deformed: `/v1/edits/${edit.id}/intervals/${u}/renders/${k}?stage=deformed`,
        });
        edit.picture.set(u, part(u));
        edit.picture.set(0, part(0));
        edit.finished_intervals = [
          ...edit.finished_intervals,
          {
            interval: u,
            seconds: 1.04,
            positions: part(u).handles.map((h) => h.target ?? h.source),
            loss: null,
            renders: [0, 1, 2, 3].map((k) => ({ view: `000${k + 1}.jpg`, stages: stagesOf(k) })),
          },
        ];
      }
      const over = edit.state === "stop_requested" || edit.interval === edit.intervals;
      if (over) {
        const scene = scenes.get(edit.scene);
        const points = dragged(findPoints(scene, edit.version), edit.picture.get(edit.interval) ?? edit.request);
        const version = scene.versions.at(-1).version + 1;
        scene.versions.push({ version, parent: edit.version, edit: edit.id, name: null, created: now(), points });
        Object.assign(edit, {
          state: "succeeded",
          stopped_early: edit.interval < edit.intervals,
          ended: now(),
          stage: null,
          progress: 1,
          eta_seconds: null,
          result_version: version,
          gaussians: { input: points.length, output: points.length, removed: 120, copies: 120, changeable: 240, crumbs: 0 },
          uncovered: [{ view: "view 1", area: 0.04, open: 0.01, open_box: [0.4, 0.5, 0.6, 0.75] }],
          timings: [
            { stage: "assign", seconds: 0.02 },
            { stage: "deform", seconds: 1.7 },
            { stage: "mask", seconds: 2.9 },
          ],
        });
        return told(edit);
      }
      edit.interval += 1;
    }
    edit.stage = stages[(at + 1) % 3];
    const steps = edit.intervals * 3;
    const done = (edit.interval - 1) * 3 + ((at + 1) % 3);
    Object.assign(edit, { progress: Math.min(0.99, done / steps), eta_seconds: ((steps - done) * tick) / 1000 });
    told(edit);
  }, tick);
  timer.unref();

  const routes = [
    [
      "GET",
      /^\/v1\/info$/,
      () => ({
        version: "0.3.0",
        simd: { target: "AVX2", available: ["AVX2", "SSE4", "EMU128"] },
        threads: 2,
        devices: ["cpu"],
        correctors: [
          { name: "none", available: true, reason: null },
          { name: "scene", available: true, reason: null },
          { name: "sd", available: false, reason: "this version cannot load a diffusion model yet" },
        ],
        formats: {
          read: ["ply", "compressed_ply", "splat", "spz", "sog", "glb"],
          write: ["ply", "compressed_ply", "splat", "spz", "sog", "glb"],
          pictures: ["png", "jpeg", "exr"],
        },
        presets: ["preview", "draft", "standard", "paper"],
        parameters: PARAMETERS,
        limits: {
          upload_bytes: 2e9,
          json_bytes: 1 << 20,
          handles: 256,
          render_side: 4096,
          queued_edits: 32,
          streams: 16,
        },
        token_required: token !== null,
        session: true,
        scene_root: true,
      }),
    ],
    ["GET", /^\/v1\/scenes$/, () => ({ scenes: [...scenes.values()].map(sceneJson) })],
    [
      "POST",
      /^\/v1\/scenes$/,
      ({ json, query, body, reply }) => {
        if (json) {
          if (!/\.(ply|spz|splat|sog|glb)$/.test(json.path))
            fail(404, "not_found", `there is no file "${json.path}" in the scene folder`, "path");
          return reply(201, sceneJson(addScene(json.name ?? json.path)));
        }
        if (body.subarray(0, 3).toString() === "bad")
          fail(422, "corrupt_data", "expected a number, found NaN", "broken.ply:vertex[1204].opacity");
        return reply(201, sceneJson(addScene(query.get("name") ?? "scene")));
      },
    ],
    ["GET", /^\/v1\/scenes\/(\w+)$/, ({ match }) => sceneJson(findScene(match[1]))],
    ["PATCH", /^\/v1\/scenes\/(\w+)$/, ({ match, json }) => sceneJson(Object.assign(findScene(match[1]), json))],
    [
      "DELETE",
      /^\/v1\/scenes\/(\w+)$/,
      ({ match, reply }) => {
        const scene = findScene(match[1]);
        const busy = [...edits.values()].find((e) => e.scene === scene.id && ["queued", "running"].includes(e.state));
        if (busy) fail(409, "conflict", `edit ${busy.id} of this scene is ${busy.state}: cancel it first`, "scene");
        scenes.delete(scene.id);
        return reply(204);
      },
    ],
    [
      "PUT",
      /^\/v1\/scenes\/(\w+)\/dataset$/,
      ({ match }) => {
        const scene = findScene(match[1]);
        scene.dataset = {
          kind: "colmap",
          views: 24,
          photos: 24,
          psnr_mean_db: 12.1,
          psnr_worst_db: 9.3,
          psnr_worst_view: "0003.jpg",
          warnings: [
            "renders differ from the photos by 12.1 dB on average: the cameras may be in another frame than the scene",
          ],
        };
        return sceneJson(scene);
      },
    ],
    [
      "DELETE",
      /^\/v1\/scenes\/(\w+)\/dataset$/,
      ({ match }) => sceneJson(Object.assign(findScene(match[1]), { dataset: null })),
    ],
    [
      "GET",
      /^\/v1\/scenes\/(\w+)\/events$/,
      ({ match, response }) => {
        findScene(match[1]);
        response.writeHead(200, { "Content-Type": "text/event-stream", "Cache-Control": "no-cache" });
        const say = (event, data) => response.write(`event: ${event}\ndata: ${JSON.stringify(data)}\n\n`);
        let last = null;
        const look = () => {
          const scene = scenes.get(match[1]);
          if (!scene) return say("gone", {}), response.end();
          const text = JSON.stringify(sceneJson(scene));
          if (text !== last) say("scene", sceneJson(scene));
          last = text;
        };
        const listener = { id: match[1], send: (edit) => (look(), say("edit", editJson(edit))) };
        listeners.add(listener);
        const looking = setInterval(look, 250);
        const living = setInterval(() => say("alive", {}), 1000);
        response.on("close", () => {
          clearInterval(looking);
          clearInterval(living);
          listeners.delete(listener);
        });
        look();
        return null;
      },
    ],
    [
      "GET",
      /^\/v1\/scenes\/(\w+)\/photo$/,
      ({ match, query, reply }) => {
        const scene = findScene(match[1]);
        const view = ringOfViews(24).find(({ name }) => scene.dataset && name === query.get("view"));
        if (!view) fail(404, "not_found", "the dataset has no photo of that name", "view");
        const { width, height, cam_from_world: rows, fy } = view;
        const eye = [0, 1, 2].map((i) => -rows.reduce((sum, row) => sum + row[i] * row[3], 0));
        const fov = (2 * Math.atan(height / 2 / fy) * 180) / Math.PI;
        const camera = { eye, target: add(eye, rows[2].slice(0, 3)), up: scale(rows[1].slice(0, 3), -1), fov, width, height };
        const { pixels } = draw(scene.versions[0].points, camera, "color");
        return reply(200, png(pixels, width, height), { "Content-Type": "image/png" });
      },
    ],
    [
      "PATCH",
      /^\/v1\/scenes\/(\w+)\/versions\/(\d+)$/,
      ({ match, json }) => {
        const scene = findScene(match[1]);
        findPoints(scene, match[2]);
        scene.versions.find((v) => v.version === Number(match[2])).name = json.name;
        return sceneJson(scene).versions.find((v) => v.version === Number(match[2]));
      },
    ],
    [
      "DELETE",
      /^\/v1\/scenes\/(\w+)\/versions\/(\d+)$/,
      ({ match, reply }) => {
        const scene = findScene(match[1]);
        const gone = scene.versions.find((v) => v.version === Number(match[2]));
        if (!gone) fail(404, "not_found", "there is no such version", "version");
        if (gone.version === 0) fail(409, "conflict", "all versions lie over version 0", "version");
        scene.versions = scene.versions.filter((v) => v !== gone);
        for (const version of scene.versions) if (version.parent === gone.version) version.parent = gone.parent;
        return reply(204);
      },
    ],
    [
      "GET",
      /^\/v1\/scenes\/(\w+)\/views$/,
      ({ match }) => {
        const scene = findScene(match[1]);
        return {
          kind: scene.dataset ? "dataset" : "virtual",
          views: ringOfViews(scene.dataset ? 24 : 50).map((v) =>
            scene.dataset ? v : { ...v, name: v.name.replace(".jpg", ""), photo: false },
          ),
        };
      },
    ],
    [
      "POST",
      /^\/v1\/scenes\/(\w+)\/versions\/(\w+)\/render$/,
      async ({ match, json, reply }) => {
        const camera = cameraOf(json.camera);
        const scene = findScene(match[1]);
        const asked = json.selection ? scene.selections.get(json.selection) : [];
        if (!asked) fail(404, "not_found", "this version has no such selection: post it again", "selection");
        const points = findPoints(scene, match[2]);
        const { pixels } = draw(points, camera, json.what ?? "color", selected(points, asked));
        if (slow) await new Promise((resolve) => setTimeout(resolve, slow));
        return reply(200, png(pixels, camera.width, camera.height), { "Content-Type": "image/png" });
      },
    ],
    [
      "POST",
      /^\/v1\/scenes\/(\w+)\/versions\/(\w+)\/pick$/,
      ({ match, json }) => {
        const points = findPoints(findScene(match[1]), match[2]);
        const within = (point, r) => points.reduce((n, { p }) => n + (distance(p, point) < r), 0);
        const answer = (point, depth, normal) => ({
          hit: true,
          point,
          depth,
          normal,
          gaussian: depth === null ? null : 1,
          gaussians_in_radius: json.radius ? within(point, json.radius) : null,
        });
        if (json.point) return answer(json.point, null, null);
        const camera = cameraOf(json.camera);
        const { depths } = draw(points, camera, "color");
        const depth = depths[Math.floor(json.y) * camera.width + Math.floor(json.x)];
        if (!(depth < Infinity))
          return { hit: false, point: null, depth: null, normal: null, gaussian: null, gaussians_in_radius: null };
        const { forward } = axes(camera);
        const point = onViewPlane(camera, json.x, json.y, addScaled(camera.eye, forward, depth));
        return answer(point, depth, scale(rayThrough(camera, json.x, json.y).direction, -1));
      },
    ],
    [
      "POST",
      /^\/v1\/scenes\/(\w+)\/versions\/(\w+)\/select$/,
      ({ match, json }) => {
        const scene = findScene(match[1]);
        const held = [...selected(findPoints(scene, match[2]), json.selection)].map(({ p }) => p);
        const name = id("q", scene.selections.size + 1);
        scene.selections.set(name, json.selection);
        const over = (reduce) => [0, 1, 2].map((axis) => (held.length ? reduce(held.map((p) => p[axis])) : 0));
        return {
          id: name,
          count: held.length,
          bounds: {
            low: over((x) => x.reduce((a, b) => Math.min(a, b))),
            high: over((x) => x.reduce((a, b) => Math.max(a, b))),
          },
          centre: over((x) => x.reduce((a, b) => a + b) / x.length),
          undecided: 0,
          border: json.selection.some(({ grow }) => grow?.whole) ? { wider: 0, more: false, less: false } : null,
          warnings: held.length ? [] : ["nothing is selected"],
        };
      },
    ],
    [
      "GET",
      /^\/v1\/scenes\/(\w+)\/versions\/(\w+)\/file$/,
      ({ match, query, reply }) => {
        findPoints(findScene(match[1]), match[2]);
        return reply(200, Buffer.from("ply\nformat binary_little_endian 1.0\nend_header\n"), {
          "Content-Type": "application/octet-stream",
          "Content-Disposition": `attachment; filename="scene-v${match[2]}.${query.get("format") ?? "ply"}"`,
        });
      },
    ],
    [
      "POST",
      /^\/v1\/previews$/,
      ({ json }) => {
        const { scene, points, counts, intervals } = check(json);
        const version = id("p", ++made.preview);
        scene.previews.set(version, dragged(points, json));
        if (scene.previews.size > 16) scene.previews.delete(scene.previews.keys().next().value);
        const moved = counts.reduce((n, { gaussians }) => n + gaussians, 0);
        return {
          scene: scene.id,
          version,
          parent: json.version ?? 0,
          expires: new Date(Date.now() + 600_000).toISOString(),
          handles: counts.map((c, i) => ({ ...c, position: json.handles[i].target ?? json.handles[i].source })),
          intervals,
          gaussians: { input: points.length, output: points.length, removed: 0, copies: moved, changeable: 2 * moved, crumbs: 0 },
          seconds: 0.08,
          warnings: json.prompt ? ["without effect on this edit: prompt"] : [],
          links: {},
        };
      },
    ],
    [
      "POST",
      /^\/v1\/edits$/,
      ({ json, query, reply }) => {
        const { counts, intervals } = check(json);
        const preset = json.preset ?? "standard";
        const request = {
          ...json,
          preset,
          params: {
            corrector: preset === "preview" ? "none" : "scene",
            views: 50,
            max_image_side: 512,
            rotation: "shortest_arc",
            interpolation: "paper",
            seed: 0,
            ...json.params,
            intervals,
          },
        };
        if (query.get("validate_only") === "true")
          return {
            valid: true,
            handles: counts,
            views: request.params.views,
            intervals,
            estimate: { seconds: 1.1 * intervals, memory_bytes: 184_000_000 },
            request,
            warnings: [],
          };
        const editId = id("e", ++made.edit);
        const edit = {
          id: editId,
          scene: json.scene,
          version: json.version ?? 0,
          state: "queued",
          stopped_early: false,
          queue_position: 1,
          stage: null,
          progress: 0,
          eta_seconds: null,
          interval: 0,
          intervals,
          finished_intervals: [],
          handles: counts,
          request,
          timings: [],
          gaussians: null,
          uncovered: [],
          warnings: [],
          result_version: null,
          error: null,
          created: now(),
          started: null,
          ended: null,
          simd: null,
          links: { self: `/v1/edits/${editId}` },
          picture: new Map(),
        };
        edits.set(editId, edit);
        return reply(202, editJson(edit), { Location: `/v1/edits/${editId}`, "Retry-After": "1" });
      },
    ],
    [
      "GET",
      /^\/v1\/edits$/,
      ({ query }) => ({
        edits: [...edits.values()]
          .filter((e) => !query.get("scene") || e.scene === query.get("scene"))
          .reverse()
          .map(editJson),
      }),
    ],
    [
      "GET",
      /^\/v1\/edits\/(\w+)$/,
      ({ match, reply, request }) => {
        const edit = edits.get(match[1]) ?? fail(404, "not_found", "there is no such edit", "edit");
        const text = JSON.stringify(editJson(edit));
        const etag = `"${Buffer.from(`${edit.state}${edit.progress}${edit.queue_position}${edit.stage}`).toString("base64url")}"`;
        if (request.headers["if-none-match"] === etag) return reply(304);
        return reply(200, Buffer.from(text), { "Content-Type": "application/json", ETag: etag });
      },
    ],
    [
      "GET",
      /^\/v1\/edits\/(\w+)\/events$/,
      ({ match, response }) => {
        const edit = edits.get(match[1]) ?? fail(404, "not_found", "there is no such edit", "edit");
        response.writeHead(200, { "Content-Type": "text/event-stream", "Cache-Control": "no-cache" });
        let n = 0;
        const listener = {
          id: edit.id,
          send: (e) => {
            response.write(`event: edit\nid: ${++n}\ndata: ${JSON.stringify(editJson(e))}\n\n`);
            if (["succeeded", "failed", "cancelled"].includes(e.state)) response.end();
          },
        };
        listeners.add(listener);
        response.on("close", () => listeners.delete(listener));
        listener.send(edit);
        return null;
      },
    ],
    [
      "GET",
      /^\/v1\/edits\/(\w+)\/intervals\/(\d+)\/renders\/(\d+)$/,
      ({ match, query, reply }) => {
        const edit = edits.get(match[1]) ?? fail(404, "not_found", "there is no such edit");
        const u = Number(match[2]) - (query.get("stage") === "before" ? 1 : 0);
        const points = dragged(findPoints(scenes.get(edit.scene), edit.version), edit.picture.get(u));
        const angle = Number(match[3]) * 0.5 - 1;
        const camera = {
          eye: [4 * Math.sin(angle), -1.4, -4 * Math.cos(angle)],
          target: [0, 0.1, 0],
          up: [0, -1, 0],
          fov: 40,
          width: 512,
          height: 384,
        };
        return reply(200, png(draw(points, camera, "color").pixels, 512, 384), { "Content-Type": "image/png" });
      },
    ],
    [
      "POST",
      /^\/v1\/edits\/(\w+)\/(stop|cancel)$/,
      ({ match }) => {
        const edit = edits.get(match[1]) ?? fail(404, "not_found", "there is no such edit");
        if (match[2] === "stop") {
          if (edit.finished_intervals.length === 0)
            fail(409, "conflict", "no interval is finished yet: wait for the first, or cancel");
          edit.state = "stop_requested";
        } else if (edit.state === "queued")
          Object.assign(edit, { state: "cancelled", ended: now(), queue_position: null });
        else edit.state = "cancel_requested";
        told(edit);
        return editJson(edit);
      },
    ],
    [
      "DELETE",
      /^\/v1\/edits\/(\w+)$/,
      ({ match, reply }) => {
        edits.delete(match[1]);
        return reply(204);
      },
    ],
  ];

  const server = createServer(async (request, response) => {
    const url = new URL(request.url, "http://localhost");
    const reply = (status, content, headers = {}) => {
      const bytes = Buffer.isBuffer(content)
        ? content
        : content === undefined
          ? Buffer.alloc(0)
          : Buffer.from(JSON.stringify(content));
      const type = content === undefined ? {} : { "Content-Type": "application/json" };
      response.writeHead(status, {
        "Cache-Control": "no-cache",
        "X-Content-Type-Options": "nosniff",
        ...type,
        ...headers,
      });
      response.end(bytes);
      return null;
    };
    try {
      if (!url.pathname.startsWith("/v1/")) {
        const path = join(WEB, normalize(url.pathname === "/" ? "/index.html" : url.pathname));
        const file = await readFile(path).catch(() => fail(404, "not_found", "no such file"));
        return reply(200, file, {
          "Content-Type": TYPES[extname(path)] ?? "text/plain",
          "Content-Security-Policy": CSP,
        });
      }
      const chunks = [];
      for await (const chunk of request) chunks.push(chunk);
      const body = Buffer.concat(chunks);
      if (url.pathname === "/v1/session") {
        if (request.method === "POST" && request.headers.authorization !== `Bearer ${token}` && token !== null)
          fail(401, "unauthorized", "the token is not this service's");
        const session = `s${sessions.size}`;
        if (request.method === "POST") sessions.add(session);
        return reply(204, undefined, {
          "Set-Cookie": `splatdrag_session=${request.method === "POST" ? session : ""}; HttpOnly; SameSite=Strict; Path=/`,
        });
      }
      const session = /splatdrag_session=(\w+)/.exec(request.headers.cookie ?? "")?.[1];
      if (token !== null && !sessions.has(session)) fail(401, "unauthorized", "this service needs a token");
      const route = routes.find(([method, path]) => method === request.method && path.test(url.pathname));
      if (!route) fail(404, "not_found", `there is no ${request.method} ${url.pathname}`);
      const json = /json/.test(request.headers["content-type"] ?? "") ? JSON.parse(body.toString()) : null;
      const answer = await route[2]({
        match: route[1].exec(url.pathname),
        query: url.searchParams,
        json,
        body,
        reply,
        request,
        response,
      });
      if (answer !== null) reply(200, answer);
    } catch (error) {
      const { status = 500, code = "internal", detail = String(error.stack), where } = error;
      reply(
        status,
        { type: "about:blank", title: code, status, detail, code, ...(where ? { where } : {}), request_id: "r1" },
        { "Content-Type": "application/problem+json" },
      );
    }
  });
  return new Promise((resolve) => {
    server.listen(port, "127.0.0.1", () =>
      resolve({
        port: server.address().port,
        close: () => {
          clearInterval(timer);
          server.closeAllConnections();
          return new Promise((done) => server.close(done));
        },
      }),
    );
  });
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const option = (name) => {
    const i = process.argv.indexOf(`--${name}`);
    return i < 0 ? undefined : process.argv[i + 1];
  };
  const { port } = await start({
    port: Number(option("port") ?? 8090),
    token: option("token") ?? null,
    slow: Number(option("slow") ?? 0),
    empty: process.argv.includes("--empty"),
  });
  process.stdin.resume();
  console.log(`http://127.0.0.1:${port}/`);
}
