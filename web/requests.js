// Edit requests: from what is on the screen, and from and to files. The names are those of the service's contract.

import { isMoved } from "./motion.js";
import { add } from "./vectors.js";

/** A file that cannot be imported: what is wrong, and where in it. */
export class ImportError extends Error {
  constructor(detail, where = "") {
    super(where ? `${where}: ${detail}` : detail);
    Object.assign(this, { name: "ImportError", detail, where });
  }
}

/** The request that the screen describes. What is left to the service's defaults is left out. */
export function requestOf(state) {
  // Where nothing moves, what is healed is removed: then all that a run does is to heal it.
  if (onlyHeals(state)) return requestOf({ ...state, mode: "remove", selection: state.heal });
  const { scene, version, mode, preset, prompt, handles, selection = [], heal = [], attach, region, params } = state;
  const { negative_prompt, lora, allow_slow, crumbs, shadow, settle } = state;
  const goes = mode !== "remove"; // else targets stay on the screen, for when the mode changes back
  const leaves = selection.length > 0 && mode !== "extend"; // what goes along with it is asked for there alone
  const given = Object.entries(params ?? {}).filter(
    ([, value]) => value !== null && value !== undefined && value !== "",
  );
  return {
    scene,
    version,
    mode,
    ...(preset ? { preset } : {}),
    ...(prompt ? { prompt } : {}),
    ...(negative_prompt ? { negative_prompt } : {}),
    ...(lora ? { lora } : {}),
    ...(allow_slow ? { allow_slow } : {}),
    handles: handles.map((handle) => ({
      source: handle.source,
      ...(goes && handle.target ? { target: handle.target } : {}),
      ...radiusGiven(handle, selection),
      group: handle.group,
      ...(goes && handle.rotation ? { rotation: handle.rotation } : {}),
      ...(goes && handle.scale ? { scale: handle.scale } : {}),
    })),
    ...(selection.length ? { selection } : {}),
    ...(heal.length ? { heal } : {}),
    ...(attach ? { attach } : {}),
    ...(crumbs && leaves ? { crumbs } : {}),
    ...(shadow && leaves ? { shadow } : {}),
    ...(settle && selection.length && mode === "move" ? { settle } : {}),
    ...(region ? { region } : {}),
    ...(given.length ? { params: Object.fromEntries(given) } : {}),
  };
}

/** Is it only to be healed, what is marked? Nothing else is placed. */
const onlyHeals = ({ handles, selection = [], heal = [] }) => heal.length > 0 && handles.length + selection.length === 0;

/** Is there anything that could be sent: something to take hold of, to remove, or to heal? */
export const isStated = (state) =>
  state.handles.length > 0 || (state.mode === "remove" && state.selection?.length > 0) || onlyHeals(state);

/** Would it change the scene? What is removed goes nowhere; else a handle has a target. */
export const changesScene = (state) =>
  isStated(state) && (state.mode === "remove" || onlyHeals(state) || state.handles.some(isMoved));

/** A handle's sphere says what moves only where no selection does. With one, a radius is given if somebody gave one. */
function radiusGiven({ radius, grip = null }, selection) {
  if (selection.length === 0) return { radius };
  return grip === null ? {} : { radius: grip };
}

/** What of the screen decides how a preview looks: two equal texts, the same preview. It shows where Gaussians go, so of
 *  the `parameters` that the service describes those of the motion count, and any that it does not describe. */
export function previewKey(request, parameters = []) {
  const { handles, selection, attach, crumbs, settle, mode, region, params = {}, preset, scene, version } = request; // healing shows later
  const others = new Set(parameters.filter(({ part }) => part !== "motion").map(({ name }) => name));
  const motion = Object.entries(params).filter(([name]) => !others.has(name));
  motion.sort(([a], [b]) => (a < b ? -1 : 1));
  return JSON.stringify({ scene, version, handles, selection, attach, crumbs, settle, mode, region, preset, motion });
}

/** "max_image_side" as a person reads it. */
export const labelOf = (name) => name[0].toUpperCase() + name.slice(1).replaceAll("_", " ");

/** What a parameter is if nobody gives it; null: that depends on the drag. A request without a preset is "standard". */
export const usualValue = (parameter, preset) => parameter.defaults[preset || "standard"] ?? null;

/** What an error's address points to: {part: "handle", index, field}, {part: "param", name}, {part: "region"},
 *  {part: "mode" | "preset" | ...}, or {part: "request"} for anything else. */
