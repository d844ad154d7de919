/** Raster layers: the signs of all samples of a plane that are not known yet, row by row (5.12). */
import { STEP } from "./coder.js";
import { squash, stretch } from "./domain/logistic.js";
import type { Meter } from "./errors.js";
import type { Grid } from "./grid.js";
import type { Contexts } from "./models.js";
import { KNOWN, SIGN } from "./store.js";
import { TRUST } from "./trust.js";
import { Leaves, type Pass, type Tube } from "./tube.js";

/** Nearest samples before one that each of its contexts looks at (7.19). */
export const NEAR = [6, 10, 16, 24, 34, 50];
/** Contexts of flags. */
const BLOCKS = 8;
/** Models of each context of signs; where those of the last one begin. */
const HASHED = 65536, SURE = NEAR.length * HASHED;
/** Bits of a model's probability, below how many symbols it has seen. */
const SEEN = 16, ONE = 1 << SEEN;
/** How many of the nearest samples before one that are looked at, in two words of so many. */
const FEW = 50, WORD = FEW / 2;
/** Rows above a sample and columns beside it that those lie in; so many columns beside the box are kept, too. */
export const REACH = 5;
/** Samples along an edge of a block. */
export const BLOCK = 32;
const MOST = 2 ** 28;

/** Check that there may be a raster layer, and that the limits allow it. */
export function check({ n, last }: Grid, meter: Meter, leans: boolean): void {
  if (n !== 2) throw meter.wrong("5.12", "a raster layer of a volume");
  if (leans) throw meter.wrong("5.12", "a raster layer of an isovalue that leans on another one");
  const samples = (last[0] + 1) * (last[1] + 1);
  if (samples > MOST) throw meter.wrong("5.12", "a raster layer of too many samples");
  meter.step(samples / 4);
}

/** Weights of opinions, by how many contexts have been used. */
export const WEIGHTS: readonly number[] = Array.from({ length: NEAR.length * (NEAR.length + 1) }, () => 22000);

/** Models of signs. */
export const SIGN_MODELS = SURE + 32 * 4096;

/** The models of flags as a raster layer begins. */
export const flagModels = (): Contexts => ({ p: new Uint16Array(BLOCKS).fill(ONE / 2), seen: new Uint8Array(BLOCKS) });

/** Enter the models of signs: the probability of a 1, and above its bits the symbols seen. */
export function enterModels(model: Int32Array): void {
  model.fill(ONE / 2, 0, SURE);
  for (let i = SURE; i < SIGN_MODELS; i++) model[i] = squash[128 * (i % 32) + 64]! | (6 << SEEN);
}

const WIDE = 2 * REACH + 1;
/** Distances of the nearest samples before a sample along both axes. */
const BEFORE = Array.from({ length: (REACH + 1) * WIDE }, (_, i) => [Math.floor(i / WIDE) - REACH, (i % WIDE) - REACH] as const)
  .filter(([a, b]) => a < 0 || (a === 0 && b < 0))
  .sort(([a, b], [c, d]) => a * a + b * b - c * c - d * d || a - c || b - d)
  .slice(0, FEW);
/**
 * For each column around a sample and the signs of its last rows, the last one lowest: those among the nearest, in two
 * words of which the nearest are highest.
 */
export const HIGH = new Int32Array(WIDE << (REACH + 1)), LOW = new Int32Array(HIGH.length);
BEFORE.forEach(([a, b], k) => {
  // the last row that is known is that of the sample itself in the columns before it
  const row = b < 0 ? -a : -a - 1, words = k < WORD ? HIGH : LOW, bit = 1 << (WORD - 1 - (k % WORD));
  for (let signs = 0; signs < 2 << REACH; signs++) if ((signs >> row) & 1) words[((REACH + b) << (REACH + 1)) | signs]! |= bit;
});

/** A raster layer that goes on: the row of the next sample, and the simplices that have been found. */
export class Raster {
  row = 0;
  readonly next: Leaves;
  private readonly model: Int32Array;
  private readonly weights = Int32Array.from(WEIGHTS);
  private readonly models = flagModels();
  /** Signs of the last rows in each column, the last one lowest. */
  private readonly columns: Uint8Array;
  /** By column whether the last block that has begun has one sign, and twice that sign. */
  private readonly flags: Uint8Array;
  private readonly contexts = new Int32Array(NEAR.length);
  private readonly said = new Int32Array(NEAR.length);
  /** By parity of both indices of a square's least corner: its simplices by the place of `x_1`. */
  private readonly classes: number[][] = [];

  constructor(private readonly t: Tube) {
    const { grid: { last, phases }, meter } = t;
    check(t.grid, meter, t.lean !== undefined);
    meter.take(last[1] + 1 + 2 * REACH + 4 * SIGN_MODELS);
    this.model = new Int32Array(SIGN_MODELS);
    enterModels(this.model);
    this.columns = new Uint8Array(last[1] + 1 + 2 * REACH);
    this.flags = new Uint8Array(Math.floor(last[1] / BLOCK) + 1);
    this.next = new Leaves(meter);
    const { count, off } = phases[0]!;
    for (let square = 0; square < 4; square++) {
      const found: number[] = (this.classes[square] = []);
      // vertices in halves of a sample; the diagonal goes through the square
      for (let cls = 0; cls < count; cls++) {
        const at = (j: number, a: number): number => off[12 * cls + 3 * j + a]! / 2 - (a ? square & 1 : square >> 1);
        if (Math.min(at(0, 0), at(2, 0)) === 0 && Math.min(at(0, 1), at(2, 1)) === 0) found[2 * at(1, 0) + at(1, 1)] = cls;
      }
    }
  }

