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

  /** The value before `present`; undefined if there is none. */
  undo(present) {
    if (this.#past.length === 0) return undefined;
    this.#future.push(present);
    return this.#past.pop();
  }

  redo(present) {
    if (this.#future.length === 0) return undefined;
    this.#past.push(present);
    return this.#future.pop();
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
