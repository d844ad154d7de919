/** Crossed edges of leaves, in the order in which they come (10.6). */
import type { Meter } from "../errors.js";
import type { Complex } from "./complex.js";

export class Crossings {
  /** The ends of each edge, the lower one first, and the leaf that it belongs to. */
  readonly low: number[] = [];
  readonly high: number[] = [];
  readonly leaf: number[] = [];
  private table = new Int32Array(64);

  constructor(mesh: Complex, leaves: ArrayLike<number>, sign: Int8Array, meter: Meter) {
    const { n, cells } = mesh;
    meter.take(16 * leaves.length);
    for (let l = 0; l < leaves.length; l++) {
      const from = (n + 1) * leaves[l]!;
      meter.step(4);
      for (let i = 0; i < n; i++) for (let j = i + 1; j <= n; j++) {
        const p = cells[from + i]!, q = cells[from + j]!;
        if (sign[p]! + sign[q]! === 1) this.add(Math.min(p, q), Math.max(p, q), leaves[l]!);
      }
    }
  }

  private slot(a: number, b: number): number {
    const { table, low, high } = this, mask = table.length - 1;
    let h = Math.imul(a, 0x9e3779b1) ^ Math.imul(b, 0x85ebca77);
    h = Math.imul(h ^ (h >>> 15), 0xc2b2ae3d);
    for (let i = (h ^ (h >>> 13)) & mask; ; i = (i + 1) & mask) {
      const id = table[i]! - 1;
      if (id < 0 || (low[id] === a && high[id] === b)) return i;
    }
  }

  private add(a: number, b: number, leaf: number): void {
    let at = this.slot(a, b);
    if (this.table[at]) return;
    if (2 * this.low.length >= this.table.length) {
      this.table = new Int32Array(2 * this.table.length);
      for (let id = 0; id < this.low.length; id++) this.table[this.slot(this.low[id]!, this.high[id]!)] = id + 1;
      at = this.slot(a, b);
    }
    this.low.push(a);
    this.high.push(b);
    this.leaf.push(leaf);
    this.table[at] = this.low.length;
  }

  /** The number of the edge between two vertices, -1 if it is none of these. */
  find(p: number, q: number): number {
    return this.table[this.slot(Math.min(p, q), Math.max(p, q))]! - 1;
  }

  get count(): number {
    return this.low.length;
  }
}
