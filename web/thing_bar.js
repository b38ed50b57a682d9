// On the picture: what was taken hold of, how it is made more or less of, and what becomes of it once it is let go.

import { attrs, BY_TOUCH, button, byId, h, text } from "./dom.js";
import { statusLine } from "./edits.js";
import { duration, gaussians } from "./format.js";
import { furtherBorders, proposalOf, sentence } from "./selection.js";

export function buildThingBar(editor) {
  const { store, selecting } = editor;
  const press = (label, testid, title, onclick, more = {}) => button(label, testid, onclick, { title, ...more });

  const line = h("span", { class: "thing-line", role: "status", testid: "thing-line" });
  const problem = h("span", { class: "thing-problem", role: "alert", hidden: true, testid: "thing-problem" });
  const less = press("\u2212 Less", "thing-less", "Only up to the next border within (,)", () => selecting.widen(-1));
  const more = press("+ More", "thing-more", "Up to the next border beyond (.)", () => selecting.widen(1));
  const byKeys = () => {
    editor.holdThing();
    const { handles, selected } = store.state;
    const index = handles.findIndex((handle) => handle.id === selected);
    requestAnimationFrame(() => document.querySelector(`[data-testid=handle-${index}-target]`)?.focus());
  };
  const byNumbers = () => {
    store.set({ tab: "drag", sheet: true });
    document.querySelector("[data-testid=held]").scrollIntoView({ block: "start" });
  };
  const hold = BY_TOUCH
    ? press("By numbers", "thing-hold", "Move, turn and size it by numbers", byNumbers)
    : press("By keys", "thing-hold", "A handle to move by arrow keys, or by numbers in the panel", byKeys);
  const remove = press("Remove", "thing-remove", "Take it away for good, and complete what it hid", () =>
    editor.removeThing(),
  );
  const letOff = () => {
    editor.takeOff();
    // The button is gone by that: who pressed it by a key goes on from what comes next.
    requestAnimationFrame(() => free.hidden && (repair.hidden ? byId("view") : repair).focus());
  };
  const bends = "It is held by what it grows out of, and bends: let it go as one piece instead";
  const free = press("Comes off", "thing-free", bends, letOff);
  const repair = press("Repair", "thing-repair", "Run it as a draft", () => editor.runDraft(), {
    class: "small primary",
  });
  const drop = press("Let go", "thing-drop", "", () => editor.letGo());
  const cancel = press("Stop", "thing-cancel", "Give up the repair; it stays where you dragged it", () =>
    editor.cancelDraft(),
  );
  const better = press(
    "Run it well",
    "thing-better",
    "Runs the same drag once more with the preset standard: slower, and better",
    () => editor.runBetter(),
    { class: "small primary" },
  );
  const undo = press("Undo", "thing-undo", "Back to before (Ctrl + Z)", () => editor.undo());
  byId("thing-bar").append(line, problem, less, more, hold, remove, free, repair, drop, cancel, better, undo);

  store.watch(
    [
      ...["thingMode", "selectMode", "selection", "selectionAnswer", "selectionWaits", "handles", "dragging", "draft"],
      ...["drafted", "edits", "problem", "version", "submitting", "draftOnRelease", "preview", "attach"],
    ],
    (state) => {
      const { selection, selectionAnswer: answer, selectionWaits, draft, drafted, dragging } = state;
      const moved = state.handles.some((handle) => handle.target);
      const taken = selection.length > 0;
      const done = drafted !== null && !taken;
      byId("thing-bar").hidden = state.selectMode || !state.thingMode || !(taken || done);
      const idle = taken && !dragging && !draft;
      const borders = furtherBorders(selectionWaits ? null : answer);
      for (const [element, shows] of [
        [less, idle && !moved && proposalOf(selection)],
        [more, idle && !moved && proposalOf(selection)],
        [hold, idle && !moved],
        [remove, idle && !moved],
        [free, (idle && moved && state.attach !== "free" && isHeld(state.preview)) || (done && isHeld(draftOf(state)))],
        [repair, idle && moved],
        [drop, idle],
        [cancel, draft !== null],
        [better, done && !drafted.better],
        [undo, done],
      ])
        element.hidden = !shows;
      less.disabled = selectionWaits || !borders.less;
      remove.disabled = selectionWaits || !(answer?.count > 0);
      // With a handle, Esc leaves the handle only.
      attrs(drop, { title: `Nothing is taken any more${state.handles.length ? "" : " (Esc)"}` });
      more.disabled = selectionWaits || !borders.more;
      // What is being asked for is not to be called off yet.
      free.disabled = better.disabled = state.submitting;
      text(line, lineOf(state));
      const refused = taken ? (answer?.error && sentence(answer.error.detail)) || state.problem?.error.detail : null;
      problem.hidden = !refused;
      text(problem, refused ?? "");
      attrs(byId("thing-bar"), {
        "data-state": done ? "done" : draft ? "repairing" : dragging ? "dragging" : moved ? "moved" : "taken",
      });
    },
  );
}

/** Does a preview, or an edit, say that what moved was held? */
const isHeld = (told) => told?.parts?.[0]?.how === "held";
const draftOf = ({ drafted, edits }) => edits.find(({ id }) => id === drafted?.edit);

function lineOf({ selection, selectionAnswer: answer, selectionWaits, draft, drafted, edits, dragging, handles }) {
  if (draft) {
    const edit = edits.find((e) => e.id === draft.id);
    return edit ? `Repairing: ${statusLine(edit)}` : "Repairing\u2026";
  }
  if (dragging) return "Let go where it should be";
  if (selection.length === 0) {
    if (!drafted) return "";
    const better = edits.find((e) => e.id === drafted.better);
    if (better) return `Running it well: ${statusLine(better)}`;
    const edit = draftOf({ drafted, edits });
    const seconds = edit?.started && edit?.ended ? (new Date(edit.ended) - new Date(edit.started)) / 1000 : null;
    return `Done, as a draft${seconds === null ? "" : ` in ${duration(seconds)}`}.`;
  }
  if (selectionWaits || !answer) return "Looking for where it ends\u2026";
  if (answer.error) return "";
  const moved = handles.some((handle) => handle.target);
  return `${gaussians(answer.count)}${moved ? "" : ": drag it"}`;
}
