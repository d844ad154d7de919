/** Files as they come (clause 8). */
import { readChunks } from "./chunks.js";
import type { DomainFile } from "./domain/contents.js";
import { IsoError, LIMITS, type Meter } from "./errors.js";
import type { DecoderOptions, Domains, Header, IsoEvent } from "./events.js";
import { type Contour, GridFile } from "./gridfile.js";
import { readHeader } from "./header.js";
import type { MainProfile } from "./main/profile.js";
import { type Metadata, readMetadata, readPromises } from "./metadata.js";
import type { Steps } from "./reader.js";
import type { Isovalue } from "./series.js";
import { Session } from "./session.js";

export type { Contour };
export * from "./events.js";

/**
 * Decodes a file that comes in pieces. `feed` and `end` return what has happened; after an event "error" nothing more is
 * decoded, and what was decoded stays available.
 */
export class Decoder {
  header: Header | undefined;
  /** What is known of a file of a grid. */
  grid: GridFile | undefined;
  /** What is known of a file of an explicit domain (clause 10). */
  domain: DomainFile | undefined;
  readonly metadata: Metadata = {};
  error: IsoError | undefined;
  done = false;
  /** Decoding pauses when there are so many complete layers. */
  pauseAt = Infinity;
  /** What a file waits for: see `setMain` and `setDomains`. */
  needs: "main" | "domains" | undefined;
  private readonly s: Session;
  private readonly run: Steps;
  private main: MainProfile | undefined;
  private domains: Domains | undefined;

  constructor(private readonly options: DecoderOptions = {}) {
    this.s = new Session({ ...LIMITS, ...options.limits }, options.keepFrames ?? false);
    this.main = options.main;
    this.domains = options.domains;
    this.run = this.file();
  }

  /** Layers that are complete, of all isovalues. */
  get layers(): number {
    return this.s.layers;
  }

  get meter(): Meter {
    return this.s.meter;
  }

  /** Isovalues by frame; of a file that is no series there is one frame. Those no longer kept are undefined. */
  get frames(): readonly (readonly Isovalue[] | undefined)[] {
    return (this.grid ?? this.domain)?.series.frames ?? [[]];
  }

  /** Isovalues of the present frame. */
  get contours(): readonly Isovalue[] {
    return this.frames[this.frames.length - 1]!;
  }

  /** Take the next bytes of the file. */
  feed(bytes: Uint8Array): IsoEvent[] {
    const { r, meter } = this.s, { input } = r;
    if (!this.error && !this.done && input.dropped + input.length + bytes.length > meter.limits.bytes)
      this.fail(new IsoError("limit", "11.2", meter.limits.bytes, "the file is longer than the limit"));
    if (this.error) return this.take();
    if (this.done) {
      if (bytes.length) this.fail(r.error("3.4.4", "there are bytes after the end"));
      return this.take();
    }
    input.push(bytes);
    return this.go();
  }

  /** No more bytes will come. */
  end(): IsoEvent[] {
    this.s.r.input.ended = true;
    return this.go();
  }

  /** Give the main profile, of `isocodec/main`, to a decoder that waits for it. */
  setMain(main: MainProfile): IsoEvent[] {
    this.main = main;
    return this.go();
  }

  /** Give the module `isocodec/domain` to a decoder that waits for it. */
  setDomains(domains: Domains): IsoEvent[] {
    this.domains = domains;
    return this.go();
  }

  /** Go on after a pause. */
  go(): IsoEvent[] {
    const { s, s: { r } } = this;
    try {
      while (!this.error && !this.done && s.layers < this.pauseAt) {
        const before = s.layers;
        if (this.run.next().done) {
          this.done = true;
          if (r.at < r.input.length) throw r.error("3.4.4", "there are bytes after the end");
        } else if (s.layers === before) {
          if (r.input.ended && !this.needs)
            throw new IsoError("truncated", "8.3", r.input.dropped + r.input.length, "the file ends too early");
          break;
        }
      }
    } catch (error) {
      if (error instanceof IsoError) this.fail(error);
      else if (error instanceof RangeError) this.fail(new IsoError("limit", "11.2", s.meter.bytes, error.message));
      else throw error;
    }
    return this.take();
  }

  private take(): IsoEvent[] {
    const events = this.s.events;
    this.s.events = [];
    return events;
  }

  private fail(error: IsoError): void {
    this.error = error;
    this.s.emit({ type: "error", bytes: error.offset, error });
  }

  private *file(): Steps {
    const { s } = this, header = (this.header = yield* readHeader(s.r));
    s.emit({ type: "header", bytes: s.r.offset, header });
    const contents = header.explicit ? yield* this.explicit(header) : yield* this.ofGrid(header);
    yield* readChunks(s, contents, (...chunk) => this.note(...chunk) || contents.note(...chunk));
  }

  private *ofGrid(header: Header): Steps<GridFile> {
    const main = header.profile === "main";
    this.needs = main ? "main" : undefined;
    while (main && !this.main) yield;
    this.needs = undefined;
    return (this.grid = new GridFile(this.s, header, main ? this.main : undefined, this.options.kernels));
  }

  private *explicit(header: Header): Steps<DomainFile> {
    this.needs = "domains";
    while (!this.domains) yield;
    this.needs = undefined;
    return (this.domain = new this.domains.DomainFile(this.s, header, this.options.mesh));
  }

  private note(type: number, payload: Uint8Array, bytes: number): boolean {
    if (type === 3) {
      const metadata = readMetadata(payload);
      Object.assign(this.metadata, metadata);
      this.s.emit({ type: "metadata", bytes, metadata });
      return true;
    }
    const promises = type === 6 ? readPromises(payload) : undefined;
    if (promises) this.s.emit({ type: "promises", bytes, isovalue: this.contours.length - 1, promises });
    return promises !== undefined;
  }
}
