// The scene itself: its versions as a tree, with names and downloads; its dataset, its up direction.

import * as api from "./api.js";
import { askConfirmation, askText, say } from "./dialogs.js";
import { asking, attrs, button, h, keyedList, problemPlace, row, text } from "./dom.js";
import { treeOf } from "./drafts.js";
import { parentOf } from "./editor.js";
import { bytes, count, gaussians, point, when } from "./format.js";
import { warnings } from "./request_panel.js";
import { pathForm, showUpload } from "./uploads.js";

const ORIGINAL = "as uploaded";

export function buildVersions(editor) {
  const { store } = editor;
  const problem = problemPlace("scene-tab-problem");
  const act = (fn) => asking(problem, fn);
  const undo = button("", "undo-version", () => editor.showVersion(parentOf(store.state.scene, store.state.version)));
  const list = h("ol", { class: "versions", testid: "versions" });
  const update = keyedList(
    list,
    ({ version }) => version.version,
    ({ version }) => versionRow(editor, version.version, act),
  );

  const dataset = h("div", { testid: "dataset" });
  const zip = h("input", {
    type: "file",
    accept: ".zip,application/zip",
    hidden: true,
    testid: "dataset-file",
    "aria-label": "Dataset as a zip file",
  });
  const uploads = h("div", { testid: "dataset-uploads" });
  const upload = (file) =>
    showUpload(
      uploads,
      file,
      (options) => api.uploadDataset(store.state.scene.id, file, options),
      (scene) => {
        editor.datasetChanged(scene);
        say(`${count(scene.dataset?.views ?? scene.views)} views are there now.`, { kind: "good" });
      },
    );
  zip.addEventListener("change", () => {
    const [file] = zip.files;
    zip.value = "";
    if (file) upload(file);
  });
  const remove = button(
    "Remove",
    "dataset-remove",
    act(async () => {
      const { id, dataset: info } = store.state.scene;
      const sure = await askConfirmation({
        title: "Remove the dataset?",
        detail: `Its ${count(info.views)} cameras and ${count(info.photos)} photos go; the scene and its versions stay. A folder of the service's own is left as it is.`,
        yes: "Remove",
      });
      if (sure) editor.datasetChanged(await api.deleteDataset(id));
    }),
    { class: "small quiet-danger" },
  );

  const paths = pathForm({
    label: h("span", { class: "muted" }, "or a folder of the service's scene folder"),
    field: {
      placeholder: "chair",
      testid: "dataset-path",
      "aria-label": "Dataset folder below the service's scene folder",
    },
    button: ["Use", { class: "small", testid: "dataset-path-set" }],
    problem: "dataset-path-problem",
    send: (path) => api.putDatasetPath(store.state.scene.id, path),
    done: (scene) => editor.datasetChanged(scene),
  });
  store.watch(["info"], ({ info }) => (paths.hidden = !info?.scene_root));

  const facts = h("dl", { class: "facts", testid: "scene-facts" });
  const rename = button(
    "Rename",
    "rename",
    act(async () => {
      const name = await askText({ title: "Rename the scene", label: "Name", value: store.state.scene.name });
      if (name) await editor.rename(name);
    }),
  );
  store.watch(["scene", "version", "views", "edits", "drafts"], ({ scene, version }) => {
    if (!scene) return;
    const parent = parentOf(scene, version);
    undo.hidden = parent === null;
    text(undo, `Undo: back to version ${parent}`);
    update(treeOf(scene.versions));
    remove.hidden = !scene.dataset;
    dataset.replaceChildren(...datasetFacts(scene));
    const rows = [
      ["Name", scene.name],
      ["Format", `${scene.format.replace("_", " ")}, SH degree ${scene.sh_degree}`],
      ["Gaussians", count(scene.gaussians)],
      ["From", point(scene.bounds.low)],
      ["To", point(scene.bounds.high)],
      ["Centre", `${point(scene.centre)}; half within ${scene.radius.toPrecision(3)}`],
      ["Up", `${point(editor.worldUp)}${scene.up ? "" : " (default)"}`],
      ["On disk", bytes(scene.disk_bytes)],
      ["In memory", bytes(scene.memory_bytes)],
      ["Added", when(scene.created)],
    ];
    facts.replaceChildren(...rows.flatMap(([key, value]) => [h("dt", {}, key), h("dd", {}, value)]));
  });

  const element = h(
    "div",
    {},
    h("section", {}, h("div", { class: "row between" }, h("h2", {}, "Versions"), undo), problem, list),
    h(
      "section",
      {},
      h("h2", {}, "Cameras and photos"),
      dataset,
      row(
        button("Upload a dataset (.zip)…", "dataset-button", () => zip.click()),
        remove,
      ),
      zip,
      uploads,
      paths,
    ),
    h("section", {}, h("h2", {}, "Scene"), facts, h("div", { class: "row wrap" }, rename)),
  );
  return { element, uploadDataset: upload };
}

