/** The directories of a file in tiles, and the files of its tiles, read as they are asked for (12.4 to 12.6). */
import { assemble } from "./assemble.js";
import { verify } from "./cursor.js";
import { type Block, FIRST, headSize, type Opened, readHead } from "./head.js";
import { Kept } from "./kept.js";
import { type Channel, CODED, type Group, readLeaf, type Segment } from "./leaf.js";
import { morton } from "./order.js";
import type { Pieces } from "./source.js";
import type { Box, TilesHead } from "./types.js";

/** A tile: its indices, and its number in the order of its block, whose directory `channels` is. */
export interface Place {
  index: number[];
  number: number;
  channels: readonly Channel[];
}

/** Bytes of directories, and of segments, that are kept. */
const KEPT = 2 ** 26;

export class Directory {
  readonly head: TilesHead;
  private readonly leaves = new Kept<Block, Channel[]>(KEPT);
  private readonly groups = new Kept<number, Uint8Array>(KEPT);
  /** Orders of the tiles of a block by its extent: blocks end at the end of an axis or do not. */
  private readonly orders = new Map<string, Uint32Array>();

  private constructor(readonly pieces: Pieces, private readonly opened: Opened) {
    this.head = opened.head;
  }

  /** Read the head; in most files the first request brings some leaf directories, too. */
  static async open(pieces: Pieces, signal?: AbortSignal): Promise<Directory> {
    const start = await pieces.first(FIRST, signal), size = headSize(start);
    return new Directory(pieces, readHead(start.slice(0, size), morton));
  }

  /** See that the file does not end before its last segment. */
  whole(): Promise<void> {
    return this.pieces.reaches(this.opened.end);
  }

  /** Samples along each axis of a tile. */
  widths(index: readonly number[]): number[] {
    const { shape, tile, tiles } = this.head;
    return index.map((i, a) => (i < tiles[a]! - 1 ? tile + 1 : shape[a]! - i * tile));
  }

  /** Blocks with tiles that lie in a box, in whole or in part, with their directories. */
  async blocks(box: Box | undefined, signal?: AbortSignal): Promise<[Block, Channel[]][]> {
    const { head, opened: { blocks } } = this;
    const met = blocks.filter(({ first, extent }) => !box || this.meets(first, first.map((x, a) => x + extent[a]! - 1), box));
    const missing = met.filter((block) => !this.leaves.get(block)), fresh = new Map<Block, Channel[]>();
    const found = await this.pieces.read(missing.map(({ leaf }) => leaf), signal);
    missing.forEach((block, i) => {
      const { leaf: { at, size, sum } } = block;
      verify(found[i]!, sum, at, "12.4", "a leaf directory");
      const channels = readLeaf(found[i]!, block, head.stages.length, head.isovalues.length, head.masked);
      fresh.set(block, channels);
      this.leaves.set(block, channels, 16 * size);
    });
    return met.map((block) => [block, fresh.get(block) ?? this.leaves.get(block)!]);
  }

  /** Isovalues of the group of one of them, by number. */
  group(isovalue: number): number[] {
    const { together, isovalues } = this.head, first = isovalue - (isovalue % together);
    return Array.from({ length: Math.min(together, isovalues.length - first) }, (_, i) => first + i);
  }

  /** Isovalues of the group of one at which a tile is coded: its file has these. */
  at({ number, channels }: Place, isovalue: number): number[] {
    const masks = Number(this.head.masked);
    return this.group(isovalue).filter((i) => channels[masks + i]!.kind(number) === CODED);
  }

  /** Tiles of a block that are coded at one of some isovalues and lie in a box, in whole or in part. */
  coded(block: Block, channels: readonly Channel[], isovalues: readonly number[], box: Box | undefined): Place[] {
    const { n, masked } = this.head, order = this.order(block.extent), found: Place[] = [];
    const numbers = isovalues.flatMap((isovalue) => channels[Number(masked) + isovalue]!.coded);
    for (const number of isovalues.length > 1 ? [...new Set(numbers)].sort((a, b) => a - b) : numbers) {
      const index = block.first.map((x, a) => x + order[n * number + a]!);
      if (!box || this.meets(index, index, box)) found.push({ index, number, channels });
    }
    return found;
  }

  private order(extent: readonly number[]): Uint32Array {
    const key = extent.join(), order = this.orders.get(key) ?? morton(extent);
    this.orders.set(key, order);
    return order;
  }

  /** Whether tiles from one to another lie in a box. */
  private meets(from: readonly number[], to: readonly number[], box: Box): boolean {
    const { shape, tile, tiles } = this.head;
    return box.every(([low, high], a) => {
      const end = to[a]! < tiles[a]! - 1 ? (to[a]! + 1) * tile : shape[a]! - 1;
      return from[a]! * tile < high && end > low;
    });
  }

  /** The segments of a tile's file at the group of an isovalue, up to a stage: of the mask first, if it has one. */
  segments(place: Place, isovalue: number, stage: number): Segment[] {
    const { number, channels } = place, masks = Number(this.head.masked);
    const own = this.at(place, isovalue).map((i) => channels[masks + i]!.of(number));
    return [...this.mask(place), ...Array.from({ length: stage + 1 }, (_, i) => own.map((segments) => segments[i]!)).flat()];
  }

  private mask({ number, channels }: Place): Segment[] {
    return this.head.masked ? channels[0]!.of(number) : [];
  }

  /** Whether a tile has any bytes of layers at an isovalue, up to a stage: else nothing is drawn of it. */
  filled({ number, channels }: Place, isovalue: number, stage: number): boolean {
    return channels[Number(this.head.masked) + isovalue]!.of(number).some(({ size }, i) => size > 0 && i <= stage);
  }

  /** The groups that hold some segments, their checksums verified. */
  async fetch(segments: readonly Segment[], signal?: AbortSignal): Promise<Map<Group, Uint8Array>> {
    const wanted = new Set<Group>(), held = new Map<Group, Uint8Array>();
    for (const { group } of segments) {
      const kept = group && this.groups.get(group.at);
      if (kept) held.set(group, kept);
      else if (group) wanted.add(group);
    }
    const list = [...wanted], found = await this.pieces.read(list, signal);
    list.forEach((group, i) => {
      verify(found[i]!, group.sum, group.at, "12.5", "a group of segments");
      held.set(group, found[i]!);
      this.groups.set(group.at, found[i]!, group.size);
    });
    return held;
  }

  /** The file of a tile at the group of an isovalue, up to a stage. */
  file(place: Place, isovalue: number, stage: number, groups: Map<Group, Uint8Array>): Uint8Array {
    const segments = this.segments(place, isovalue, stage);
    const parts = segments.map(({ group, at, size }) => group ? groups.get(group)!.subarray(at, at + size) : new Uint8Array(0));
    const mask = this.mask(place).length ? parts.shift() : undefined;
    return assemble(this.opened, this.at(place, isovalue), this.widths(place.index), mask, parts);
  }
}
