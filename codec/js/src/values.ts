/** Geometry by values (5.6, 5.9.5), the values around, and guesses (7.7). */
import { VALUE, VALUE_NEAR } from "./models.js";
import { inOrder } from "./order.js";
import { Ints, KNOWN, SIGN } from "./store.js";
import type { Pass, Tube } from "./tube.js";

/** Numbers of this many bits and more take sums beyond the integers of a double; they are added as BigInt. */
const WIDE = 43;
/** Powers of two: looked up faster than computed. */
const POWER = Float64Array.from({ length: 64 }, (_, i) => 2 ** i);

// Sums of near values are numbers or, in files of wide numbers, BigInt: the same text computes both.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
type Wide = any;

/** Steps from a vertex to the samples around it, three coordinates each, in the order of `survey`, by axes less 2. */
export const STEPS = [2, 3].map((n) => {
  const steps: number[] = [];
  const push = (...ways: [number, number][]): void => {
    const by = [0, 0, 0];
    for (const [a, way] of ways) by[a] = way;
    steps.push(...by);
  };
  for (let a = 0; a < n; a++) for (const way of [-1, 1, -2, 2]) push([a, way]);
  for (let a = 0; a < n; a++) for (let b = a + 1; b < n; b++)
    for (const i of [-1, 1]) for (const j of [-1, 1]) push([a, i], [b, j]);
  return Int8Array.from(steps);
});

export class Values {
  /** By the number of the vertex in `known`: what has been sent, the bits missing, 1 if it is active. */
  number = new Float64Array(0);
  missing = new Uint8Array(0);
  active = new Uint8Array(0);
  protected ids = new Int32Array(0);
  private least: Float64Array | undefined;
  private most: Float64Array | undefined;
  private assigned = 0;
  private readonly list: Ints;
  private listed = -1;
  wide: boolean;
  /** Near values around a vertex (7.15(1)): what is there, and its value. */
  readonly there = new Uint8Array(24);
  readonly near = new Float64Array(24);
  readonly wideNear: bigint[] = [];
  private per = 0;
  private neighbours = new Int32Array(0);

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
    const [lo, hi, missing] = range, { down, up } = t.shift!;
    const least = sign ? lo - up - 1 : down - hi, most = sign ? hi - down - 1 : up - lo;
    if (Math.abs(least) >= 2 ** 53 || Math.abs(most) >= 2 ** 53) return;
    if (missing === 0 && least === most) {
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
    const { t, list } = this, { n, grid, store } = t, d = t.leaves.data, length = t.leaves.length, full = t.onFullGrid;
    if (this.listed === t.changes) return;
    this.listed = t.changes;
    this.active = new Uint8Array(t.known.length / 3);
    list.length = 0;
    const [lastX, lastY, lastZ] = grid.last;
    const add = (x: number, y: number, z: number): void => {
      const id = this.ids[store.at(x, y, z)]! - 1;
      if (this.active[id]) return;
      this.active[id] = 1;
      list.push(id);
    };
    if (full) {
      gridEdges(t, (px, py, pz, qx, qy, qz) => {
        add(px, py, pz);
        add(qx, qy, qz);
      });
    } else for (let i = 0; i < length; i += 4) {
      const level = d[i]! >> 8, cls = d[i]! & 255, c = grid.edge(level), { off } = grid.phases[level % n]!;
      t.meter.step(4);
      for (let j = 0, o = 12 * cls; j <= n; j++, o += 3) {
        add(Math.max(0, Math.min(lastX, d[i + 1]! + (off[o]! * c) / 2)),
          Math.max(0, Math.min(lastY, d[i + 2]! + (off[o + 1]! * c) / 2)),
          Math.max(0, Math.min(lastZ, d[i + 3]! + (off[o + 2]! * c) / 2)));
      }
    }
    const ids = list.data.slice(0, list.length), points = new Int32Array(3 * ids.length);
    ids.forEach((id, i) => points.set(t.known.data.subarray(3 * id, 3 * id + 3), 3 * i));
    inOrder(n, points).forEach((row, i) => (list.data[i] = ids[row]!));
    if (full) this.survey();
  }

