/** Head and root directory of a file in tiles (12.2 to 12.4). */
import { IsoError } from "../errors.js";
import { readMetadata } from "../metadata.js";
import { Cursor, verify } from "./cursor.js";
import type { TilesHead } from "./types.js";

/** A block of tiles: the index of its first one, how many there are along each axis, where its parts lie in the file. */
export interface Block {
  first: number[];
  extent: number[];
  leaf: { at: number; size: number; sum: number };
  areas: { at: number; size: number }[];
}

/** Head, root directory, and what files of tiles take over from them as it is. */
export interface Opened {
  head: TilesHead;
  blocks: Block[];
  /** Where the last segment ends. */
  end: number;
  /** Of each isovalue its kind, and its bytes. */
  coded: { kind: number; bytes: Uint8Array }[];
}

const MOST = 16384;
/** Bytes that are asked for first. */
export const FIRST = 2 * MOST;
const BLOCKS = 3276;

/** Bytes of head and root directory, as the start of a file states it, of which there are `FIRST` if it has so many. */
export function headSize(start: Uint8Array): number {
  const signature = [0x89, 0x49, 0x53, 0x54], wrong = signature.findIndex((byte, i) => i < start.length && start[i] !== byte);
  if (wrong >= 0) throw new IsoError("malformed", "12.3.1", wrong, "not a file in tiles");
  if (start.length < 8) throw new IsoError("truncated", "8.3", start.length, "the file ends too early");
  const size = start[6]! * 256 + start[7]!;
  if (size < 12 || size > MOST) throw new IsoError("malformed", "12.3.1", 6, "a head of a size out of range");
  if (start.length < size) throw new IsoError("truncated", "8.3", start.length, "the file ends too early");
  return size;
}

/** Read head and root directory, all their bytes. `order` lists the indices of blocks. */
export function readHead(bytes: Uint8Array, order: (extent: number[]) => Uint32Array): Opened {
  const length = bytes.length - 4;
  verify(bytes.subarray(0, length), new Cursor(bytes.subarray(length), length, "12.3.1").word(), length, "12.3.1", "the head");
  const c = new Cursor(bytes.subarray(0, length), 0, "12.3.1");
  c.at = 4;
  if ((c.byte() & 15) !== 1) throw c.error("another version of the format", "3.3.1");
  const flags = c.byte();
  if (flags & 0x18 || (flags & 3) > 1) throw c.error("an unknown flag or profile");
  c.at = 8;
  const within = (what: string, least: number, most: number, x: number): number => {
    if (!(x >= least && x <= most)) throw c.error(`${what} out of range`);
    return x;
  };
  const n = 2 + ((flags >> 2) & 1), masked = (flags & 128) !== 0;
  const shape = Array.from({ length: n }, () => within("a size", 1, 2 ** 40, c.varint()));
  const tile = 2 ** within("a width of tiles", 5, 20, c.byte()), across = 2 ** within("a width of blocks", 0, 20 / n, c.byte());
  const stages = Array.from({ length: within("a number of stages", 1, 16, c.byte()) }, () => {
    const stage = c.byte();
    if (stage & 0x30) throw c.error("an unknown flag of a stage");
    return { cube: 2 ** (stage & 15), geometry: (stage & 128) !== 0, adaptive: (stage & 64) !== 0 };
  });
  const scale = flags & 32 ? c.binary64() : undefined;
  if (scale !== undefined && !(scale > 0 && scale < Infinity)) throw c.error("a scale that is not positive and finite");
  const coded: Opened["coded"] = [];
  const isovalues = Array.from({ length: within("a number of isovalues", 1, 4096, c.varint()) }, () => {
    const kind = within("a kind of isovalue", 0, 3, c.byte()), { at } = c, isovalue = c.isovalue(kind);
    coded.push({ kind, bytes: bytes.slice(at, c.at) });
    return isovalue;
  });
  const together = flags & 64 ? within("a number of isovalues in a group", 2, 256, c.varint()) : 1;
  const metadata = readMetadata(c.take(c.varint()));
  const tiles = shape.map((s) => Math.max(1, -Math.floor((17 - s) / tile))), extent = tiles.map((m) => Math.ceil(m / across));
  within("a number of blocks", 1, BLOCKS, extent.reduce((product, m) => product * m, 1));
  c.clause = "12.4";
  const indices = order(extent), areas = Number(masked) + stages.length * isovalues.length, blocks: Block[] = [];
  for (let i = 0; i < indices.length; i += n) {
    const first = Array.from(indices.subarray(i, i + n), (x) => x * across);
    const leaf = { at: 0, size: c.varint(), sum: c.word() };
    blocks.push({
      first, extent: first.map((x, a) => Math.min(across, tiles[a]! - x)), leaf,
      areas: Array.from({ length: areas }, () => ({ at: 0, size: c.varint() })),
    });
  }
  c.clause = "12.3.1";
  c.end("the root directory");
  let at = bytes.length;
  const place = (part: { at: number; size: number }): void => {
    part.at = at;
    at += part.size;
  };
  for (const { leaf } of blocks) place(leaf);
  for (let area = 0; area < areas; area++) for (const block of blocks) place(block.areas[area]!);
  const profile = flags & 1 ? "main" : "baseline";
  return { head: { n, profile, shape, tile, tiles, stages, isovalues, together, scale, masked, metadata }, blocks, end: at, coded };
}
