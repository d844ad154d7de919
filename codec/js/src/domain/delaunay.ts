/** Delaunay triangulations that grow point by point (10.5.1). */
import type { Meter } from "../errors.js";
import type { Exact, Points } from "./circles.js";

/** Where a point lies: a triangle, or a side of it, `side` being the place of the vertex that it lacks. */
export interface Place {
  triangle: number;
  side: number;
}

export class Delaunay {
  /** Three vertices of each triangle, anticlockwise, and the triangle across the side that lacks each, or -1. */
  readonly corners: number[] = [];
  private readonly across: number[] = [];
  private last = 0;

  /** Begin with the corners of the convex hull, anticlockwise. */
  constructor(private readonly points: Points, hull: readonly number[], private readonly meter: Meter) {
    for (let i = 2; i < hull.length; i++) {
      const t = this.corners.length / 3;
      this.corners.push(hull[0]!, hull[i - 1]!, hull[i]!);
      this.across.push(-1, i + 1 < hull.length ? t + 1 : -1, i > 2 ? t - 1 : -1);
    }
    for (let t = 0; t < hull.length - 2; t++) this.legal(3 * t + 1);
  }

  get count(): number {
    return this.corners.length / 3;
  }

  /** Find the triangle or side that a point of the hull lies in. */
  find(p: number): Place {
    const { corners, across, points } = this;
    for (let t = this.last, turn = 0; ; turn++) {
      this.meter.step(1);
      let side = -1, out = -1;
      for (let i = 0; i < 3 && out < 0; i++) {
        const j = (i + turn) % 3, area = points.area(corners[3 * t + ((j + 1) % 3)]!, corners[3 * t + ((j + 2) % 3)]!, p);
        if (area < 0) out = j;
        else if (Number(area) === 0) side = j;
      }
      if (out < 0) return { triangle: (this.last = t), side };
      t = across[3 * t + out]!;
      if (t < 0) throw new RangeError("a point lies beyond the convex hull");
    }
  }

  /** What is seen from a point at a place: vertices and their weights (10.9.4(2)). */
  seen(p: number, { triangle: t, side }: Place): [number, Exact][] {
    const { corners, points, points: { x, y } } = this, [a, b, c] = corners.slice(3 * t, 3 * t + 3) as [number, number, number];
    if (side < 0) return [[a, points.area(b, c, p)], [b, points.area(c, a, p)], [c, points.area(a, b, p)]];
    const q = corners[3 * t + ((side + 1) % 3)]!, r = corners[3 * t + ((side + 2) % 3)]!;
    const axis = Math.abs(x[q]! - x[r]!) >= Math.abs(y[q]! - y[r]!) ? x : y;
    return [[q, Math.abs(axis[r]! - axis[p]!)], [r, Math.abs(axis[q]! - axis[p]!)]];
  }

  /** Put a point into the triangulation. */
  insert(p: number, { triangle: t, side }: Place): void {
    if (side < 0) this.split(t, p);
    else this.splitSide(t, side, p);
  }

  private set(t: number, corners: readonly number[], across: readonly number[]): void {
    for (let i = 0; i < 3; i++) {
      this.corners[3 * t + i] = corners[i]!;
      this.across[3 * t + i] = across[i]!;
    }
  }

  /** The triangle `t` lies across a side of `of`, where `was` did. */
  private join(of: number, was: number, t: number): void {
    if (of < 0) return;
    for (let i = 0; i < 3; i++) if (this.across[3 * of + i] === was) {
      this.across[3 * of + i] = t;
      return;
    }
  }

  private split(t: number, p: number): void {
    const [a, b, c] = this.corners.slice(3 * t, 3 * t + 3) as [number, number, number];
    const [A, B, C] = this.across.slice(3 * t, 3 * t + 3) as [number, number, number], u = this.count, v = u + 1;
    this.meter.take(48);
    this.set(t, [p, b, c], [A, u, v]);
    this.set(u, [p, c, a], [B, v, t]);
    this.set(v, [p, a, b], [C, t, u]);
    this.join(B, t, u);
    this.join(C, t, v);
    for (const each of [t, u, v]) this.legal(3 * each);
  }

  private splitSide(t: number, side: number, p: number): void {
    const { corners, across } = this, other = across[3 * t + side]!;
    const a = corners[3 * t + side]!, b = corners[3 * t + ((side + 1) % 3)]!, c = corners[3 * t + ((side + 2) % 3)]!;
    const B = across[3 * t + ((side + 1) % 3)]!, C = across[3 * t + ((side + 2) % 3)]!, u = this.count;
    this.meter.take(48);
    // t keeps the half with b, u takes that with c
    const grown = [t, u];
    this.set(u, [p, c, a], [B, t, -1]);
    this.set(t, [p, a, b], [C, -1, u]);
    this.join(B, t, u);
    if (other >= 0) {
      const i = [0, 1, 2].find((j) => across[3 * other + j] === t)!, v = this.count;
      const d = corners[3 * other + i]!, D = across[3 * other + ((i + 1) % 3)]!, E = across[3 * other + ((i + 2) % 3)]!;
      // other was d, c, b: it keeps the half with c, v takes that with b
      this.set(v, [p, b, d], [D, other, t]);
      this.set(other, [p, d, c], [E, u, v]);
      this.join(D, other, v);
      this.across[3 * t + 1] = v;
      this.across[3 * u + 2] = other;
      grown.push(other, v);
    }
    for (const each of grown) this.legal(3 * each);
  }

  /** Flip sides, from that of a face on, until all have circles without other points. */
  private legal(face: number): void {
    const { corners, across, points } = this, open = [face];
    for (let f = open.pop(); f !== undefined; f = open.pop()) {
      const t = Math.floor(f / 3), i = f % 3, other = across[f]!;
      this.meter.step(1);
      if (other < 0) continue;
      const j = [0, 1, 2].find((k) => across[3 * other + k] === t)!;
      const a = corners[f]!, b = corners[3 * t + ((i + 1) % 3)]!, c = corners[3 * t + ((i + 2) % 3)]!, d = corners[3 * other + j]!;
      if (!points.inCircle(a, b, c, d)) continue;
      const B = across[3 * t + ((i + 1) % 3)]!, C = across[3 * t + ((i + 2) % 3)]!;
      const D = across[3 * other + ((j + 1) % 3)]!, E = across[3 * other + ((j + 2) % 3)]!;
      // other is d, c, b: D lies across b-d, E across d-c
      this.set(t, [a, b, d], [D, other, C]);
      this.set(other, [a, d, c], [E, B, t]);
      this.join(D, other, t);
      this.join(B, t, other);
      open.push(3 * t, 3 * t + 2, 3 * other, 3 * other + 1);
    }
  }
}
