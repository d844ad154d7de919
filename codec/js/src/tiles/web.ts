/** Files of web servers: ranges of their bytes, and never more than was asked for. */
import { IsoError } from "../errors.js";

/** Statuses after which a server is asked again, and milliseconds before that. */
const BUSY = [408, 425, 429, 500, 502, 503, 504], PAUSES = [250, 500, 1000];
/** Bytes that have to arrive in time, again and again. */
const PIECE = 65536;
/** Bytes of a file that is taken whole from a server that sends no ranges. */
export const WHOLE = 2 ** 24;

export class WebFile {
  /** What servers say of the version of a file, as it was said first. */
  private readonly version: Record<string, string> = {};
  private ranged = false;

  /** `timeout`: milliseconds that an answer, and then each piece of it, may take; `most`: the limit on bytes of the file. */
  constructor(private readonly url: string | URL, private readonly timeout: number, private readonly most: number) {}

  /** The bytes from `from` up to `to`, fewer if the file ends before; or all of a short file, if the server sends no ranges. */
  async read(from: number, to: number, signal?: AbortSignal): Promise<{ bytes: Uint8Array<ArrayBuffer>; whole: boolean }> {
    const until = Date.now() + this.timeout;
    for (let i = 0; ; i++) {
      const rest = await this.inTime(signal, async (within, more) => {
        const answer = await fetch(this.url, { headers: { range: `bytes=${from}-${to - 1}` }, signal: within });
        const asked = Math.max(PAUSES[i] ?? Infinity, 1000 * (Number(answer.headers.get("retry-after")) || 0));
        return BUSY.includes(answer.status) && Date.now() + asked < until ? asked : this.take(answer, from, to, more);
      });
      if (typeof rest !== "number") return rest;
      await new Promise((resolve) => setTimeout(resolve, rest));
    }
  }

  private error(what: string): Error {
    return new Error(`${this.url}: ${what}`);
  }

  /**
   * Do something that stops when `signal` aborts, or when `timeout` has passed since it began or called `more` last. An answer
   * is let go of at the end, whatever has been read of it.
   */
  private async inTime<T>(signal: AbortSignal | undefined, work: (within: AbortSignal, more: () => void) => Promise<T>): Promise<T> {
    signal?.throwIfAborted();
    const own = new AbortController(), stop = (): void => own.abort(signal!.reason);
    let timer: ReturnType<typeof setTimeout> | undefined;
    const more = (): void => {
      clearTimeout(timer);
      timer = setTimeout(() => own.abort(this.error(`the server has not answered within ${this.timeout / 1000} seconds`)), this.timeout);
    };
    signal?.addEventListener("abort", stop);
    more();
    try {
      return await work(own.signal, more);
    } catch (error) {
      if (own.signal.aborted) throw own.signal.reason;
      throw error instanceof TypeError ? this.error(`cannot be read (${error.message})`) : error;
    } finally {
      clearTimeout(timer);
      signal?.removeEventListener("abort", stop);
      own.abort();
    }
  }

  /** See that the file is the one that was read before. */
  private same(name: string, value: string | null | undefined): void {
    if (value && (this.version[name] ??= value) !== value) throw this.error("the file has changed on the server while it was being read; open it again");
  }

  private async take(answer: Response, from: number, to: number, more: () => void): Promise<{ bytes: Uint8Array<ArrayBuffer>; whole: boolean }> {
    const { status, headers, body } = answer, ranged = status === 206, coding = headers.get("content-encoding");
    if (status === 416) return { bytes: new Uint8Array(0), whole: false };
    if (!(ranged || status === 200) || !body) throw this.error(`the server answers ${status} ${answer.statusText}`.trimEnd());
    if (coding && coding !== "identity") throw this.error("the server compresses what it sends; download the file first");
    for (const name of ["etag", "last-modified"]) this.same(name, headers.get(name));
    if (!ranged) {
      const room = Math.min(WHOLE, this.most), bytes = this.ranged || Number(headers.get("content-length")) > room ? undefined : await collect(body, room, more);
      if (bytes) return { bytes, whole: true };
      if (this.most < WHOLE) throw new IsoError("limit", "11.2", this.most, "the server sends the whole file, which is longer than the limit");
      throw this.error("the server sends the whole file instead of the requested range; download it first, or use a server that supports range requests");
    }
    this.ranged = true;
    // servers of other sites may keep where a range lies to themselves
    const stated = headers.get("content-range"), [, first, last, size] = /^bytes (\d+)-(\d+)\/(\d+|\*)$/.exec(stated ?? "") ?? [];
    const end = stated === null ? to : Number(last) + 1;
    // fewer bytes are right at the end of the file only
    if (stated !== null && !(Number(first) === from && end > from && end <= to && (end === to || size === "*" || Number(size) === end)))
      throw this.error(`the server sends other bytes than the requested ${from} to ${to - 1}`);
    this.same("size", size === "*" ? undefined : size);
    const bytes = await collect(body, end - from, more);
    if (!bytes) throw this.error(`the server sends more than the requested bytes ${from} to ${end - 1}`);
    if (stated !== null && bytes.length < end - from) throw this.error("the answer of the server ends too early");
    return { bytes, whole: false };
  }
}

/** All bytes of a stream, undefined if there are more than `most`; `more` is called as they come. */
async function collect(stream: ReadableStream<Uint8Array>, most: number, more: () => void): Promise<Uint8Array<ArrayBuffer> | undefined> {
  const parts: Uint8Array[] = [], reader = stream.getReader();
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (Math.floor((length + value.length) / PIECE) > Math.floor(length / PIECE)) more();
    if ((length += value.length) > most) return undefined;
    parts.push(value);
  }
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
