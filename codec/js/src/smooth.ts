/** Points moved within the parts of their edges, so that a curve bends evenly (9.10). */
import type { Metadata } from "./metadata.js";

/** The rounds that a file asks for, 0 if it asks for none (3.7.2). */
export const roundsOf = ({ smoothing = "" }: Metadata): number =>
  (/^([1-9]|[1-5]\d|6[0-4])$/.test(smoothing) ? +smoothing : 0);

/**
 * For each point its edge's lower end, the way to the upper end (both `n` numbers), its place, and from where to where it
 * may go.
 */
export interface Ways {
  low: ArrayLike<number>;
  way: ArrayLike<number>;
  t: Float64Array;
  from: ArrayLike<number>;
  to: ArrayLike<number>;
}

/** Moves points in place; those whose way is 0 become the mean of their neighbours. */
export function smooth(n: number, points: Float64Array, cells: Uint32Array, ways: Ways, rounds: number): void {
  const { low, way, t, from, to } = ways, count = points.length / n, sums = (each: number) => new Float64Array(each * count);
  const near = sums(1), bend = sums(1), around = sums(1), mean = sums(n), normal = sums(n);
  /** Calls for each pair of neighbours, as often as they share a piece. */
  const each = (pair: (v: number, w: number) => void): void => {
    for (let i = 0; i < cells.length; i += n)
      for (let j = 0; j < n; j++) for (let k = 1; k < n; k++) pair(cells[i + j]!, cells[i + ((j + k) % n)]!);
  };
  each((v) => near[v]!++);
  for (; rounds > 0; rounds--) {
    for (const sum of [mean, normal, around]) sum.fill(0);
    each((v, w) => {
      for (let a = 0; a < n; a++) mean[n * v + a]! += points[n * w + a]! / near[v]!;
    });
    for (let i = 0; i < cells.length; i += n) {
      const side = (k: number, a: number): number => points[n * cells[i + k]! + a]! - points[n * cells[i]! + a]!;
      for (let a = 0; a < n; a++) {
        const b = (a + 1) % n, c = (a + 2) % n;
        const across = n === 2 ? (a ? side(1, 0) : -side(1, 1)) : side(1, b) * side(2, c) - side(1, c) * side(2, b);
        for (let k = 0; k < n; k++) normal[n * cells[i + k]! + a]! += across;
      }
    }
    for (let v = 0; v < count; v++) {
      let length = 0;
      bend[v] = 0;
      for (let a = n * v; a < n * v + n; a++) length += normal[a]! ** 2;
      for (let a = n * v; length && a < n * v + n; a++)
        bend[v]! += (normal[a]! /= Math.sqrt(length)) * (mean[a]! - points[a]!);
    }
    each((v, w) => (around[v]! += bend[w]! / near[v]!));
    for (let v = 0; v < count; v++) {
      if (near[v]! < 2) continue;
      let length = 0, across = 0;
      for (let a = n * v; a < n * v + n; a++) {
        length += way[a]! ** 2;
        across += way[a]! * normal[a]!;
      }
      if (across ** 2 > 1e-6 * length)
        t[v] = Math.min(to[v]!, Math.max(from[v]!, t[v]! + (bend[v]! - around[v]!) / across / 2));
      for (let a = n * v; a < n * v + n; a++) points[a] = length ? low[a]! + t[v]! * way[a]! : mean[a]!;
    }
  }
}
