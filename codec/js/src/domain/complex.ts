/** The cells of a mesh, what lies beside them, and what is linear in one (10.2, 10.4.2). */
import type { Meter } from "../errors.js";
import { mulDiv, rootOfSquares, shr, sumDiv } from "./integers.js";

export class Complex {
  /** Cells of each vertex: those of vertex `v` are `stars[first[v]] .. stars[first[v + 1] - 1]`, in ascending order. */
  readonly first: Int32Array;
  readonly stars: Int32Array;

  /**
   * `d` numbers of `positions` for each of `V` vertices, `n + 1` of `cells` for each of `T` cells; `neighbours` has the
   * cell across each face, or -1.
   */
  constructor(readonly d: number, readonly n: number, readonly V: number, readonly T: number,
              readonly positions: Float64Array, readonly cells: Int32Array, readonly neighbours: Int32Array, meter: Meter) {
    meter.take(4 * (V + 1 + cells.length));
    const first = (this.first = new Int32Array(V + 1)), stars = (this.stars = new Int32Array(cells.length));
    for (const v of cells) first[v + 1]!++;
    for (let v = 0; v < V; v++) first[v + 1]! += first[v]!;
    const at = first.slice(0, V);
    for (let i = 0; i < cells.length; i++) stars[at[cells[i]!]!++] = Math.floor(i / (n + 1));
  }

  /** Coordinate `k` of vertex `i` of a cell. */
  x(cell: number, i: number, k: number): number {
    return this.positions[this.d * this.cells[(this.n + 1) * cell + i]! + k]!;
  }

  /** `shift` of 10.4.2(1), with the vertex `v` unless it is negative. */
  shift(cell: number, v: number): number {
    const { n, d, positions } = this;
    let far = 0, shift = 0;
    for (let k = 0; k < d; k++) {
      const from = this.x(cell, 0, k);
      if (v >= 0) far = Math.max(far, Math.abs(positions[d * v + k]! - from));
      for (let i = 1; i <= n; i++) far = Math.max(far, Math.abs(this.x(cell, i, k) - from));
    }
    while (shr(far, shift) >= 8192) shift++;
    return shift;
  }

  /** What is linear in a cell, with the values `f` at its vertices, beyond its face `o` at the vertex `v` (10.4.2). */
  beyond(cell: number, o: number, v: number, f: ArrayLike<number>): number {
    const { n, d, positions } = this, m = n + 1, a = (o + 1) % m, b = (o + 2) % m, c = (o + 3) % m;
    const shift = this.shift(cell, v);
    const side = (i: number): [number, number, number] => {
      const s: [number, number, number] = [0, 0, 0];
      for (let k = 0; k < d; k++)
        s[k] = shr((i < 0 ? positions[d * v + k]! : this.x(cell, i, k)) - this.x(cell, a, k), shift);
      return s;
    };
    const toB = side(b), toL = side(o), toV = side(-1), fa = f[a]!, fb = f[b]!, fl = f[o]!;
    if (n === 2) {
      const B = dot(toB, toB), P = areaOf(toB, toV), Q = areaOf(toB, toL);
      const F = (x: number): number => fa + mulDiv(fb - fa, x, 1024);
      return F(ratio(dot(toV, toB), B)) + mulDiv(F(ratio(dot(toL, toB), B)) - fl, ratio(P, Q), 1024);
    }
    const toC = side(c), fc = f[c]!, W = determinant(toB, toC, toL);
    return fa + sumDiv([fb - fa, fc - fa, fl - fa],
      [ratio(determinant(toV, toC, toL), W), ratio(determinant(toB, toV, toL), W), ratio(determinant(toB, toC, toV), W)],
      1024);
  }
}

type Vector = readonly [number, number, number];

const dot = (u: Vector, v: Vector): number => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];

const determinant = (u: Vector, v: Vector, w: Vector): number => u[0] * (v[1] * w[2] - v[2] * w[1]) -
  u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]);

/** The whole part of the root of `uu * vv - uv * uv`, which is the sum of the squares of what follows. */
const areaOf = (u: Vector, v: Vector): number => rootOfSquares(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
  u[0] * v[1] - u[1] * v[0]);

/** `x * 1024 // y`, limited to -8192 .. 8192; 0 for `y = 0` (10.4.2(2)). */
function ratio(x: number, y: number): number {
  if (y === 0) return 0;
  if (Math.abs(x) > 9 * Math.abs(y)) return x < 0 === y < 0 ? 8192 : -8192;
  return Math.min(Math.max(mulDiv(x, 1024, y), -8192), 8192);
}

/** The cell across each face, -1 where there is none. */
export function neighboursOf(n: number, T: number, cells: Int32Array, meter: Meter): Int32Array {
  const m = n + 1, size = 2 ** Math.ceil(Math.log2(2 * m * T + 2));
  meter.take(4 * (size + m * T));
  const neighbours = new Int32Array(m * T).fill(-1), table = new Int32Array(size).fill(-1);
  const corners = (face: number): number[] => {
    const from = face - (face % m);
    return Array.from(cells.subarray(from, from + m)).filter((_, i) => from + i !== face).sort((p, q) => p - q);
  };
  for (let face = 0; face < m * T; face++) {
    const own = corners(face);
    let h = 0;
    for (const v of own) h = Math.imul(h ^ (h >>> 15) ^ v, 0x9e3779b1);
    for (let i = (h ^ (h >>> 15)) & (size - 1); ; i = (i + 1) & (size - 1)) {
      const other = table[i]!;
      if (other < 0) {
        table[i] = face;
        break;
      }
      if (neighbours[other]! >= 0 || !corners(other).every((v, j) => v === own[j])) continue;
      neighbours[face] = Math.floor(other / m);
      neighbours[other] = Math.floor(face / m);
      break;
    }
  }
  return neighbours;
}
