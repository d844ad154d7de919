/** Files for tests: varints, checksums, notes put into a file. */
import assert from "node:assert/strict";
import { Decoder } from "../dist/index.js";

export function varint(x) {
  const bytes = [x % 128];
  while ((x = Math.floor(x / 128))) bytes.unshift(128 + (x % 128));
  return bytes;
}

/** The CRC-32 of some bytes (3.4.4). */
export function crc32(bytes) {
  let x = -1;
  for (const byte of bytes) {
    x ^= byte;
    for (let i = 0; i < 8; i++) x = x & 1 ? (x >>> 1) ^ 0xedb88320 : x >>> 1;
  }
  return ~x >>> 0;
}

/** Bytes with their CRC-32 behind them. */
export function summed(bytes) {
  const sum = crc32(bytes);
  return Uint8Array.from([...bytes, sum >>> 24, (sum >>> 16) & 255, (sum >>> 8) & 255, sum & 255]);
}

/** The bytes of a header, and the chunks behind it: the bits ancillary and type of their heads, and their payloads. */
export function chunksOf(data) {
  const [{ bytes }] = new Decoder().feed(data), chunks = [];
  for (let at = bytes; at < data.length - 4; ) {
    const head = data[at++];
    let length = 0;
    do length = length * 128 + (data[at] & 127);
    while (data[at++] & 128);
    chunks.push({ head: head & 159, payload: data.subarray(at, at + length) });
    at += length + (head & 64 ? 4 : 0);
  }
  return { header: data.subarray(0, bytes), chunks };
}

/** A file of a header and chunks, without checksums of their own. */
export function joined({ header, chunks }) {
  const bytes = [...header];
  chunks.forEach(({ head, payload }, i) => {
    bytes.push(head | (i === chunks.length - 1 ? 32 : 0), ...varint(payload.length));
    for (const byte of payload) bytes.push(byte);
  });
  return summed(bytes);
}

/** A file with a chunk of metadata behind its header. */
export function withMetadata(data, metadata) {
  const [{ bytes }] = new Decoder().feed(data), note = new TextEncoder().encode(JSON.stringify(metadata));
  return summed([...data.subarray(0, bytes), 0x83, ...varint(note.length), ...note, ...data.subarray(bytes, -4)]);
}

/**
 * Where parts of a file in tiles lie that have checksums, and where these are: the head, leaf directories, groups. Each
 * checksum is in the part `within`, that of the head in none.
 */
export function tiledParts(data) {
  let at = 8;
  const number = () => {
    let value = 0;
    do value = value * 128 + (data[at] & 127);
    while (data[at++] & 128);
    return value;
  };
  const end = data[6] * 256 + data[7], flags = data[5], n = 2 + ((flags >> 2) & 1), head = { at: 0, size: end - 4, sum: end - 4 };
  const shape = Array.from({ length: n }, number), edge = 2 ** data[at++], across = 2 ** data[at++], S = data[at++];
  at += S + (flags & 32 ? 8 : 0);
  const I = number();
  for (let i = 0; i < I; i++) {
    const kind = data[at++];
    if (kind === 3) at++;
    if (kind % 3) at += 4 * kind;
    else number();
  }
  if (flags & 64) number();
  const notes = number();
  at += notes;
  const masks = flags >> 7, areas = masks + S * I, parts = [head], blocks = [], tiles = shape.map((s) => Math.max(1, Math.ceil((s - 17) / edge)));
  while (at < end - 4) {
    const size = number(), sum = at;
    at += 4;
    blocks.push({ size, sum, areas: Array.from({ length: areas }, number) });
  }
  let start = end, area = end + blocks.reduce((total, { size }) => total + size, 0);
  const starts = Array.from({ length: areas }, (_, k) => blocks.map((block) => (area += block.areas[k]) - block.areas[k]));
  assert.equal(blocks.length, tiles.reduce((total, m) => total * Math.ceil(m / across), 1));
  blocks.forEach(({ size, sum }, b) => {
    const leaf = { at: start, size, sum, within: head };
    parts.push(leaf);
    at = start;
    start += size;
    // of blocks that end at the end of an axis the number of tiles follows from the runs: those of a file of one block
    let left = blocks.length > 1 ? NaN : tiles.reduce((total, m) => total * m, 1);
    if (Number.isNaN(left)) return;
    const sizes = [];
    for (let channel = 0; channel < masks + I; channel++) {
      const stages = channel < masks ? 1 : S, own = [];
      for (let listed = 0; listed < left; ) {
        const u = number(), count = Math.floor(u / 4) + 1;
        for (let i = 0; u % 4 === 2 && i < count; i++) own.push(Array.from({ length: stages }, number));
        listed += count;
      }
      sizes.push(own);
    }
    for (let k = 0; k < areas; k++) {
      const channel = k < masks ? 0 : masks + ((k - masks) % I), stage = k < masks ? 0 : Math.floor((k - masks) / I);
      let from = starts[k][b], group = from, to = from;
      const close = () => {
        if (to > group) parts.push({ at: group, size: to - group, sum: at, within: leaf });
        at += to > group ? 4 : 0;
        group = to;
      };
      for (const own of sizes[channel]) {
        to += own[stage];
        if (to - group >= 1024) close();
      }
      close();
    }
  });
  return { parts };
}

/** A file in tiles of 32 samples in the plane, without segments: leaf directories, and of each block what the root says of it. */
export function emptyTiles({ shape, block, leaves, entries }) {
  const fields = [...shape.flatMap(varint), 5, block, 1, 4, 1, 0, 1, 0, ...entries.flat()], size = 12 + fields.length;
  const head = summed([0x89, 0x49, 0x53, 0x54, 0x11, 0, size >> 8, size & 255, ...fields]);
  return new Uint8Array(Buffer.concat([head, ...leaves]));
}

/** What a root directory says of a leaf directory whose block has no segments. */
export function entry(leaf) {
  return [...varint(leaf.length), ...summed(leaf).slice(-4), 0];
}

/** Put right the checksum of a part, and of those that it is in. */
export function repair(data, part) {
  const sum = crc32(data.subarray(part.at, part.at + part.size));
  new DataView(data.buffer, data.byteOffset).setUint32(part.sum, sum);
  if (part.within) repair(data, part.within);
}
