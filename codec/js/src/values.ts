/** Geometry by values (5.6, 5.9.5), its guesses and candidates (7.7, 7.15). */
import { rows } from "./coder.js";
import { VALUE, VALUE_NEAR } from "./models.js";
import { bits } from "./rows.js";
import { Ints, KNOWN, SIGN } from "./store.js";
import type { Pass, Tube } from "./tube.js";

/** Numbers of this many bits and more take sums beyond the integers of a double; they are added as BigInt. */
const WIDE = 43;

// Sums of near values are numbers or, in files of wide numbers, BigInt: the same text computes both.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
type Wide = any;

export class Values {
  /** By the number of the vertex in `known`: what has been sent, the bits missing, 1 if it is active. */
  number = new Float64Array(0);
  missing = new Uint8Array(0);
  active = new Uint8Array(0);
  private ids = new Int32Array(0);
  private least: Float64Array | undefined;
  private most: Float64Array | undefined;
  private assigned = 0;
  private readonly list: Ints;
  private listed = -1;
  private wide: boolean;
  /** Near values around a vertex: what is there, known finely, and its value. */
  private readonly there = new Uint8Array(32);
  private readonly fine = new Uint8Array(32);
  private near: Wide[] = [];
  private slots: Wide[] = [];
  private slotFine: number[] = [];
  private guess: Wide;

  constructor(private readonly t: Tube, readonly above: number, readonly below: number) {
    this.list = new Ints(t.meter);
    this.wide = Math.max(above, below) >= WIDE;
  }

  /** Number of a position in `known`, -1 if it has no number (5.6.1). */
  id(x: number, y: number, z: number): number {
    return (this.ids[this.t.store.at(x, y, z)]! | 0) - 1;
  }

  private assign(): void {
    const { t } = this, { known, store } = t, count = known.length / 3, from = this.assigned;
    if (count === from) return;
    t.meter.take(26 * (count - from) + 4 * (store.flags.length - this.ids.length));
    const ids = new Int32Array(store.flags.length), number = new Float64Array(count), missing = new Uint8Array(count);
    ids.set(this.ids);
    number.set(this.number);
    missing.set(this.missing);
    this.ids = ids;
    this.number = number;
    this.missing = missing;
    if (t.lean?.values) {
      const least = new Float64Array(count).fill(NaN), most = new Float64Array(count).fill(NaN);
      if (this.least) {
        least.set(this.least);
        most.set(this.most!);
      }
      this.least = least;
      this.most = most;
    }
    for (let id = from; id < count; id++) {
      const x = known.data[3 * id]!, y = known.data[3 * id + 1]!, z = known.data[3 * id + 2]!;
      const at = store.at(x, y, z), sign = store.flags[at]! & SIGN ? 1 : 0;
      ids[at] = id + 1;
      missing[id] = sign ? this.above : this.below;
      if (this.least) this.take(id, x, y, z, sign);
    }
    this.assigned = count;
  }

  /** What follows for a number from the earlier isovalue (5.9.5). */
  private take(id: number, x: number, y: number, z: number, sign: number): void {
    const { t } = this, flags = t.lean!.store.get(x, y, z);
    if (!(flags & KNOWN)) return;
    const range = t.bounds(x, y, z, flags & SIGN ? 1 : 0);
    if (!range) return;
    const [lo, hi, missing] = range, shift = t.shift!;
    const least = sign ? lo - shift - 1 : shift - hi, most = sign ? hi - shift - 1 : shift - lo;
    if (Math.abs(least) >= 2 ** 53 || Math.abs(most) >= 2 ** 53) return;
    if (missing === 0) {
      this.number[id] = least;
      this.missing[id] = 0;
      if (Math.abs(least) >= 2 ** WIDE) this.wide = true;
    } else {
      this.least![id] = least;
      this.most![id] = most;
    }
  }

