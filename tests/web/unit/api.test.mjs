import assert from "node:assert/strict";
import { afterEach, test } from "node:test";

import * as api from "../../../web/api.js";

const original = globalThis.fetch;
afterEach(() => {
  globalThis.fetch = original;
  api.onUnauthorized(null);
});

/** Answers requests one after the other; returns what was asked. */
function answering(...answers) {
  const asked = [];
  globalThis.fetch = async (path, options = {}) => {
    asked.push({ path, ...options });
    const answer = answers.shift();
    if (answer instanceof Error) throw answer;
    return answer;
  };
  return asked;
}

const json = (value, status = 200, headers = {}) =>
  new Response(JSON.stringify(value), { status, headers: { "Content-Type": "application/json", ...headers } });

test("a problem becomes an error with status, code, where and detail", async () => {
  answering(
    json(
      { status: 422, code: "unprocessable", detail: "raise the radius", where: "handles[1].radius", request_id: "r7" },
      422,
    ),
  );
  await assert.rejects(api.createPreview({}), (error) => {
    assert.ok(error instanceof api.ApiError);
    assert.deepEqual(
      [error.status, error.code, error.where, error.detail, error.requestId],
      [422, "unprocessable", "handles[1].radius", "raise the radius", "r7"],
    );
    return true;
  });
});

test("an error that is no problem document still says what happened", async () => {
  answering(new Response("<h1>Bad gateway</h1>", { status: 502 }));
  await assert.rejects(api.info(), { status: 502, detail: "The service answered with status 502." });
});

test("a busy service says when to come back", async () => {
  answering(json({ code: "busy", detail: "the queue is full" }, 429, { "Retry-After": "5" }));
  await assert.rejects(api.createEdit({}, "k"), { status: 429, retryAfter: 5 });
});

test("a service that does not answer, or stops in the middle, is unreachable", async () => {
  answering(new TypeError("Failed to fetch"), new Response("{", { status: 200 }));
  await assert.rejects(api.info(), { status: 0, code: "unreachable" });
  await assert.rejects(api.info(), { status: 0, code: "unreachable" });
});

test("a request that was given up stays recognisable as such", async () => {
  answering(Object.assign(new Error("aborted"), { name: "AbortError" }));
  await assert.rejects(api.render("s1", 0, {}), (error) => api.wasGivenUp(error));
});

test("after signing in, a refused request is made again, once", async () => {
  let questions = 0;
  api.onUnauthorized(async () => ++questions > 0);
  const asked = answering(json({ detail: "token" }, 401), json({ version: "1" }));
  assert.deepEqual(await api.info(), { version: "1" });
  assert.equal(asked.length, 2);
  answering(json({ detail: "token" }, 401), json({ detail: "token" }, 401));
  await assert.rejects(api.info(), { status: 401 });
  assert.equal(questions, 2);
});

test("who gives up signing in gets the refusal; a wrong token asks no further", async () => {
  api.onUnauthorized(async () => false);
  answering(json({ detail: "needs a token" }, 401));
  await assert.rejects(api.info(), { status: 401, detail: "needs a token" });
  api.onUnauthorized(() => assert.fail());
  answering(json({ detail: "wrong" }, 401));
  await assert.rejects(api.createSession("x"), { status: 401 });
});

test("JSON is sent as JSON, with the key of a submission", async () => {
  const asked = answering(json({ id: "e1" }, 202));
  await api.createEdit({ scene: "s1" }, "key-1");
  assert.equal(asked[0].method, "POST");
  assert.equal(asked[0].headers["Content-Type"], "application/json");
  assert.equal(asked[0].headers["Idempotency-Key"], "key-1");
  assert.equal(asked[0].body, '{"scene":"s1"}');
});

test("names cannot lead out of their place in a path", async () => {
  const asked = answering(json({}));
  await api.scene("../info?x=1");
  assert.equal(asked[0].path, "/v1/scenes/..%2Finfo%3Fx%3D1");
  assert.equal(api.fileUrl("s000001", 3, "spz"), "/v1/scenes/s000001/versions/3/file?format=spz");
});
