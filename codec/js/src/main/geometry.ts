/** Rows that the networks of the main profile see of numbers and digits (7.14.7, 7.15(4)). */
import { bits } from "../bits.js";
import type { Offsets } from "../offsets.js";
import type { Tube } from "../tube.js";
import type { Values } from "../values.js";
import { rows } from "./rows.js";

/** Rows of a bit of a vertex's number; `values` has its candidates. How many. */
export function valueRows(values: Values, t: Tube, number: number, plane: number): number {
  const { slotThere, slotFine, there, fine, wide } = values, { n } = t, base = n === 2 ? 2136 : 2949;
  let seen = 0, count = 0;
  if (t.onFullGrid) {
    // numbers or, where they are wide, BigInt: the same text computes both
    // eslint-disable-next-line @typescript-eslint/no-explicit-any
    const cut: any = values.cut(number, plane), slots: any = wide ? values.wideSlots : values.slots;
    for (let slot = 0; slot < 14; slot++) {
      if (!slotThere[slot]) continue;
      const off = slots[slot] - cut, below = off < 0, size = below ? -off : off, twice = size + size;
      const far = values.shifted(twice + twice + twice + twice, plane + 1);
      rows[seen++] = base + 52 * slot + 26 * slotFine[slot]! + (below ? 13 : 0) + (far < 4096 ? bits(far) : 12);
    }
    for (let a = 0; a < n; a++) for (let i = 4 * a; i < 4 * a + 2; i++) if (there[i] && fine[i]) count++;
  }
  const rest = base + (n === 2 ? 468 : 728);
  rows[seen++] = rest + Math.min(plane, 15);
  rows[seen++] = rest + 16 + Math.min(bits(number), 7);
  rows[seen++] = rest + 24 + count;
  return seen;
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
  rows[seen++] = rest + 28 + (cut >> 9 < 0 ? 0 : cut >> 9 > 7 ? 7 : cut >> 9);
  if (nearer >= 0) rows[seen++] = rest + 36 + Math.min(bits(nearer), 7);
  if (!full) {
    const e = edges.ends, o = 6 * id;
    let axes = 0;
    for (let a = 0; a < n; a++) if (e[o + a] !== e[o + 3 + a]) axes++;
    rows[seen++] = rest + 44 + axes - 1;
  }
  return seen;
}
