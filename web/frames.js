// Requests for pictures while the camera moves: how large, and in which order.

/** Chooses the size of pictures while moving so that one comes back in about `goal` ms. */
export class AdaptiveSide {
  #side;

  constructor({ start = 400, min = 160, max = 960, goal = 90 } = {}) {
    this.#side = start;
    this.limits = { min, max, goal };
  }

  /** Longer side, pixels. */
  get side() {
    return Math.round(this.#side / 16) * 16;
  }

  /** A picture of the present size took `ms` from question to screen. */
  record(ms) {
    const { min, max, goal } = this.limits;
    // Cost grows with the area, in part: half of the correction, and no more than a third at once, so that one slow
    // answer (a scene just being loaded) does not spoil the rest.
    const factor = Math.min(1.2, Math.max(0.75, Math.sqrt(goal / Math.max(1, ms))));
    this.#side = Math.min(max, Math.max(min, this.#side * factor));
  }
}

/** Requests one picture at a time; of the requests made meanwhile, only the latest is carried out next. An older answer
 *  can therefore never replace a newer one.
 *    load(job, signal)        returns the picture
 *    onPicture(picture, job)  is called when it has arrived
 *    onError(error, job)      is called when loading failed, but not for a picture that was given up
 *  A job is {key, large, ...}: equal keys are equal pictures; a large one is given up as soon as another is requested. */
export class FrameQueue {
  #running = null;
  #next = null;

  constructor({ load, onPicture, onError }) {
    Object.assign(this, { load, onPicture, onError });
  }

  get busy() {
    return this.#running !== null;
  }

  request(job) {
    if (!this.#running) {
      this.#start(job);
    } else if (this.#running.job.key === job.key && !this.#running.abort.signal.aborted) {
      this.#next = null;
    } else {
      this.#next = job;
      if (this.#running.job.large) this.#running.abort.abort();
    }
  }

  /** Gives everything up. */
  clear() {
    this.#next = null;
    this.#running?.abort.abort();
  }

  async #start(job) {
    const abort = new AbortController();
    this.#running = { job, abort };
    let outcome;
    try {
      const picture = await this.load(job, abort.signal);
      outcome = () => this.onPicture(picture, job);
    } catch (error) {
      outcome = () => this.onError(error, job);
    }
    this.#running = null;
    if (!abort.signal.aborted) outcome();
    // The call may itself have led to a new request, which is then under way.
    const next = this.#next;
    this.#next = null;
    if (next && !this.#running) this.#start(next);
  }
}

/** A cache of the last few values by key; the least recently used go first.
 *    onEvict(value)  is called for each that goes */
export class Recent {
  #entries = new Map();

  constructor(limit, onEvict = () => {}) {
    Object.assign(this, { limit, onEvict });
  }

  get(key) {
    const value = this.#entries.get(key);
    if (value === undefined) return undefined;
    this.#entries.delete(key);
    this.#entries.set(key, value);
    return value;
  }

  put(key, value) {
    const old = this.#entries.get(key);
    if (old !== undefined && old !== value) this.onEvict(old);
    this.#entries.delete(key);
    this.#entries.set(key, value);
    while (this.#entries.size > this.limit) {
      const [oldest, gone] = this.#entries.entries().next().value;
      this.#entries.delete(oldest);
      this.onEvict(gone);
    }
  }

  clear() {
    for (const value of this.#entries.values()) this.onEvict(value);
    this.#entries.clear();
  }
}
