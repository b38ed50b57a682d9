// Scenes made from a demo scene, for what it lacks itself: the noise of a capture, SH of degree 3, a far place. By
// arithmetic alone, so that they are the same bytes everywhere.
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';

/// A number in [0, 1) for each row and column (Wang's integer hash).
const noise = (row, column) => {
  let x = Math.imul(row + 1, 0x9e3779b1) ^ Math.imul(column + 1, 0x85ebca6b);
  x = (x ^ 61) ^ (x >>> 16);
  x = Math.imul(x, 9);
  x ^= x >>> 4;
  x = Math.imul(x, 0x27d4eb2d);
  return ((x ^ (x >>> 15)) >>> 0) / 4294967296;
};

/// A binary PLY whose properties are all floats, as a demo scene's: {names, rows, at(row, name), of(row)}.
const floatRows = (ply) => {
  const head = ply.subarray(0, ply.indexOf('end_header\n') + 11).toString();
  const names = [...head.matchAll(/^property float (\w+)$/gm)].map(([, name]) => name);
  const rows = Number(/^element vertex (\d+)$/m.exec(head)[1]);
  const first = Buffer.byteLength(head);
  const of = (row) => names.map((_, i) => ply.readFloatLE(first + 4 * (row * names.length + i)));
  return { names, rows, of };
};
/// The inverse, with one more property of another type, which no edit may lose.
const written = (names, rows, label) => {
  const header = ['ply', 'format binary_little_endian 1.0', `element vertex ${rows.length}`, ...names.map((name) => `property float ${name}`),
    'property uchar label', 'end_header', ''].join('\n');
  const body = Buffer.alloc(rows.length * (4 * names.length + 1));
  let offset = 0;
  rows.forEach((row, r) => {
    for (const value of row) offset = body.writeFloatLE(value, offset);
    offset = body.writeUInt8(label(r), offset);
  });
  return Buffer.concat([Buffer.from(header), body]);
};

/// As a capture: every mean a little off its surface, every 29th Gaussian a faint floater, SH of degree 3.
export const asCapture = (ply) => {
  const { names, rows, of } = floatRows(ply);
  const before = names.indexOf('f_rest_0'), low = names.filter((name) => name.startsWith('f_rest_')).length / 3;
  const wide = [...names.slice(0, before), ...Array.from({ length: 45 }, (_, i) => `f_rest_${i}`), ...names.slice(before + 3 * low)];
  const [x, opacity] = ['x', 'opacity'].map((name) => wide.indexOf(name));
  const made = Array.from({ length: rows }, (_, r) => {
    const row = of(r), floats = r % 29 === 0;
    const rest = Array.from({ length: 45 }, (_, i) => i % 15 < low ? row[before + Math.floor(i / 15) * low + i % 15] : 0.1 * (noise(r, i) - 0.5));
    const out = [...row.slice(0, before), ...rest, ...row.slice(before + 3 * low)];
    for (let axis = 0; axis < 3; ++axis) out[x + axis] += (floats ? 0.4 : 0.006) * (noise(r, 100 + axis) - 0.5);
    if (floats) out[opacity] = -2 + 2 * noise(r, 200);
    return out;
  });
  return written(wide, made, (r) => r % 251);
};

/// Somewhere else.
///   by  [3], world units
export const moved = (ply, by) => {
  const { names, rows, of } = floatRows(ply);
  const x = names.indexOf('x');
  const made = Array.from({ length: rows }, (_, r) => of(r).map((value, i) => i >= x && i < x + 3 ? value + by[i - x] : value));
  return written(names, made, () => 7);
};
/// The handles and the region of a request, as far as the scene.
export const movedRequest = (request, by) => {
  const there = (point) => point?.map((value, axis) => value + by[axis]);
  return { ...request, handles: request.handles.map((handle) => ({ ...handle, source: there(handle.source), ...(handle.target ? { target: there(handle.target) } : {}) })) };
};
/// The cameras of a COLMAP text model, as far as the scene: t' = t - R by, in place.
export const moveCameras = async (folder, by) => {
  const file = path.join(folder, 'sparse', '0', 'images.txt');
  const lines = (await readFile(file, 'utf8')).split('\n').map((line) => {
    const fields = line.split(' ');
    if (line.startsWith('#') || fields.length < 10) return line;
    const [w, a, b, c] = fields.slice(1, 5).map(Number);
    const turned = [
      (1 - 2 * (b * b + c * c)) * by[0] + 2 * (a * b - c * w) * by[1] + 2 * (a * c + b * w) * by[2],
      2 * (a * b + c * w) * by[0] + (1 - 2 * (a * a + c * c)) * by[1] + 2 * (b * c - a * w) * by[2],
      2 * (a * c - b * w) * by[0] + 2 * (b * c + a * w) * by[1] + (1 - 2 * (a * a + b * b)) * by[2]];
    return [...fields.slice(0, 5), ...turned.map((value, axis) => Number(fields[5 + axis]) - value), ...fields.slice(8)].join(' ');
  });
  await writeFile(file, lines.join('\n'));
};