  /** The list of active vertices (5.6.2). */
  private relist(): void {
    const { t } = this, { n, grid, store } = t, d = t.leaves.data, length = t.leaves.length, full = t.onFullGrid;
    if (this.listed === t.changes) return;
    this.listed = t.changes;
    this.active = new Uint8Array(t.known.length / 3);
    this.list.length = 0;
    const [lastX, lastY, lastZ] = grid.last;
    const at = new Int32Array(4);
    for (let i = 0; i < length; i += 4) {
      const level = d[i]! >> 8, cls = d[i]! & 255, c = grid.edge(level), { off } = grid.phases[level % n]!;
      t.meter.step(4);
      let signs = 0;
      const x: number[] = [], y: number[] = [], z: number[] = [];
      for (let j = 0; j <= n; j++) {
        const o = 12 * cls + 3 * j;
        x.push(Math.max(0, Math.min(lastX, d[i + 1]! + (off[o]! * c) / 2)));
        y.push(Math.max(0, Math.min(lastY, d[i + 2]! + (off[o + 1]! * c) / 2)));
        z.push(Math.max(0, Math.min(lastZ, d[i + 3]! + (off[o + 2]! * c) / 2)));
        at[j] = store.at(x[j]!, y[j]!, z[j]!);
        if (store.flags[at[j]!]! & SIGN) signs |= 1 << j;
      }
      const crossed = (j: number): boolean => j >= 0 && j < n && (((signs >> j) ^ (signs >> (j + 1))) & 1) !== 0 &&
        wholeEdge(t, x[j]!, y[j]!, z[j]!, x[j + 1]!, y[j + 1]!, z[j + 1]!);
      for (let j = 0; j <= n; j++) {
        if (full && !crossed(j - 1) && !crossed(j)) continue;
        const id = this.ids[at[j]!]! - 1;
        if (this.active[id]) continue;
        this.active[id] = 1;
        this.list.push(id);
      }
    }
  }

  /** A layer that leaves `plane` bits missing (5.6.3). */
  *layer(plane: number): Pass {
    const { t } = this;
    this.assign();
    this.relist();
    const { list, number, missing, least, most } = this, { known, store, coder } = t;
    const full = t.onFullGrid;
    let before = 0;
    for (let i = 0; i < list.length; i++) {
      const id = list.data[i]!, x = known.data[3 * id]!, y = known.data[3 * id + 1]!, z = known.data[3 * id + 2]!;
      const sign = store.get(x, y, z) & SIGN;
      t.meter.step(4);
      while (missing[id]! > plane) {
        const m = missing[id]! - 1, so = number[id]!;
        let bit = -1;
        if (least && least[id] === least[id]) {
          const one = (2 * so + 1) * 2 ** m;
          if (most![id]! < one) bit = 0;
          else if (least[id]! >= one) bit = 1;
        }
        if (bit < 0) {
          const context = VALUE + (2 * m + (so !== 0 ? 1 : 0)) * 3 + before;
          if (full) this.around(x, y, z, sign, m);
          if (t.main) {
            this.see(so, m, full);
            const kind = 36 + Math.min(bits(so), 2);
            while ((bit = coder.mixed(6, kind, context, false)) < 0) {
              yield;
              this.see(so, m, full);
            }
          } else {
            const near = full ? this.class(so, m) : -1;
            const below = VALUE_NEAR + (2 * Math.min(m, 15) + (so !== 0 ? 1 : 0)) * 16 + near;
            while ((bit = near < 0 ? coder.bit(context) : coder.below(below, context)) < 0) yield;
          }
          before = 1 + bit;
        }
        number[id] = 2 * so + bit;
        missing[id] = m;
      }
    }
  }

