// A file on its way to the service: name, how far it is, and what went wrong; or the path of one that is there already.

import { wasGivenUp } from "./api.js";
import { asking, attrs, button, h, problemPlace, showProblem, text } from "./dom.js";
import { bytes } from "./format.js";

/** Shows an upload as a row in `place`.
 *    send({progress, signal})  -> a promise of the service's answer
 *    done(answer)              it went well; the row is gone
 *  A row whose upload was refused stays until it is dismissed. */
export async function showUpload(place, file, send, done) {
  const abort = new AbortController();
  const bar = h("progress", { max: 1, value: 0, "aria-label": `Upload of ${file.name}`, testid: "upload-progress" });
  const state = h("span", { class: "muted" }, "0 %");
  const problem = problemPlace("upload-problem");
  const close = button("Cancel", "upload-cancel", () => abort.abort());
  const row = h(
    "div",
    { class: "upload", testid: "upload" },
    h("div", { class: "row between" }, h("strong", {}, file.name), h("span", { class: "row" }, state, close)),
    bar,
    problem,
  );
  place.append(row);
  try {
    const progress = (sent, total) => {
      bar.value = total > 0 ? sent / total : 0;
      text(state, sent < total ? `${bytes(sent)} of ${bytes(total)}` : "The service is reading it…");
      // It does not say how long that takes.
      if (sent >= total) attrs(bar, { value: null });
    };
    const answer = await send({ progress, signal: abort.signal });
    row.remove();
    done(answer);
  } catch (error) {
    if (wasGivenUp(error)) return row.remove();
    bar.hidden = true;
    text(state, "Not accepted");
    text(close, "Dismiss");
    close.addEventListener("click", () => row.remove());
    showProblem(problem, namedAs(file.name, error));
  }
}

/** An error of the service about what was uploaded, by the name that the user knows: it has no name for the service. */
export function namedAs(name, { detail, message, where = "" }) {
  const named = (text) => text.replace(/^upload(?=[:/[ ]|$)/, () => name);
  return { detail: named(detail || message), where: named(where) };
}

/** A form for a path below the service's scene folder; hidden until that is known to be there.
 *    label         in front of it
 *    field         of the text: testid, placeholder, aria-label
 *    button        [label, {testid, ...}]
 *    problem       test id of the place for what is refused
 *    send(path)    -> a promise of the service's answer; the field is empty once it is there
 *    done(answer) */
export function pathForm({ label, field, button: [name, more], problem, send, done, ...form }) {
  const path = h("input", { type: "text", ...field });
  const place = problemPlace(problem);
  const submit = asking(place, async () => {
    const answer = await send(path.value.trim());
    path.value = "";
    done(answer);
  });
  const element = h(
    "form",
    {
      class: "path-form",
      hidden: true,
      ...form,
      onsubmit: async (event) => {
        event.preventDefault();
        if (!path.value.trim()) return;
        element.classList.add("waiting");
        await submit();
        element.classList.remove("waiting");
      },
    },
    label,
    h("div", { class: "row" }, path, h("button", more, name)),
    place,
  );
  return element;
}