  *decode(): Pass {
    const { t, columns, flags } = this, { coder, grid, grid: { last } } = t, known = t.known.length > 0;
    const above = (j: number): number => columns[REACH + j]! & 1;
    coder.models = this.models;
    for (; this.row <= last[0]; this.row++) {
      const i = this.row;
      for (let j = 0; j <= last[1]; j++) {
        const b = Math.floor(j / BLOCK);
        if (i % BLOCK === 0 && j % BLOCK === 0) {
          const sign = j > 0 ? above(j - 1) : above(0);
          let even = 1;
          for (let c = j; i > 0 && c < Math.min(j + BLOCK, last[1] + 1); c++) if (above(c) !== sign) even = 0;
          const context = (b > 0 ? flags[b - 1]! & 1 : 1) + 2 * (flags[b]! & 1) + 4 * even;
          let flag: number;
          while ((flag = coder.bit(context)) < 0) yield;
          flags[b] = flag + 2 * sign;
        }
        const marks = known ? t.store.get(i, j, 0) : 0;
        let sign: number;
        if (marks & KNOWN) sign = marks & SIGN ? 1 : 0;
        else if (flags[b]! & 1) sign = flags[b]! >> 1;
        else while ((sign = this.sign(j)) < 0) yield;
        const column = columns[REACH + j]!, before = columns[REACH + j - 1]!;
        columns[REACH + j] = (column << 1) | sign;
        if (i === 0 && j === 0) t.learn(0, 0, 0, sign);
        if (i === 0 || j === 0) continue;
        const signs = ((before >> 1) & 1) | ((column & 1) << 1) | ((before & 1) << 2) | (sign << 3);
        if (signs !== 0 && signs !== 15) this.square(i - 1, j - 1, signs);
      }
    }
    coder.models = t.models;
    t.leaves = this.next;
    if (!t.hasBase) t.base = grid.full;
    t.uniform = grid.full;
    t.hasBase = t.baseDone = true;
    t.raster = undefined;
    t.changes++;
  }

  /** Append the mixed simplices of a unit square, by its least corner and the signs of its corners. */
  private square(i: number, j: number, signs: number): void {
    const { t, next } = this, x = i & ~1, y = j & ~1, { off } = t.grid.phases[0]!;
    const of = (corner: number): number => (signs >> corner) & 1;
    // both corners beside the diagonal
    for (const other of (i + j) & 1 ? [0, 3] : [1, 2]) {
      if (of(other) === of(other ^ 1) && of(other) === of(other ^ 2)) continue;
      const cls = this.classes[2 * (i & 1) + (j & 1)]![other]!;
      for (let v = 0; v < 3; v++) {
        const px = x + off[12 * cls + 3 * v]! / 2, py = y + off[12 * cls + 3 * v + 1]! / 2;
        t.learn(px, py, 0, of(2 * (px - i) + py - j));
      }
      next.add(t.grid.full, cls, x, y, 0);
    }
  }

  /** The sign of sample `j` of the row (7.19); -1 if it is not received. */
  private sign(j: number): number {
    const { t: { coder }, columns, contexts, said, weights, model } = this;
    let first = 0, second = 0, used = 0, sum = 0;
    for (let c = 0; c < WIDE; c++) {
      const at = (c << (REACH + 1)) | (columns[j + c]! & ((2 << REACH) - 1));
      first |= HIGH[at]!;
      second |= LOW[at]!;
    }
    for (let i = 0; i < NEAR.length; i++) {
      const near = NEAR[i]!, low = first >> Math.max(WORD - near, 0), high = near < WORD ? 0 : second >> (FEW - near);
      const spread = (Math.imul(low, 0x9e3779b1) + Math.imul(high, 0x85ebca77)) >>> 16;
      const context = (contexts[i] = HASHED * i + spread), entry = model[context]!, seen = entry >> SEEN;
      if (seen) used++;
      said[i] = (stretch[(entry & (ONE - 1)) >> 4]! * TRUST[seen]!) >> 8;
    }
    const o = NEAR.length * used;
    for (let i = 0; i < NEAR.length; i++) sum += weights[o + i]! * said[i]!;
    const x = Math.min(Math.max(Math.floor(sum / 65536), -2047), 2047) + 2047, mixed = squash[x]!;
    const sure = SURE + 32 * (first >> (WORD - 12)) + (x >> 7), bit = coder.raw((mixed + (model[sure]! & (ONE - 1))) >> 1);
    if (bit < 0) return bit;
    // a rate of 48 / 2^20; as 3 / 2^16 the products stay below 2^31
    const error = ((bit << 16) - mixed) * 3;
    for (let i = 0; i < NEAR.length; i++) {
      const w = weights[o + i]! + ((error * said[i]!) >> 16);
      weights[o + i] = Math.min(Math.max(w, -4194304), 4194304);
      adapt(model, contexts[i]!, bit);
    }
    adapt(model, sure, bit);
    return bit;
  }
}

/** Adaptation (6.5). */
function adapt(model: Int32Array, at: number, bit: number): void {
  const entry = model[at]!, seen = entry >> SEEN, p = entry & (ONE - 1), step = STEP[seen]!;
  const x = bit ? p + (((ONE - p) * step) >>> 16) : p - ((p * step) >>> 16);
  model[at] = Math.min(Math.max(x, 32), ONE - 32) | (Math.min(seen + 1, STEP.length - 2) << SEEN);
}
