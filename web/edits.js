// The edits of a scene: the queue, the one that runs, those that ended.

import { askConfirmation, say } from "./dialogs.js";
import { attrs, button, h, iconButton, keyedList, problemPlace, showProblem, text } from "./dom.js";
import { count, counted, duration, gaussians, loss, when } from "./format.js";
import { frameAround, insetOf, pointsOf } from "./framing.js";
import { lossCurve } from "./loss_curve.js";
import { warnings } from "./request_panel.js";
import { showScrubber } from "./scrubber.js";
import { describe } from "./selection.js";
import { hasEnded } from "./watch.js";

const STATES = {
  queued: "Waiting",
  running: "Running",
  succeeded: "Done",
  failed: "Failed",
  cancelled: "Cancelled",
  stop_requested: "Stopping",
  cancel_requested: "Cancelling",
};
/** Each stage of the contract, as people call it. */
export const STAGES = {
  load: "Reading the scene",
  assign: "Finding the Gaussians",
  views: "Choosing views",
  deform: "Deforming",
  mask: "Masking",
  relocate: "Relocating handles",
  observe: "Looking at what cameras have seen",
  correct: "Correcting",
  tune: "Learning the scene",
  repaint: "Repainting views",
  set_up: "Preparing views",
  optimise: "Optimising",
  pictures: "Rendering pictures",
  checkpoint: "Saving",
  finish: "Finishing",
  publish: "Publishing",
};

/** A sentence on where an edit is. */
export function statusLine(edit) {
  if (edit.state === "queued") {
    if (!edit.queue_position || edit.queue_position <= 1) return "Next in the queue";
    return `Number ${edit.queue_position} in the queue`;
  }
  if (!hasEnded(edit)) {
    const stage = edit.stage ? (STAGES[edit.stage] ?? edit.stage) : "Starting";
    const interval = edit.intervals > 0 && edit.interval > 0 ? ` · interval ${edit.interval} of ${edit.intervals}` : "";
    const done = `iteration ${count(edit.iteration ?? 0)} of ${count(edit.iterations ?? 0)}, loss ${loss(edit.loss)}`;
    const iteration = edit.iteration > 0 ? ` · ${done}` : "";
    const eta = typeof edit.eta_seconds === "number" ? ` · about ${duration(edit.eta_seconds)} left` : "";
    return `${stage}${interval}${iteration}${eta}`;
  }
  if (edit.state === "succeeded") {
    const kept = edit.stopped_early
      ? `, stopped after interval ${edit.finished_intervals.length} of ${edit.intervals}`
      : "";
    return `Version ${edit.result_version}${kept}`;
  }
  return edit.ended ? when(edit.ended) : "";
}

export function buildEdits(editor) {
  const list = h("ol", { class: "edits", testid: "edits" });
  const empty = h(
    "p",
    { class: "empty", testid: "no-edits" },
    "No edits yet. Place handles and press “Run edit”: its progress shows here.",
  );
  const update = keyedList(
    list,
    (edit) => edit.id,
    (edit) => card(editor, edit.id),
  );
  editor.store.watch(["edits", "version", "scene"], ({ edits }) => {
    empty.hidden = edits.length > 0;
    update(edits);
  });
  // Who has just asked for one wants to see it, however far down the list was read.
  editor.store.watch(["asked"], ({ asked }) => {
    if (asked) requestAnimationFrame(() => list.scrollIntoView({ block: "start" }));
  });
  return h("section", {}, h("h2", {}, "Edits"), empty, list);
}

