// The state of the page: one object, changed through set(), watched by key. And what of it outlives a reload.

/** A store over plain values. Values are replaced, never changed in place. Watchers are told once per turn of the event
 *  loop, however often their keys were set in it. */
export class Store {
  #state;
  #watchers = [];
  #changed = new Set();

  constructor(initial) {
    this.#state = { ...initial };
  }

  get state() {
    return this.#state;
  }

  set(patch) {
    for (const [key, value] of Object.entries(patch)) {
      if (Object.is(this.#state[key], value)) continue;
      if (this.#changed.size === 0) queueMicrotask(() => this.#tell());
      this.#changed.add(key);
      this.#state = { ...this.#state, [key]: value };
    }
  }

  /** Calls fn(state) now, and whenever one of the keys has another value. Returns a function that ends it. */
  watch(keys, fn) {
    const watcher = { keys, fn };
    this.#watchers.push(watcher);
    fn(this.#state);
    return () => {
      this.#watchers = this.#watchers.filter((w) => w !== watcher);
    };
  }

  #tell() {
    const changed = this.#changed;
    this.#changed = new Set();
    for (const { keys, fn } of this.#watchers) if (keys.some((key) => changed.has(key))) fn(this.#state);
  }
}

const PREFIX = "splatdrag.scene.";
const LETTER_KEYS = "splatdrag.letter_keys";

/** What is kept for each scene in the browser's storage, by id. A record of another scene that had the same id (of
 *  another service at this address) is not used: `created` tells them apart. */
export class SceneMemory {
  #letterKeys = null; // As set on this page: where storage is forbidden, all that is known.

  constructor(storage) {
    this.storage = storage;
  }

  /** Whether single letters are keys for commands. */
  get letterKeys() {
    if (this.#letterKeys !== null) return this.#letterKeys;
    try {
      return this.storage.getItem(LETTER_KEYS) !== "off";
    } catch {
      return true;
    }
  }

  set letterKeys(on) {
    this.#letterKeys = on;
    try {
      this.storage.setItem(LETTER_KEYS, on ? "on" : "off");
    } catch {
      // As below.
    }
  }

  load(scene) {
    try {
      const record = JSON.parse(this.storage.getItem(PREFIX + scene.id) ?? "null");
      return record && record.created === scene.created ? record : null;
    } catch {
      return null;
    }
  }

  save(scene, record) {
    try {
      this.storage.setItem(PREFIX + scene.id, JSON.stringify({ ...record, created: scene.created }));
    } catch {
      // Storage is full or forbidden: the page works without, and forgets.
    }
  }

  forget(id) {
    try {
      this.storage.removeItem(PREFIX + id);
    } catch {
      // As above.
    }
  }
}
