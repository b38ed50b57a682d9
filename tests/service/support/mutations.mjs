// Wrong requests, made from a right one and its schema.
import { complaint, resolve } from './contract.mjs';

/// JSON text of a value with one place altered.
///   alter  called with (value, path): JSON text to stand there, null to leave the member out, undefined to go on
const write = (value, alter, path = []) => {
  const altered = alter(value, path);
  if (altered !== undefined) return altered;
  if (Array.isArray(value)) return `[${value.map((member, i) => write(member, alter, [...path, i])).join()}]`;
  if (value === null || typeof value !== 'object') return JSON.stringify(value);
  const members = Object.entries(value).map(([name, member]) => {
    const text = write(member, alter, [...path, name]);
    return text === null ? null : `${JSON.stringify(name)}:${text}`;
  });
  return `{${members.filter((text) => text !== null).join()}}`;
};
const at = (place) => (path) => path.length === place.length && path.every((step, i) => step === place[i]);

/// "handles[2].radius"
export const address = (path) => path.reduce((text, step) => typeof step === 'number' ? `${text}[${step}]` : text ? `${text}.${step}` : step, '');

/// The part of a schema that a value follows: references and alternatives resolved.
const part = (schema, value) => {
  const found = resolve(schema);
  const choices = found.oneOf ?? found.anyOf;
  if (!choices || choices.every(({ required, properties }) => required && !properties)) return found;
  return part(choices.find((choice) => complaint(choice, value) === null), value);
};

const candidates = [null, true, 'text', '', 0, -1, 7, 1.5, 1e13, -1e13, 99_999_999_999, [], [1, 2], [1, 2, 3, 4], ['a', 'b', 'c'], {}, { x: 1 }];

/// Every way to get a request wrong that its schema knows of: [{text, where, what}]; `where` is the address that an error has
/// to begin with.
export const mutations = (schema, value) => {
  const found = [];
  const visit = (nodeSchema, node, path) => {
    const own = part(nodeSchema, node);
    const ambiguous = own !== resolve(nodeSchema);  // which member is missing depends on which form was meant
    const name = address(path) || 'the body';
    const put = (text, where, what) => found.push({ text, where: address(where), what: `${name}: ${what}` });
    for (const candidate of candidates)
      if (complaint(nodeSchema, candidate) !== null)
        put(write(value, (_, place) => at(path)(place) ? JSON.stringify(candidate) : undefined), path, `is ${JSON.stringify(candidate)}`);
    if (typeof node === 'number')
      for (const text of ['1e999', '-1e999', 'NaN', 'Infinity', '0x10', '01', '+1'])
        put(write(value, (_, place) => at(path)(place) ? text : undefined), text.endsWith('999') ? path : [], `is ${text}`);
    if (Array.isArray(node)) node.forEach((member, i) => visit(own.items, member, [...path, i]));
    if (node === null || typeof node !== 'object' || Array.isArray(node)) return;
    for (const required of own.required ?? [])
      put(write(value, (_, place) => at([...path, required])(place) ? null : undefined), ambiguous ? path : [...path, required], `lacks ${required}`);
    const members = Object.entries(node);
    const inner = (extra) => write(value, (member, place) => at(path)(place) ? `{${[...members.map(([key, one]) => `${JSON.stringify(key)}:${JSON.stringify(one)}`), extra].join()}}` : undefined);
    put(inner('"surprise":1'), [...path, 'surprise'], 'has an unknown field');
    for (const [key, member] of members) {
      put(inner(`${JSON.stringify(key)}:${JSON.stringify(member)}`), [...path, key], `has ${key} twice`);
      if (own.properties[key]) visit(own.properties[key], member, [...path, key]);
    }
  };
  visit(schema, value, []);
  return found;
};
