/** Range decoder and adaptation (clause 6). */
import { IsoError, type Meter } from "./errors.js";
import type { Contexts } from "./models.js";

/** The bytes of a file as they come; those of chunks that are done may be dropped. */
export class Input {
  data = new Uint8Array(1024);
  /** Bytes in `data`; and those that were dropped before them. */
  length = 0;
  dropped = 0;
  ended = false;

  push(bytes: Uint8Array): void {
    if (this.length + bytes.length > this.data.length) {
      const old = this.data;
      this.data = new Uint8Array(Math.max(this.length + bytes.length, 2 * old.length));
      this.data.set(old.subarray(0, this.length));
    }
    this.data.set(bytes, this.length);
    this.length += bytes.length;
  }

  /** Forget all before `at`, a place in `data`. */
  drop(at: number): void {
    this.data.copyWithin(0, at, this.length);
    this.length -= at;
    this.dropped += at;
  }
}

const TOP = 2 ** 32;
/** Steps of adaptation by symbols seen (6.5). */
export const STEP = Int32Array.from({ length: 160 }, (_, seen) => Math.floor(65536 / (seen + 2)));

/** Decodes the symbols of a run. Methods that decode return -1, and change nothing, if the symbol is not received yet (6.4). */
export class Coder {
  models!: Contexts;
  shifts = 0;
  private range = TOP;
  private code = 0;
  private loaded = 0;
  private start = 0;
  private length = 0;

  constructor(private readonly input: Input, readonly meter: Meter) {}

  /** Begin a run of `length` bytes at the place `start` of the input (6.1). */
  begin(start: number, length: number): void {
    this.start = start;
    this.length = length;
    this.range = TOP;
    this.code = this.shifts = this.loaded = 0;
    this.meter.bytes = this.input.dropped + start;
  }

  /** Bytes of the run after its last symbol (8.2.3). */
  get used(): number {
    return Math.min(this.shifts + 4, this.length);
  }

  private load(): void {
    const { input, start, length } = this;
    const have = Math.min(length, input.length - start), to = this.shifts + 4;
    while (this.loaded < to) {
      if (this.loaded < have) this.code += input.data[start + this.loaded]! * 2 ** (8 * (to - 1 - this.loaded));
      else if (have < length) return;
      this.loaded++;
    }
  }

  /** A symbol by 6.2 with the probability `p` of a 1, without an update. */
  raw(p: number): number {
    if (this.shifts > this.length)
      throw new IsoError("malformed", "6.3", this.input.dropped + this.start + this.length, "a run is too short");
    const bound = Math.floor((this.range * p) / 65536);
    let code = this.code;
    if (this.loaded < this.shifts + 4) {
      this.load();
      code = this.code;
      if (code < bound && code + 2 ** (8 * (this.shifts + 4 - this.loaded)) - 1 >= bound) return -1;
    }
    let bit = 0, range = bound;
    if (code < bound) bit = 1;
    else {
      code -= bound;
      range = this.range - bound;
    }
    while (range < 16777216) {
      code *= 256;
      range *= 256;
      this.shifts++;
      this.meter.bytes++;
      const i = this.shifts + 3;
      if (this.loaded === i && i < this.length) {
        const at = this.start + i;
        if (at < this.input.length) {
          code += this.input.data[at]!;
          this.loaded++;
        }
      }
    }
    this.code = code;
    this.range = range;
    this.meter.step(16);
    return bit;
  }

  /** Adaptation (6.5). */
  update(context: number, bit: number): void {
    const { p, seen } = this.models;
    const s = seen[context]!, step = STEP[s]!;
    let x = p[context]!;
    x = bit ? x + (((65536 - x) * step) >>> 16) : x - ((x * step) >>> 16);
    p[context] = x < 32 ? 32 : x > 65504 ? 65504 : x;
    if (s < 158) seen[context] = s + 1;
  }

  /** A symbol in a context. */
  bit(context: number): number {
    const bit = this.raw(this.models.p[context]!);
    if (bit >= 0) this.update(context, bit);
    return bit;
  }

  /** A symbol in a context below another one (7.1(4)). */
  below(context: number, parent: number): number {
    const p = this.models.p;
    const first = p[context] || p[parent]!;
    const bit = this.raw(first);
    if (bit < 0) return bit;
    p[context] = first;
    this.update(context, bit);
    this.update(parent, bit);
    return bit;
  }
}
