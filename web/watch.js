// Follows one edit until it ends: by server-sent events, and by asking again and again where those are not to be had.

const FINAL = new Set(["succeeded", "failed", "cancelled"]);

export const hasEnded = (edit) => FINAL.has(edit.state);

/** Follows an edit.
 *    told(edit)        each time there is news; the last time with a final state
 *    gone()            there is no such edit any more
 *    events(id)        -> an EventSource; null: ask only
 *    ask(id, etag)     -> {edit, etag}, or null for no news; throws {status}
 *    every             ms between questions
 *    wait(ms, signal)  -> resolves after that time, or at once when given up
 *  Returns a function that ends it. */
export function follow(id, { told, gone = () => {}, events = null, ask, every = 1000, wait = pause }) {
  const over = new AbortController();
  let source = null;

  const end = () => {
    over.abort();
    source?.close();
  };
  const tell = (edit) => {
    if (over.signal.aborted) return;
    // Ended before told: whoever is told may follow it again.
    if (hasEnded(edit)) end();
    told(edit);
  };

  async function askOnAndOn() {
    let etag = null;
    let delay = every;
    while (!over.signal.aborted) {
      try {
        const news = await ask(id, etag);
        delay = every;
        if (news) {
          etag = news.etag;
          tell(news.edit);
        }
      } catch (error) {
        if (error.status === 404) {
          if (!over.signal.aborted) gone();
          return end();
        }
        // The service may be restarting, and will go on with the edit: keep asking, but less often.
        delay = Math.min(8000, delay * 2);
      }
      await wait(delay, over.signal);
    }
  }

  if (events) {
    source = events(id);
    source.addEventListener("edit", (event) => tell(JSON.parse(event.data)));
    source.addEventListener(
      "error",
      () => {
        // No stream left for us (429), a restart, a proxy that cuts long answers.
        source.close();
        if (!over.signal.aborted) askOnAndOn();
      },
      { once: true },
    );
  } else {
    askOnAndOn();
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

/** One edit put into a list of them, youngest first. News from before its end, come late, is dropped. */
export function merged(edits, edit) {
  const at = edits.findIndex((e) => e.id === edit.id);
  if (at < 0) return [edit, ...edits].sort((a, b) => (a.id < b.id ? 1 : -1));
  if (hasEnded(edits[at]) && !hasEnded(edit)) return edits;
  return edits.map((e, i) => (i === at ? edit : e));
}
