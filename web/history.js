// Undo and redo of what the user placed. Entries are values that are never changed in place.

export class History {
  #past = [];
  #future = [];

  /** limit: entries that can be undone; a choice. */
  constructor(limit = 100) {
    this.limit = limit;
  }

  /** Notes the value that is about to be replaced. */
  note(value) {
    if (this.#past.at(-1) === value) return;
    this.#past.push(value);
    if (this.#past.length > this.limit) this.#past.shift();
    this.#future = [];
  }

  /** The value before `present`; undefined if there is none.
   *    isUsable  whether a value can still be gone back to; those that cannot are forgotten */
  undo(present, isUsable = () => true) {
    return step(this.#past, this.#future, present, isUsable);
  }

  redo(present, isUsable = () => true) {
    return step(this.#future, this.#past, present, isUsable);
  }

  clear() {
    this.#past = [];
    this.#future = [];
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }
}

/** The latest usable value of a list, for which `present` goes to the other one. */
function step(from, to, present, isUsable) {
  while (from.length > 0) {
    const value = from.pop();
    if (!isUsable(value)) continue;
    to.push(present);
    return value;
  }
  return undefined;
}
