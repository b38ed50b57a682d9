// Requests for pictures while the camera moves: how large, and in which order.

/** Chooses the size of pictures while moving so that the service works about `goal` ms on one. The way there and back
 *  has no say in it: smaller pictures would not come sooner for it. */
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

  /** A picture of the present size took the service so many ms.
   *    atOnce  of so many at a time: they share its cores, so that one comes this much more often than each takes */
  record(took, atOnce = 1) {
    const ms = took / Math.max(1, atOnce);
    const { min, max, goal } = this.limits;
    // Cost grows with the area, in part: half of the correction, and no more than a third at once, so that one slow
    // answer (a scene just being loaded) does not spoil the rest.
    const factor = Math.min(1.2, Math.max(0.75, Math.sqrt(goal / Math.max(1, ms))));
    this.#side = Math.min(max, Math.max(min, this.#side * factor));
  }
}

/** How long the service worked on a picture, ms, by its Server-Timing header; null where that says nothing. */
export function serverTime(header) {
  const times = [...(header ?? "").matchAll(/;\s*dur=([\d.]+)/g)].map(([, ms]) => Number(ms));
  return times.length > 0 ? times.reduce((sum, ms) => sum + ms, 0) : null;
}

/** Requests pictures, a few at a time; of the requests made meanwhile, only the latest is carried out next. An answer
 *  that comes after that of a later request is dropped: an older picture never replaces a newer one. A failure is told
 *  only of the latest request; pictures of earlier ones are shown still.
 *    load(job, signal)        returns the picture
 *    onPicture(picture, job)  is called when it has arrived
 *    onError(error, job)      is called when loading failed, but not for a picture that was given up
 *    atOnce                   so many small ones are under way at most: the way there and back then costs no pictures
 *  A job is {key, large, ...}: equal keys are equal pictures; a large one goes alone, and is given up as soon as another
 *  is requested. */
export class FrameQueue {
  #running = []; // In the order in which they were requested.
  #next = null;
  #count = 0;
  #latest = 0; // Number of the latest request whose picture was shown.

  constructor({ load, onPicture, onError, atOnce = 1 }) {
    Object.assign(this, { load, onPicture, onError, atOnce });
  }

  get busy() {
    return this.#running.length > 0;
  }

  /** How many are under way; for load(), this one among them. */
  get underWay() {
    return this.#running.length;
  }

  request(job) {
    const last = this.#running.at(-1);
    if (last?.job.key === job.key && !last.abort.signal.aborted) {
      this.#next = null;
      return;
    }
    if (this.#hasRoomFor(job)) return this.#start(job);
    this.#next = job;
    for (const one of this.#running) if (one.job.large) one.abort.abort();
  }

  #hasRoomFor({ large }) {
    if (this.#running.length === 0) return true;
    return !large && this.#running.length < this.atOnce && !this.#running.some((one) => one.job.large);
  }

  /** Gives everything up. */
  clear() {
    this.#next = null;
    for (const one of this.#running) one.abort.abort();
  }

  async #start(job) {
    const one = { job, abort: new AbortController(), number: ++this.#count };
    this.#running.push(one);
    let picture = null;
    let failure = null;
    try {
      picture = await this.load(job, one.abort.signal);
    } catch (error) {
      failure = { error };
    }
    this.#running = this.#running.filter((other) => other !== one);
    const outdated = one.abort.signal.aborted || one.number < this.#latest;
    if (!outdated && !failure) {
      this.#latest = one.number;
      this.onPicture(picture, job);
    } else if (!outdated && !this.#running.some(({ number }) => number > one.number)) {
      this.onError(failure.error, job);
    }
    // The call may itself have led to a new request, which is then under way.
    const next = this.#next;
    if (!next || !this.#hasRoomFor(next)) return;
    this.#next = null;
    this.#start(next);
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
