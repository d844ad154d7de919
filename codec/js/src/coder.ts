/** Range decoder, adaptation and mixing (clauses 6 and 7.11). */
import { IsoError, type Meter } from "./errors.js";
import type { Panel } from "./frames.js";
import { CLASS, type Contexts, PAIR } from "./models.js";

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
const STEP = Int32Array.from({ length: 160 }, (_, seen) => Math.floor(65536 / (seen + 2)));
const TRUST = Int32Array.from({ length: 160 }, (_, seen) => Math.floor((512 * seen) / (2 * seen + 3)));

/** Rows that a network sees, and how many. */
export const rows = new Int32Array(1024);

/**
 * Decodes the symbols of a run. Every method that decodes returns -1, and changes nothing, if the symbol is not received
 * yet (6.4), or, with `cut` set, if no more symbols may be decoded (3.5.4).
 */
export class Coder {
  models!: Contexts;
  shifts = 0;
  cut = false;
  /** Symbols decoded in this run, and by number of the syntax element in the layer. */
  symbols = 0;
  private range = TOP;
  private code = 0;
  private loaded = 0;
  private start = 0;
  private length = 0;
  private most = Infinity;
  /** Rows on the list of the symbol that is mixed. */
  seen = 0;

  constructor(private readonly input: Input, readonly meter: Meter) {}

  /** Begin a run of `length` bytes at the place `start` of the input (6.1). */
  begin(start: number, length: number, most: number): void {
    this.start = start;
    this.length = length;
    this.most = most;
    this.range = TOP;
    this.code = this.shifts = this.loaded = this.symbols = 0;
    this.cut = false;
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
    if (this.symbols >= this.most) {
      this.cut = true;
      return -1;
    }
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
    this.symbols++;
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

  private opinion(context: number, stretch: Int16Array): number {
    const { p, seen } = this.models;
    return (stretch[p[context]! >> 4]! * TRUST[seen[context]!]!) >> 8;
  }

  /** The sum of the rows, cut off below 0, weighed by the network (7.11(1)). */
  private network(network: number): number {
    const { weight, out } = this.models.tables!;
    const count = this.seen;
    let total = out[49 * network + 48]!;
    for (let j = 0; j < 24; j += 8) {
      let s0 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0, s5 = 0, s6 = 0, s7 = 0;
      for (let i = 0; i < count; i++) {
        const at = 24 * rows[i]! + j;
        s0 += weight[at]!;
        s1 += weight[at + 1]!;
        s2 += weight[at + 2]!;
        s3 += weight[at + 3]!;
        s4 += weight[at + 4]!;
        s5 += weight[at + 5]!;
        s6 += weight[at + 6]!;
        s7 += weight[at + 7]!;
      }
      const o = 49 * network + 2 * j;
      total += pair(s0, out, o) + pair(s1, out, o + 2) + pair(s2, out, o + 4) + pair(s3, out, o + 6) +
        pair(s4, out, o + 8) + pair(s5, out, o + 10) + pair(s6, out, o + 12) + pair(s7, out, o + 14);
    }
    return total;
  }

  /** Opinions of a panel's contexts. */
  private readonly opinions = new Int32Array(7);

  /** The opinions of a panel, weighed (7.18.3(3)). */
  private ask(panel: Panel, said: number): number {
    const { opinions } = this, { panel: weights, tables } = this.models;
    panel.choose(said);
    let sum = 0;
    for (let i = 0; i < 7; i++) {
      opinions[i] = this.opinion(panel.contexts[i]!, tables!.stretch);
      sum += weights![7 * panel.kind + i]! * opinions[i]!;
    }
    return sum;
  }

  private teach(panel: Panel, error: number, bit: number): void {
    const weights = this.models.panel!;
    for (let i = 0; i < 7; i++) {
      const o = 7 * panel.kind + i;
      weights[o] = moved(weights[o]!, (error * this.opinions[i]!) / 2097152);
      this.update(panel.contexts[i]!, bit);
    }
  }

  /** A seed that a panel looks at (7.18.3(4)). */
  seed(context: number, panel: Panel): number {
    const { squash, stretch } = this.models.tables!, said = this.opinion(context, stretch);
    const p = squash[logit(65536 * said + this.ask(panel, said)) + 2047]!;
    const bit = this.raw(p);
    if (bit < 0) return bit;
    this.teach(panel, 40 * (65536 * bit - p), bit);
    this.update(context, bit);
    return bit;
  }

  /** A symbol that is mixed (7.11), of the rows that are on the list; `panel` is that of 7.18, if it has one. */
  mixed(network: number, kind: number, context: number, flip: boolean, panel?: Panel): number {
    const { tables, mix } = this.models;
    const { squash, stretch } = tables!, m = mix!;
    let said = Math.floor(this.network(network) / 4096);
    said = said < -2047 ? -2047 : said > 2047 ? 2047 : said;
    if (flip) said = -said;
    const group = CLASS + 32 * kind + ((said + 2047) >> 7);
    const said1 = this.opinion(context, stretch), said2 = this.opinion(group, stretch);
    const o = 4 * kind;
    let sum = m[o]! * said + m[o + 1]! * said1 + m[o + 2]! * said2 + m[o + 3]! * 256;
    if (panel) sum += this.ask(panel, said);
    const p = squash[logit(sum) + 2047]!;
    const bit = this.raw(p);
    if (bit < 0) return bit;
    const error = 40 * (65536 * bit - p);
    for (let j = 0; j < 4; j++) {
      const by = j === 0 ? said : j === 1 ? said1 : j === 2 ? said2 : 256;
      m[o + j] = moved(m[o + j]!, (error * by) / 1048576);
    }
    if (panel) this.teach(panel, error, bit);
    this.update(context, bit);
    this.update(group, bit);
    return bit;
  }
}

function logit(sum: number): number {
  const x = Math.floor(sum / 65536);
  return x < -2047 ? -2047 : x > 2047 ? 2047 : x;
}

/** A weight after a step, rounded down (7.11(4)). */
function moved(weight: number, by: number): number {
  const w = weight + Math.floor(by);
  return w < -4194304 ? -4194304 : w > 4194304 ? 4194304 : w;
}

/** Both columns of a sum, each cut off below 0, weighed. */
function pair(sum: number, out: Float64Array, at: number): number {
  const high = Math.round(sum / PAIR), low = sum - PAIR * high;
  return (low > 0 ? out[at]! * low : 0) + (high > 0 ? out[at + 1]! * high : 0);
}
