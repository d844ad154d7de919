/** Where the bytes of a file in tiles come from, and requests for ranges of them. */
import { IsoError } from "../errors.js";
import type { TileSource } from "./types.js";

export interface Range {
  at: number;
  size: number;
}

/** Bytes between two ranges that are read with both rather than asked for twice, and those in all for fewer requests. */
const GAP = 8192, SLACK = 2 ** 20;
/** Ranges that are not joined over larger gaps. */
const FEW = 4;
/** Statuses after which a server is asked again, and milliseconds before that, and in all. */
const BUSY = [408, 425, 429, 500, 502, 503, 504], PAUSES = [250, 500, 1000], PATIENCE = 8000;
/** Requests at a time. */
const LANES = 6;

export class Pieces {
  /** Pieces that have been read, and their bytes. */
  requests = 0;
  received = 0;
  /** The beginning of the file, or all of it. */
  private start = new Uint8Array(0);
  private whole = false;
  private tag: string | null | undefined;

  constructor(private readonly source: TileSource, private readonly most: number) {
    if (!(source instanceof Uint8Array)) return;
    this.start = source as Uint8Array<ArrayBuffer>;
    this.whole = true;
  }

  /** The first bytes of the file, as many as `count` if it has so many. */
  async first(count: number): Promise<Uint8Array> {
    if (!this.whole) {
      const start = await this.fetch(0, count);
      if (!this.whole) this.start = start;
      if (start.length < count) this.whole = true;
    }
    return this.start.subarray(0, count);
  }

  /** The bytes of some ranges. Neighbours are read together. */
  async read(ranges: readonly Range[]): Promise<Uint8Array[]> {
    const found: Uint8Array[] = [], joined: Joined[] = [];
    const order = ranges.map((_, i) => i).sort((i, j) => ranges[i]!.at - ranges[j]!.at);
    let total = 0;
    for (const i of order) {
      const { at, size } = ranges[i]!, end = at + size, last = joined.at(-1);
      if (this.whole || end <= this.start.length) {
        if (end > this.start.length) throw this.short();
        found[i] = this.start.subarray(at, end);
      } else if (last && at <= last.end + GAP) {
        last.end = Math.max(last.end, end);
        last.members.push(i);
      } else joined.push({ at, end, members: [i] });
    }
    bridge(joined);
    for (const { at, end } of joined) total += end - at;
    if (total > this.most) throw new IsoError("limit", "11.2", joined[0]!.at, "what is needed is longer than the limit");
    const lane = async (): Promise<void> => {
      for (let next = joined.shift(); next; next = joined.shift()) {
        const { at, end, members } = next, bytes = await this.fetch(at, end);
        if (bytes.length < end - at) throw this.short(at + bytes.length);
        for (const i of members) found[i] = bytes.subarray(ranges[i]!.at - at, ranges[i]!.at - at + ranges[i]!.size);
      }
    };
    await Promise.all(Array.from({ length: LANES }, lane));
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
  private async fetch(from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
    const { source } = this;
    if (this.whole) return this.start.slice(from, to);
    this.requests++;
    const bytes = source instanceof Blob ? new Uint8Array(await source.slice(from, to).arrayBuffer()) : await this.ask(from, to);
    this.received += bytes.length;
    return this.whole ? bytes.slice(from, to) : bytes;
  }

  /** Ask for a range; again, if the server is busy. */
  private async ask(from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
    const url = this.source as string | URL, until = Date.now() + PATIENCE;
    for (const pause of [...PAUSES, Infinity]) {
      const answer = await fetch(url, { headers: { range: `bytes=${from}-${to - 1}` } });
      const rest = Math.max(pause, 1000 * (Number(answer.headers.get("retry-after")) || 0));
      if (!BUSY.includes(answer.status) || Date.now() + rest > until) return this.take(answer, from, to);
      await answer.body?.cancel();
      await new Promise((resolve) => setTimeout(resolve, rest));
    }
    throw new Error(`${url}: is busy`);
  }

  private async take(answer: Response, from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
    const url = this.source as string | URL;
    if (answer.status === 416) return new Uint8Array(0);
    if (!answer.ok || !answer.body) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
    const tag = answer.headers.get("etag") ?? answer.headers.get("last-modified");
    if ((this.tag ??= tag) !== tag) throw new Error(`${url}: has changed while it was read`);
    const range = answer.headers.get("content-range"), ends = range && /^bytes (\d+)-(\d+)\//.exec(range);
    if (answer.status === 206 && range && !(ends && Number(ends[1]) === from && Number(ends[2]) < to))
      throw new Error(`${url}: sends other bytes than those asked for`);
    const ranged = answer.status === 206, bytes = await collect(answer.body, ranged ? to - from : this.most);
    if (ranged) return bytes;
    console.warn(`${url}: the server sends no parts of files; all of it was read`);
    this.start = bytes;
    this.whole = true;
    return bytes;
  }
}

interface Joined {
  at: number;
  end: number;
  members: number[];
}

/** Join ranges over the smallest gaps while there are more than a few, as far as that reads little in vain. */
function bridge(ranges: Joined[]): void {
  const gaps = ranges.slice(1).map(({ at }, i) => ({ size: at - ranges[i]!.end, next: ranges[i + 1]! })).sort((a, b) => a.size - b.size);
  let left = SLACK + ranges.reduce((sum, { at, end }) => sum + end - at, 0);
  for (const { size, next } of gaps) {
    if (ranges.length <= FEW || (left -= size) < 0) return;
    const i = ranges.indexOf(next), before = ranges[i - 1]!;
    before.end = next.end;
    before.members.push(...next.members);
    ranges.splice(i, 1);
  }
}

/** All bytes of a stream, at most so many. */
async function collect(stream: ReadableStream<Uint8Array>, most: number): Promise<Uint8Array<ArrayBuffer>> {
  const parts: Uint8Array[] = [], reader = stream.getReader();
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    if ((length += value.length) > most) {
      await reader.cancel();
      throw new IsoError("limit", "11.2", most, "a server sends more bytes than the limit");
    }
  }
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
