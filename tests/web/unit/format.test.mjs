import assert from "node:assert/strict";
import { test } from "node:test";

import {
  bytes,
  coordinate,
  coordinates,
  count,
  counted,
  duration,
  gaussians,
  loss,
  nameOfFile,
  said,
  when,
} from "../../../web/format.js";

test("sizes, times and counts read as people write them", () => {
  assert.equal(bytes(999), "999 B");
  assert.equal(bytes(14_234_567), "14.2 MB");
  assert.equal(bytes(234_000_000), "234 MB");
  assert.equal(bytes(3e15), "3000 TB");
  assert.equal(bytes(undefined), "0 B");
  assert.equal(count(62000), "62,000");
  assert.equal(gaussians(1), "1 Gaussian");
  assert.equal(counted(2000, "handle"), "2,000 handles");
  assert.equal(loss(0.0123456), "0.0123");
  assert.equal(loss(2), "2");
  assert.equal(loss(null), "unknown");
  assert.equal(duration(0.0123), "12 ms");
  assert.equal(duration(0), "0.0 s");
  assert.equal(duration(0.44), "0.4 s");
  assert.equal(duration(12.3), "12 s");
  assert.equal(duration(200), "3 min 20 s");
  assert.equal(duration(59.7), "1 min");
  assert.equal(duration(7500), "2 h 5 min");
  assert.equal(duration(null), "");
  assert.equal(duration(NaN), "");
});

test("coordinates keep six digits and no tail", () => {
  assert.equal(coordinate(0.30000000000000004), "0.3");
  assert.equal(coordinate(-1234567.8), "-1234570");
  assert.equal(coordinate(-0), "0");
  assert.equal(coordinate(NaN), "");
});

test("a point's coordinates end at the same digit, so that rounding noise is nought", () => {
  assert.deepEqual(coordinates([2.9e-17, -0.3702401, 12.5]), ["0", "-0.3702", "12.5"]);
  assert.deepEqual(coordinates([0, 0, 0]), ["0", "0", "0"]);
  assert.deepEqual(coordinates([1e-7, 0.5e-7, 0]), ["1e-7", "5e-8", "0"]);
  assert.deepEqual(coordinates([1234567.8, 1, 2]), ["1234570", "1", "2"]);
});

test("a scene is named after its file, without what says its format", () => {
  assert.equal(nameOfFile("chair.ply"), "chair");
  assert.equal(nameOfFile("guitar.compressed.ply"), "guitar");
  assert.equal(nameOfFile("a.b.SPZ"), "a.b");
  assert.equal(nameOfFile(".ply"), ".ply");
});

test("times of today come without their date", () => {
  const now = new Date(2026, 10, 21, 15, 0);
  assert.match(when(new Date(2026, 10, 21, 11, 9).toISOString(), now), /^today /);
  assert.match(when(new Date(2026, 10, 20, 11, 9).toISOString(), now), /2026/);
  assert.equal(when("nonsense", now), "");
});

test("what the service says begins as a sentence does, and a name stays a name", () => {
  assert.equal(said("the queue is full"), "The queue is full");
  assert.equal(said("chair.ply is none"), "chair.ply is none");
  assert.equal(said("handles[0].radius: expected a number"), "handles[0].radius: expected a number");
  assert.equal(said("140 Gaussians"), "140 Gaussians");
  assert.equal(said(""), "");
});
