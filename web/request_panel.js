// The panel of the request besides its handles, with its buttons: preview, estimate, run; import and export.

import { askChoice, say } from "./dialogs.js";
import { attrs, button, h, problemPlace, problemText, row, showProblem, text } from "./dom.js";
import { choice, labelled, pointField, segments, toggle } from "./fields.js";
import { bytes, count, counted, duration, gaussians, said } from "./format.js";
import { hasDiffusion, paramFields } from "./params.js";
import { buildPresets, runPresets } from "./presets.js";
import { changesScene, isStated, partOf, readRequests } from "./requests.js";
import { whatMoves } from "./selection.js";

const CONSTRAINTS = [
  ["view", "View", "In the plane that faces you (V)"],
  ["surface", "Surface", "On the surface under the pointer: what is dragged stands on it (U)"],
  ["level", "Level", "At its height above the ground (L)"],
  ["x", "X", "Along the x axis (X)"],
  ["y", "Y", "Along the y axis (Y)"],
  ["z", "Z", "Along the z axis (Z)"],
  ["normal", "Normal", "Along the surface normal where the handle was placed (N)"],
];

export function buildRequestPanel(editor) {
  const { store } = editor;
  const setParam = (name, value) => {
    const { [name]: _, ...rest } = store.state.params;
    editor.settle({ params: value === null || value === "" ? rest : { ...rest, [name]: value } });
  };

  // --- how targets are dragged, and what the drag does
  const constraint = segments({
    label: "Drag targets",
    testid: "constraint",
    options: CONSTRAINTS,
    changed: (value) => store.set({ constraint: value }),
  });
  const mode = segments({
    label: "Mode",
    testid: "mode",
    options: [
      ["move", "Move", "What is dragged leaves its old place"],
      ["extend", "Extend", "What is dragged is drawn out: what lies between is filled"],
      ["remove", "Remove", "What is selected, or in the handles' spheres, goes; what it hid is completed"],
    ],
    changed: (value) => editor.settle({ mode: value }),
  });

  // --- region
  const regionOn = toggle({
    label: "Only within a box",
    testid: "region-on",
    title: "Only Gaussians inside of the box are dragged",
    changed: (on) => editor.settle({ region: on ? boxAround(editor) : null }),
  });
  const centre = pointField({
    label: "Box centre",
    testid: "region-center",
    changed: (p) => editor.settle({ region: { ...store.state.region, center: p } }),
  });
  const size = pointField({
    label: "Box size",
    testid: "region-size",
    min: 0,
    changed: (p) => p.every((e) => e > 0) && editor.settle({ region: { ...store.state.region, size: p } }),
  });
  const regionProblem = problemPlace("region-problem");
  const regionFields = h("div", {}, labelled("Centre", centre.element), labelled("Size (full edges)", size.element));

  // --- parameters
  const preset = choice({
    label: "Preset",
    testid: "preset",
    options: [["", "default"]],
    changed: (value) => editor.settle({ preset: value }),
  });
  /** What becomes of something that goes along with a selection, unless it is asked to go away or to stay. */
  const fate = (label, name, [along, away, stays]) => {
    const options = [["", along], ["remove", away], ["keep", stays]];
    const words = choice({ label, testid: name, options, changed: (value) => editor.settle({ [name]: value || null }) });
    const field = labelled(label, words.element);
    const update = (state) => {
      field.hidden = state.selection.length === 0 || state.mode === "extend";
      words.update(state[name] === "move" ? "" : (state[name] ?? ""));
    };
    return { field, update };
  };
  const crumbs = fate("Crumbs", "crumbs", ["go along", "go away", "stay"]);
  crumbs.field.title = "Small pieces of the part that the selection has left out";
  const shadow = fate("Shadow", "shadow", ["goes along", "goes away", "stays"]);
  shadow.field.title = "Of the part, on what it stands on or next to: a run shows what becomes of it";
  const settle = choice({
    label: "Set down",
    testid: "settle",
    options: [
      ["", "on what it stands on"],
      ["off", "where handles say"],
    ],
    changed: (value) => editor.settle({ settle: value || null }),
  });
  const settleField = labelled("Set down", settle.element);
  settleField.title = "A part that handles lift off a floor by a little, or sink into it, or tilt, arrives standing";
  const params = paramFields(setParam);
  const also = h("p", { class: "note", hidden: true, testid: "other-params" });
  const promptField = h("input", {
    type: "text",
    maxlength: 4096,
    testid: "prompt",
    "aria-label": "Prompt",
    placeholder: "a photo of sks scene",
    title: "What the scene shows: the diffusion model is trained and asked with it",
  });
  promptField.addEventListener("change", () => editor.settle({ prompt: promptField.value.trim() || null }));
  const lora = choice({
    label: "Adapter",
    testid: "lora",
    options: [["", "none"]],
    changed: (value) => editor.settle({ lora: value || null }),
  });
  const loraField = labelled("Adapter", lora.element);
  loraField.title = "What the diffusion model paints with beside what it learns of the scene, such as one for few steps";
  const slow = toggle({
    label: "It may take hours",
    testid: "allow-slow",
    title: "Without a graphics card networks work for hours: Estimate tells for how long",
    changed: (on) => editor.settle({ allow_slow: on }),
  });
  const painted = h("div", { testid: "painted" }, labelled("Prompt", promptField), loraField);
  const paramProblem = problemPlace("param-problem");
  const settings = h(
    "details",
    { class: "settings", testid: "settings" },
    h("summary", {}, "Settings"),
    labelled("Preset", preset.element),
    crumbs.field,
    shadow.field,
    settleField,
    params.element,
    painted,
    slow.element,
    regionOn.element,
    regionFields,
    regionProblem,
    also,
  );

  // --- files
  const file = h("input", {
    type: "file",
    accept: ".json,application/json",
    hidden: true,
    testid: "import-file",
    "aria-label": "Request file",
  });
  const importProblem = problemPlace("import-problem");
  file.addEventListener("change", async () => {
    const [chosenFile] = file.files;
    file.value = "";
    if (chosenFile) await importFile(editor, chosenFile, importProblem);
  });
  const files = row(
    button("Import…", "import", () => file.click(), {
      title: "An edit request, or a configuration as released with 3DGS-Drag",
    }),
    button("Export", "export", () => exportFile(editor)),
    file,
  );

  // --- preview and run
  const auto = toggle({
    label: "Preview by itself",
    testid: "auto-preview",
    title: "Preview again whenever a handle has been moved",
    changed: (on) => store.set({ autoPreview: on }),
  });
  const repair = toggle({
    label: "Repair by itself",
    testid: "auto-repair",
    title: "A thing that was dragged is repaired as a draft as soon as it is let go; each draft is a version",
    changed: (on) => store.set({ draftOnRelease: on }),
  });
  const large = (label, testid, title, onclick, kind = null) => button(label, testid, onclick, { class: kind, title });
  const preview = large("Preview", "preview", "Preview (P)", () => editor.preview());
  const estimate = large("Estimate", "estimate", "What a run will take", () => {
    presets.ask();
    editor.estimate();
  });
  const run = large("Run edit", "run", null, () => editor.run(), "primary");
  const problem = problemPlace("run-problem");
  const answer = h("div", { class: "answer", role: "status", testid: "run-answer" });

  const moving = h("p", { class: "note", testid: "what-moves" });
  const element = h(
    "section",
    { class: "run" },
    moving,
    labelled("Drag targets", constraint.element),
    labelled("Mode", mode.element),
    settings,
    paramProblem,
    h("div", { class: "row between" }, files, h("div", {}, auto.element, repair.element)),
    importProblem,
  );
  const presets = buildPresets(editor);
  const footer = h(
    "div",
    { class: "footer" },
    answer,
    problem,
    presets.element,
    h("div", { class: "row buttons" }, preview, estimate, run),
  );

  store.watch(
    [
      ...["constraint", "mode", "region", "preset", "crumbs", "shadow", "settle", "selection", "params", "autoPreview", "draftOnRelease"],
      ...["info", "handles", "scene", "prompt", "lora", "allow_slow"],
    ],
    (state) => {
      constraint.update(state.constraint);
      mode.update(state.mode);
      regionOn.update(state.region !== null);
      regionFields.hidden = state.region === null;
      if (state.region) {
        centre.update(state.region.center);
        size.update(state.region.size);
      }
      preset.options([["", "default"], ...runPresets(state.info).map((name) => [name, name])]);
      preset.update(state.preset);
      crumbs.update(state);
      shadow.update(state);
      settleField.hidden = state.selection.length === 0 || state.mode !== "move";
      settle.update(state.settle === "auto" ? "" : (state.settle ?? ""));
      params.update(state.info, state.params, state.preset);
      painted.hidden = !(state.params.corrector === "sd" && hasDiffusion(state.info));
      promptField.value = state.prompt ?? "";
      // One that a request names stays in sight where the service has it no longer.
      const loras = [...new Set([...(state.info?.loras ?? []), ...(state.lora ? [state.lora] : [])])];
      loraField.hidden = loras.length === 0;
      lora.options([["", "none"], ...loras.map((name) => [name, name])]);
      lora.update(state.lora ?? "");
      slow.element.hidden = painted.hidden && state.params.perceptual !== "lpips";
      slow.update(state.allow_slow);
      auto.update(state.autoPreview);
      repair.update(state.draftOnRelease);
      const others = Object.keys(state.params).filter((name) => !params.shows(name));
      if (state.prompt && painted.hidden) others.push(`prompt “${state.prompt}”`);
      if (state.lora && painted.hidden) others.push(`adapter “${state.lora}”`);
      also.hidden = others.length === 0;
      text(also, `Also set, by the imported request: ${others.join(", ")}`);
    },
  );

  store.watch(["selection", "selectionAnswer", "heal", "healing"], (state) => text(moving, whatMoves(state)));
  store.watch(
    [
      ...["handles", "selection", "previewing", "submitting", "problem", "preview", "estimate", "scene", "version"],
      ...["region", "mode", "preset", "crumbs", "shadow", "settle", "attach", "params", "prompt", "lora", "allow_slow"],
    ],
    (state) => {
      const ready = state.scene !== null && isStated(state);
      const moves = changesScene(state);
      preview.disabled = !ready || !moves;
      estimate.disabled = !ready || !moves || state.submitting; // anchors alone ask for nothing
      run.disabled = !ready || !moves || state.submitting;
      attrs(preview, { "aria-busy": String(state.previewing) });
      text(preview, state.previewing ? "Previewing…" : "Preview");
      const at = state.problem ? partOf(state.problem.error.where) : {};
      const here = (...parts) => (state.problem && parts.includes(at.part) ? state.problem.error : null);
      showProblem(regionProblem, here("region"));
      showProblem(paramProblem, here("param", "mode", "preset", "crumbs", "shadow", "settle"));
      showProblem(problem, here("request", "handles", "prompt", "negative_prompt", "lora", "allow_slow"));
      if (here("region") || here("param", "preset", "crumbs", "shadow", "settle")) settings.open = true;
      if (here("handle") && !state.handles[at.index]) showProblem(problem, state.problem.error);
      answer.replaceChildren(...answers(editor, state));
    },
  );

  return { element, footer };
}

