import assert from "node:assert/strict";
import { test } from "node:test";

import { AdaptiveSide, FrameQueue, Recent, serverTime } from "../../../web/frames.js";

/** A queue whose loads are answered by hand. */
function byHand(atOnce) {
  const loads = [];
  const shown = [];
  const failed = [];
  const queue = new FrameQueue({
    load: (job, signal) =>
      new Promise((resolve, reject) => {
        loads.push({ job, resolve, reject, signal });
        signal.addEventListener("abort", () => reject(Object.assign(new Error("given up"), { name: "AbortError" })));
      }),
    onPicture: (picture, job) => shown.push([picture, job.key]),
    onError: (error, job) => failed.push([error.message, job.key]),
    atOnce,
  });
  return { queue, loads, shown, failed };
}
const settle = () => new Promise((resolve) => setImmediate(resolve));

test("one picture is asked for at a time, and of those wished for meanwhile only the latest", async () => {
  const { queue, loads, shown } = byHand();
  for (const key of ["a", "b", "c", "d"]) queue.request({ key });
  assert.deepEqual(
    loads.map((a) => a.job.key),
    ["a"],
  );
  loads[0].resolve("A");
  await settle();
  assert.deepEqual(
    loads.map((a) => a.job.key),
    ["a", "d"],
  );
  loads[1].resolve("D");
  await settle();
  assert.deepEqual(shown, [
    ["A", "a"],
    ["D", "d"],
  ]);
  assert.equal(queue.busy, false);
});

test("a large picture is given up for a newer wish, and is never shown", async () => {
  const { queue, loads, shown, failed } = byHand();
  queue.request({ key: "large", large: true });
  queue.request({ key: "small" });
  loads[0].resolve("too late");
  await settle();
  assert.ok(loads[0].signal.aborted);
  assert.deepEqual(
    loads.map((a) => a.job.key),
    ["large", "small"],
  );
  loads[1].resolve("S");
  await settle();
  assert.deepEqual(shown, [["S", "small"]]);
  assert.deepEqual(failed, []);
});

test("a wish for what is under way cancels what was wished for in between", async () => {
  const { queue, loads } = byHand();
  queue.request({ key: "a" });
  queue.request({ key: "b" });
  queue.request({ key: "a" });
  loads[0].resolve("A");
  await settle();
  assert.equal(loads.length, 1);
});

test("after a failure the next wish is still met", async () => {
  const { queue, loads, failed } = byHand();
  queue.request({ key: "a" });
  queue.request({ key: "b" });
  loads[0].reject(new Error("no"));
  await settle();
  assert.deepEqual(failed, [["no", "a"]]);
  assert.equal(loads[1].job.key, "b");
});

test("a queue that was cleared shows nothing more", async () => {
  const { queue, loads, shown } = byHand();
  queue.request({ key: "a" });
  queue.request({ key: "b" });
  queue.clear();
  loads[0].resolve("A");
  await settle();
  assert.deepEqual(shown, []);
  assert.equal(loads.length, 1);
  assert.equal(queue.busy, false);
});

test("several are on their way at once, and an older one never replaces a newer one", async () => {
  const { queue, loads, shown } = byHand(3);
  for (const key of ["a", "b", "c", "d", "e"]) queue.request({ key });
  const asked = () => loads.map((a) => a.job.key).join("");
  assert.equal(asked(), "abc");
  loads[1].resolve("B");
  await settle();
  assert.equal(asked(), "abce", "of those wished for meanwhile the latest");
  loads[0].resolve("A");
  loads[3].resolve("E");
  await settle();
  loads[2].resolve("C");
  await settle();
  assert.deepEqual(
    shown.map(([, key]) => key),
    ["b", "e"],
  );
  assert.equal(queue.busy, false);
});

test("a failed request drops no picture of an earlier one, and is told of only if it is the latest", async () => {
  const { queue, loads, shown, failed } = byHand(3);
  for (const key of ["a", "b", "c"]) queue.request({ key });
  assert.equal(queue.underWay, 3);
  loads[1].reject(new Error("no"));
  await settle();
  assert.deepEqual(failed, [], "a later one is under way");
  loads[0].resolve("A");
  await settle();
  assert.deepEqual(shown, [["A", "a"]]);
  loads[2].reject(new Error("never"));
  await settle();
  assert.deepEqual(failed, [["never", "c"]]);
  for (const key of ["d", "e"]) queue.request({ key });
  loads[4].resolve("E");
  await settle();
  loads[3].reject(new Error("late"));
  await settle();
  assert.equal(failed.length, 1, "a newer one is shown");
  assert.equal(queue.underWay, 0);
});

test("a large picture goes alone", async () => {
  const { queue, loads } = byHand(3);
  queue.request({ key: "a" });
  queue.request({ key: "large", large: true });
  assert.equal(loads.length, 1, "it waits for the small ones");
  loads[0].resolve("A");
  await settle();
  assert.equal(loads[1].job.key, "large");
  queue.request({ key: "b" });
  await settle();
  assert.ok(loads[1].signal.aborted);
  assert.equal(loads[2].job.key, "b");
});

test("the service says how long it worked", () => {
  assert.equal(serverTime("render;dur=30.5, encode;dur=4.5"), 35);
  assert.equal(serverTime(null), null);
  assert.equal(serverTime("cache"), null);
});

test("slow answers make moving pictures smaller, quick ones larger, within limits", () => {
  const side = new AdaptiveSide({ start: 400, min: 160, max: 960, goal: 90 });
  assert.equal(side.side, 400);
  side.record(400);
  assert.ok(side.side < 400 && side.side >= 288, "one slow answer is no catastrophe");
  for (let i = 0; i < 50; ++i) side.record(5000);
  assert.equal(side.side, 160);
  for (let i = 0; i < 50; ++i) side.record(1);
  assert.equal(side.side, 960);
});

test("pictures that share the service may each take as much longer", () => {
  const [alone, shared] = [0, 1].map(() => new AdaptiveSide({ start: 400, min: 160, max: 960, goal: 90 }));
  alone.record(90);
  shared.record(270, 3);
  assert.deepEqual([alone.side, shared.side], [400, 400]);
});

test("the size settles where pictures take as long as they may", () => {
  const side = new AdaptiveSide({ start: 400, min: 160, max: 960, goal: 90 });
  for (let i = 0; i < 60; ++i) side.record(10 + side.side ** 2 * 2e-4);
  const ms = 10 + side.side ** 2 * 2e-4;
  assert.ok(Math.abs(ms - 90) < 15, `${side.side} px take ${ms} ms`);
});

test("the least recently used goes first", () => {
  const gone = [];
  const recent = new Recent(2, (value) => gone.push(value));
  recent.put("a", 1);
  recent.put("b", 2);
  assert.equal(recent.get("a"), 1);
  recent.put("c", 3);
  assert.deepEqual(gone, [2]);
  assert.equal(recent.get("b"), undefined);
  recent.put("a", 4);
  assert.deepEqual(gone, [2, 1]);
  recent.clear();
  assert.deepEqual(gone, [2, 1, 3, 4]);
});
