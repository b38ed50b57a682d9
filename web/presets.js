// What a run would take with each preset: time and memory, from the estimate that a run's own "time left" begins with.

import * as api from "./api.js";
import { attrs, h, text } from "./dom.js";
import { bytes, duration } from "./format.js";
import { changesScene, impossibleWith } from "./requests.js";

const DELAY_MS = 500; // After the last change of the request: an estimate costs the service what a preview does.

/** Presets that make sense for a run: `preview` is what the Preview button does. */
export const runPresets = (info) => (info?.presets ?? ["draft", "standard", "paper"]).filter((name) => name !== "preview");

/** Buttons, one for each preset: {element}. The one that is pressed is what "Run edit" runs. */
export function buildPresets(editor) {
  const { store } = editor;
  const element = h("div", { class: "segments presets", role: "group", "aria-label": "How well", testid: "presets" });
  let buttons = [];
  let known = { key: null }; // What was asked for, and what the service said: {key, draft: {estimate} or {error}, ...}
  let asking = null;
  let timer = null;

  const build = (info) => {
    buttons = runPresets(info).map((name) => {
      const cost = h("small", { testid: `preset-cost-${name}` });
      const click = () => editor.settle({ preset: name });
      const button = h("button", { type: "button", class: "segment", testid: `preset-${name}`, onclick: click }, name, cost);
      return { name, button, cost };
    });
    element.replaceChildren(...buttons.map(({ button }) => button));
  };

  /** The request but for its preset: what the estimates are of. */
  const keyOf = () => {
    const { preset, ...rest } = editor.request();
    return JSON.stringify(rest);
  };

  const show = () => {
    const { scene, preset } = store.state;
    const fresh = scene !== null && known.key === keyOf();
    for (const { name, button, cost } of buttons) {
      attrs(button, { "aria-pressed": String(name === (preset || "standard")) });
      const found = fresh ? known[name] : undefined;
      const { seconds, memory_bytes: memory } = found?.estimate ?? {};
      text(cost, found?.estimate ? `${duration(seconds)} · ${bytes(memory)}` : found?.error ? "not possible" : "");
      attrs(button, { title: found?.error?.detail ?? null });
    }
  };

  const ask = async () => {
    asking?.abort();
    const { signal } = (asking = new AbortController());
    const request = editor.request();
    known = { key: keyOf() };
    const mine = known;
    for (const { name } of buttons) {
      const why = impossibleWith(name, request, store.state.info);
      if (why) {
        mine[name] = { error: { detail: why } };
        continue;
      }
      try {
        mine[name] = await api.estimateEdit({ ...request, preset: name }, signal);
      } catch (error) {
        if (signal.aborted) return;
        mine[name] = { error };
      }
      show();
    }
    show();
  };

  store.watch(["info"], ({ info }) => build(info));
  store.watch(
    ["info", "scene", "version", "handles", "selection", "heal", "region", "mode", "preset", "params", "crumbs", "shadow", "settle", "dragging", "preview", "selectMode"],
    ({ scene, dragging, selectMode, preview }) => {
      clearTimeout(timer);
      element.hidden = !scene || !changesScene(store.state);
      show();
      // Only once the preview is there: nobody waits for an estimate as for that.
      const idle = !element.hidden && !dragging && !selectMode && preview && editor.previewIsCurrent;
      if (!idle) return asking?.abort();
      if (known.key !== keyOf()) timer = setTimeout(ask, DELAY_MS);
    },
  );
  return { element, ask };
}
