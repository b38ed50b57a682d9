// A scene as all see it who look at it: what happens to it and to its edits, and whether the service answers at all.

// Choices. The service says something each second: after two and a half without a word it is gone, or the way to it.
const SILENCE_MS = 2500;
const AGAIN_MS = 1000;

const FINAL = new Set(["succeeded", "failed", "cancelled"]);

export const hasEnded = (edit) => FINAL.has(edit.state);

/** Follows a scene until it is ended: by its stream of events, or by asking where there is none to be had.
 *    onScene(scene), onEdit(edit)  something may be new
 *    onGone()                      the scene has been deleted
 *    onAnswering(does)             whether the service answers
 *    events()                      returns an EventSource
 *    ask()                         returns {scene, edits}, youngest first; throws {status}
 *    silence, again                ms without a word that are too many; ms between two attempts
 *  Returns a function that ends it. */
export function followScene({ silence = SILENCE_MS, again = AGAIN_MS, events, ask, ...told }) {
  const controller = new AbortController();
  const { signal } = controller;
  const tell = (name, ...what) => signal.aborted || told[name](...what);
  const end = () => controller.abort();
  const gone = () => {
    tell("onGone");
    end();
  };

  let heard = new Set(); // What the stream has told of since it was last asked: "scene", ids of edits.

  /** Asks for all there is; an edit that ended while nobody listened is told so. What the stream tells meanwhile is newer
   *  than the answer. */
  async function catchUp() {
    const meanwhile = (heard = new Set());
    try {
      const { scene, edits } = await ask();
      tell("onAnswering", true);
      if (meanwhile !== heard) return; // Asked once more: that answer is the newer one.
      if (!meanwhile.has("scene")) tell("onScene", scene);
      for (const edit of [...edits].reverse()) if (!meanwhile.has(edit.id)) tell("onEdit", edit);
    } catch (error) {
      if (error.status === 404) gone();
      else if (!error.status) tell("onAnswering", false);
    }
  }

  /** Listens to a stream until that is over. */
  const listen = () =>
    new Promise((resolve) => {
      const source = events();
      const over = () => {
        clearTimeout(timer);
        source.close();
        resolve();
      };
      const silent = () => {
        tell("onAnswering", false);
        over();
      };
      let timer = setTimeout(silent, silence);
      let first = true;
      const on = (name, fn) =>
        source.addEventListener(name, ({ data }) => {
          if (signal.aborted) return;
          clearTimeout(timer);
          timer = setTimeout(silent, silence);
          tell("onAnswering", true);
          fn(JSON.parse(data));
        });
      on("scene", (scene) => {
        heard.add("scene");
        tell("onScene", scene);
        if (first) catchUp();
        first = false;
      });
      on("edit", (edit) => {
        heard.add(edit.id);
        tell("onEdit", edit);
      });
      on("alive", () => {});
      on("gone", gone);
      // No stream left for us (429), a restart, a proxy that cuts long answers.
      source.addEventListener("error", over, { once: true });
      signal.addEventListener("abort", over, { once: true });
    });

  (async () => {
    while (!signal.aborted) {
      await listen();
      if (!signal.aborted) await catchUp();
      if (!signal.aborted) await pause(again, signal);
    }
  })();
  return end;
}

function pause(ms, signal) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, ms);
    signal.addEventListener("abort", () => {
      clearTimeout(timer);
      resolve();
    });
  });
}

/** A list of edits, youngest first, with one edit put into it. A late update from before the edit's end is dropped. */
export function merged(edits, edit) {
  const at = edits.findIndex((e) => e.id === edit.id);
  if (at < 0) return [edit, ...edits].sort((a, b) => (a.id < b.id ? 1 : -1));
  if (hasEnded(edits[at]) && !hasEnded(edit)) return edits;
  return edits.map((e, i) => (i === at ? edit : e));
}
