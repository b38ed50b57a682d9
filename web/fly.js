// Flying: while keys are held, the camera goes ahead, aside, up and down, and a drag looks around.

/** Which way keys fly: shares of a step to the right, up and ahead. */
const WAYS = {
  w: [0, 0, 1],
  s: [0, 0, -1],
  a: [-1, 0, 0],
  d: [1, 0, 0],
  e: [0, 1, 0],
  q: [0, -1, 0],
  arrowup: [0, 0, 1],
  arrowdown: [0, 0, -1],
  arrowleft: [-1, 0, 0],
  arrowright: [1, 0, 0],
};
// Choices: the distance to the pivot takes two seconds, with Shift half a one; a tap is seen, and a page that was busy
// makes no leap.
const PER_SECOND = 0.5;
const FAST = 4;
const FIRST_STEP_S = 0.03;
const LONGEST_STEP_S = 0.1;

export class Flight {
  #fly;
  #held = new Map(); // From keys to whether they are fast.
  #frame = null;
  #before = 0;

  /**   fly([right, up, ahead])  goes so many times the distance to the pivot */
  constructor(fly) {
    this.#fly = fly;
  }

  /** A key went down. Returns whether it flies. */
  press(key, fast) {
    if (!Object.hasOwn(WAYS, key)) return false;
    const first = !this.#held.has(key);
    this.#held.set(key, fast);
    if (first) this.#go(FIRST_STEP_S, [key]);
    this.#frame ??= requestAnimationFrame((now) => ((this.#before = now), this.#next()));
    return true;
  }

  release(key) {
    this.#held.delete(key);
  }

  stop() {
    this.#held.clear();
  }

  #next() {
    this.#frame =
      this.#held.size === 0
        ? null
        : requestAnimationFrame((now) => {
            this.#go(Math.min((now - this.#before) / 1000, LONGEST_STEP_S), this.#held.keys());
            this.#before = now;
            this.#next();
          });
  }

  #go(seconds, keys) {
    const step = [0, 0, 0];
    for (const key of keys) {
      const length = PER_SECOND * seconds * (this.#held.get(key) ? FAST : 1);
      WAYS[key].forEach((share, axis) => (step[axis] += share * length));
    }
    if (step.some((x) => x !== 0)) this.#fly(step);
  }
}
