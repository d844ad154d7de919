/** Models and their beginnings (clauses 6.5, 7.1, 7.10, 7.18.3), and the tables of the main profile. */
import { IsoError } from "./errors.js";

/** First numbers of the contexts of each name (7.10(2)). */
export const ORIGIN = 0, COMPONENT = 3, ROOT = 4, PATH = 5, FIRST = 7, CURVE = 31, SURFACE = 79, TREE = 655, LEAF = 730,
  BORDER = 790, CROSSED = 1630, VALUE = 4150, OFFSET = 4462, LEVEL = 4606, LEVEL_PATH = 4630, SPLIT = 4694,
  CONTINUE = 4886, SEED = 4887, OFFSET_LEAN = 4903, TURNED = 5031, VALUE_NEAR = 5032, OFFSET_NEAR = 5544, CLASS = 5800,
  HOLE = 7368, CONTEXTS = 7416;

/** Kinds of symbols that have a panel; contexts of its seven lists, which follow on the others (7.18.3(1)). */
const PANEL_KINDS = 10, PANEL_CONTEXTS = 13337;

/** Columns of a row of `weight`, kinds of symbols, networks. */
const WIDTH = 48, KINDS = 49, NETWORKS = 9;

/** The tables of the main profile for one number of axes. */
export interface Tables {
  squash: Uint16Array;
  stretch: Int16Array;
  /** Two columns in one number, the second `2**26` times its value: sums of rows add both at once. */
  weight: Float64Array;
  out: Float64Array;
  mix: Float64Array;
  /** Context, probability, counter of each context that does not begin as 7.1 states. */
  begin: Uint16Array;
}

export const PAIR = 2 ** 26;

/** Probabilities and counters by context, and what symbols that are mixed need beside. */
export interface Contexts {
  p: Uint16Array;
  seen: Uint8Array;
  mix?: Float64Array | undefined;
  panel?: Float64Array | undefined;
  tables?: Tables | undefined;
}

function stretches(squash: Uint16Array): Int16Array {
  const table = new Int16Array(4096).fill(2047);
  for (let p = 0, x = 0; p < 4096; p++) {
    while (x < 4095 && squash[x]! < 16 * p + 8) x++;
    table[p] = Math.min(x, 4094) - 2047;
  }
  return table;
}

/** Read `isospec/main.bin` (7.10(1)). */
export function readTables(bytes: Uint8Array, n: number): Tables {
  if (bytes.length !== 894696) throw new RangeError("the tables of the main profile have 894696 bytes");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 0;
  const u16 = (count: number): Uint16Array => Uint16Array.from({ length: count }, () => view.getUint16((at += 2) - 2));
  const i32 = (count: number): Float64Array => Float64Array.from({ length: count }, () => view.getInt32((at += 4) - 4));
  const squash = u16(4095);
  for (const m of [2, 3]) {
    const rows = m === 2 ? 3474 : 5417;
    if (m !== n) {
      at += 2 * WIDTH * rows + 4 * NETWORKS * (WIDTH + 1) + 16 * KINDS;
      at += 2 + 6 * view.getUint16(at);
      continue;
    }
    const weight = new Float64Array((rows * WIDTH) / 2);
    for (let i = 0; i < weight.length; i++, at += 4) weight[i] = view.getInt16(at) + PAIR * view.getInt16(at + 2);
    const out = i32(NETWORKS * (WIDTH + 1)), mix = i32(KINDS * 4);
    const begin = u16(3 * u16(1)[0]!);
    return { squash, stretch: stretches(squash), weight, out, mix, begin };
  }
  throw new RangeError("two or three axes");
}

/** How contexts begin (7.1): the first one, how many, `p`, `seen`; later rows replace what earlier ones say. */
const BEGINNINGS: readonly (readonly [number, number, number, number])[] = [
  [0, CONTEXTS, 32768, 1],
  [COMPONENT, 1, 52429, 1],
  [PATH, 2, 32768, 4],
  [CURVE, 48, 52429, 8],
  [SURFACE, 576, 52429, 4],
  [LEAF, 60, 13107, 2],
  [BORDER, 840, 13107, 4],
  [CROSSED, 2520, 52429, 4],
  [VALUE, 312, 32768, 2],
  ...Array.from({ length: 52 }, (_, plane) => [VALUE + 6 * plane, 3, plane > 2 ? 6554 : plane ? 16384 : 26214, 2] as const),
  [OFFSET, 144, 32768, 2],
  [LEVEL, 24, 32768, 2],
  [LEVEL_PATH, 64, 52429, 2],
  [SPLIT, 192, 32768, 2],
  [CONTINUE, 1, 52429, 2],
  [SEED, 16, 32768, 2],
  [OFFSET_LEAN, 128, 32768, 2],
  [TURNED, 1, 1311, 2],
  // VALUE_NEAR and OFFSET_NEAR: a `p` of 0 stands for that of the context above (7.1(4))
  [VALUE_NEAR, 768, 0, 0],
  [HOLE, 24, 62259, 2],
  [HOLE + 24, 24, 3277, 2],
];

/** Probabilities and counters of all contexts of an isovalue; in the main profile its mixing weights, too. */
export class Models implements Contexts {
  p: Uint16Array;
  seen: Uint8Array;
  mix: Float64Array | undefined;
  /** Weights of the panel (7.18.3), of an isovalue that leans on one of the frame before. */
  panel: Float64Array | undefined;

  /** `framed` says whether there is a panel; what `other` has begins as a copy (5.9.2, 7.18.3(2)). */
  constructor(readonly tables: Tables | undefined, other: Models | undefined, framed: boolean) {
    const count = CONTEXTS + (framed ? PANEL_CONTEXTS : 0);
    this.p = new Uint16Array(count).fill(32768);
    this.seen = new Uint8Array(count);
    if (framed) this.panel = other?.panel?.slice() ?? new Float64Array(7 * PANEL_KINDS).fill(4096);
    if (other) {
      this.p.set(other.p.subarray(0, count));
      this.seen.set(other.seen.subarray(0, count));
      this.mix = other.mix?.slice();
      return;
    }
    for (const [from, many, p, seen] of BEGINNINGS) {
      this.p.fill(p, from, from + many);
      this.seen.fill(seen, from, from + many);
    }
    if (!tables) return;
    this.mix = tables.mix.slice();
    for (let c = 0; c < 32 * KINDS; c++) {
      this.p[CLASS + c] = tables.squash[128 * (c & 31) + 64]!;
      this.seen[CLASS + c] = 0;
    }
    for (let i = 0; i < tables.begin.length; i += 3) {
      const c = tables.begin[i]!;
      if (c >= CONTEXTS) throw new IsoError("malformed", "7.10", 0, "the tables name a context that does not exist");
      this.p[c] = tables.begin[i + 1]!;
      this.seen[c] = tables.begin[i + 2]!;
    }
  }
}
