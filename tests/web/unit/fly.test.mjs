import assert from "node:assert/strict";
import { afterEach, beforeEach, test } from "node:test";

import { Flight } from "../../../web/fly.js";

let frames, flown, flight;
beforeEach(() => {
  frames = [];
  globalThis.requestAnimationFrame = (fn) => frames.push(fn);
  flown = [0, 0, 0];
  flight = new Flight((step) => (flown = flown.map((x, i) => x + step[i])));
});
afterEach(() => delete globalThis.requestAnimationFrame);
const frame = (now) => frames.splice(0).forEach((fn) => fn(now));

test("a tap is a step, and a key that is held goes on in proportion to time", () => {
  assert.ok(flight.press("w", false));
  const tap = flown[2];
  assert.ok(tap > 0 && flown[0] === 0 && flown[1] === 0);
  frame(1000);
  frame(1050);
  const held = flown[2] - tap;
  frame(1070);
  assert.ok(Math.abs(flown[2] - tap - (70 / 50) * held) < 1e-12);
  flight.release("w");
  const before = flown[2];
  frame(1090);
  assert.equal(flown[2], before);
  assert.equal(frames.length, 0, "nothing goes on for nobody");
});

test("keys add up, opposites cancel, and shift is faster", () => {
  flight.press("d", false);
  flight.press("e", true);
  assert.ok(flown[0] > 0 && Math.abs(flown[1] - 4 * flown[0]) < 1e-12);
  const before = [...flown];
  flight.press("a", false);
  flight.press("q", true);
  frame(0);
  frame(40);
  flown.forEach((x, i) => assert.ok(Math.abs(x - [0, 0, 0][i]) < 1e-12, `${before} and back: ${flown}`));
});

test("repeats of a key are one key, other keys are not the flight's, and a page that was busy makes no leap", () => {
  flight.press("arrowup", false);
  const tap = flown[2];
  flight.press("arrowup", false);
  assert.equal(flown[2], tap);
  for (const key of ["x", "escape", "constructor", " "]) assert.equal(flight.press(key, false), false);
  frame(0);
  frame(60_000);
  assert.ok(flown[2] - tap < 0.1);
  flight.stop();
  frame(60_001);
  assert.equal(frames.length, 0);
});
