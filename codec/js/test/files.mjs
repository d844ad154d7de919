/** Files for tests: varints, checksums, notes put into a file. */
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

/** A file with a chunk of metadata behind its header. */
export function withMetadata(data, metadata) {
  const [{ bytes }] = new Decoder().feed(data), note = new TextEncoder().encode(JSON.stringify(metadata));
  return summed([...data.subarray(0, bytes), 0x83, ...varint(note.length), ...note, ...data.subarray(bytes, -4)]);
}