function datasetFacts({ dataset }) {
  if (!dataset)
    return [
      h(
        "p",
        { class: "muted" },
        "None. Edits look through virtual cameras around the handles. A zip of a COLMAP, nerfstudio or INRIA folder brings the real ones.",
      ),
    ];
  const photos = dataset.photos > 0 ? `, ${count(dataset.photos)} photos` : ", no photos";
  const facts = [h("p", {}, `${dataset.kind}: ${count(dataset.views)} views${photos}`)];
  if (dataset.psnr_mean_db !== null) {
    const worst =
      dataset.psnr_worst_db === null
        ? ""
        : `, worst ${dataset.psnr_worst_db.toFixed(1)} dB (${dataset.psnr_worst_view})`;
    facts.push(
      h("p", { class: "muted" }, `The scene against its photos: ${dataset.psnr_mean_db.toFixed(1)} dB${worst}`),
    );
  }
  return [...facts, ...warnings(dataset.warnings)];
}

/** A version in the tree: shown by a press, with a name, and what can be had of it. */
function versionRow(editor, number, act) {
  const name = h("span", {});
  const detail = h("span", { class: "muted" });
  const show = h(
    "button",
    { type: "button", class: "version-head", testid: `version-${number}`, onclick: () => editor.showVersion(number) },
    name,
    detail,
  );
  const current = () => editor.state.scene.versions.find((v) => v.version === number);
  const tag = `version-${number}`;
  const rename = button(
    "Name…",
    `${tag}-name`,
    act(async () => {
      const value = current().name ?? "";
      const wish = await askText({ title: `Name version ${number}`, label: "Name", value, optional: true });
      if (wish !== null) await editor.nameVersion(number, wish);
    }),
  );
  const branch = button(
    "Edit from here",
    `${tag}-branch`,
    () => {
      editor.showVersion(number);
      editor.store.set({ tab: "drag" });
    },
    { title: "What is made next is made of this version; the others stay" },
  );
  const keep = button("Keep", `${tag}-keep`, () => editor.keep(number), {
    title: "A draft goes when a better result of the same version is there, unless it is kept",
  });
  const remove = button(
    "Delete",
    `${tag}-delete`,
    act(async () => {
      const sure = await askConfirmation({
        title: `Delete version ${number}?`,
        detail: "It is gone for good. Versions that were made from it stay.",
        yes: "Delete",
      });
      if (sure) await editor.deleteVersion(number);
    }),
    { class: "small quiet-danger" },
  );
  const links = h("div", { class: "row wrap downloads" });
  const actions = h("div", { class: "row wrap version-actions" }, branch, rename, keep, number === 0 ? null : remove);
  const element = h("li", { class: "version" }, show, actions, links);
  return {
    element,
    update: ({ version, depth }) => {
      const { scene, edits, drafts, info } = editor.state;
      const shown = editor.state.version === number;
      const preset = edits.find(({ id }) => id === version.edit)?.request.preset;
      attrs(show, { "aria-pressed": String(shown) });
      attrs(element, { "aria-level": depth + 1, "data-depth": depth });
      element.style.marginLeft = `${14 * Math.min(depth, 8)}px`;
      const from = number === 0 ? ORIGINAL : `from ${version.parent}`;
      text(name, version.name ? `${version.name} · ${number}` : `Version ${number} · ${from}`);
      const made = version.edit ? ` · ${version.edit}${preset ? `, ${preset}` : ""}` : "";
      text(detail, `${gaussians(version.gaussians)} · ${when(version.created)}${made}`);
      keep.hidden = !drafts.some((draft) => draft.version === number);
      if (links.children.length > 0) return;
      const formats = [...(info?.formats?.write ?? ["ply", "splat", "spz", "sog", "glb"]), "original"];
      links.append(
        h("span", { class: "muted" }, "Download"),
        ...formats.map((format) => {
          const more = { href: api.fileUrl(scene.id, number, format), download: "", testid: `download-${number}-${format}` };
          // What somebody has taken home is not deleted behind their back.
          return h("a", { ...more, onclick: () => editor.keep(number) }, format.replace("_", " "));
        }),
      );
    },
  };
}