  /** A layer that leaves `plane` bits missing (5.6.3). */
  *layer(plane: number): Pass {
    const { t } = this;
    this.assign();
    this.relist();
    const { list, number, missing, least, most } = this, { coder } = t;
    const full = t.onFullGrid;
    let before = 0;
    for (let i = 0; i < list.length; i++) {
      const id = list.data[i]!;
      t.meter.step(4);
      while (missing[id]! > plane) {
        const m = missing[id]! - 1, so = number[id]!;
        let bit = -1;
        if (least && least[id] === least[id]) {
          const one = (2 * so + 1) * POWER[m]!;
          if (most![id]! < one) bit = 0;
          else if (least[id]! >= one) bit = 1;
        }
        if (bit < 0) {
          const context = VALUE + (2 * m + (so !== 0 ? 1 : 0)) * 3 + before;
          if (full) this.around(i);
          if (full && t.main) {
            while ((bit = t.main.value(this, so, m, context)) < 0) yield;
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

  /**
   * Samples around each active vertex, as twice their number in `known`, plus 1 if their sign is that of the vertex, or -1:
   * for each axis back_1, on_1, back_2, on_2, then the four of each pair of axes (7.15(2)).
   */
  private survey(): void {
    const { t, list, ids } = this, { n, store, known } = t, [lastX, lastY, lastZ] = t.grid.last;
    const per = (this.per = n === 2 ? 12 : 24), d = known.data;
    t.meter.take(4 * per * list.length);
    const around = (this.neighbours = new Int32Array(per * list.length)), steps = STEPS[n - 2]!;
    for (let i = 0; i < list.length; i++) {
      const id = list.data[i]!, x = d[3 * id]!, y = d[3 * id + 1]!, z = d[3 * id + 2]!, sign = store.get(x, y, z) & SIGN;
      for (let j = 0; j < per; j++) {
        const px = x + steps[3 * j]!, py = y + steps[3 * j + 1]!, pz = z + steps[3 * j + 2]!;
        let found = -1;
        if (px >= 0 && py >= 0 && pz >= 0 && px <= lastX && py <= lastY && pz <= lastZ) {
          const at = store.at(px, py, pz), other = (ids[at]! | 0) - 1;
          if (other >= 0 && this.active[other]) found = 2 * other + ((store.flags[at]! & SIGN) === sign ? 1 : 0);
        }
        around[per * i + j] = found;
      }
    }
  }

  /** Near values around entry `entry` of the list. */
  private around(entry: number): void {
    const { neighbours, per, there, missing, number, wide, near, wideNear } = this;
    for (let i = 0; i < per; i++) {
      const found = neighbours[per * entry + i]!;
      there[i] = found < 0 ? 0 : 1;
      if (found < 0) continue;
      const id = found >> 1, same = (found & 1) === 1;
      if (wide) {
        const value = (2n * BigInt(number[id]!) + 1n) << BigInt(missing[id]!);
        wideNear[i] = same ? value : -value;
      } else {
        const value = (2 * number[id]! + 1) * POWER[missing[id]!]!;
        near[i] = same ? value : -value;
      }
    }
  }

  /** The guess of 7.7(3), undefined if there is none. */
  private guess(): Wide {
    const { there, wide } = this, { n } = this.t, near: Wide = wide ? this.wideNear : this.near, zero: Wide = wide ? 0n : 0;
    let same = zero, sames = 0, sum = zero, count = 0, rest = zero, rests = 0;
    const add = (place: Wide): void => {
      if (place > zero) sum += place;
      count++;
    };
    for (let b = 0; b < 4 * n; b += 4) {
      if (there[b] && there[b + 1]) add(this.div(near[b] + near[b + 1], 2));
      for (let i = b; i < b + 2; i++) {
        if (!there[i]) continue;
        if (near[i] > zero) {
          same += near[i];
          sames++;
        }
        if (!there[i + 2]) continue;
        rest += near[i] + near[i] - near[i + 2];
        rests++;
      }
    }
    let at = 4 * n;
    for (let a = 0; a < n; a++) for (let b = a + 1; b < n; b++) for (let i = 0; i < 4; i++, at++) {
      const p = 4 * a + (i >> 1), q = 4 * b + (i & 1);
      if (there[at] && there[p] && there[q]) add(near[p] + near[q] - near[at]);
    }
    if (sames) add(this.div(same, sames));
    if (count) return this.div(sum, count);
    return rests ? this.div(rest > zero ? rest : zero, rests) : undefined;
  }

  /** `a // count`. */
  div(a: Wide, count: number): Wide {
    if (!this.wide) return Math.floor(a / count);
    const b = BigInt(count), q = a / b;
    return a % b !== 0n && a < 0n ? q - 1n : q;
  }

  cut(number: number, plane: number): Wide {
    return this.wide ? (2n * BigInt(number) + 1n) << BigInt(plane + 1) : (2 * number + 1) * POWER[plane + 1]!;
  }

  /** `near` of 7.7(2), -1 without a guess. */
  private class(number: number, plane: number): number {
    const guess = this.guess();
    if (guess === undefined) return -1;
    const far = 4 * Number(guess - this.cut(number, plane)), near = Math.floor(far / POWER[plane + 1]!);
    return 8 + (near < -8 ? -8 : near > 7 ? 7 : near);
  }
}

/** The crossed edges of the full grid, lower ends first, both ends of which are known, and that carry geometry (5.7.2(2)). */
export function gridEdges(t: Tube, each: (px: number, py: number, pz: number, qx: number, qy: number, qz: number) => void): void {
  const { known, store, n } = t, [lastX, lastY, lastZ] = t.grid.last, d = known.data;
  for (let i = 0; i < known.length; i += 3) {
    t.meter.step(4);
    const x = d[i]!, y = d[i + 1]!, z = d[i + 2]!, sign = store.get(x, y, z) & SIGN;
    for (let a = 0; a < n; a++) {
      const qx = x + Number(a === 0), qy = y + Number(a === 1), qz = z + Number(a === 2);
      if (qx > lastX || qy > lastY || qz > lastZ) continue;
      const flags = store.get(qx, qy, qz);
      if (flags & KNOWN && (flags & SIGN) !== sign && wholeEdge(t, x, y, z, qx, qy, qz)) each(x, y, z, qx, qy, qz);
    }
  }
}

/** Whether some whole unit cell has the grid edge between two neighbouring samples (5.10.2, 5.10.4). */
function wholeEdge(t: Tube, px: number, py: number, pz: number, qx: number, qy: number, qz: number): boolean {
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
function wholeCell(t: Tube, x: number, y: number, z: number): boolean {
  for (let i = 0; i < 1 << t.n; i++) if (t.mask!.missing(x + (i & 1), y + ((i >> 1) & 1), z + (i >> 2))) return false;
  return true;
}
