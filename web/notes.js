// On the picture: what the service says of what is seen there. What was torn, left open or left behind, before a run and
// after it; where that is; and what was refused, wherever the panel's own message is.

import { byId, button, h, text } from "./dom.js";
import { said } from "./format.js";
import { pictureIn } from "./framing.js";
import { placeOver, viewOf } from "./photo.js";
import { partOf } from "./requests.js";
import { share } from "./selection.js";

/** What there is to say of what the state shows: {notes: [sentences], open: [{view, share, box}], refused: error or null}. */
export function notesOn({ scene, version, preview, previewIsCurrent, selectMode, edits, problem, drafted }) {
  const refused = problem?.error ?? null;
  if (preview && !selectMode) return { notes: previewIsCurrent ? (preview.warnings ?? []) : [], open: [], refused };
  const made = scene?.versions.find((v) => v.version === version)?.edit;
  const edit = made && edits.find(({ id }) => id === made);
  if (!edit) return { notes: [], open: [], refused };
  const open = edit.uncovered
    .filter(({ open: part }) => part > 0)
    .map(({ view, open: part, area, open_box: box }) => ({ view, share: area > 0 ? part / area : 0, box }))
    .sort((a, b) => b.share - a.share);
  return { notes: edit.warnings, open, refused };
}

export function buildNotes(editor, viewer) {
  const { store } = editor;
  const summary = h("summary", {});
  const list = h("div", { class: "stack" });
  const details = h("details", { id: "notes", testid: "notes", hidden: true }, summary, list);
  const mark = h("div", { id: "open-mark", hidden: true, testid: "open-mark" }, h("span", {}, "made up: no camera saw it"));
  byId("chips").append(details);
  byId("view").append(mark);

  let told = null;
  let wasOpen = false; // Before something was refused.
  const update = () => {
    const { state } = store;
    if (!state.scene) return (details.hidden = mark.hidden = true);
    const { notes, open, refused } = notesOn({ ...state, previewIsCurrent: editor.previewIsCurrent });
    const all = notes.length + (open.length > 0 ? 1 : 0) + (refused ? 1 : 0);
    details.hidden = all === 0;
    text(summary, refused ? "Refused" : all === 1 ? "1 note" : `${all} notes`);
    details.classList.toggle("bad", refused !== null);
    // Once: who closes it has read it. After a refusal it is open to those who had it open, and have not closed it.
    if (refused && !told) wasOpen = details.open;
    if (refused !== told) details.open = refused !== null || (wasOpen && details.open);
    told = refused;
    list.replaceChildren(...lines(editor, { notes, open, refused }));
    const view = viewOf(state);
    const here = open.find((one) => one.view === view?.name && one.box);
    mark.hidden = !here || !viewer.camera || state.preview !== null || state.comparing;
    if (mark.hidden) return;
    const { x, y, width, height } = pictureIn(viewer.camera, view);
    const [left, top, right, bottom] = here.box;
    const box = { x: x + left * width, y: y + top * height, width: (right - left) * width, height: (bottom - top) * height };
    placeOver(mark, box);
  };
  byId("view").addEventListener("shown", update);
  store.watch(["scene", "version", "preview", "selectMode", "edits", "problem", "viewName", "views", "pose", "comparing"], update);
}

function lines(editor, { notes, open, refused }) {
  const told = [];
  if (refused) {
    const { region } = editor.state;
    told.push(h("p", {}, said(refused.detail || refused.message)));
    if (region && (partOf(refused.where).part === "region" || /\bbox\b|\bregion\b/.test(refused.detail)))
      told.push(button("Without the box", "note-no-region", () => editor.settle({ region: null })));
  }
  told.push(...notes.map((note) => h("p", {}, said(note))));
  const [worst] = open;
  if (worst && editor.state.views.some(({ name }) => name === worst.view)) {
    told.push(h("p", {}, `Made up in ${worst.view}: ${share(worst.share, 1)} of what the part has left there.`));
    told.push(button("Look there", "note-look", () => editor.lookFrom(worst.view)));
  }
  return told;
}
