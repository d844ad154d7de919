/** CRC-32 of gzip, PNG and zlib (3.4.4(3)). */

const TABLE = Int32Array.from({ length: 256 }, (_, i) => {
  let x = i;
  for (let j = 0; j < 8; j++) x = x & 1 ? (x >>> 1) ^ 0xedb88320 : x >>> 1;
  return x;
});

/** Continue the CRC-32 `crc` with the bytes from `start` to `stop`. */
export function crc32(crc: number, bytes: Uint8Array, start: number, stop: number): number {
  let x = ~crc;
  for (let i = start; i < stop; i++) x = TABLE[(x ^ bytes[i]!) & 255]! ^ (x >>> 8);
  return ~x >>> 0;
}
