// The first page: the scenes there are, and how to bring one.

import * as api from "./api.js";
import { askConfirmation, askText } from "./dialogs.js";
import { asking, button, h, keyedList, problemPlace, showProblem, text } from "./dom.js";
import { bytes, count, counted, gaussians, nameOfFile, when } from "./format.js";
import { pathForm, showUpload } from "./uploads.js";

export const SCENE_FILES = /\.(ply|splat|spz|sog|glb)$/i;

const EVERY_MS = 1400; // Asked and not answered twice is less than three seconds. A choice.

/** The page.  open(id): go to a scene. */
export function buildScenes(home, { store, memory, open }) {
  const file = h("input", {
    type: "file",
    multiple: true,
    accept: ".ply,.splat,.spz,.sog,.glb",
    hidden: true,
    testid: "scene-file",
    "aria-label": "Scene file",
  });
  const uploads = h("div", { class: "uploads", testid: "uploads" });
  const problem = problemPlace("scenes-problem");
  const grid = h("ul", { class: "cards", testid: "scenes" });
  const limit = h("span", {});

  const upload = async (files) => {
    // One after the other: they would only share the line.
    for (const one of files)
      await showUpload(
        uploads,
        one,
        (options) => api.uploadScene(one, nameOfFile(one.name), options),
        (scene) => {
          refresh();
          if (files.length === 1) open(scene.id);
        },
      );
  };
  file.addEventListener("change", () => {
    const files = [...file.files];
    file.value = "";
    upload(files);
  });

  const paths = pathForm({
    label: h("label", { class: "muted" }, "or open a file of the service's scene folder"),
    field: {
      placeholder: "chair/point_cloud.ply",
      testid: "scene-path",
      "aria-label": "Path below the service's scene folder",
    },
    button: ["Open", { testid: "scene-path-open" }],
    problem: "path-problem",
    testid: "path-form",
    send: api.addScenePath,
    done: (scene) => open(scene.id),
  });

  const drop = h(
    "div",
    { class: "drop-area" },
    h("p", { class: "lead" }, "Drop a scene here"),
    h("p", { class: "muted" }, "A trained 3D Gaussian Splatting scene: .ply, compressed .ply, .splat, .spz, .sog or .glb", limit),
    h(
      "button",
      { type: "button", class: "primary", testid: "upload-button", onclick: () => file.click() },
      "Choose a file…",
    ),
    file,
    paths,
  );
  const empty = h("p", { class: "empty", testid: "no-scenes", hidden: true }, "There are no scenes yet.");

  home.append(
    h(
      "div",
      { class: "home-head" },
      h("h1", {}, "Scenes"),
      h(
        "p",
        { class: "muted" },
        "Edit trained 3D Gaussian Splatting scenes by dragging points. Every edit makes a new version; the original stays.",
      ),
    ),
    drop,
    uploads,
    problem,
    empty,
    grid,
  );

  const update = keyedList(
    grid,
    (scene) => scene.id,
    (scene) => card(scene.id, { memory, open, refresh: () => refresh() }),
  );
  store.watch(["scenes", "info"], ({ scenes, info }) => {
    update(scenes ?? []);
    empty.hidden = scenes === null || scenes.length > 0;
    paths.hidden = !info?.scene_root;
    text(limit, info?.limits?.upload_bytes ? `, up to ${bytes(info.limits.upload_bytes)}` : "");
  });

  // Others bring and take scenes, too, and a service that went away is said to have: the list has no stream. Who has not
  // signed in is not asked each time.
  let refused = false;
  setInterval(() => home.hidden || document.hidden || refused || refresh(), EVERY_MS);

  async function refresh() {
    try {
      const scenes = await api.scenes(AbortSignal.timeout(EVERY_MS));
      refused = false;
      // Youngest first: ids count up.
      store.set({ scenes: [...scenes].sort((a, b) => (a.id < b.id ? 1 : -1)) });
      showProblem(problem, null);
    } catch (error) {
      refused = error.status === 401;
      showProblem(problem, error);
    }
  }
  return { refresh, upload };
}

function card(id, { memory, open, refresh }) {
  const picture = h("img", { alt: "", hidden: true });
  const blank = h("span", { class: "blank", "aria-hidden": "true" });
  const name = h("a", { class: "scene-name", href: `#/scenes/${id}`, testid: "scene-open" });
  const facts = h("p", { class: "muted" });
  const more = h("p", { class: "muted" });
  const problem = problemPlace("scene-problem");
  let current = null;
  const rename = asking(problem, async () => {
    const wish = await askText({ title: "Rename the scene", label: "Name", value: current.name });
    if (!wish) return;
    await api.patchScene(id, { name: wish });
    await refresh();
  });
  const remove = asking(problem, async () => {
    const n = current.versions.length - 1;
    const sure = await askConfirmation({
      title: `Delete “${current.name}”?`,
      detail: `The scene${n > 0 ? ` and its ${counted(n, "edited version")}` : ""} will be gone from the service. This cannot be undone.`,
      yes: "Delete",
    });
    if (!sure) return;
    await api.deleteScene(id);
    memory.forget(id);
    await refresh();
  });
  const element = h(
    "li",
    { class: "card", testid: `scene-${id}` },
    h(
      "button",
      { type: "button", class: "picture", tabindex: "-1", "aria-hidden": "true", onclick: () => open(id) },
      blank,
      picture,
    ),
    h("div", { class: "card-body" }, name, facts, more, problem),
    h(
      "div",
      { class: "row card-actions" },
      button("Rename", "scene-rename", rename),
      button("Delete", "scene-delete", remove, { class: "small quiet-danger" }),
    ),
  );
  return {
    element,
    update: (scene) => {
      current = scene;
      const thumbnail = memory.load(scene)?.thumbnail;
      picture.hidden = !thumbnail;
      if (thumbnail && picture.src !== thumbnail) picture.src = thumbnail;
      text(name, scene.name);
      const versions = counted(scene.versions.length, "version");
      text(
        facts,
        `${gaussians(scene.gaussians)} · SH degree ${scene.sh_degree} · ${scene.format.replace("_", " ")} · ${bytes(scene.disk_bytes)}`,
      );
      const views = scene.dataset ? `${count(scene.dataset.views)} views` : "no dataset";
      text(more, `${versions} · ${views} · ${when(scene.created)} · ${scene.id}`);
    },
  };
}
