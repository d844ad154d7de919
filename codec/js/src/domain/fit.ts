/** A linear function through the heights of a ring (10.8.4); all numbers are exact below `2**53`. */
import { clip } from "./integers.js";
import { root, scaleOf } from "./shapes.js";

/** Vertices of a ring at most. */
const MOST = 256;

export class RingFit {
  /** Estimates of each vertex: height, trust, and tilt. */
  readonly height: Float64Array;
  readonly trust: Int32Array;
  readonly tilt: Int32Array;
  /** The ring, its vertices' weights and distances, and how many there are. */
  readonly ring = new Int32Array(MOST);
  readonly weight = new Float64Array(MOST);
  readonly distance = new Float64Array(MOST);
  count = 0;
  /** Units of positions that a shifted one has, the mean distance, `F` and `slope`. */
  unit = 1;
  far = 1;
  value = 0;
  slope = 0;
  private readonly mark: Int32Array;
  private readonly x = new Float64Array(3 * MOST);
  private readonly f = new Float64Array(MOST);
  private clock = 0;
  private total = 0;

  constructor(private readonly p: Float64Array, private readonly V: number) {
    this.height = new Float64Array(V);
    this.trust = new Int32Array(V);
    this.tilt = new Int32Array(V);
    this.mark = new Int32Array(V);
  }

  /** The weighted mean of numbers of the ring. */
  mean(of: Int32Array): number {
    let sum = 0;
    for (let i = 0; i < this.count; i++) sum += this.weight[i]! * of[this.ring[i]!]!;
    return Math.floor(sum / this.total);
  }

  /** The ring of `v`, of the faces from `from` to `to`, and the fit there. */
  make(v: number, faces: Int32Array, from: number, to: number): void {
    const { mark, ring, V, p, x, f, weight, distance } = this, clock = ++this.clock;
    let count = 0, extent = 0;
    for (let i = from; i < to; i++) {
      const u = faces[i]!;
      if (u === V || mark[u] === clock) continue;
      mark[u] = clock;
      ring[count++] = u;
      for (let k = 0; k < 3; k++) extent = Math.max(extent, Math.abs(p[3 * u + k]! - p[3 * v + k]!));
    }
    this.count = count;
    const scale = scaleOf(extent, 11);
    this.unit = 1 / scale;
    let near = Infinity, far = 0;
    for (let i = 0; i < count; i++) {
      let square = 0;
      for (let k = 0; k < 3; k++) {
        const one = (x[3 * i + k] = Math.floor((p[3 * ring[i]! + k]! - p[3 * v + k]!) * scale));
        square += one * one;
      }
      far += distance[i] = root(square);
      weight[i] = Math.max(square, 1);
      near = Math.min(near, weight[i]!);
      f[i] = clip(Math.floor(this.height[ring[i]!]! * 16 * scale), -32768, 32768);
    }
    this.far = Math.max(Math.floor(far / count), 1);
    this.solve(near);
  }

  private solve(near: number): void {
    const { count, x, f, weight, far } = this, mean = [0, 0, 0], C = [0, 0, 0, 0, 0, 0], c = [0, 0, 0];
    let total = 0, level = 0;
    for (let i = 0; i < count; i++) {
      const w = (weight[i] = Math.max(Math.floor((near * 1024) / weight[i]!), 1));
      total += w;
      level += w * f[i]!;
      for (let k = 0; k < 3; k++) mean[k]! += w * x[3 * i + k]!;
    }
    this.total = total;
    level = Math.floor(level / total);
    const m = mean.map((sum) => Math.floor(sum / total)) as [number, number, number];
    for (let i = 0; i < count; i++) {
      const w = weight[i]!, a = x[3 * i]! - m[0], b = x[3 * i + 1]! - m[1], d = x[3 * i + 2]! - m[2], h = f[i]! - level;
      [a * a, a * b, a * d, b * b, b * d, d * d].forEach((xx, j) => (C[j]! += w * xx));
      c[0]! += w * a * h;
      c[1]! += w * b * h;
      c[2]! += w * d * h;
    }
    const stiff = Math.floor((total * far * far) / 100) + 1;
    for (const j of [0, 3, 5]) C[j]! += stiff;
    const shift = scaleOf(Math.max(C[0]!, C[3]!, C[5]!), 13);
    const [xx, xy, xz, yy, yz, zz] = C.map((sum) => Math.floor(sum * shift)) as [number, number, number, number, number, number];
    const [p, q, r] = c.map((sum) => clip(Math.floor(sum * shift), -(2 ** 23), 2 ** 23)) as [number, number, number];
    const a00 = yy * zz - yz * yz, a01 = xz * yz - xy * zz, a02 = xy * yz - xz * yy;
    const a11 = xx * zz - xz * xz, a12 = xy * xz - xx * yz, a22 = xx * yy - xy * xy;
    const D = Math.max(Math.floor((xx * a00 + xy * a01 + xz * a02) / 1024), 1);
    const by = (u: number, v: number, w: number): number => clip(Math.floor((u * p + v * q + w * r) / D), -(2 ** 20), 2 ** 20);
    const b = [by(a00, a01, a02), by(a01, a11, a12), by(a02, a12, a22)] as const;
    this.slope = root(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
    this.value = level - Math.floor((b[0] * m[0] + b[1] * m[1] + b[2] * m[2]) / 1024);
  }
}
