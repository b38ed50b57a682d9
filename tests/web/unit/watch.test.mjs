import assert from "node:assert/strict";
import { test } from "node:test";

import { follow, merged } from "../../../web/watch.js";

const settle = () => new Promise((resolve) => setImmediate(resolve));

class FakeEvents extends EventTarget {
  closed = false;
  close() {
    this.closed = true;
  }
  send(edit) {
    this.dispatchEvent(Object.assign(new Event("edit"), { data: JSON.stringify(edit) }));
  }
  fail() {
    this.dispatchEvent(new Event("error"));
  }
}

test("events are passed on, and the stream is closed after the last", () => {
  const events = new FakeEvents();
  const states = [];
  const fetchEdit = () => assert.fail("need not ask");
  follow("e1", { onUpdate: (e) => states.push(e.state), events: () => events, fetchEdit });
  events.send({ state: "running" });
  events.send({ state: "succeeded" });
  assert.deepEqual(states, ["running", "succeeded"]);
  assert.ok(events.closed);
});

test("without a stream it is asked every second, with the ETag, until the end", async () => {
  const events = new FakeEvents();
  const states = [];
  const waits = [];
  const etags = [];
  const answers = [{ edit: { state: "running" }, etag: '"1"' }, null, { edit: { state: "cancelled" }, etag: '"2"' }];
  follow("e1", {
    onUpdate: (e) => states.push(e.state),
    events: () => events,
    fetchEdit: async (id, etag) => (etags.push(etag), answers.shift()),
    wait: async (ms) => void waits.push(ms),
  });
  events.fail();
  for (let i = 0; i < 10; ++i) await settle();
  assert.ok(events.closed);
  assert.deepEqual(states, ["running", "cancelled"]);
  assert.deepEqual(etags, [null, '"1"', '"1"']);
  assert.ok(waits.every((ms) => ms === 1000));
});

test("a service that does not answer is asked again, less and less often", async () => {
  const waits = [];
  let failures = 5;
  const states = [];
  follow("e1", {
    onUpdate: (e) => states.push(e.state),
    fetchEdit: async () => {
      if (failures-- > 0) throw Object.assign(new Error("down"), { status: 0 });
      return { edit: { state: "succeeded" }, etag: "x" };
    },
    wait: async (ms) => void waits.push(ms),
  });
  for (let i = 0; i < 20; ++i) await settle();
  assert.deepEqual(waits.slice(0, 5), [2000, 4000, 8000, 8000, 8000]);
  assert.deepEqual(states, ["succeeded"]);
});

test("an edit whose record is gone is not asked for again", async () => {
  let asked = 0;
  let gone = 0;
  follow("e1", {
    onUpdate: () => assert.fail(),
    onGone: () => ++gone,
    fetchEdit: async () => {
      ++asked;
      throw Object.assign(new Error("gone"), { status: 404 });
    },
    wait: async () => {},
  });
  for (let i = 0; i < 5; ++i) await settle();
  assert.deepEqual([asked, gone], [1, 1]);
});

test("after its end there are no more updates", () => {
  const events = new FakeEvents();
  const end = follow("e1", { onUpdate: () => assert.fail(), events: () => events, fetchEdit: () => null });
  end();
  events.send({ state: "running" });
  assert.ok(events.closed);
});

test("news is merged by id, youngest first, and an edit that ended stays so", () => {
  const a = { id: "e000001", state: "running", progress: 0.5 };
  const b = { id: "e000002", state: "queued", progress: 0 };
  assert.deepEqual(
    merged([a], b).map((e) => e.id),
    ["e000002", "e000001"],
  );
  assert.equal(merged([a], { ...a, progress: 0.2 })[0].progress, 0.2, "it was resumed from its last interval");
  const done = { ...a, state: "succeeded", progress: 1 };
  assert.equal(merged([b, a], done)[1].state, "succeeded");
  assert.equal(merged([done], a)[0].state, "succeeded");
  assert.equal(merged([a], { ...a, state: "cancelled", progress: 0.1 })[0].state, "cancelled");
});
