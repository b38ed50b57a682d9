import assert from "node:assert/strict";
import { test } from "node:test";

import { statusLine } from "../../../web/edits.js";

const edit = (patch) => ({
  state: "running",
  stage: "deform",
  interval: 2,
  intervals: 5,
  eta_seconds: 12.4,
  finished_intervals: [],
  ...patch,
});

test("a waiting edit says which number it is", () => {
  assert.equal(statusLine(edit({ state: "queued", queue_position: 1 })), "Next in the queue");
  assert.equal(statusLine(edit({ state: "queued", queue_position: 4 })), "Number 4 in the queue");
  assert.equal(statusLine(edit({ state: "queued", queue_position: null })), "Next in the queue");
});

test("a running edit says stage, interval and how long it will take, as far as they are known", () => {
  assert.equal(statusLine(edit()), "Deforming · interval 2 of 5 · about 12 s left");
  assert.equal(statusLine(edit({ stage: null, interval: 0, intervals: 0, eta_seconds: null })), "Starting");
  assert.equal(statusLine(edit({ stage: "something new", eta_seconds: null })), "something new · interval 2 of 5");
});

test("an edit that optimises says how far it is and what it has reached", () => {
  assert.equal(
    statusLine(edit({ stage: "optimise", iteration: 1200, iterations: 2000, loss: 0.012345, eta_seconds: null })),
    "Optimising · interval 2 of 5 · iteration 1,200 of 2,000, loss 0.0123",
  );
  assert.equal(
    statusLine(edit({ iteration: 0, iterations: 2000, loss: null, eta_seconds: null })),
    "Deforming · interval 2 of 5",
  );
});

test("an edit that is done names its version, and whether it was stopped early", () => {
  assert.equal(statusLine(edit({ state: "succeeded", result_version: 3 })), "Version 3");
  const stopped = edit({ state: "succeeded", result_version: 3, stopped_early: true, finished_intervals: [{}, {}] });
  assert.equal(statusLine(stopped), "Version 3, stopped after interval 2 of 5");
});
