/** Leaf directories: which tiles of a block are coded, and where their segments lie (12.5). */
import { Cursor } from "./cursor.js";
import type { Block } from "./head.js";

/** Kinds of tiles (12.5(2)). */
export const CODED = 2;

/** Bytes that a group of segments has at least. */
const GROUP = 1024;

/** Segments of one area that a checksum holds together: they lie from `at` to `at + size` in the file. */
export interface Group {
  at: number;
  size: number;
  sum: number;
}

/** Where a segment lies: in a group, from its byte `at` on; no group if it is empty. */
export interface Segment {
  group: Group | undefined;
  at: number;
  size: number;
}

/** The tiles of a block at an isovalue, or their masks. */
export class Channel {
  /** Where runs of tiles of a kind end, in the order of tiles, and their kinds. */
  private readonly ends: number[] = [];
  private readonly kinds: number[] = [];
  /** Numbers of the coded tiles, in the order of the block, and for each of them the bytes of its segments. */
  readonly coded: number[] = [];
  private readonly sizes: number[] = [];
  private readonly segments: Segment[][] = [];

  constructor(c: Cursor, tiles: number, private readonly stages: number) {
    for (let done = 0; done < tiles; ) {
      const u = c.varint(), kind = u % 4, to = done + (u - kind) / 4 + 1;
      if (kind === 3) throw c.error("an unknown kind of tiles");
      if (to > tiles) throw c.error("a run with more tiles than the block");
      for (let i = done; kind === CODED && i < to; i++) {
        this.coded.push(i);
        for (let stage = 0; stage < stages; stage++) {
          const size = c.varint();
          if (size >= 2 ** 40) throw c.error("a segment of a size out of range");
          this.sizes.push(size);
        }
      }
      this.ends.push((done = to));
      this.kinds.push(kind);
    }
  }

  /** The kind of the tile of that number. */
  kind(number: number): number {
    let low = 0, high = this.ends.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (number < this.ends[middle]!) high = middle;
      else low = middle + 1;
    }
    return this.kinds[low]!;
  }

  /** The segments of a coded tile, by stage. */
  of(number: number): Segment[] {
    let low = 0, high = this.coded.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.coded[middle]! < number) low = middle + 1;
      else high = middle;
    }
    return this.coded[low] === number ? this.segments.map((segments) => segments[low]!) : [];
  }

  /** Read the checksums of the groups of a stage's segments, which lie from `at` to `at + size` in the file. */
  group(c: Cursor, stage: number, { at, size: expected }: { at: number; size: number }): void {
    const segments: Segment[] = (this.segments[stage] = []), groups: Group[] = [];
    let total = 0, group: Group | undefined;
    for (let i = stage; i < this.sizes.length; i += this.stages) {
      const size = this.sizes[i]!;
      if (size && !group) groups.push((group = { at: at + total, size: 0, sum: 0 }));
      segments.push({ group: size ? group : undefined, at: size ? group!.size : 0, size });
      total += size;
      if (group && (group.size += size) >= GROUP) group = undefined;
    }
    if (total !== expected) throw c.error("segments take other numbers of bytes than the root directory says", "12.4");
    for (const each of groups) each.sum = c.word();
  }
}

/** A leaf directory: the masks, if the file has any, then the isovalues. */
export function readLeaf(bytes: Uint8Array, block: Block, stages: number, isovalues: number, masked: boolean): Channel[] {
  const c = new Cursor(bytes, block.leaf.at, "12.5"), tiles = block.extent.reduce((product, m) => product * m, 1);
  const mask = masked ? [new Channel(c, tiles, 1)] : [], channels = Array.from({ length: isovalues }, () => new Channel(c, tiles, stages));
  for (const channel of mask) channel.group(c, 0, block.areas[0]!);
  for (let stage = 0, area = mask.length; stage < stages; stage++)
    for (const channel of channels) channel.group(c, stage, block.areas[area++]!);
  c.end("a leaf directory");
  return [...mask, ...channels];
}
