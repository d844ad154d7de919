/** Contexts, mixing weights, and symbols told by opinions (10.4). */
import type { Coder } from "../coder.js";
import { TRUST } from "../trust.js";
import { clip } from "./integers.js";
import { squash, stretch } from "./logistic.js";

/** The names of a table of contexts by their first numbers; and how many there are. */
function numbered<Name extends string>(table: readonly (readonly [Name, number])[]): [Record<Name, number>, number] {
  const first = {} as Record<Name, number>;
  let count = 0;
  for (const [name, many] of table) {
    first[name] = count;
    count += many;
  }
  return [first, count];
}

/** How models of a run begin: names with their numbers, and what weights begin with. */
export class Layout<Name extends string, Set extends string> {
  readonly at: Record<Name, number>;
  readonly sets: Record<Set, number>;
  private readonly count: number;
  private readonly setCount: number;

  constructor(private readonly contexts: readonly (readonly [Name, number, number, number])[],
              sets: readonly (readonly [Set, number])[], private readonly weight: number) {
    [this.at, this.count] = numbered(contexts.map(([name, many]) => [name, many] as const));
    [this.sets, this.setCount] = numbered(sets);
  }

  /** Models as they begin. */
  make(): Models {
    const models = new Models(new Uint16Array(this.count), new Uint8Array(this.count),
      new Int32Array(12 * this.setCount).fill(this.weight));
    let at = 0;
    for (const [, many, p, seen] of this.contexts) {
      models.p.fill(p, at, at + many);
      models.seen.fill(seen, at, at + many);
      at += many;
    }
    return models;
  }
}

export class Models {
  constructor(readonly p: Uint16Array, readonly seen: Uint8Array, readonly weights: Int32Array) {}

  copy(): Models {
    return new Models(this.p.slice(), this.seen.slice(), this.weights.slice());
  }
}

/** 10.4.1, probabilities in units of `2**-16`. */
export const LAYERS = new Layout([
  ["COMPONENT", 1, 52429, 1], ["FIRST", 16, 32768, 0], ["SIGN_SURE", 24, 45875, 2], ["SIGN_RING", 72, 45875, 1],
  ["SIGN_PAST", 128, 45875, 1], ["SIGN_BOTH", 216, 45875, 1], ["SIGN_THEN", 108, 45875, 1],
  ["SIGN_THEN_SURE", 216, 45875, 1], ["COARSE", 144, 32768, 0], ["COARSE_THEN", 216, 32768, 0],
  ["LEVEL_FIT", 88, 0, 4], ["LEVEL_RING", 192, 0, 4], ["LEVEL_SHARE", 352, 0, 4], ["LEVEL_TILT", 132, 0, 4],
  ["LEVEL_COUNT", 961, 0, 4], ["LEVEL_PAST", 176, 0, 4], ["LEVEL_SLOPE", 264, 0, 4],
  ["LEVEL_THEN", 192, 32768, 0], ["LEVEL_THEN_SHARE", 204, 32768, 0], ["NEW", 16, 6554, 1], ["NEW_THEN", 4, 32768, 0],
  ["UNASKED", 16, 6554, 1], ["SPLIT", 24, 32768, 0],
  ["OFFSET", 256, 32768, 0], ["VALUE", 256, 32768, 0], ["HIGHER", 16, 32768, 0],
], [["SIGN", 8], ["OFFSET", 64], ["VALUE", 64], ["LEVEL", 11]], 22000);

/** How often a fit has the right sign, in hundredths: by its size, the share of its ring, and the signs around. */
const SIZE = [51, 57, 64, 74, 85, 94, 98, 99, 99, 97, 91], SHARE = [46, 46, 51, 55, 60, 60, 62, 65, 68, 72, 79, 84, 90, 95, 98, 99],
  TILT = [61, 72, 73, 74, 78, 82, 85, 87, 91, 93, 95, 95];