/** What the service last said about this very request. */
function answers(editor, state) {
  const { preview, estimate, scene } = state;
  if (!scene) return [];
  const lines = [];
  if (estimate && estimate.key === JSON.stringify(editor.request())) {
    lines.push(
      h(
        "p",
        { testid: "estimate-answer" },
        `A run takes about ${duration(estimate.estimate.seconds)} and ${bytes(estimate.estimate.memory_bytes)}: ` +
          `${counted(estimate.intervals, "interval")}, ${count(estimate.views)} views.`,
      ),
    );
    lines.push(...warnings(estimate.warnings));
  } else if (preview) {
    const current = editor.previewIsCurrent;
    const shows =
      state.mode === "remove"
        ? `without ${gaussians(preview.handles.reduce((sum, handle) => sum + handle.gaussians, 0))}`
        : `of ${gaussians(preview.gaussians.changeable)}`;
    lines.push(
      h(
        "p",
        { testid: "preview-answer", class: current ? "" : "stale" },
        current
          ? `Preview ${shows}${withCrumbs(preview, state)} in ${duration(preview.seconds)}.`
          : "The preview is of an earlier state of the handles.",
      ),
    );
    if (current) lines.push(...warnings(preview.warnings));
  }
  return lines;
}

/** What the selection had left out, and does not stay. */
function withCrumbs({ gaussians: { crumbs } }, state) {
  if (crumbs === 0) return "";
  return state.crumbs === "remove" ? `, ${count(crumbs)} crumbs gone,` : `, ${count(crumbs)} of them crumbs,`;
}