export function partOf(where = "") {
  const handle = /^handles\[(\d+)\](?:\.(\w+))?/.exec(where);
  if (handle) return { part: "handle", index: Number(handle[1]), field: handle[2] ?? "" };
  const param = /^params\.(\w+)/.exec(where);
  if (param) return { part: "param", name: param[1] };
  if (/^region\b/.test(where)) return { part: "region" };
  if (/^(mode|preset|handles|prompt|negative_prompt|lora|allow_slow|crumbs|shadow|settle)$/.test(where)) return { part: where };
  return { part: "request" };
}

/** Reads a request file: an edit request, a configuration as released with 3DGS-Drag, or several of either by name.
 *    returns  [{name, request}], at least one; name is "" in a file of one
 *    throws   ImportError */
export function readRequests(text) {
  let document;
  try {
    document = JSON.parse(text);
  } catch (error) {
    throw new ImportError(`this is not JSON (${error.message})`);
  }
  if (!isObject(document)) throw new ImportError("expected a JSON object");
  if (isEither(document)) return [{ name: "", request: readEither(document, "") }];
  const named = Object.entries(document).filter(([, value]) => typeof value !== "string");
  if (named.length === 0 || !named.every(([, value]) => isObject(value) && isEither(value)))
    throw new ImportError(
      "expected an edit request (with handles) or a 3DGS-Drag configuration (with start, direction and voxel_size)",
    );
  return named.map(([name, value]) => ({ name, request: readEither(value, name) }));
}

const isObject = (value) => typeof value === "object" && value !== null && !Array.isArray(value);
const isRequest = (document) => "handles" in document || "selection" in document;
const isReleased = (document) => ["start", "direction", "voxel_size"].some((name) => name in document);
const isEither = (document) => isRequest(document) || isReleased(document);

function readEither(document, where) {
  return isRequest(document) ? readRequest(document, where) : readReleased(document, where);
}

const within = (where, name) => (where ? `${where}.${name}` : name);

function known(document, names, where) {
  for (const name of Object.keys(document))
    if (!names.includes(name))
      throw new ImportError(`unknown field; known here: ${names.join(", ")}`, within(where, name));
}

function point(value, where) {
  if (Array.isArray(value) && value.length === 3 && value.every(Number.isFinite)) return [...value];
  throw new ImportError("expected three numbers", where);
}

function quaternion(value, where) {
  if (Array.isArray(value) && value.length === 4 && value.every(Number.isFinite) && value.some((x) => x !== 0)) return [...value];
  throw new ImportError("expected four numbers that are not all 0", where);
}

function positive(value, where) {
  if (Number.isFinite(value) && value > 0) return value;
  throw new ImportError("expected a number above 0", where);
}

function edges(value, where) {
  return point(value, where).map((edge, i) => positive(edge, `${where}[${i}]`));
}

function groupNumber(value, where) {
  if (Number.isInteger(value) && value >= 0) return value;
  throw new ImportError("expected a whole number from 0 up", where);
}

function list(value, where, count) {
  if (!Array.isArray(value) || value.length === 0) throw new ImportError("expected a list with something in it", where);
  if (count !== undefined && value.length !== count)
    throw new ImportError(`expected ${count} elements, as many as start has; found ${value.length}`, where);
  return value;
}

function modeOf(value, where) {
  if (["move", "extend", "remove"].includes(value)) return value;
  throw new ImportError('expected "move", "extend" or "remove"', where);
}

/** One of the names, or null where none is given. */
function nameAmong(names, value, where) {
  if (value === undefined || names.includes(value)) return value ?? null;
  throw new ImportError(`expected one of ${names.map((name) => JSON.stringify(name)).join(", ")}`, where);
}

const FIELDS =
  "scene version mode preset prompt negative_prompt lora allow_slow handles selection heal attach crumbs shadow settle region params".split(" ");

