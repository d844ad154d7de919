/** Where the bytes of a file in tiles come from, and requests for ranges of them. */
import { IsoError } from "../errors.js";
import type { TileSource } from "./types.js";

export interface Range {
  at: number;
  size: number;
}

/** Bytes between two ranges that are read with both rather than asked for twice. */
const GAP = 8192;
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
    const found: Uint8Array[] = [], joined: { at: number; end: number; members: number[] }[] = [];
    const order = ranges.map((_, i) => i).sort((i, j) => ranges[i]!.at - ranges[j]!.at);
    let total = 0;
    for (const i of order) {
      const { at, size } = ranges[i]!, end = at + size, last = joined.at(-1);
      if (this.whole || end <= this.start.length) {
        if (end > this.start.length) throw this.short();
        found[i] = this.start.subarray(at, end);
      } else if (last && at - last.end <= GAP) {
        last.end = Math.max(last.end, end);
        last.members.push(i);
      } else joined.push({ at, end, members: [i] });
    }
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

  private async ask(from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
    const url = this.source as string | URL, answer = await fetch(url, { headers: { range: `bytes=${from}-${to - 1}` } });
    if (answer.status === 416) return new Uint8Array(0);
    if (!answer.ok || !answer.body) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
    const tag = answer.headers.get("etag") ?? answer.headers.get("last-modified");
    if ((this.tag ??= tag) !== tag) throw new Error(`${url}: has changed while it was read`);
    const range = answer.headers.get("content-range");
    if (answer.status === 206 && range && Number(/^bytes (\d+)-/.exec(range)?.[1]) !== from)
      throw new Error(`${url}: sends other bytes than those asked for`);
    const ranged = answer.status === 206, bytes = await collect(answer.body, ranged ? to - from : this.most);
    if (ranged) return bytes;
    // a server without ranges sends all of it
    this.start = bytes;
    this.whole = true;
    return bytes;
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
