/** Edges that leaves cross, which of them are implied, and which are sent (5.7.2). */
import { edgesInOrder } from "./order.js";
import { SIGN, type Ints } from "./store.js";
import type { Tube } from "./tube.js";

/** Limits the place of a point on its edge, so that no two points fall together (9.5(6)). */
export const apart = (t: number): number => Math.min(1 - 2 ** -21, Math.max(2 ** -21, t));

/** Numbers edges by the positions of their ends, the lexicographically smaller one first. */
export class EdgeIndex {
  count = 0;
  /** Six coordinates each. */
  ends = new Int32Array(6 * 64);
  private table = new Int32Array(256);

  constructor(private readonly t: Tube) {}

  private slot(ax: number, ay: number, az: number, bx: number, by: number, bz: number): number {
    let h = Math.imul(ax + bx, 0x9e3779b1) ^ Math.imul(ay + by, 0x85ebca77) ^ Math.imul(az + bz, 0xc2b2ae3d) ^
      Math.imul(bx - ax, 0x27d4eb2f) ^ Math.imul(by - ay, 0x165667b1);
    h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
    h = Math.imul(h ^ (h >>> 12), 0x297a2d39);
    const { table, ends } = this, mask = table.length - 1;
    let i = (h ^ (h >>> 15)) & mask;
    for (; table[i] !== 0; i = (i + 1) & mask) {
      const at = 6 * (table[i]! - 1);
      if (ends[at] === ax && ends[at + 1] === ay && ends[at + 2] === az && ends[at + 3] === bx &&
        ends[at + 4] === by && ends[at + 5] === bz) break;
    }
    return i;
  }

  /** The number of an edge, -1 if there is none. */
  find(ax: number, ay: number, az: number, bx: number, by: number, bz: number): number {
    if (ax - bx || ay - by ? ax > bx || (ax === bx && ay > by) : az > bz)
      return this.table[this.slot(bx, by, bz, ax, ay, az)]! - 1;
    return this.table[this.slot(ax, ay, az, bx, by, bz)]! - 1;
  }

  /** Their numbers in order: by the lower ends, those of one by the upper ends lexicographically (5.7.2). */
  inOrder(): Uint32Array {
    const { count } = this, ends = this.ends.subarray(0, 6 * count);
    return edgesInOrder(this.t.n, ends);
  }

  add(ax: number, ay: number, az: number, bx: number, by: number, bz: number): number {
    if (ax - bx || ay - by ? ax > bx || (ax === bx && ay > by) : az > bz) return this.add(bx, by, bz, ax, ay, az);
    const i = this.slot(ax, ay, az, bx, by, bz);
    if (this.table[i]) return this.table[i]! - 1;
    const id = this.count++;
    if (6 * id + 6 > this.ends.length) {
      this.t.meter.take(4 * this.ends.length);
      const ends = new Int32Array(2 * this.ends.length);
      ends.set(this.ends);
      this.ends = ends;
    }
    this.ends.set([ax, ay, az, bx, by, bz], 6 * id);
    this.table[i] = id + 1;
    if (2 * this.count > this.table.length) {
      this.t.meter.take(4 * this.table.length);
      const size = 2 * this.table.length, e = this.ends;
      this.table = new Int32Array(size);
      for (let j = 0; j < this.count; j++) {
        const o = 6 * j;
        this.table[this.slot(e[o]!, e[o + 1]!, e[o + 2]!, e[o + 3]!, e[o + 4]!, e[o + 5]!)] = j + 1;
      }
    }
    return id;
  }
}

/** Clamped vertices of leaf number `i` into `p`, three coordinates each; the signs as bits. */
export function leafVertices(t: Tube, leaves: Ints, i: number, p: Int32Array): number {
  const d = leaves.data, level = d[4 * i]! >> 8, o = 12 * (d[4 * i]! & 255), { grid, n } = t;
  const c = grid.edge(level), { off } = grid.phases[level % n]!, last = grid.last;
  let signs = 0;
  for (let j = 0; j <= n; j++) {
    for (let a = 0; a < 3; a++) {
      const x = d[4 * i + 1 + a]! + (off[o + 3 * j + a]! * c) / 2;
      p[3 * j + a] = x > last[a]! ? last[a]! : x;
    }
    if (t.store.get(p[3 * j]!, p[3 * j + 1]!, p[3 * j + 2]!) & SIGN) signs |= 1 << j;
  }
  return signs;
}

/** The ring of an implied edge: positions, three coordinates each. */
type Ring = Int32Array;

