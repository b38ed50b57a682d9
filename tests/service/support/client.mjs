// A client of the service whose every answer is held against the contract.
import assert from 'node:assert/strict';
import http from 'node:http';
import { setTimeout as sleep } from 'node:timers/promises';
import { check, complaint, count, named } from './contract.mjs';

export const finalStates = ['succeeded', 'failed', 'cancelled'];

const readable = ({ headers, body }) =>
  /json|text/.test(headers['content-type'] ?? '') ? body.toString().slice(0, 1000) : `${body.length} bytes of ${headers['content-type']}`;

export class Client {
  /// token  sent as bearer token with each request, if given
  constructor(url, { token } = {}) {
    this.url = new URL(url);
    this.token = token;
    this.agent = new http.Agent({ keepAlive: true, maxSockets: 64 });
  }

  close() { this.agent.destroy(); }

  /// Sends one request.
  ///   json     sent as JSON; body: bytes, sent as they are
  ///   expect   status, or several; another one fails with the problem's words
  ///   returns  {status, headers, body, json()}
  async request(method, path, { query, headers = {}, json, body, expect, timeout = 60_000 } = {}) {
    const target = new URL(path, this.url);
    for (const [name, value] of Object.entries(query ?? {})) target.searchParams.set(name, value);
    const bytes = json !== undefined ? Buffer.from(JSON.stringify(json)) : body;
    const all = { ...headers };
    if (json !== undefined) all['content-type'] ??= 'application/json';
    if (bytes !== undefined) all['content-length'] ??= Buffer.byteLength(bytes);
    if (this.token && !('authorization' in all)) all.authorization = `Bearer ${this.token}`;
    const response = await this.#exchange(method, target, all, bytes, timeout);
    response.json = () => JSON.parse(response.body.toString());
    check({ method, path: decodeURI(target.pathname), json }, response);
    if (expect !== undefined)
      assert.ok([expect].flat().includes(response.status),
        `${method} ${target.pathname}${target.search}: expected ${expect}, got ${response.status}: ${readable(response)}`);
    return response;
  }

  #exchange(method, target, headers, bytes, timeout) {
    return new Promise((done, failed) => {
      const request = http.request(target, { method, headers, agent: this.agent, timeout }, (answer) => {
        const chunks = [];
        answer.on('data', (chunk) => chunks.push(chunk));
        answer.on('end', () => done({ status: answer.statusCode, headers: answer.headers, body: Buffer.concat(chunks) }));
        answer.on('error', failed);
      });
      request.on('timeout', () => request.destroy(new Error(`${method} ${target.pathname}: no answer in ${timeout} ms`)));
      request.on('error', (error) => {
        // The service may end a connection that waits, to make room, just when it is used again.
        const isCut = method === 'GET' && request.reusedSocket && error.code === 'ECONNRESET';
        if (isCut) this.#exchange(method, target, headers, bytes, timeout).then(done, failed);
        else failed(error);
      });
      request.end(bytes);
    });
  }

  get(path, options) { return this.request('GET', path, { expect: 200, ...options }); }
  post(path, json, options) { return this.request('POST', path, { json, expect: 200, ...options }); }
  delete(path, options) { return this.request('DELETE', path, { expect: 204, ...options }); }

  /// A new scene from bytes.
  async upload(bytes, { name, ...options } = {}) {
    const response = await this.request('POST', '/v1/scenes', {
      body: bytes, query: name ? { name } : {}, headers: { 'content-type': 'application/octet-stream' }, expect: 201, ...options });
    return response.json();
  }
  async putDataset(scene, zip, options) {
    const response = await this.request('PUT', `/v1/scenes/${scene}/dataset`,
      { body: zip, headers: { 'content-type': 'application/zip' }, expect: 200, ...options });
    return response.json();
  }
  async submit(request, headers = {}) {
    return (await this.request('POST', '/v1/edits', { json: request, headers, expect: 202 })).json();
  }
  async edit(id) { return (await this.get(`/v1/edits/${id}`)).json(); }
  /// Polls an edit, with If-None-Match, until `reached(edit)`; it must also not end before that.
  async until(id, reached, { timeout = 120_000, every = 20 } = {}) {
    const deadline = Date.now() + timeout;
    let etag, edit;
    for (;;) {
      const response = await this.get(`/v1/edits/${id}`, { headers: etag ? { 'if-none-match': etag } : {}, expect: [200, 304] });
      if (response.status === 200) {
        edit = response.json();
        etag = response.headers.etag;
        if (reached(edit)) return edit;
        assert.ok(!finalStates.includes(edit.state), `${id} ended too early: ${JSON.stringify(edit, null, 1)}`);
      }
      assert.ok(Date.now() < deadline, `${id} did not get there in ${timeout} ms: ${JSON.stringify(edit, null, 1)}`);
      await sleep(every);
    }
  }
  ended(id, options) { return this.until(id, (edit) => finalStates.includes(edit.state), options); }
  async succeeded(id, options) {
    const edit = await this.ended(id, options);
    assert.equal(edit.state, 'succeeded', JSON.stringify(edit.error));
    return edit;
  }
  async file(scene, version, format = 'ply') {
    return (await this.get(`/v1/scenes/${scene}/versions/${version}/file`, { query: { format } })).body;
  }

  /// Follows an edit's events to the end of the stream: [{event, id, edit}].
  ///   onEvent  called with each
  async events(id, onEvent = () => {}) {
    const told = ({ event, id: number, data }) => ({ event, id: number, edit: data });
    const events = await this.#stream('followEdit', `/v1/edits/${id}/events`, (one) => onEvent(told(one)));
    return events.map(told);
  }
  /// Follows a scene's: [{event, id, data}].
  ///   onEvent  called with each; ends it by returning false
  sceneEvents(id, onEvent = () => {}) { return this.#stream('followScene', `/v1/scenes/${id}/events`, onEvent); }

  #stream(operation, path, onEvent) {
    return new Promise((done, failed) => {
      const headers = { accept: 'text/event-stream', ...(this.token ? { authorization: `Bearer ${this.token}` } : {}) };
      const request = http.get(new URL(path, this.url), { headers }, (answer) => {
        const events = [];
        let text = '';
        const end = () => {
          try {
            assert.equal(answer.statusCode, 200, text);
            assert.match(answer.headers['content-type'], /^text\/event-stream/);
            count(operation, 200);
            done(events);
          } catch (error) {
            failed(error);
          }
        };
        answer.setEncoding('utf8');
        answer.on('data', (chunk) => {
          text += chunk;
          for (let at; (at = text.indexOf('\n\n')) >= 0; text = text.slice(at + 2)) {
            const lines = text.slice(0, at).split('\n');
            const field = (name) => lines.filter((line) => line.startsWith(`${name}:`)).map((line) => line.slice(name.length + 1).replace(/^ /, ''));
            if (field('data').length === 0) continue;
            const one = { event: field('event')[0], id: field('id')[0], data: JSON.parse(field('data').join('\n')) };
            const schema = { edit: 'Edit', scene: 'Scene' }[one.event];
            const wrong = schema && complaint(named(schema), one.data);
            if (wrong) return request.destroy(new Error(`event of ${path}: ${wrong}`));
            events.push(one);
            if (onEvent(one) !== false) continue;
            end();
            return request.destroy();
          }
        });
        answer.on('end', end);
        answer.on('error', failed);
      });
      request.on('error', failed);
    });
  }
}