function card(editor, id) {
  const current = () => editor.state.edits.find((e) => e.id === id);
  const problem = problemPlace("edit-problem");
  let refused = null;
  const asking = (ask) => async () => {
    try {
      refused = null;
      await ask();
    } catch (error) {
      refused = error;
    }
    showProblem(problem, refused ?? errorOf(current()));
  };
  const name = h("span", { class: "edit-name" });
  const state = h("span", { class: "state", testid: "edit-state" });
  const line = h("p", { class: "line", testid: "edit-line" });
  const progress = h("progress", { max: 1, testid: "edit-progress" });
  const stop = button(
    "Stop and keep",
    "edit-stop",
    asking(() => editor.stopEdit(id)),
    { title: "Ends at once, with the last finished interval as the result" },
  );
  const cancel = button(
    "Cancel",
    "edit-cancel",
    asking(async () => {
      const started = current()?.state !== "queued";
      const sure =
        !started ||
        (await askConfirmation({
          title: "Cancel this edit?",
          detail: "What it has done so far is lost.",
          yes: "Cancel the edit",
        }));
      if (sure) await editor.cancelEdit(id);
    }),
  );
  const show = button("Show result", "edit-show", () => editor.showVersion(current().result_version));
  const reuse = button("Load its handles", "edit-reuse", () => {
    const edit = current();
    if (edit.version !== editor.state.version) editor.showVersion(edit.version);
    editor.load(edit.request);
    const what = edit.request.selection?.length ? "The handles and the selection" : "The handles";
    say(`${what} of ${id} are back on version ${edit.version}.`);
  });
  const forget = iconButton(
    "✕",
    "edit-forget",
    "Remove from the list",
    asking(() => editor.deleteEdit(id)),
  );
  const curve = lossCurve();
  const intervals = h("div", { class: "intervals" });
  const updateIntervals = keyedList(
    intervals,
    (u) => u.interval,
    (u) => intervalRow(editor, id, u),
  );
  const notes = h("div", {});
  const facts = h("dl", { class: "facts" });
  const details = h("details", { class: "more" }, h("summary", {}, "Details"), facts);

  const element = h(
    "li",
    { class: "edit" },
    h("div", { class: "row between" }, h("div", { class: "row" }, name, state), forget),
    line,
    progress,
    curve.element,
    problem,
    intervals,
    notes,
    h("div", { class: "row wrap" }, stop, cancel, show, reuse),
    details,
  );
  return {
    element,
    update: (edit) => {
      const ended = hasEnded(edit);
      attrs(element, { "data-state": edit.state, "data-testid": `edit-${edit.id}` });
      text(name, `${edit.id} · ${counted(edit.request.handles.length, "handle")} on version ${edit.version}`);
      text(state, STATES[edit.state] ?? edit.state);
      text(line, statusLine(edit));
      progress.hidden = ended || edit.state === "queued";
      progress.value = edit.progress;
      attrs(progress, { "aria-label": `Progress of ${edit.id}` });
      stop.hidden = edit.state !== "running";
      stop.disabled = edit.finished_intervals.length === 0;
      cancel.hidden = ended || edit.state === "cancel_requested";
      const there =
        edit.result_version !== null && editor.state.scene?.versions.some((v) => v.version === edit.result_version);
      show.hidden = !there;
      show.disabled = editor.state.version === edit.result_version;
      reuse.hidden = !ended;
      forget.hidden = !ended;
      showProblem(problem, refused ?? errorOf(edit));
      curve.update(edit);
      updateIntervals(edit.finished_intervals);
      notes.replaceChildren(...warnings(edit.warnings));
      facts.replaceChildren(...factsOf(edit).flatMap(([key, value]) => [h("dt", {}, key), h("dd", {}, value)]));
    },
  };
}

/** What it failed of. That it is of this very edit, its card says already. */
const errorOf = (edit) => edit?.error && { ...edit.error, where: edit.error.where === edit.id ? null : edit.error.where };

/** The part of a view's picture that an edit is about. */
function frameOf(editor, edit, name) {
  const view = editor.state.views.find((v) => v.name === name);
  return frameAround(view ?? {}, view ? pointsOf(edit) : []);
}

/** The pictures of a finished interval, as it found the scene and as it left it. */
function intervalRow(editor, id, { interval, seconds, loss: reached, renders }) {
  const took = duration(seconds) + (typeof reached === "number" ? `, loss ${loss(reached)}` : "");
  const edit = () => editor.state.edits.find((e) => e.id === id);
  const pictures = renders.slice(0, 4).map(({ view, stages }, k) => {
    const urls = Object.values(stages);
    const last = urls.at(-1);
    const picture = (src, more = {}) => {
      const img = h("img", { src, alt: "", loading: "lazy", ...more });
      img.style.objectViewBox = insetOf(frameOf(editor, edit(), view));
      return img;
    };
    return h(
      "button",
      {
        type: "button",
        class: "thumb",
        testid: `thumb-${interval}-${k}`,
        title: `${view}: before and after interval ${interval}`,
        "aria-label": `Interval ${interval}, view ${view}: show how it came about`,
        onclick: () => showScrubber(edit(), { view, url: last }, (name) => frameOf(editor, edit(), name)),
      },
      picture(last),
      stages.before && urls.length > 1 ? picture(stages.before, { class: "before" }) : null,
    );
  });
  return {
    element: h(
      "div",
      { class: "interval", testid: `interval-${interval}` },
      h("span", { class: "interval-name" }, `Interval ${interval}`, h("small", {}, took)),
      h("div", { class: "thumbs" }, pictures),
    ),
  };
}

function factsOf(edit) {
  const facts = [["Submitted", when(edit.created)]];
  if (edit.started && edit.ended)
    facts.push(["Took", duration((new Date(edit.ended) - new Date(edit.started)) / 1000)]);
  edit.handles.forEach((handle, i) => facts.push([`Handle ${i + 1}`, gaussians(handle.gaussians)]));
  if (edit.gaussians) {
    const { input, output, removed, copies } = edit.gaussians;
    facts.push(["Gaussians", `${count(input)} → ${count(output)} (${count(removed)} removed, ${count(copies)} new)`]);
  }
  const left = edit.uncovered.reduce((sum, { area }) => sum + area, 0);
  const open = edit.uncovered.reduce((sum, view) => sum + view.open, 0);
  if (left > 0) facts.push(["Completed", `${Math.floor(100 * (1 - open / left))} % of the place that was left`]);
  for (const { stage, seconds } of edit.timings) facts.push([STAGES[stage] ?? stage, duration(seconds)]);
  const { mode, preset, params = {} } = edit.request;
  const { selection = [] } = edit.request;
  if (selection.length) facts.push(["Selection", selection.map(describe).join(", ")]);
  facts.push(["Mode", mode], ...(preset ? [["Preset", preset]] : []));
  for (const [key, value] of Object.entries(params))
    facts.push([key, Array.isArray(value) ? value.join(", ") || "none" : String(value)]);
  if (edit.simd) facts.push(["Ran on", edit.simd]);
  return facts;
}