  /** Near value of a sample (7.15(2)) into place `i`. */
  private look(i: number, x: number, y: number, z: number, sign: number, plane: number): void {
    const { t } = this, [lastX, lastY, lastZ] = t.grid.last;
    this.there[i] = 0;
    if (x < 0 || y < 0 || z < 0 || x > lastX || y > lastY || z > lastZ) return;
    const at = t.store.at(x, y, z), id = (this.ids[at]! | 0) - 1;
    if (id < 0 || !this.active[id]) return;
    const missing = this.missing[id]!;
    this.there[i] = 1;
    this.fine[i] = missing <= plane ? 1 : 0;
    const size = 2 * this.number[id]! + 1, same = (t.store.flags[at]! & SIGN) === sign;
    if (this.wide) {
      const value = (2n * BigInt(this.number[id]!) + 1n) << BigInt(missing);
      this.near[i] = same ? value : -value;
    } else this.near[i] = (same ? size : -size) * 2 ** missing;
  }

  /** Near values, candidates by slot, and the guess of 7.7(3). */
  private around(x: number, y: number, z: number, sign: number, plane: number): void {
    const { t, there, fine, near, slots, slotFine } = this, { n } = t;
    const Z: (x: number) => Wide = this.wide ? BigInt : Number;
    const div = (a: Wide, count: number): Wide => {
      if (!this.wide) return Math.floor(a / count);
      const b = BigInt(count), q = a / b;
      return a % b !== 0n && a < 0n ? q - 1n : q;
    };
    const zero = Z(0);
    slots.length = slotFine.length = 2 + 3 * n + (n === 2 ? 1 : 3);
    slots.fill(undefined);
    // places: 4 * axis + 0 .. 3 for back_1, on_1, back_2, on_2
    for (let a = 0; a < n; a++) {
      for (let i = 0; i < 4; i++) {
        const by = (i & 1 ? 1 : -1) * (i < 2 ? 1 : 2);
        this.look(4 * a + i, x + (a === 0 ? by : 0), y + (a === 1 ? by : 0), z + (a === 2 ? by : 0), sign, plane);
      }
    }
    let same = zero, other = zero, sames = 0, others = 0, sameFine = 1, otherFine = 1;
    let sum = zero, count = 0, rest = zero, rests = 0;
    for (let a = 0; a < n; a++) {
      const b = 4 * a;
      for (let i = b; i < b + 2; i++) {
        if (!there[i]) continue;
        if (near[i]! > zero) {
          same += near[i]!;
          sames++;
          sameFine &= fine[i]!;
        } else {
          other += near[i]!;
          others++;
          otherFine &= fine[i]!;
        }
      }
      if (there[b] && there[b + 1]) {
        const line = div(near[b]! + near[b + 1]!, 2);
        slots[2 + 3 * a] = line;
        slotFine[2 + 3 * a] = fine[b]! & fine[b + 1]!;
        if (line > zero) sum += line;
        count++;
      }
      for (let i = 0; i < 2; i++) {
        if (!there[b + i] || !there[b + 2 + i]) continue;
        const beyond = near[b + i]! + near[b + i]! - near[b + 2 + i]!;
        slots[3 + 3 * a + i] = beyond;
        slotFine[3 + 3 * a + i] = fine[b + i]! & fine[b + 2 + i]!;
        rest += beyond;
        rests++;
      }
    }
    let pair = 2 + 3 * n;
    for (let a = 0; a < n; a++) for (let b = a + 1; b < n; b++, pair++) {
      let across = zero, acrosses = 0, acrossFine = 1;
      for (let i = 0; i < 4; i++) {
        const p = 4 * a + (i >> 1), q = 4 * b + (i & 1);
        if (!there[p] || !there[q]) continue;
        const wa = i >> 1 ? 1 : -1, wb = i & 1 ? 1 : -1;
        this.look(12, x + (a === 0 ? wa : 0), y + (a === 1 ? wa : b === 1 ? wb : 0), z + (b === 2 ? wb : 0), sign, plane);
        if (!there[12]) continue;
        const place = near[p]! + near[q]! - near[12]!;
        across += place;
        acrosses++;
        acrossFine &= fine[p]! & fine[q]! & fine[12]!;
        if (place > zero) sum += place;
        count++;
      }
      if (acrosses) {
        slots[pair] = div(across, acrosses);
        slotFine[pair] = acrossFine;
      }
    }
    if (sames) {
      slots[0] = div(same, sames);
      slotFine[0] = sameFine;
      sum += slots[0];
      count++;
    }
    if (others) {
      slots[1] = div(other, others);
      slotFine[1] = otherFine;
    }
    this.guess = count ? div(sum, count) : rests ? div(rest > zero ? rest : zero, rests) : undefined;
  }