export const warnings = (list) => (list ?? []).map((warning) => h("p", { class: "warning" }, said(warning)));

/** A box to start from: around the handles and where they go. */
function boxAround(editor) {
  const { handles, scene } = editor.state;
  const points = handles.flatMap((x) => [x.source, ...(x.target ? [x.target] : [])]);
  if (points.length === 0) {
    const { low, high } = scene.bounds;
    return { center: scene.centre, size: low.map((l, i) => Math.max(high[i] - l, 1e-3)) };
  }
  const margin = 2 * Math.max(...handles.map((x) => x.radius));
  const low = [0, 1, 2].map((i) => Math.min(...points.map((p) => p[i])) - margin);
  const high = [0, 1, 2].map((i) => Math.max(...points.map((p) => p[i])) + margin);
  const digits = (x) => Number(x.toPrecision(5));
  return { center: low.map((l, i) => digits((l + high[i]) / 2)), size: low.map((l, i) => digits(high[i] - l)) };
}

/** Reads a request file and puts it on the screen. */
export async function importFile(editor, file, place) {
  showProblem(place, null);
  try {
    const requests = readRequests(await file.text());
    const name =
      requests.length === 1
        ? requests[0].name
        : await askChoice({ title: `Which request of ${file.name}?`, options: requests.map((r) => r.name) });
    if (name === null) return;
    const { request } = requests.find((r) => r.name === name);
    editor.load(request);
    const selected = request.selection.length ? " and a selection" : "";
    say(`${counted(request.handles.length, "handle")}${selected} imported from ${file.name}.`);
  } catch (error) {
    showProblem(place, { detail: `${file.name}: ${error.detail ?? problemText(error)}`, where: error.where });
  }
}

function exportFile(editor) {
  const { scene } = editor.state;
  if (!isStated(editor.state)) return say("There is nothing to export: no handle has been placed.");
  const url = URL.createObjectURL(
    new Blob([`${JSON.stringify(editor.request(), null, 2)}\n`], { type: "application/json" }),
  );
  const link = h("a", { href: url, download: `${scene.name.replace(/[^\w.-]+/g, "_")}-drag.json` });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