function readRequest(document, where) {
  known(document, FIELDS, where);
  const mode = modeOf(document.mode ?? "move", within(where, "mode"));
  const selection = readSelection(document.selection, within(where, "selection"));
  const heal = readSelection(document.heal, within(where, "heal"));
  const needless = mode === "remove" && selection.length > 0 && (document.handles ?? []).length === 0;
  const handles = (needless ? [] : list(document.handles, within(where, "handles"))).map((handle, i) => {
    const at = within(where, `handles[${i}]`);
    if (!isObject(handle)) throw new ImportError("expected an object", at);
    known(handle, ["source", "target", "radius", "group", "rotation", "scale"], at);
    return {
      source: point(handle.source, `${at}.source`),
      target: handle.target === undefined ? null : point(handle.target, `${at}.target`),
      ...readRadius(handle.radius, selection, `${at}.radius`),
      group: groupNumber(handle.group ?? 0, `${at}.group`),
      ...(handle.rotation === undefined ? {} : { rotation: quaternion(handle.rotation, `${at}.rotation`) }),
      ...(handle.scale === undefined ? {} : { scale: positive(handle.scale, `${at}.scale`) }),
    };
  });
  let region = null;
  if (document.region !== undefined) {
    const at = within(where, "region");
    if (!isObject(document.region)) throw new ImportError("expected an object", at);
    known(document.region, ["center", "size"], at);
    region = { center: point(document.region.center, `${at}.center`), size: edges(document.region.size, `${at}.size`) };
  }
  const params = document.params ?? {};
  if (!isObject(params)) throw new ImportError("expected an object", within(where, "params"));
  return {
    mode,
    preset: document.preset ?? null,
    prompt: document.prompt ?? null,
    negative_prompt: document.negative_prompt ?? null,
    lora: document.lora ?? null,
    allow_slow: document.allow_slow ?? false,
    handles,
    selection,
    heal,
    attach: nameAmong(["auto", "held", "free"], document.attach, within(where, "attach")),
    crumbs: nameAmong(["move", "remove", "keep"], document.crumbs, within(where, "crumbs")),
    shadow: nameAmong(["move", "remove", "keep"], document.shadow, within(where, "shadow")),
    settle: nameAmong(["auto", "off"], document.settle, within(where, "settle")),
    region,
    params: { ...params },
  };
}

/** Operations as they are: what each may hold is the service's to judge. */
function readSelection(value, where) {
  if (value === undefined || (Array.isArray(value) && value.length === 0)) return [];
  return list(value, where).map((operation, i) => {
    if (!isObject(operation)) throw new ImportError("expected an object", `${where}[${i}]`);
    return operation;
  });
}

/** The radius of a handle, which a selection makes needless; null: the page's own. */
function readRadius(value, selection, where) {
  if (selection.length === 0) return { radius: positive(value, where) };
  return { radius: null, grip: value === undefined ? null : positive(value, where) };
}

function readReleased(document, where) {
  known(document, ["start", "direction", "voxel_size", "cluster", "local_mask", "mode"], where);
  const at = (name) => within(where, name);
  const start = list(document.start, at("start"));
  const directions = list(document.direction, at("direction"), start.length);
  const radius = positive(document.voxel_size, at("voxel_size"));
  const cluster = document.cluster === undefined ? null : list(document.cluster, at("cluster"), start.length);
  const handles = start.map((value, i) => {
    const source = point(value, at(`start[${i}]`));
    const direction = point(directions[i], at(`direction[${i}]`));
    // The released program moves a handle of zero direction by nothing: an anchor.
    const still = direction.every((d) => d === 0);
    return {
      source,
      target: still ? null : add(source, direction),
      radius,
      group: cluster ? groupNumber(cluster[i], at(`cluster[${i}]`)) : 0,
    };
  });
  let region = null;
  if (document.local_mask !== undefined) {
    const mask = document.local_mask;
    if (!isObject(mask)) throw new ImportError("expected an object", at("local_mask"));
    known(mask, ["center", "xyz"], at("local_mask"));
    region = { center: point(mask.center, at("local_mask.center")), size: edges(mask.xyz, at("local_mask.xyz")) };
  }
  return {
    mode: modeOf(document.mode ?? "move", at("mode")),
    preset: null,
    prompt: null,
    negative_prompt: null,
    lora: null,
    allow_slow: false,
    handles,
    selection: [],
    heal: [],
    attach: null,
    crumbs: null,
    shadow: null,
    settle: null,
    region,
    params: {},
  };
}

/** Why a preset cannot carry a request out, as far as that is known without asking; null: it may. */
export function impossibleWith(preset, { params = {}, handles, attach }, info) {
  const turns = handles.some(({ rotation, scale }) => rotation || scale);
  const parameter = info?.parameters?.find(({ name }) => name === "interpolation");
  const interpolation = params.interpolation ?? parameter?.defaults[preset];
  // What is moved as one piece is an elastic body, where it is selected.
  if (!interpolation || interpolation === "arap" || (interpolation === "rigid" && !params.interpolation)) return null;
  if (turns) return `It moves things, and does not turn or size them: its interpolation is “${interpolation}”.`;
  if (!attach) return null;
  return `What holds a part can be chosen only with the interpolation “arap”, not with “${interpolation}”.`;
}
