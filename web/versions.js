// The scene itself: its versions with undo and downloads, its dataset, its up direction.

import * as api from "./api.js";
import { askText, say } from "./dialogs.js";
import { asking, attrs, h, keyedList, problemPlace, text } from "./dom.js";
import { parentOf } from "./editor.js";
import { bytes, count, gaussians, point, when } from "./format.js";
import { warnings } from "./request_panel.js";
import { pathForm, showUpload } from "./uploads.js";

export function buildVersions(editor) {
  const { store } = editor;
  const undo = h("button", {
    type: "button",
    class: "small",
    testid: "undo-version",
    onclick: () => editor.showVersion(parentOf(store.state.scene, store.state.version)),
  });
  const list = h("ol", { class: "versions", testid: "versions" });
  const update = keyedList(
    list,
    (version) => version.version,
    (version) => row(editor, version.version),
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
  const problem = problemPlace("scene-tab-problem");
  const button = (label, testid, onclick, extra) =>
    h("button", { type: "button", class: "small", testid, onclick, ...extra }, label);
  const rename = button(
    "Rename",
    "rename",
    asking(problem, async () => {
      const name = await askText({ title: "Rename the scene", label: "Name", value: store.state.scene.name });
      if (name) await editor.rename(name);
    }),
  );

  store.watch(["scene", "version", "views"], ({ scene, version }) => {
    if (!scene) return;
    const parent = parentOf(scene, version);
    undo.hidden = parent === null;
    text(undo, `Undo: back to version ${parent}`);
    update([...scene.versions].reverse());
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
    h("section", {}, h("div", { class: "row between" }, h("h2", {}, "Versions"), undo), list),
    h(
      "section",
      {},
      h("h2", {}, "Cameras and photos"),
      dataset,
      h(
        "button",
        { type: "button", class: "small", testid: "dataset-button", onclick: () => zip.click() },
        "Upload a dataset (.zip)…",
      ),
      zip,
      uploads,
      paths,
    ),
    h("section", {}, h("h2", {}, "Scene"), facts, problem, h("div", { class: "row wrap" }, rename)),
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

function row(editor, number) {
  const name = h("span", {});
  const detail = h("span", { class: "muted" });
  const show = h(
    "button",
    { type: "button", class: "version-head", testid: `version-${number}`, onclick: () => editor.showVersion(number) },
    name,
    detail,
  );
  const links = h("div", { class: "row downloads" });
  const element = h("li", { class: "version" }, show, links);
  return {
    element,
    update: (version) => {
      const { scene } = editor.state;
      const current = editor.state.version === number;
      attrs(show, { "aria-pressed": String(current) });
      text(name, number === 0 ? "Version 0 · as uploaded" : `Version ${number} · from ${version.parent}`);
      text(
        detail,
        `${gaussians(version.gaussians)} · ${when(version.created)}${version.edit ? ` · ${version.edit}` : ""}`,
      );
      if (links.children.length === 0)
        links.append(
          h("span", { class: "muted" }, "Download"),
          ...["ply", "splat", "spz", "sog", "glb"].map((format) =>
            h(
              "a",
              { href: api.fileUrl(scene.id, number, format), download: "", testid: `download-${number}-${format}` },
              format,
            ),
          ),
        );
    },
  };
}
