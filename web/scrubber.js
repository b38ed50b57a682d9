// The pictures of an edit, one after the other, as it came to its result: a dialog with a slider.

import { openDialog } from "./dialogs.js";
import { attrs, h, text } from "./dom.js";
import { choice, toggle } from "./fields.js";
import { insetOf } from "./framing.js";

const STAGES = { before: "as it was found", deformed: "dragged", corrected: "as it should become", optimised: "optimised" };

/** The pictures of one view in the order in which they came about: [{label, url}]. `before` only once: an interval finds
 *  what the last one left. */
export function stepsOf({ finished_intervals: finished }, view) {
  return finished.flatMap(({ interval, renders }, i) => {
    const stages = renders.find((one) => one.view === view)?.stages ?? {};
    return Object.keys(STAGES)
      .filter((stage) => stages[stage] && (stage !== "before" || i === 0))
      .map((stage) => ({ label: `Interval ${interval}: ${STAGES[stage]}`, url: stages[stage] }));
  });
}

/** Shows them.
 *    start            {view, url}: where to begin
 *    frameOf(view)    the part of its picture that the edit is about */
export function showScrubber(edit, start, frameOf) {
  const views = [...new Set(edit.finished_intervals.flatMap(({ renders }) => renders.map(({ view }) => view)))];
  let view = start.view;
  let steps = stepsOf(edit, view);
  let near = true;
  const img = h("img", { testid: "scrub-picture" });
  const line = h("output", { class: "muted", testid: "scrub-line" });
  const at = h("input", { type: "range", min: 0, step: 1, testid: "scrub", "aria-label": "Step of the edit" });
  const show = () => {
    const { label, url } = steps[at.valueAsNumber];
    attrs(img, { src: url, alt: `${view}, ${label}` });
    attrs(at, { "aria-valuetext": label });
    img.style.objectViewBox = near ? insetOf(frameOf(view)) : "";
    text(line, label);
  };
  const begin = (url) => {
    steps = stepsOf(edit, view);
    attrs(at, { max: steps.length - 1 });
    const found = steps.findIndex((step) => step.url === url);
    at.value = found < 0 ? steps.length - 1 : found;
    show();
  };
  const which = choice({
    label: "View",
    testid: "scrub-view",
    options: views.map((name) => [name, name]),
    changed: (name) => {
      view = name;
      begin(null);
    },
  });
  const closer = toggle({
    label: "Near",
    testid: "scrub-near",
    title: "Only the part of the picture that the edit is about",
    changed: (on) => {
      near = on;
      show();
    },
  });
  which.update(view);
  closer.update(near);
  at.addEventListener("input", show);
  begin(start.url);
  openDialog(
    "pictures",
    `${edit.id}: how it came about`,
    [img, at, h("div", { class: "row between" }, line, h("div", { class: "row" }, closer.element, which.element))],
    { closes: true, class: "pictures" },
  );
  at.focus();
}