/** All edges that some leaves cross, with the rings of those that are implied. */
export class Crossings {
  readonly index: EdgeIndex;
  readonly rings: (Ring | undefined)[] = [];
  /** For n = 2: the edges of each leaf, two each; the leaves of each edge, two each, that with the lesser sum of vertices first (-1: none). */
  leafEdges = new Int32Array(0);
  edgeLeaves: number[] = [];

  constructor(t: Tube, leaves: Ints) {
    const { n, meter } = t, index = (this.index = new EdgeIndex(t)), count = leaves.length / 4;
    const p = new Int32Array(12), whole: number[][] = [], squares: number[][] = [];
    meter.take(leaves.length * 16);
    if (n === 2) this.leafEdges = new Int32Array(2 * count).fill(-1);
    const sums = new Int32Array(n === 2 ? 2 * count : 0);
    const before = (l: number, m: number): boolean => (sums[2 * l]! - sums[2 * m]! || sums[2 * l + 1]! - sums[2 * m + 1]!) < 0;
    for (let l = 0; l < count; l++) {
      const signs = leafVertices(t, leaves, l, p), level = leaves.data[4 * l]! >> 8, r = level % n, d = n - r;
      meter.step(8);
      if (n === 2) for (let i = 0; i < 6; i++) sums[2 * l + (i & 1)]! += p[3 * (i >> 1) + (i & 1)]!;
      let sides = 0;
      for (let i = 0; i < n; i++) for (let j = i + 1; j <= n; j++) {
        if (!(((signs >> i) ^ (signs >> j)) & 1)) continue;
        const id = index.add(p[3 * i]!, p[3 * i + 1]!, p[3 * i + 2]!, p[3 * j]!, p[3 * j + 1]!, p[3 * j + 2]!);
        if (n === 2) {
          this.leafEdges[2 * l + sides++] = id;
          this.edgeLeaves[2 * id] ??= -1;
          this.edgeLeaves[2 * id + 1] ??= -1;
          const other = this.edgeLeaves[2 * id]!;
          if (other >= 0) this.edgeLeaves[2 * id + 1] = before(l, other) ? other : l;
          if (other < 0 || before(l, other)) this.edgeLeaves[2 * id] = l;
        }
        if (i === 0 && j === d && r !== (n === 2 ? 2 : 1)) (whole[id] ??= []).push(l);
        if (n === 3 && ((r === 0 && j === i + 2) || (r === 1 && i === 0 && j === 2)))
          (squares[id] ??= []).push(p[3 * i + 3]!, p[3 * i + 4]!, p[3 * i + 5]!);
      }
    }
    for (let id = 0; id < index.count; id++) {
      const o = 6 * id, e = index.ends;
      const members = whole[id], halves = squares[id];
      let ring: Ring | undefined;
      if (members) {
        for (const phase of n === 2 ? [0, 1] : [0, 2]) {
          const size = n === 2 ? 2 : phase === 0 ? 6 : 8;
          const some = members.filter((l) => (leaves.data[4 * l]! >> 8) % n === phase);
          if (some.length === size && !ring) ring = symmetric(this.wholeRing(t, leaves, some, p), e, o);
        }
      }
      if (!ring && halves) {
        const points = triples(halves), ya = points[0]!, yb = points.find((y) => compare(y, ya) !== 0);
        if (yb && points.every((y) => compare(y, ya) === 0 || compare(y, yb) === 0))
          ring = symmetric([ya, yb].sort(compare), e, o);
      }
      this.rings[id] = ring;
    }
  }

  private wholeRing(t: Tube, leaves: Ints, members: number[], p: Int32Array): number[][] {
    const { n } = t, list: number[][] = [];
    for (const l of members) {
      leafVertices(t, leaves, l, p);
      const d = n - ((leaves.data[4 * l]! >> 8) % n);
      for (let j = 1; j <= n; j++) if (j !== d) list.push([p[3 * j]!, p[3 * j + 1]!, p[3 * j + 2]!]);
    }
    list.sort(compare);
    return list.filter((_, i) => i % (n - 1) === 0);
  }
}

function triples(flat: number[]): number[][] {
  const list: number[][] = [];
  for (let i = 0; i < flat.length; i += 3) list.push(flat.slice(i, i + 3));
  return list;
}

const compare = (p: number[], q: number[]): number => p[0]! - q[0]! || p[1]! - q[1]! || p[2]! - q[2]!;

/** A ring if it lies symmetrically about the middle of the edge at `o` (5.7.2(4)). */
function symmetric(ring: number[][], e: Int32Array, o: number): Ring | undefined {
  const m = ring.length;
  for (let i = 0; i < m; i++) for (let a = 0; a < 3; a++) {
    if (ring[i]![a]! + ring[m - 1 - i]![a]! !== e[o + a]! + e[o + 3 + a]!) return undefined;
  }
  return Int32Array.from(ring.flat());
}
