// Follows one edit until it ends: by server-sent events, or by polling where those are not to be had.

const FINAL = new Set(["succeeded", "failed", "cancelled"]);

export const hasEnded = (edit) => FINAL.has(edit.state);

/** Follows an edit until it ends, and calls back.
 *    onUpdate(edit)       is called each time the edit has changed; the last time with a final state
 *    onGone()             is called when there is no such edit any more
 *    events(id)           returns an EventSource; null: poll only
 *    fetchEdit(id, etag)  returns {edit, etag}, or null if nothing has changed; throws {status}
 *    every                ms between two polls
 *    wait(ms, signal)     resolves after that time, or at once when the signal aborts
 *  Returns a function that ends it. */
export function follow(id, { onUpdate, onGone = () => {}, events = null, fetchEdit, every = 1000, wait = pause }) {
  const controller = new AbortController();
  let source = null;

  const end = () => {
    controller.abort();
    source?.close();
  };
  const publish = (edit) => {
    if (controller.signal.aborted) return;
    // The end comes before the call: whoever is called may follow the edit again.
    if (hasEnded(edit)) end();
    onUpdate(edit);
  };

  async function poll() {
    let etag = null;
    let delay = every;
    while (!controller.signal.aborted) {
      try {
        const update = await fetchEdit(id, etag);
        delay = every;
        if (update) {
          etag = update.etag;
          publish(update.edit);
        }
      } catch (error) {
        if (error.status === 404) {
          if (!controller.signal.aborted) onGone();
          return end();
        }
        // The service may be restarting, and will go on with the edit: keep asking, but less often.
        delay = Math.min(8000, delay * 2);
      }
      await wait(delay, controller.signal);
    }
  }

  if (events) {
    source = events(id);
    source.addEventListener("edit", (event) => publish(JSON.parse(event.data)));
    source.addEventListener(
      "error",
      () => {
        // No stream left for us (429), a restart, a proxy that cuts long answers.
        source.close();
        if (!controller.signal.aborted) poll();
      },
      { once: true },
    );
  } else {
    poll();
  }
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
