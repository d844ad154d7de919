/** What the main profile sees of numbers and digits: opinions of 7.15, rows of 7.14.7. */
import { bits } from "../bits.js";
import { AROUND } from "../models.js";
import type { Offsets } from "../offsets.js";
import type { Tube } from "../tube.js";
import type { Values } from "../values.js";
import { rows } from "./rows.js";

// Places of candidates are numbers or, where they are wide, BigInt: the same text computes both.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
type Wide = any;

/** Opinions on a value bit that are leans; those of contexts come after them. */
export const LEANS = 5;

/** Opinions on a bit of a vertex's number (7.15). */
export class ValueOpinions {
  /** Leans by kind of candidate, in the order of 7.15(2), and room for what the contexts say. */
  readonly said = new Int32Array(10);
  readonly contexts = new Int32Array(5);
  private cut: Wide;
  private half = 0;
  /** The last lean. */
  private lean = 0;

  /** Enter the leans of the candidates, and the contexts: that of 7.7(1), then AROUND. */
  list(values: Values, n: number, number: number, plane: number, context: number): void {
    const { there, wide } = values, { said, contexts } = this;
    const near: Wide = wide ? values.wideNear : values.near, zero: Wide = wide ? 0n : 0;
    this.cut = values.cut(number, plane);
    this.half = 2 ** (plane + 1);
    contexts[0] = context;
    let same = zero, sames = 0, other = zero, others = 0;
    for (let i = 0; i < 4 * n; i += i & 1 ? 3 : 1) {
      if (!there[i]) continue;
      if (near[i] > zero) {
        same += near[i];
        sames++;
      } else {
        other += near[i];
        others++;
      }
    }
    const alike = this.class(sames, sames && values.div(same, sames));
    said[0] = this.lean;
    this.class(others, others && values.div(other, others));
    said[1] = this.lean;
    said[2] = said[3] = said[4] = 0;
    let planes = 0;
    for (let a = 0; a < n; a++) {
      const x = 4 * a, y = x + 1;
      let found = this.class(there[x]! & there[y]!, there[x]! & there[y]! && values.div(near[x] + near[y], 2));
      said[2]! += this.lean;
      for (let i = x; i <= y; i++) {
        found = 8 * found + this.class(there[i]! & there[i + 2]!, there[i]! & there[i + 2]! && near[i] + near[i] - near[i + 2]);
        said[3]! += this.lean;
      }
      contexts[1 + a] = AROUND + 4096 * a + 8 * found + alike;
    }
    let at = 4 * n;
    for (let a = 0; a < n; a++) for (let b = a + 1; b < n; b++) {
      let sum = zero, count = 0;
      for (let i = 0; i < 4; i++, at++) {
        const p = 4 * a + (i >> 1), q = 4 * b + (i & 1);
        if (!there[at] || !there[p] || !there[q]) continue;
        sum += near[p] + near[q] - near[at];
        count++;
      }
      planes = 8 * planes + this.class(count, count && values.div(sum, count));
      said[4]! += this.lean;
    }
    contexts[n + 1] = AROUND + 12288 + 8 * planes + alike;
  }

  /** Class of the lean of a candidate at a place, 0 if it is not there. */
  private class(there: number, place: Wide): number {
    this.lean = 0;
    if (!there) return 0;
    const { half } = this, far = place - this.cut;
    this.lean = Math.floor(((far < -half ? -half : far >= half ? half - 1 : Number(far)) * 256) / half);
    return 1 + ((7 * (this.lean + 256)) >> 9);
  }
}

/** Symbol number `i` of a digit of an edge: which of the parts `low .. high - 1` of `R` it is (5.7.3). */
export interface OffsetSymbol {
  id: number;
  i: number;
  rising: number;
  told: number;
  R: number;
  low: number;
  split: number;
  high: number;
  again: number;
  nearer: number;
}

/** Rows of a symbol of a digit; `offsets` has its candidates. How many. */
export function offsetRows(offsets: Offsets, t: Tube, symbol: OffsetSymbol): number {
  const { at, fine, recent, edges } = offsets, { n, onFullGrid: full } = t;
  const { id, rising, told, R, low, split, high, again, nearer } = symbol, P = offsets.parts[id]!;
  const base = full ? (n === 2 ? 902 : 1454) : n === 2 ? 1622 : 2174;
  const recents = full ? 9 : n === 2 ? 5 : 10, slots = recents + 4;
  const cut = Math.floor(((told * R + split) * 4096) / (P * R));
  let seen = 0;
  for (let slot = 0; slot < slots; slot++) {
    let place: number, sure = 1;
    if (slot >= recents) {
      if (slot - recents >= recent.length) break;
      place = recent[slot - recents]!;
    } else {
      place = at[slot]!;
      if (place !== place) continue;
      sure = fine[slot]!;
      if (!rising) place = 4096 - place;
    }
    const off = place - cut;
    rows[seen++] = base + 52 * slot + 26 * sure + (off < 0 ? 13 : 0) + Math.min(bits(Math.abs(off) >> 2), 12);
  }
  const rest = base + (full ? 676 : 52 * slots);
  rows[seen++] = rest + bits(high - low) + 7 * again;
  rows[seen++] = rest + 14 + bits(Math.floor(((high - low) * 4096) / (P * R)));
  rows[seen++] = rest + 28 + (cut >> 9);
  if (nearer >= 0) rows[seen++] = rest + 36 + Math.min(bits(nearer), 7);
  if (!full) {
    const e = edges.ends, o = 6 * id;
    let axes = 0;
    for (let a = 0; a < n; a++) if (e[o + a] !== e[o + 3 + a]) axes++;
    rows[seen++] = rest + 44 + axes - 1;
  }
  return seen;
}
