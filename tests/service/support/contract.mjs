// proto/openapi.yaml as a judge: every answer of the service is held against it, and what was seen is counted.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { Ajv2020, parseYaml } from './packages.mjs';

export const contractFile = new URL('../../../proto/openapi.yaml', import.meta.url);
export const document = parseYaml(readFileSync(contractFile, 'utf8'), { maxAliasCount: -1 });

const ajv = new Ajv2020({ strict: false, allErrors: true, validateFormats: false });
ajv.addSchema({ $id: 'contract', components: document.components });

/// A copy of `value` in which "#/..." references are absolute, so that any part of the contract compiles alone.
const absolute = (value) => {
  if (Array.isArray(value)) return value.map(absolute);
  if (value === null || typeof value !== 'object') return value;
  return Object.fromEntries(Object.entries(value).map(([name, member]) =>
    [name, name === '$ref' && typeof member === 'string' ? member.replace(/^#/, 'contract#') : absolute(member)]));
};

const compiled = new Map();
/// What is wrong with a value according to a schema: a sentence, or null.
export const complaint = (schema, value) => {
  if (!compiled.has(schema)) compiled.set(schema, ajv.compile(absolute(schema)));
  const validate = compiled.get(schema);
  return validate(value) ? null : ajv.errorsText(validate.errors, { dataVar: 'value' });
};
export const named = (name) => document.components.schemas[name];

/// Follows a reference, if it is one.
export const resolve = (part) => {
  if (!part?.$ref) return part;
  const found = part.$ref.slice(2).split('/').reduce((at, name) => at?.[name], document);
  assert.ok(found, `the contract refers to ${part.$ref}, which it does not hold`);
  return resolve(found);
};

const methods = ['get', 'put', 'post', 'patch', 'delete'];
/// [{method, path, operation, parameters}] of the whole contract.
export const operations = Object.entries(document.paths).flatMap(([path, item]) =>
  methods.filter((method) => item[method]).map((method) => ({
    method: method.toUpperCase(), path, operation: item[method], id: item[method].operationId,
    parameters: [...(item.parameters ?? []), ...(item[method].parameters ?? [])].map(resolve),
    pattern: new RegExp(`^${path.replace(/\{[^}]+\}/g, '[^/]+').replace(/\./g, '\\.')}$`),
  })));

export const operationOf = (method, path) =>
  operations.find((candidate) => candidate.method === method && candidate.pattern.test(path));

/// Status of each problem code. `general` ones may come from any route; the others only where they are listed.
const statusOf = {
  invalid_argument: [400, 416], unprocessable: [422], not_found: [404], conflict: [409], corrupt_data: [422], unsupported: [422, 501, 505],
  too_large: [413, 414, 431], no_space: [507], busy: [429], quota_exceeded: [429], cancelled: [503], unavailable: [503], internal: [500],
  unauthorized: [401], forbidden: [403], misdirected_request: [421], method_not_allowed: [405], unsupported_media_type: [415],
  not_acceptable: [406], request_timeout: [408],
};
const general = [400, 401, 403, 405, 408, 413, 414, 415, 421, 429, 431, 501, 503, 505];

const seen = new Map();  // "getScene 200" -> how often
export const count = (id, status) => seen.set(`${id} ${status}`, (seen.get(`${id} ${status}`) ?? 0) + 1);
export const timesSeen = (id, status) => seen.get(`${id} ${status}`) ?? 0;
/// One line about how much of the contract the answers so far have touched.
export const summary = () => {
  const answers = [...seen.values()].reduce((sum, times) => sum + times, 0);
  const ids = new Set([...seen.keys()].map((key) => key.split(' ')[0]));
  return `${answers} answers held against the contract: ${ids.size} of ${operations.length} operations, ` +
    `${seen.size} pairs of operation and status`;
};

const checkProblem = (response, what) => {
  assert.match(response.headers['content-type'] ?? '', /^application\/problem\+json\b/, `${what}: an error must be a problem`);
  const problem = JSON.parse(response.body.toString());
  assert.equal(complaint(named('Problem'), problem), null, `${what}: ${response.body}`);
  assert.equal(problem.status, response.status, `${what}: the problem's status`);
  assert.ok(statusOf[problem.code].includes(response.status), `${what}: code ${problem.code} with status ${response.status}`);
  assert.equal(problem.request_id, response.headers['x-request-id'], `${what}: the problem's request id`);
  assert.notEqual(problem.code, 'internal', `${what}: ${problem.detail}`);
};

const checkHeaders = (documented, response, what) => {
  for (const [name, part] of Object.entries(documented ?? {})) {
    const value = response.headers[name.toLowerCase()];
    const flat = Array.isArray(value) ? value.join(', ') : value;
    if (flat !== undefined && part) {
      const wrong = complaint(resolve(part).schema, flat);
      assert.equal(wrong, null, `${what}: header ${name}: ${flat}: ${wrong}`);
    }
    if (['ETag', 'Location'].includes(name)) assert.ok(flat, `${what}: header ${name} is missing`);
  }
};

/// Fails unless the answer is one that the contract allows.
///   request   {method, path (no query), json (the body sent, if it was JSON)}
///   response  {status, headers, body (Buffer)}
export const check = (request, response) => {
  const what = `${request.method} ${request.path} -> ${response.status}`;
  assert.ok(response.headers['x-request-id'], `${what}: no X-Request-Id`);
  assert.equal(response.headers['x-content-type-options'], 'nosniff', `${what}: X-Content-Type-Options`);
  assert.ok(response.headers['cache-control'], `${what}: no Cache-Control`);
  const found = operationOf(request.method, request.path);
  if (response.status >= 400 && request.method !== 'HEAD') checkProblem(response, what);
  if (!found) {
    assert.ok(response.status >= 400 || ['HEAD', 'GET', 'OPTIONS'].includes(request.method), `${what}: an operation that is not in the contract`);
    return;
  }
  count(found.id, response.status);
  const documented = resolve(found.operation.responses[response.status]);
  if (!documented) {
    assert.ok(general.includes(response.status), `${what}: ${found.id} does not list this status: ${response.body.subarray(0, 500)}`);
    return;
  }
  checkHeaders(documented.headers, response, what);
  if (!documented.content) {
    assert.equal(response.body.length, 0, `${what}: no body is documented`);
    return;
  }
  const type = (response.headers['content-type'] ?? '').split(';')[0];
  assert.ok(documented.content[type], `${what}: media type ${type} is not documented`);
  if (type === 'application/json') {
    const wrong = complaint(documented.content[type].schema, JSON.parse(response.body.toString()));
    assert.equal(wrong, null, `${what}: ${wrong}\n${response.body.subarray(0, 2000)}`);
  }
  const taken = resolve(found.operation.requestBody)?.content?.['application/json']?.schema;
  if (response.status < 300 && request.json !== undefined && taken)
    assert.equal(complaint(taken, request.json), null, `${what}: the service took a body that the contract refuses`);
};
