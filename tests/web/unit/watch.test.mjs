import assert from "node:assert/strict";
import { test } from "node:test";

import { followScene, merged } from "../../../web/watch.js";

const settle = async () => {
  for (let i = 0; i < 5; ++i) await new Promise((resolve) => setImmediate(resolve));
};

/** An EventSource that says what it is told to. */
class FakeEvents extends EventTarget {
  closed = false;
  close() {
    this.closed = true;
  }
  send(name, data = {}) {
    this.dispatchEvent(Object.assign(new Event(name), { data: JSON.stringify(data) }));
  }
  fail() {
    this.dispatchEvent(new Event("error"));
  }
}

/** Follows a scene; `said` is all that it is told. */
function following(options = {}) {
  const said = [];
  const streams = [];
  const end = followScene({
    onScene: ({ name }) => said.push(`scene ${name}`),
    onEdit: ({ id, state }) => said.push(`${id} ${state}`),
    onGone: () => said.push("gone"),
    onAnswering: (does) => said.at(-1) !== `answers ${does}` && said.push(`answers ${does}`),
    events: () => {
      streams.push(new FakeEvents());
      return streams.at(-1);
    },
    ask: async () => ({ scene: { name: "asked" }, edits: [] }),
    silence: 1e6,
    again: 0,
    ...options,
  });
  return { said, streams, end };
}

test("what a stream says is passed on, until the scene is gone", async () => {
  const { said, streams } = following();
  streams[0].send("scene", { name: "chair" });
  streams[0].send("edit", { id: "e1", state: "running" });
  streams[0].send("alive");
  streams[0].send("gone");
  assert.ok(streams[0].closed);
  streams[0].send("edit", { id: "e1", state: "succeeded" });
  await settle();
  assert.equal(streams.length, 1, "and is not asked for again");
  assert.deepEqual(
    said.filter((text) => text !== "answers true"),
    ["scene chair", "e1 running", "gone"],
  );
});

test("an edit that ended while nobody listened is told of when the stream begins, the oldest first", async () => {
  const edits = [
    { id: "e2", state: "running" },
    { id: "e1", state: "succeeded" },
  ];
  const { said, streams, end } = following({ ask: async () => ({ scene: { name: "chair" }, edits }) });
  streams[0].send("scene", { name: "chair" });
  await settle();
  assert.deepEqual(
    said.filter((text) => text.startsWith("e")),
    ["e1 succeeded", "e2 running"],
  );
  end();
});

test("an answer that was on its way while the stream told something newer does not take that back", async () => {
  let answer;
  const { said, streams, end } = following({ ask: () => new Promise((resolve) => (answer = resolve)) });
  streams[0].send("scene", { name: "before" });
  await settle();
  streams[0].send("scene", { name: "renamed" });
  streams[0].send("edit", { id: "e1", state: "succeeded" });
  const edits = [
    { id: "e2", state: "queued" },
    { id: "e1", state: "running" },
  ];
  answer({ scene: { name: "before" }, edits });
  await settle();
  assert.deepEqual(
    said.filter((text) => !text.startsWith("answers")),
    ["scene before", "scene renamed", "e1 succeeded", "e2 queued"],
  );
  end();
});

test("without a stream it is asked, and a stream is tried again", async () => {
  const { said, streams, end } = following();
  streams[0].fail();
  while (streams.length < 2) await settle();
  assert.ok(streams[0].closed);
  assert.deepEqual(said, ["answers true", "scene asked"]);
  end();
  assert.ok(streams.at(-1).closed);
});

test("a stream that says nothing any more is a service that does not answer, until it does", async () => {
  let up = false;
  const ask = async () => {
    if (!up) throw Object.assign(new Error("down"), { status: 0 });
    return { scene: { name: "back" }, edits: [] };
  };
  const { said, streams, end } = following({ silence: 5, ask });
  while (!said.includes("answers false")) await new Promise((resolve) => setTimeout(resolve, 1));
  assert.ok(streams[0].closed);
  up = true;
  while (!said.includes("scene back")) await new Promise((resolve) => setTimeout(resolve, 1));
  assert.ok(said.indexOf("answers true") > said.indexOf("answers false"));
  end();
});

test("a service that is full is one that answers, and a scene that is not found is gone", async () => {
  const statuses = [429, 404];
  const ask = async () => {
    throw Object.assign(new Error("no"), { status: statuses.shift() });
  };
  const { said, streams } = following({ ask });
  streams[0].fail();
  while (streams.length < 2) await settle();
  streams[1].fail();
  await settle();
  assert.deepEqual(said, ["gone"]);
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
