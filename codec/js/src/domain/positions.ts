/** Positions of points, by halving cells (10.9.3), and the models of surfaces (10.9.2). */
import type { IsoError, Meter } from "../errors.js";
import type { Steps } from "../reader.js";
import { bits } from "../bits.js";
import { Layout, type Opinions } from "./models.js";

const NAMES = [
  ["NEAR", 1152], ["SIDES", 648], ["WIDE", 800], ["PAST", 512], ["RAW", 36], ["ZERO_SPREAD", 108], ["ZERO_REACH", 126],
  ["ZERO_PART", 144], ["ZERO_NEXT", 108], ["SIGN_PART", 48], ["SIGN_NEXT", 27], ["SIGN_PAST", 27], ["SIZE_MISS", 162],
  ["SIZE_SPREAD", 216], ["SIZE_REACH", 252], ["DIGIT", 72],
] as const;

export const SURFACE = new Layout(NAMES.map(([name, many]) => [name, many, 32768, 0] as const),
  [["CELL", 32], ["ZERO", 3], ["SIGN", 1], ["SIZE", 18]], 24000);

const FIRST = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2047, 2047, 2047, 2047, 2047, 2047];
const SECOND = [-1419, -1241, -1063, -883, -702, -516, -322, -111, 139, 475, 1019, 2047, 2047, 2047, 2047, 2047, 2047];

/** Halves around a half: their differences, and what they count for in `beside`. */
const AROUND = [[-1, 0, 1], [0, -1, 3], [0, 1, 9], [1, 0, 27], [-1, -1, 0], [-1, 1, 0], [1, -1, 0], [1, 1, 0]] as const;

/** Cells of one size that have points, in their order, to be looked up by their indices. */
class Cells {
  readonly x: number[] = [];
  readonly y: number[] = [];
  private table = new Int32Array(0);

  add(x: number, y: number): void {
    this.x.push(x);
    this.y.push(y);
  }

  index(meter: Meter): void {
    const size = 2 ** Math.ceil(Math.log2(2 * this.x.length + 2));
    meter.take(4 * size);
    this.table = new Int32Array(size);
    for (let i = 0; i < this.x.length; i++) this.table[this.slot(this.x[i]!, this.y[i]!)] = i + 1;
  }

  private slot(x: number, y: number): number {
    const { table } = this, mask = table.length - 1;
    let h = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca77);
    h = Math.imul(h ^ (h >>> 15), 0xc2b2ae3d);
    for (let i = (h ^ (h >>> 13)) & mask; ; i = (i + 1) & mask) {
      const at = table[i]! - 1;
      if (at < 0 || (this.x[at] === x && this.y[at] === y)) return i;
    }
  }

  /** The number of a cell, -1 if it has no points. */
  find(x: number, y: number): number {
    return this.table[this.slot(x, y)]! - 1;
  }
}

/** The positions of one run or layer in a box of `W` times `H`, of about `c` points; `tooMany` is thrown beyond `most`. */
export function* readPositions(o: Opinions, W: number, H: number, c: number, most: number, tooMany: () => IsoError):
Steps<{ x: number[]; y: number[] }> {
  const { coder: { meter } } = o, { at: C, sets } = SURFACE;
  const I = Math.ceil(Math.log2(W)), J = Math.ceil(Math.log2(H));
  let cells = new Cells();
  cells.add(0, 0);
  for (let i = I, j = J; i > 0 || j > 0;) {
    const axis = i >= j ? 0 : 1, end = axis ? H : W;
    if (axis) j--;
    else i--;
    const size = axis ? j : i, area = Math.min(i + j, 15), k = Math.min(Math.max(8 + i + j - I - J + bits(c) - 1, 0), 16);
    const next = new Cells(), halves = new Uint8Array(cells.x.length);
    meter.take(cells.x.length + 16);
    cells.index(meter);
    let past = 0, here = 0, wide = 0;
    /** What is known of the half at (x, y): 0 empty, 1 full, 2 open; `told` halves of the present cell are known. */
    const known = (x: number, y: number, told: number): number => {
      const cell = axis ? cells.find(x, y >> 1) : cells.find(x >> 1, y), half = 1 << ((axis ? y : x) & 1);
      if (cell < 0) return 0;
      if (cell > here || (cell === here && half >= told)) return 2;
      return halves[cell]! & half ? 1 : 0;
    };
    const list = (x: number, y: number, second: 0 | 1): void => {
      let near = 0, open = 0, beside = 0;
      for (const [dx, dy, by] of AROUND) {
        const state = known(x + dx, y + dy, 1 << second);
        if (state === 1) near++;
        else if (state) open++;
        beside += by * state;
      }
      o.logit((second ? SECOND : FIRST)[k]!).context(C.NEAR + ((area * 9 + near) * 4 + Math.min(open, 3)) * 2 + second)
        .context(C.SIDES + (Math.min(area, 3) * 81 + beside) * 2 + second).context(C.WIDE + (area * 25 + wide) * 2 + second)
        .context(C.PAST + ((area * 2 + axis) * 8 + past) * 2 + second);
    };
    for (; here < cells.x.length; here++) {
      const x = cells.x[here]!, y = cells.y[here]!, first = axis ? [x, 2 * y] as const : [2 * x, y] as const;
      const second = axis ? [x, 2 * y + 1] as const : [2 * x + 1, y] as const;
      meter.step(8);
      let one = 1, two = 0;
      if ((axis ? second[1] : second[0]) * 2 ** size < end) {
        wide = -1;
        for (let dx = -2; dx <= 2; dx++) for (let dy = -2; dy <= 2; dy++) if (cells.find(x + dx, y + dy) >= 0) wide++;
        for (list(...first, 0); (one = o.bit(sets.CELL + 2 * area)) < 0; list(...first, 0)) yield;
        halves[here] = one;
        two = 1;
        if (one) {
          for (list(...second, 1); (two = o.bit(sets.CELL + 2 * area + 1)) < 0; list(...second, 1)) yield;
          past = ((past << 1) & 7) | two;
        }
      }
      halves[here] = one + 2 * two;
      if (one) next.add(...first);
      if (two) next.add(...second);
    }
    meter.take(16 * (next.x.length - cells.x.length));
    if (next.x.length > most) throw tooMany();
    cells = next;
  }
  return cells;
}
