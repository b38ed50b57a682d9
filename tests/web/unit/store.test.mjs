import assert from "node:assert/strict";
import { test } from "node:test";

import { History } from "../../../web/history.js";
import { SceneMemory, Store } from "../../../web/store.js";
import { namedAs } from "../../../web/uploads.js";
import { memoryStorage } from "./stand_ins.mjs";

const settle = () => new Promise((resolve) => setImmediate(resolve));

test("a watcher is told at once, then once per change of its keys", async () => {
  const store = new Store({ a: 1, b: 1 });
  const seen = [];
  store.watch(["a"], (state) => seen.push(state.a));
  store.set({ a: 2 });
  store.set({ a: 3, b: 2 });
  store.set({ b: 3 });
  await settle();
  store.set({ a: 3 });
  store.set({ b: 4 });
  await settle();
  assert.deepEqual(seen, [1, 3]);
});

test("a watcher may set what another one watches", async () => {
  const store = new Store({ a: 1, doubled: 0 });
  const seen = [];
  store.watch(["a"], ({ a }) => store.set({ doubled: 2 * a }));
  store.watch(["doubled"], ({ doubled }) => seen.push(doubled));
  store.set({ a: 5 });
  await settle();
  assert.equal(seen.at(-1), 10);
});

test("one that stopped watching is not told", async () => {
  const store = new Store({ a: 1 });
  let told = 0;
  store.watch(["a"], () => ++told)();
  store.set({ a: 2 });
  await settle();
  assert.equal(told, 1);
});

function storage() {
  const items = new Map();
  return {
    getItem: (key) => items.get(key) ?? null,
    setItem: (key, value) => void items.set(key, value),
    removeItem: (key) => void items.delete(key),
  };
}

test("what was saved for a scene comes back, but not for another scene of the same id", () => {
  const memory = new SceneMemory(storage());
  const scene = { id: "s000001", created: "2026-01-01" };
  memory.save(scene, { version: 3 });
  assert.equal(memory.load(scene).version, 3);
  assert.equal(memory.load({ ...scene, created: "2026-02-02" }), null);
  memory.forget(scene.id);
  assert.equal(memory.load(scene), null);
});

test("storage that is full, forbidden or spoilt does no harm", () => {
  const refuse = () => {
    throw new Error("forbidden");
  };
  const memory = new SceneMemory({ getItem: refuse, setItem: refuse, removeItem: refuse });
  const scene = { id: "s1", created: "x" };
  memory.save(scene, {});
  memory.forget("s1");
  assert.equal(memory.load(scene), null);
  const spoilt = storage();
  spoilt.setItem("splatdrag.scene.s1", "{");
  assert.equal(new SceneMemory(spoilt).load(scene), null);
});

test("undo and redo walk through what was there", () => {
  const history = new History();
  const [a, b, c] = [["a"], ["b"], ["c"]];
  history.note(a);
  history.note(b);
  assert.equal(history.undo(c), b);
  assert.equal(history.undo(b), a);
  assert.equal(history.undo(a), undefined);
  assert.equal(history.redo(a), b);
  history.note(b);
  assert.equal(history.canRedo, false, "a new change forgets what was undone");
});

test("what cannot be gone back to is forgotten, and leaves nothing to do again", () => {
  const history = new History();
  history.note("gone");
  const isUsable = (value) => value !== "gone";
  assert.equal(history.undo("here", isUsable), undefined);
  assert.deepEqual([history.canUndo, history.canRedo], [false, false]);
  for (const value of ["first", "gone"]) history.note(value);
  assert.equal(history.undo("here", isUsable), "first");
  assert.equal(history.redo("first", isUsable), "here");
});

test("history forgets what is too long ago", () => {
  const history = new History(2);
  for (const value of [1, 2, 3]) history.note(value);
  assert.equal(history.undo(4), 3);
  assert.equal(history.undo(3), 2);
  assert.equal(history.undo(2), undefined);
});

test("single letters are keys until they are turned off, which outlives a reload", () => {
  const storage = memoryStorage();
  const memory = new SceneMemory(storage);
  assert.equal(memory.letterKeys, true);
  memory.letterKeys = false;
  assert.equal(new SceneMemory(storage).letterKeys, false);
  memory.letterKeys = true;
  assert.equal(new SceneMemory(storage).letterKeys, true);
  const forgetful = new SceneMemory({ getItem: () => null, setItem: () => {} });
  forgetful.letterKeys = false;
  assert.equal(forgetful.letterKeys, false, "as long as the page is open, where nothing may be stored");
});

test("what was uploaded has the name that the user knows", () => {
  const named = (where) => namedAs("chair.ply", { detail: "no", where }).where;
  assert.equal(named("upload:vertex[3].x"), "chair.ply:vertex[3].x");
  assert.equal(named("upload"), "chair.ply");
  assert.equal(named("uploads"), "uploads");
  assert.equal(named(undefined), "");
  const { detail } = namedAs("chair.ply", { detail: "upload (19 bytes) is no scene" });
  assert.equal(detail, "chair.ply (19 bytes) is no scene");
  assert.equal(namedAs("a$&b.ply", { detail: "upload: no" }).detail, "a$&b.ply: no", "whatever is in that name");
});