  /** `x >> shift`, as a number from -8 to 7 or so: limited, so that wide numbers fit. */
  private shifted(x: Wide, shift: number): number {
    return this.wide ? Number(x >> BigInt(shift)) : Math.floor(x / 2 ** shift);
  }

  private cut(number: number, plane: number): Wide {
    return this.wide ? (2n * BigInt(number) + 1n) << BigInt(plane + 1) : (2 * number + 1) * 2 ** (plane + 1);
  }

  /** `near` of 7.7(2), -1 without a guess. */
  private class(number: number, plane: number): number {
    if (this.guess === undefined) return -1;
    const far = this.guess - this.cut(number, plane), near = this.shifted(far + far + far + far, plane + 1);
    return 8 + (near < -8 ? -8 : near > 7 ? 7 : near);
  }

  /** Rows of 7.15(4). */
  private see(number: number, plane: number, full: boolean): void {
    const { t, slots, slotFine, there, fine } = this, { n } = t, base = n === 2 ? 2144 : 2819;
    let seen = 0, count = 0;
    if (full) {
      const cut = this.cut(number, plane);
      for (let slot = 0; slot < slots.length; slot++) {
        if (slots[slot] === undefined) continue;
        const off = slots[slot] - cut, below = off < 0, size = below ? -off : off, twice = size + size;
        const far = this.shifted(twice + twice + twice + twice, plane + 1);
        rows[seen++] = base + 52 * slot + 26 * slotFine[slot]! + (below ? 13 : 0) + Math.min(bits(far), 12);
      }
      for (let a = 0; a < n; a++) for (let i = 4 * a; i < 4 * a + 2; i++) if (there[i] && fine[i]) count++;
    }
    const rest = base + (n === 2 ? 468 : 728);
    rows[seen++] = rest + Math.min(plane, 15);
    rows[seen++] = rest + 16 + Math.min(bits(number), 7);
    rows[seen++] = rest + 24 + count;
    t.coder.seen = seen;
  }
}

/** Whether some whole unit cell has the grid edge between two neighbouring samples (5.10.2, 5.10.4). */
export function wholeEdge(t: Tube, px: number, py: number, pz: number, qx: number, qy: number, qz: number): boolean {
  if (!t.mask) return true;
  const [lastX, lastY, lastZ] = t.grid.last, n = t.n;
  const lx = Math.min(px, qx), ly = Math.min(py, qy), lz = Math.min(pz, qz);
  const fx = px === qx ? 1 : 0, fy = py === qy ? 1 : 0, fz = n === 3 && pz === qz ? 1 : 0;
  for (let x = lx - fx; x <= lx; x++) for (let y = ly - fy; y <= ly; y++) for (let z = lz - fz; z <= lz; z++) {
    if (x < 0 || y < 0 || z < 0 || x >= lastX || y >= lastY || (n === 3 && z >= lastZ)) continue;
    if (wholeCell(t, x, y, z)) return true;
  }
  return false;
}

/** Whether a unit cell of the box is whole (5.10.2). */
export function wholeCell(t: Tube, x: number, y: number, z: number): boolean {
  for (let i = 0; i < 1 << t.n; i++) if (t.missing(x + (i & 1), y + ((i >> 1) & 1), z + (i >> 2))) return false;
  return true;
}
