// What the page's modules find in a browser, for tests without one.

/** An empty storage, like localStorage. */
export function memoryStorage() {
  const items = new Map();
  return {
    getItem: (key) => items.get(key) ?? null,
    setItem: (key, value) => void items.set(key, value),
    removeItem: (key) => void items.delete(key),
  };
}

/** A fetch that `service` answers: {"GET /v1/info": (body, headers) => a value, a Response, or an Error to throw}. */
export function fetchFrom(service) {
  return async (path, { method = "GET", body, headers } = {}) => {
    const answer = service[`${method} ${path}`];
    if (!answer) throw new TypeError(`nobody answers ${method} ${path}`);
    const value = await answer(body && JSON.parse(body), headers);
    if (value instanceof Error) throw value;
    return value instanceof Response ? value : new Response(JSON.stringify(value), { status: 200 });
  };
}

/** Lets what is under way come to rest. */
export async function settle() {
  for (let i = 0; i < 20; ++i) await new Promise((resolve) => setImmediate(resolve));
}

/** A stream of events that says nothing. */
export class SilentEvents extends EventTarget {
  close() {}
}
