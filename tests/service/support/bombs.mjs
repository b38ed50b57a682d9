// Files of a few kilobytes that are worth gigabytes, or seconds, to a reader that believes them.
import { createDeflate, createDeflateRaw } from 'node:zlib';
import { crc32, zip } from './zip.mjs';

/// Deflates so many zeros, after some bytes, without ever holding them.
const deflated = async (to, first, zeros) => {
  const parts = [];
  to.on('data', (part) => parts.push(part));
  const ended = new Promise((done) => { to.on('end', done); });
  const piece = Buffer.alloc(1 << 22);
  to.write(first);
  for (let left = zeros; left > 0; left -= piece.length)
    if (!to.write(left < piece.length ? piece.subarray(0, left) : piece)) await new Promise((done) => { to.once('drain', done); });
  to.end();
  await ended;
  return Buffer.concat(parts);
};

/// A black PNG picture of 8-bit RGB: valid, and as small as deflate makes it.
export const blackPng = async (width, height) => {
  const chunk = (type, data) => {
    const body = Buffer.concat([Buffer.from(type), data]);
    const frame = Buffer.alloc(8);
    frame.writeUInt32BE(data.length, 0);
    frame.writeUInt32BE(crc32(body), 4);
    return Buffer.concat([frame.subarray(0, 4), body, frame.subarray(4)]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 2, 0, 0, 0], 8);  // bits, RGB, deflate, filters, not interlaced
  const pixels = await deflated(createDeflate({ level: 9 }), Buffer.alloc(0), height * (1 + 3 * width));
  return Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', head), chunk('IDAT', pixels), chunk('IEND', Buffer.alloc(0))]);
};

/// A .spz file of version 2 whose Gaussians are all alike: 19 bytes each, before gzip. Its checksum is wrong, which only
/// shows at the end.
export const alikeSpz = async (count) => {
  const head = Buffer.alloc(16);
  head.writeUInt32LE(0x5053474e, 0);  // "NGSP"
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(count, 8);
  head.set([0, 12, 0, 0], 12);  // SH degree, fractional bits, flags, reserved
  const packed = await deflated(createDeflateRaw({ level: 9 }), head, 19 * count);
  return Buffer.concat([Buffer.from([0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 2, 3]), packed, Buffer.alloc(8)]);
};

/// {"frames":[{},{},...]}: every bracket becomes an object of a parser's.
export const emptyFrames = (count) => Buffer.concat([Buffer.from('{"frames":['), Buffer.alloc(3 * (count - 1), '{},'), Buffer.from('{}]}')]);

/// A .ply header that names so many elements, all empty.
export const manyElements = (count) =>
  Buffer.from(`ply\nformat binary_little_endian 1.0\n${Array.from({ length: count }, (_, i) => `element e${i} 0\n`).join('')}end_header\n`);

/// An EXR picture that is all promise: a header, and a table that says its chunks lie nowhere.
export const hollowExr = (width, height) => {
  const u32 = (...values) => { const bytes = Buffer.alloc(4 * values.length); values.forEach((value, i) => bytes.writeUInt32LE(value >>> 0, 4 * i)); return bytes; };
  const f32 = (...values) => { const bytes = Buffer.alloc(4 * values.length); values.forEach((value, i) => bytes.writeFloatLE(value, 4 * i)); return bytes; };
  const text = (string) => Buffer.from(`${string}\0`);
  const attribute = (name, type, value) => Buffer.concat([text(name), text(type), u32(value.length), value]);
  const channel = (name) => Buffer.concat([text(name), u32(1, 0, 1, 1)]);  // half, not linear, every pixel
  const box = u32(0, 0, width - 1, height - 1);
  return Buffer.concat([
    u32(20000630, 2),
    attribute('channels', 'chlist', Buffer.concat([channel('B'), channel('G'), channel('R'), Buffer.alloc(1)])),
    attribute('compression', 'compression', Buffer.from([3])),  // ZIP, 16 rows to a chunk
    attribute('dataWindow', 'box2i', box),
    attribute('displayWindow', 'box2i', box),
    attribute('lineOrder', 'lineOrder', Buffer.from([0])),
    attribute('pixelAspectRatio', 'float', f32(1)),
    attribute('screenWindowCenter', 'v2f', f32(0, 0)),
    attribute('screenWindowWidth', 'float', f32(1)),
    Buffer.alloc(1),
    Buffer.alloc(8 * Math.ceil(height / 16)),
  ]);
};

/// A dataset of one view through a camera of that size, whose photo is these bytes.
export const oneView = (width, height, name, photo) => zip([
  { name: 'sparse/0/cameras.txt', bytes: Buffer.from(`1 PINHOLE ${width} ${height} ${width} ${width} ${width / 2} ${height / 2}\n`) },
  { name: 'sparse/0/images.txt', bytes: Buffer.from(`1 1 0 0 0 0 0 4 1 ${name}\n\n`) },
  { name: 'sparse/0/points3D.txt', bytes: Buffer.alloc(0) },
  { name: `images/${name}`, bytes: photo },
]);