/** Models of an isovalue as they begin (10.4.1). */
export function layerModels(): Models {
  const models = LAYERS.make(), { at, sets } = LAYERS;
  const start = (first: number, count: number, sum: (i: number) => number): void => {
    for (let i = 0; i < count; i++) models.p[first + i] = Math.round((sum(i) * 65536) / 200);
  };
  start(at.LEVEL_FIT, 88, (i) => 2 * SIZE[i >> 3]!);
  start(at.LEVEL_RING, 192, (i) => SHARE[Math.floor(i / 12)]! + TILT[i % 12]!);
  start(at.LEVEL_SHARE, 352, (i) => SIZE[i >> 5]! + SHARE[(i >> 1) & 15]!);
  start(at.LEVEL_TILT, 132, (i) => SIZE[Math.floor(i / 12)]! + TILT[i % 12]!);
  start(at.LEVEL_COUNT, 961, (i) => 2 * SHARE[Math.min(Math.floor((16 * (i % 31)) / Math.max(Math.floor(i / 31), 1)), 15)]!);
  start(at.LEVEL_PAST, 176, (i) => 2 * SIZE[i >> 4]!);
  start(at.LEVEL_SLOPE, 264, (i) => 2 * SIZE[Math.floor(i / 24)]!);
  models.weights.fill(11000, 12 * sets.LEVEL);
  return models;
}

/** Symbols of a run by opinions: contexts and logits are listed, then the symbol is asked for (10.4.3). */
export class Opinions {
  private readonly said = new Int32Array(12);
  private readonly listed = new Int32Array(12);
  private count = 0;
  private contexts = 0;

  constructor(readonly coder: Coder, readonly models: Models) {
    coder.models = models;
  }

  /** List a logit. */
  logit(x: number): this {
    this.said[this.count++] = clip(x, -2047, 2047);
    return this;
  }

  /** List the opinion of a context. */
  context(context: number): this {
    const { p, seen } = this.models;
    this.said[this.count++] = (stretch[p[context]! >> 4]! * TRUST[seen[context]!]!) >> 8;
    this.listed[this.contexts++] = context;
    return this;
  }

  /** The symbol, by a set of weights; -1 if it is not received. The list is empty then. */
  bit(set: number): number {
    const { said, count, contexts, listed } = this, w = this.models.weights, o = 12 * set;
    this.count = this.contexts = 0;
    let sum = 0;
    for (let i = 0; i < count; i++) sum += w[o + i]! * said[i]!;
    const p = squash[clip(Math.floor(sum / 65536), -2047, 2047) + 2047]!, bit = this.coder.raw(p);
    if (bit < 0) return bit;
    const error = (65536 * bit - p) * 40;
    for (let i = 0; i < count; i++)
      w[o + i] = clip(w[o + i]! + Math.floor((error * said[i]!) / 1048576), -4194304, 4194304);
    for (let i = 0; i < contexts; i++) this.coder.update(listed[i]!, bit);
    return bit;
  }

  /** A symbol of probability 1/2 for each halving of `low .. high - 1`: the number that is left (10.3.1(1)). */
  plain(low: number, high: number): number {
    while (high - low > 1) {
      const middle = Math.floor((low + high) / 2);
      if (this.coder.raw(32768)) low = middle;
      else high = middle;
    }
    return low;
  }

  /** A number near a guess, in a run that is there (10.4.4). `second` is another guess, with its width. */
  near(count: number, guess: number, width: number, set: number, context: number,
       second?: readonly [number, number]): number {
    let low = 0, high = count;
    while (high - low > 1) {
      const middle = Math.floor((low + high) / 2);
      let deep = 0, side = 0;
      while (deep < 7 && (high - low) * 256 < Math.floor((8 * width) / 2 ** deep)) deep++;
      if (256 * low > guess || 256 * high < guess) side = 3;
      else if (256 * middle > guess + Math.floor(width / 2)) side = 2;
      else if (256 * middle < guess - Math.floor(width / 2)) side = 1;
      this.bell(low, middle, high, guess, Math.max(Math.floor(width / 4), 1));
      this.bell(low, middle, high, guess, Math.max(width, 1));
      this.bell(low, middle, high, guess, width * 4);
      if (second) {
        this.bell(low, middle, high, second[0], Math.max(Math.floor(second[1] / 2), 1));
        this.bell(low, middle, high, second[0], second[1] * 2);
      }
      if (this.context(context + 4 * deep + side).bit(set + deep)) low = middle;
      else high = middle;
    }
    return low;
  }

  /** List what a bell of the width `u` around a guess says (10.4.4(4)). */
  private bell(low: number, middle: number, high: number, guess: number, u: number): void {
    const at = (x: number): number => {
      const far = clip(256 * x - guess, -(2 ** 40), 2 ** 40);
      return squash[clip(Math.floor((far * 256) / u), -2047, 2047) + 2047]!;
    };
    const A = at(low), M = at(middle), Z = at(high);
    this.logit(stretch[clip(Math.floor(((Z - M + 1) * 65536) / (Z - A + 2)), 0, 65535) >> 4]!);
  }
}
