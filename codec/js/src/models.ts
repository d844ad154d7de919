/** Models and their beginnings (clauses 6.5, 7.1, 7.10(2)). */

/** First numbers of the contexts of each name (7.10(2)); those from CLASS on are of the main profile. */
export const ORIGIN = 0, COMPONENT = 3, ROOT = 4, PATH = 5, FIRST = 7, CURVE = 31, SURFACE = 319, TREE = 895, LEAF = 970,
  SIGN = 1030, VALUE = 2150, OFFSET = 2462, LEVEL = 2606, LEVEL_PATH = 2630, SPLIT = 2694, CONTINUE = 2886, SEED = 2887,
  OFFSET_LEAN = 2903, CONTRARY = 3031, VALUE_NEAR = 3032, OFFSET_NEAR = 3544, CLASS = 3800,
  AROUND = 5272, CONTEXTS = 21656;

/** Probabilities and counters by context. */
export interface Contexts {
  p: Uint16Array;
  seen: Uint8Array;
}

/** How CURVE begins, in 4096ths (7.1(5)). */
const CURVES = [
  7, 11, 9, 10, 11, 10, 7, 11, 9, 10, 11, 10, 6, 8, 7, 10, 10, 5, 10, 12, 7, 12, 8, 7,
  10, 12, 11, 7, 10, 8, 12, 12, 8, 12, 9, 7, 10, 15, 8, 8, 10, 8, 14, 15, 6, 10, 11, 5,
];

/** How contexts begin (7.1): the first one, how many, `p`, `seen`; later rows replace what earlier ones say. */
const BEGINNINGS: readonly (readonly [number, number, number, number])[] = [
  [0, CONTEXTS, 32768, 1],
  [COMPONENT, 1, 52429, 1],
  [PATH, 2, 32768, 4],
  ...Array.from({ length: 144 }, (_, i) => [CURVE + 2 * i, 2, 4096 * CURVES[i % 48]!, 6] as const),
  [SURFACE, 576, 52429, 4],
  [LEAF, 60, 13107, 2],
  [SIGN, 560, 13107, 4],
  [SIGN + 560, 560, 52429, 4],
  [VALUE, 312, 32768, 2],
  ...Array.from({ length: 52 }, (_, plane) => [VALUE + 6 * plane, 3, plane > 2 ? 6554 : plane ? 16384 : 26214, 2] as const),
  [OFFSET, 144, 32768, 2],
  [LEVEL, 24, 32768, 2],
  [LEVEL_PATH, 64, 52429, 2],
  [SPLIT, 192, 32768, 2],
  [CONTINUE, 1, 52429, 2],
  [SEED, 16, 32768, 2],
  [OFFSET_LEAN, 128, 32768, 2],
  [CONTRARY, 1, 1311, 2],
  // VALUE_NEAR and OFFSET_NEAR: a `p` of 0 stands for that of the context above (7.1(4))
  [VALUE_NEAR, 768, 0, 0],
  [AROUND, 16384, 32768, 0],
];

/** What isovalues learn: models and, in the main profile, mixing weights, those of a panel apart (5.9.2). */
export interface Weighed {
  shared: boolean;
  models: Models;
  mix?: Float64Array;
  panel?: Float64Array | undefined;
}

/** Probabilities and counters of all contexts of an isovalue (7.1). */
export class Models implements Contexts {
  p: Uint16Array;
  seen: Uint8Array;

  /** So many contexts; the first `copied` begin as `other` has them, if there is one (5.9.2), the rest without symbols. */
  constructor(other: Models | undefined, count = CLASS, copied = count) {
    this.p = new Uint16Array(count).fill(32768);
    this.seen = new Uint8Array(count);
    if (other) {
      this.p.set(other.p.subarray(0, copied));
      this.seen.set(other.seen.subarray(0, copied));
      return;
    }
    for (const [from, many, p, seen] of BEGINNINGS) {
      this.p.fill(p, from, from + many);
      this.seen.fill(seen, from, from + many);
    }
  }
}
