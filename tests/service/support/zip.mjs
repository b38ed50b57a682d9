// Zip files written by hand, right ones and wrong ones. Layout: APPNOTE 6.3, sections 4.3.7, 4.3.12 and 4.3.16.
import { deflateRawSync } from 'node:zlib';

const table = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; ++bit) value = value & 1 ? 0xedb88320 ^ (value >>> 1) : value >>> 1;
  return value;
});
export const crc32 = (bytes) => {  // node:zlib has its own only from Node 20.15 on
  let crc = 0xffffffff;
  for (const byte of bytes) crc = table[(crc ^ byte) & 255] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
};

const deflated = 8, stored = 0;
const unix = 3 << 8;

/// entries  [{name, bytes, mode?, deflate?, claimedSize?, encrypted?, crc?}]
///          mode         Unix file type and permissions, such as 0o120777 for a symbolic link
///          claimedSize  unpacked size to write into the headers instead of the true one
export const zip = (entries) => {
  const parts = [], directory = [];
  let offset = 0;
  for (const { name, bytes, mode = 0o100644, deflate = true, claimedSize, encrypted = false, crc } of entries) {
    const data = deflate ? deflateRawSync(bytes) : Buffer.from(bytes);
    const encoded = Buffer.from(name);
    const common = Buffer.alloc(26);
    common.writeUInt16LE(20, 0);
    common.writeUInt16LE(0x800 | (encrypted ? 1 : 0), 2);  // names are UTF-8
    common.writeUInt16LE(deflate ? deflated : stored, 4);
    common.writeUInt16LE(0x21, 8);  // 1 January 1980
    common.writeUInt32LE(crc ?? crc32(bytes), 10);
    common.writeUInt32LE(data.length, 14);
    common.writeUInt32LE(claimedSize ?? bytes.length, 18);
    common.writeUInt16LE(encoded.length, 22);
    const local = Buffer.concat([Buffer.from('PK\x03\x04', 'latin1'), common, encoded, data]);
    const tail = Buffer.alloc(14);
    tail.writeUInt32LE((mode << 16) >>> 0, 6);
    tail.writeUInt32LE(offset, 10);
    const madeBy = Buffer.from([20, unix >> 8]);
    directory.push(Buffer.concat([Buffer.from('PK\x01\x02', 'latin1'), madeBy, common, tail, encoded]));
    parts.push(local);
    offset += local.length;
  }
  const central = Buffer.concat(directory);
  const end = Buffer.alloc(22);
  end.write('PK\x05\x06', 'latin1');
  end.writeUInt16LE(entries.length & 0xffff, 8);
  end.writeUInt16LE(entries.length & 0xffff, 10);
  end.writeUInt32LE(central.length, 12);
  end.writeUInt32LE(offset, 16);
  return Buffer.concat([...parts, central, end]);
};
