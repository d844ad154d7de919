/** Where the bytes of a file in tiles come from, and which requests for ranges of them are made. */
import { IsoError } from "../errors.js";
import type { TileSource } from "./types.js";
import { WebFile } from "./web.js";

export interface Range {
  at: number;
  size: number;
}

/** Bytes between two ranges that may be read with both rather than asked for twice. */
const GAP = 8192;
/** Ranges that are not joined over larger gaps; requests at most, unless fewer would read more than so many bytes in vain. */
const FEW = 4, MOST = 8, SLACK = 2 ** 20;
/** Requests at a time. */
const LANES = 6;

export class Pieces {
  /** Pieces that have been read, and their bytes. */
  requests = 0;
  received = 0;
  /** The beginning of the file, or all of it. */
  private start = new Uint8Array(0);
  private whole = false;
  private readonly web: WebFile | undefined;

  /** `most`: the most bytes that are read together; `timeout`: milliseconds that a server may take. */
  constructor(private readonly source: TileSource, private readonly most: number, timeout: number) {
    if (source instanceof Uint8Array) {
      this.start = source as Uint8Array<ArrayBuffer>;
      this.whole = true;
    } else if (!(source instanceof Blob)) this.web = new WebFile(source, timeout, most);
  }

  /** The first bytes of the file, as many as `count` if it has so many. */
  async first(count: number, signal?: AbortSignal): Promise<Uint8Array> {
    if (!this.whole) {
      const start = await this.fetch(0, count, signal);
      if (!this.whole) this.start = start;
      if (start.length < count) this.whole = true;
    }
    return this.start.subarray(0, count);
  }

  /** The bytes of some ranges. Neighbours are read together. */
  async read(ranges: readonly Range[], signal?: AbortSignal): Promise<Uint8Array[]> {
    const found: Uint8Array[] = [], joined: Joined[] = [];
    const order = ranges.map((_, i) => i).sort((i, j) => ranges[i]!.at - ranges[j]!.at);
    let total = 0;
    for (const i of order) {
      const { at, size } = ranges[i]!, end = at + size, last = joined.at(-1);
      if (this.whole || end <= this.start.length) {
        if (end > this.start.length) throw this.short();
        found[i] = this.start.subarray(at, end);
      } else if (last && at <= last.end) {
        last.end = Math.max(last.end, end);
        last.members.push(i);
      } else joined.push({ at, end, members: [i] });
    }
    bridge(joined);
    for (const { at, end } of joined) total += end - at;
    if (total > this.most) throw new IsoError("limit", "11.2", joined[0]!.at, "what is needed is longer than the limit");
    // if one request fails, the others stop
    const own = new AbortController(), stop = (): void => own.abort(signal!.reason);
    signal?.throwIfAborted();
    signal?.addEventListener("abort", stop);
    const lane = async (): Promise<void> => {
      for (let next = joined.shift(); next; next = joined.shift()) {
        const { at, end, members } = next, bytes = await this.fetch(at, end, own.signal);
        if (bytes.length < end - at) throw this.short(at + bytes.length);
        // what is kept of a range does not keep the others
        for (const i of members) found[i] = bytes.slice(ranges[i]!.at - at, ranges[i]!.at - at + ranges[i]!.size);
      }
    };
    try {
      await Promise.all(Array.from({ length: Math.min(LANES, joined.length) }, lane));
    } finally {
      signal?.removeEventListener("abort", stop);
      own.abort();
    }
    return found;
  }

  /** See that the file has bytes up to `end`. */
  async reaches(end: number): Promise<void> {
    if (end > 0) await this.read([{ at: end - 1, size: 1 }]);
  }

  private short(at = this.start.length): IsoError {
    return new IsoError("truncated", "8.3", at, "the file ends too early");
  }

  /** Bytes from `from` to `to`, fewer if the file ends before. */
  private async fetch(from: number, to: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const { source, web } = this;
    if (this.whole) return this.start.slice(from, to);
    this.requests++;
    const { bytes, whole } = web ? await web.read(from, to, signal)
      : { bytes: new Uint8Array(await (source as Blob).slice(from, to).arrayBuffer()), whole: false };
    this.received += bytes.length;
    if (!whole) return bytes;
    console.warn(`${source}: the server sends no parts of files; all of it was read`);
    this.start = bytes;
    this.whole = true;
    return bytes.slice(from, to);
  }
}

interface Joined {
  at: number;
  end: number;
  members: number[];
}

/**
 * Join ranges over the smallest gaps: over small ones, and while there are more than a few, as long as no more bytes are read
 * in vain than are needed; and while there are too many, as far as that reads little in vain.
 */
function bridge(ranges: Joined[]): void {
  const gaps = ranges.slice(1).map(({ at }, i) => ({ size: at - ranges[i]!.end, next: ranges[i + 1]! })).sort((a, b) => a.size - b.size);
  const needed = ranges.reduce((sum, { at, end }) => sum + end - at, 0);
  let vain = 0;
  for (const { size, next } of gaps) {
    vain += size;
    const twice = vain <= needed && (size <= GAP || ranges.length > FEW);
    if (!twice && !(vain <= needed + SLACK && ranges.length > MOST)) return;
    const i = ranges.indexOf(next), before = ranges[i - 1]!;
    before.end = next.end;
    before.members.push(...next.members);
    ranges.splice(i, 1);
  }
}
