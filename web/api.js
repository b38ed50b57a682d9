// The only way to the service: one function per route. Whatever goes wrong comes back as an ApiError.

/** What the service, or the way to it, refused. `where` is the address of the culprit ("handles[2].radius"). */
export class ApiError extends Error {
  constructor({ status = 0, code = "internal", where = "", detail = "", requestId = "", retryAfter = null }) {
    super(where ? `${where}: ${detail}` : detail);
    Object.assign(this, { name: "ApiError", status, code, where, detail, requestId, retryAfter });
  }
}

const unreachable = () =>
  new ApiError({ code: "unreachable", detail: "The service does not answer. Is it still running?" });

export const wasGivenUp = (error) => error?.name === "AbortError";

let signIn = null;

/** Says what to do when the service asks for a token: a function that returns once there is a session (true), or the
 *  user gave up (false). Requests that were refused are then made again. */
export function onUnauthorized(handler) {
  signIn = handler;
}

function problemFrom(status, text, header) {
  let problem = {};
  try {
    problem = JSON.parse(text);
  } catch {
    // Not from the service itself: a proxy on the way, perhaps.
  }
  return new ApiError({
    status,
    code: problem.code,
    where: problem.where,
    detail: problem.detail || problem.title || `The service answered with status ${status}.`,
    requestId: problem.request_id ?? header("X-Request-Id") ?? "",
    retryAfter: Number(header("Retry-After")) || null,
  });
}

async function send(path, options = {}, again = true) {
  let response;
  try {
    response = await fetch(path, { credentials: "same-origin", cache: "no-store", ...options });
  } catch (error) {
    throw wasGivenUp(error) ? error : unreachable();
  }
  if (response.ok || response.status === 304) return response;
  const problem = problemFrom(response.status, await response.text(), (name) => response.headers.get(name));
  const retry = response.status === 401 && again && signIn && path !== "/v1/session" && (await signIn());
  if (retry) return send(path, options, false);
  throw problem;
}

async function json(path, options) {
  const response = await send(path, options);
  try {
    return await response.json();
  } catch (error) {
    throw wasGivenUp(error) ? error : unreachable();
  }
}

const jsonBody = (method, value, options = {}) => ({
  ...options,
  method,
  body: JSON.stringify(value),
  headers: { "Content-Type": "application/json", ...options.headers },
});

const part = encodeURIComponent;

/** Sends a file as the body, and tells how far it is. fetch() cannot: hence XMLHttpRequest.
 *    progress(sent, total)  bytes; sent === total: the service is now reading it */
function upload(method, path, file, { progress = () => {}, signal } = {}) {
  const once = () =>
    new Promise((resolve, reject) => {
      const request = new XMLHttpRequest();
      request.open(method, path);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.addEventListener("progress", (event) => progress(event.loaded, event.total || file.size));
      request.addEventListener("load", () => {
        if (request.status >= 200 && request.status < 300) {
          try {
            resolve(JSON.parse(request.responseText));
          } catch {
            reject(unreachable());
          }
        } else {
          reject(problemFrom(request.status, request.responseText, (name) => request.getResponseHeader(name)));
        }
      });
      request.addEventListener("error", () => reject(unreachable()));
      request.addEventListener("abort", () => reject(new DOMException("given up", "AbortError")));
      signal?.addEventListener("abort", () => request.abort());
      request.send(file);
    });
  return once().catch(async (error) => {
    if (error.status === 401 && signIn && (await signIn())) return once();
    throw error;
  });
}

export const info = () => json("/v1/info");

/** Swaps the token for a session cookie. */
export const createSession = (token) =>
  send("/v1/session", { method: "POST", headers: { Authorization: `Bearer ${token}` } });
export const deleteSession = () => send("/v1/session", { method: "DELETE" });

export const scenes = async (signal) => (await json("/v1/scenes", { signal })).scenes;
export const scene = (id, signal) => json(`/v1/scenes/${part(id)}`, { signal });
/** Server-sent events: "scene", "edit", "alive" each second, "gone". */
export const sceneEvents = (id) => new EventSource(`/v1/scenes/${part(id)}/events`);
export const uploadScene = (file, name, options) => upload("POST", `/v1/scenes?name=${part(name)}`, file, options);
export const addScenePath = (path) => json("/v1/scenes", jsonBody("POST", { path }));
export const patchScene = (id, patch) => json(`/v1/scenes/${part(id)}`, jsonBody("PATCH", patch));
export const deleteScene = (id) => send(`/v1/scenes/${part(id)}`, { method: "DELETE" });
export const uploadDataset = (id, file, options) => upload("PUT", `/v1/scenes/${part(id)}/dataset`, file, options);
export const putDatasetPath = (id, path) => json(`/v1/scenes/${part(id)}/dataset`, jsonBody("PUT", { path }));
export const deleteDataset = (id) => json(`/v1/scenes/${part(id)}/dataset`, { method: "DELETE" });
export const photoUrl = (id, view, side) => `/v1/scenes/${part(id)}/photo?view=${part(view)}&max_side=${side}`;
export const views = (id) => json(`/v1/scenes/${part(id)}/views`);

const versionPath = (id, version) => `/v1/scenes/${part(id)}/versions/${part(version)}`;

export const renameVersion = (id, version, name) => json(versionPath(id, version), jsonBody("PATCH", { name }));
export const deleteVersion = (id, version) => send(versionPath(id, version), { method: "DELETE" });

/** A picture: {blob, timing}, its Server-Timing. `body`: {camera, what, format, ...}. */
export async function render(id, version, body, signal) {
  const response = await send(`${versionPath(id, version)}/render`, jsonBody("POST", body, { signal }));
  try {
    return { blob: await response.blob(), timing: response.headers.get("Server-Timing") };
  } catch (error) {
    throw wasGivenUp(error) ? error : unreachable();
  }
}

export const pick = (id, version, body, signal) =>
  json(`${versionPath(id, version)}/pick`, jsonBody("POST", body, { signal }));
export const select = (id, version, selection, signal) =>
  json(`${versionPath(id, version)}/select`, jsonBody("POST", { selection }, { signal }));
export const fileUrl = (id, version, format) => `${versionPath(id, version)}/file?format=${part(format)}`;

export const createPreview = (request, signal) => json("/v1/previews", jsonBody("POST", request, { signal }));

export const createEdit = (request, key) =>
  json("/v1/edits", jsonBody("POST", request, { headers: { "Idempotency-Key": key } }));
export const estimateEdit = (request, signal) =>
  json("/v1/edits?validate_only=true", jsonBody("POST", request, { signal }));
export const edits = async (scene, signal) => (await json(`/v1/edits?scene=${part(scene)}&limit=30`, { signal })).edits;
export const stopEdit = (id) => json(`/v1/edits/${part(id)}/stop`, { method: "POST" });
export const cancelEdit = (id) => json(`/v1/edits/${part(id)}/cancel`, { method: "POST" });
export const deleteEdit = (id) => send(`/v1/edits/${part(id)}`, { method: "DELETE" });
