// Two versions in one picture: a divider between them, one after the other, or how they differ. (Held, the button in the
// toolbar shows the other one alone.)

import * as api from "./api.js";
import { onTheWire, pictureKey } from "./camera.js";
import { attrs, byId, h, text } from "./dom.js";
import { shownVersion } from "./editor.js";
import { choice, numberField } from "./fields.js";
import { FrameQueue } from "./frames.js";
import { share } from "./selection.js";

export const WAYS = [
  ["", "Compare…", "One picture"],
  ["slider", "Slider", "The other version to the left of a line that you move"],
  ["blink", "Blink", "One after the other"],
  ["difference", "Difference", "How much each pixel differs, four times as bright"],
];
// Choices.
const BLINK_MS = 700; // Slower than three flashes a second, which can do harm (WCAG 2.3.1).
const GAIN = 4;
const SEEN = 4; // Of 255: a smaller difference of a colour is not seen.

/** How two pictures differ, as pixels of RGBA: `out` is filled; returns the share of pixels in which it can be seen.
 *    a, b, out  of one size */
export function differences(a, b, out) {
  let differ = 0;
  for (let i = 0; i < a.length; i += 4) {
    let most = 0;
    for (let k = i; k < i + 3; ++k) {
      const apart = Math.abs(a[k] - b[k]);
      most = Math.max(most, apart);
      out[k] = GAIN * apart; // A clamped array: no more than 255.
    }
    out[i + 3] = 255;
    if (most > SEEN) differ += 1;
  }
  return a.length ? differ / (a.length / 4) : 0;
}

/** Builds it.  viewer: tells of each picture that it shows by a "shown" event of the view */
export function buildCompare(editor) {
  const { store } = editor;
  const view = byId("view");
  const canvas = h("canvas", { id: "other", hidden: true, testid: "other" });
  const split = h("input", { type: "range", id: "split", min: 0, max: 100, step: 0.5, value: 50, hidden: true });
  attrs(split, { "data-testid": "compare-split", "aria-label": "Divider between the two versions" });
  const line = h("span", { class: "chip compare", role: "status", hidden: true, testid: "compare-line" });
  byId("picture").after(canvas);
  byId("overlay").after(split);
  byId("chips").append(line);
  const ways = choice({
    label: "Way to compare",
    testid: "compare-mode",
    options: WAYS,
    changed: (value) => store.set({ contrast: value || null }),
  });
  // For who does not drag (WCAG 2.5.7).
  const place = numberField({
    label: "Divider between the two versions, % from the left",
    testid: "compare-place",
    min: 0,
    max: 100,
    changed: (value) => {
      split.value = value;
      update();
    },
  });
  byId("tools").append(h("span", { class: "spacer" }), place.element, ways.element);

  let shown = null; // The job of the picture on the screen.
  let made = null; // {key, share} of what is on the canvas.
  let blinking = null;
  const queue = new FrameQueue({ load, onPicture: draw, onError: (error) => tell(`No comparison: ${error.message}`) });

  /** What is to be compared with the picture on the screen; null: nothing. */
  function wanted() {
    const { contrast: way, comparing, selectMode } = store.state;
    const other = shownVersion({ ...store.state, comparing: true });
    if (!way || comparing || selectMode || !shown || shown.scene !== store.state.scene?.id || other === shown.version) return null;
    const key = JSON.stringify([way === "difference", other, shown.version, shown.layer, pictureKey(shown.pose), shown.size]);
    return { ...shown, way, other, key, large: true };
  }

  async function load({ scene, version, other, layer, pose, size, way }, signal) {
    const exact = way === "difference"; // What a JPEG leaves out is no difference.
    const body = { camera: onTheWire({ ...pose, ...size }), what: layer, format: exact ? "png" : "jpeg" };
    const picture = async (of) => createImageBitmap((await api.render(scene, of, body, signal)).blob);
    return Promise.all([picture(other), ...(exact ? [picture(version)] : [])]);
  }

  function draw([theirs, ours], job) {
    const { width, height } = job.size;
    Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(theirs, 0, 0);
    made = { key: job.key };
    if (ours) {
      const before = context.getImageData(0, 0, width, height);
      context.drawImage(ours, 0, 0);
      const now = context.getImageData(0, 0, width, height);
      made.share = differences(before.data, now.data, now.data);
      context.putImageData(now, 0, 0);
    }
    update();
  }

  function tell(words) {
    text(line, words);
    line.hidden = !words;
  }

  const named = (version) => (String(version).startsWith("p") ? "the preview" : `version ${version}`);

  function update() {
    const job = wanted();
    const ready = job !== null && made?.key === job.key;
    const { contrast, selectMode } = store.state;
    ways.update(contrast ?? "");
    ways.element.hidden = selectMode; // The tools that select need the room, and show the version alone.
    canvas.hidden = !ready;
    split.hidden = place.element.hidden = !ready || job.way !== "slider";
    place.update(split.valueAsNumber);
    canvas.style.clipPath = split.hidden ? "" : `inset(0 ${100 - split.valueAsNumber}% 0 0)`;
    attrs(view, { "data-compared": ready ? job.way : null });
    blink(ready && job.way === "blink" ? job : null);
    if (!job) {
      queue.clear();
      return tell(contrast && shown && !selectMode ? "There is nothing to compare it with." : "");
    }
    if (!ready) {
      tell("Comparing…");
      return queue.request(job);
    }
    if (job.way === "slider") tell(`Left: ${named(job.other)} · right: ${named(job.version)}`);
    if (job.way === "difference") tell(`${share(made.share, 1)} of the picture differs from ${named(job.other)}`);
  }

  function blink(job) {
    clearInterval(blinking);
    blinking = null;
    if (!job) return;
    const turn = () => {
      canvas.hidden = !canvas.hidden;
      tell(`Now: ${named(canvas.hidden ? job.version : job.other)}`);
    };
    turn();
    blinking = setInterval(turn, BLINK_MS);
  }

  split.addEventListener("input", update);
  view.addEventListener("shown", ({ detail }) => {
    shown = detail;
    update();
  });
  store.watch(["contrast", "version", "preview", "comparing", "compareWith", "scene", "selectMode"], update);
}

/** The way after this one; the last is none. */
export function nextWay(way) {
  const at = WAYS.findIndex(([value]) => value === (way ?? ""));
  return WAYS[(at + 1) % WAYS.length][0] || null;
}
