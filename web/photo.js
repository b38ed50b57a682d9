// The dataset's photo, over the picture of its camera.

import * as api from "./api.js";
import { attrs, byId, h, iconButton } from "./dom.js";
import { pictureIn } from "./framing.js";

const SIDE = 1600; // Pixels of the longer side: as large as pictures are at rest.

/** Places an element over the picture of a view, as the camera on the screen sees it. */
export function placeOver(element, { x, y, width, height }) {
  Object.assign(element.style, { left: `${x}px`, top: `${y}px`, width: `${width}px`, height: `${height}px` });
}

/** The view whose picture is on the screen, by its own name; null once the camera has been moved. */
export const viewOf = ({ views, viewName }) => views.find(({ name }) => name === viewName) ?? null;

export function buildPhoto(editor, viewer) {
  const { store } = editor;
  const img = h("img", { id: "photo", alt: "", hidden: true, testid: "photo" });
  const strength = h("input", { type: "range", min: 0, max: 100, value: 100, testid: "photo-strength" });
  attrs(strength, { "aria-label": "How much of the photo is seen", title: "How much of the photo is seen" });
  const toggle = iconButton("▣", "photo-toggle", "The dataset's photo over the picture (O)", () => editor.togglePhoto());
  const element = h("div", { class: "photo-tools" }, strength, toggle);
  byId("picture").after(img);
  byId("view-tools").append(element);

  const update = () => {
    const { scene, photoOn } = store.state;
    const view = viewOf(store.state);
    const has = view?.photo === true;
    element.hidden = !has;
    strength.hidden = !photoOn;
    attrs(toggle, { "aria-pressed": String(photoOn) });
    img.hidden = !has || !photoOn || !viewer.camera;
    if (img.hidden) return;
    const url = api.photoUrl(scene.id, view.name, Math.min(SIDE, store.state.info?.limits?.render_side ?? SIDE));
    attrs(img, { src: url, alt: `Photo ${view.name}` });
    placeOver(img, pictureIn(viewer.camera, view));
    img.style.opacity = strength.valueAsNumber / 100;
  };
  strength.addEventListener("input", update);
  img.addEventListener("error", () => {
    if (img.hidden) return;
    editor.say("The photo could not be shown.", { kind: "bad" });
    store.set({ photoOn: false });
  });
  byId("view").addEventListener("shown", update);
  store.watch(["scene", "views", "viewName", "photoOn", "pose"], update);
}
