// The contract itself: it is sound, and the program serves it. (That it lists the very routes of the program is checked
// in tests/server/service/routes/all_routes_test.cc.)
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, describe, test } from 'node:test';
import { complaint, contractFile, document, operations, resolve } from './support/contract.mjs';
import { parseYamlDocument, visitYaml } from './support/packages.mjs';
import { Service } from './support/program.mjs';

/// Calls `visit(value, address)` on everything below a value.
const walk = (value, visit, address = '') => {
  visit(value, address);
  if (value !== null && typeof value === 'object')
    for (const [name, member] of Object.entries(value)) walk(member, visit, `${address}/${name}`);
};

/// What YAML reads otherwise than its writer meant it: "{description: This, and that}" has a key "and that" of no value.
const misread = (text) => {
  const yaml = parseYamlDocument(text);
  const found = [...yaml.errors, ...yaml.warnings].map(({ message }) => message);
  visitYaml(yaml, {
    Pair: (_, { key, value }) => {
      if (value === null || (value.value === null && value.source === '')) found.push(`"${key.value}" has no value: is a text not quoted?`);
    },
  });
  return found;
};

test('the contract says in YAML what it says to a reader', () => {
  assert.deepEqual(misread('{a: {description: What is selected is not, and the other way round.}}').length, 1, 'an unquoted comma is found');
  assert.deepEqual(misread('a: {description: "What is selected is not, and the other way round.", b: null}'), []);
  assert.equal(misread('{a: 1, a: 2}').length, 1, 'a key that is given twice is found');
  assert.deepEqual(misread(readFileSync(contractFile, 'utf8')), []);
});

test('every reference in the contract leads somewhere', () => {
  walk(document, (value) => {
    if (typeof value?.$ref === 'string') resolve(value);
  });
});

test('every schema in the contract compiles', () => {
  for (const [name, schema] of Object.entries(document.components.schemas))
    assert.doesNotThrow(() => complaint(schema, null), `schema ${name}`);
});

test('the examples in the contract follow their own schemas', () => {
  let examples = 0;
  const hold = (schema, value, address) => {
    ++examples;
    assert.equal(complaint(schema, value), null, address);
  };
  walk(document, (value, address) => {
    if (value?.schema === undefined) return;
    if (value.example !== undefined && !address.includes('event-stream')) hold(value.schema, value.example, address);
    for (const [name, example] of Object.entries(value.examples ?? {})) hold(value.schema, example.value, `${address} ${name}`);
  });
  for (const [name, schema] of Object.entries(document.components.schemas))
    for (const example of schema.examples ?? []) hold(schema, example, name);
  assert.ok(examples >= 12, `only ${examples} examples found`);
});

test('every operation is described, has a name of its own and says how it fails', () => {
  const ids = operations.map(({ id }) => id);
  assert.equal(new Set(ids).size, ids.length);
  for (const { operation, path, method, parameters } of operations) {
    assert.ok(operation.summary && operation.tags.length === 1, `${method} ${path}`);
    assert.ok(operation.responses.default, `${method} ${path}`);
    const inPath = [...path.matchAll(/\{([^}]+)\}/g)].map((match) => match[1]);
    assert.deepEqual(parameters.filter((parameter) => parameter.in === 'path').map(({ name }) => name), inPath, `${method} ${path}`);
    if (inPath.length > 0 && path.startsWith('/v1')) assert.ok(operation.responses['404'], `${method} ${path} lists no 404`);
  }
});

describe('the program keeps the contract', () => {
  let service;
  before(async () => { service = await Service.start(); });
  after(() => service?.stop());

  test('the program serves the contract as it lies in the sources', async () => {
    const response = await service.client.get('/openapi.yaml');
    assert.equal(response.body.toString(), readFileSync(contractFile, 'utf8'));
  });

  test('the query parameters of each operation are known to the program, and others are refused', async () => {
    for (const { method, path, parameters, operation } of operations) {
      if (method !== 'GET' || path === '/' || !operation.responses['400']) continue;
      const real = path.replace('{id}', path.includes('edits') ? 'e999999' : 's999999').replace('{v}', '0').replace('{u}', '1').replace('{k}', '0');
      const unknown = await service.client.request('GET', real, { query: { colour: 'red' }, expect: [400, 404] });
      if (unknown.status === 400) assert.equal(unknown.json().where, 'colour', `${method} ${path}`);
      for (const { name } of parameters.filter((parameter) => parameter.in === 'query')) {
        const answer = await service.client.request('GET', real, { query: { [name]: '' } });
        if (answer.status === 400) assert.doesNotMatch(answer.json().detail, /unknown/i, `${method} ${path}?${name}`);
      }
    }
  });

  test('the parameters of an edit are in the contract as the program describes them', async () => {
    const { parameters } = (await service.client.get('/v1/info')).json();
    const { properties } = document.components.schemas.Params;
    assert.deepEqual(Object.keys(properties), parameters.map(({ name }) => name));
    for (const { name, type, minimum, maximum, values, unit, defaults, description } of parameters) {
      const schema = properties[name];
      const words = (text) => text.replace(/\s+/g, ' ');
      assert.deepEqual(schema.enum ?? null, values, name);
      assert.equal(schema.type ?? (schema.enum && 'string'), type, name);
      const [low, high] = type === 'array' ? [schema.minItems ?? 0, schema.maxItems] : [schema.minimum, schema.maximum];
      assert.deepEqual([low ?? null, high ?? null], [minimum, maximum], name);
      assert.ok(words(schema.description).startsWith(description), `${name}: ${schema.description}`);
      if (unit) assert.match(schema.description, new RegExp(`\\b${unit}\\b`, 'i'), name);
      const [first, ...others] = Object.values(defaults).map((value) => JSON.stringify(value));
      const common = others.every((other) => other === first) && first !== 'null' ? first : undefined;
      assert.equal(JSON.stringify(schema.default), common, `${name}: default`);
    }
  });

  test('the version in the contract is the version of the program', async () => {
    assert.equal((await service.client.get('/v1/info')).json().version, document.info.version);
  });
});
