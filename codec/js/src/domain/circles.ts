/** Areas, ranks and circles of points of the plane with coordinates below `2**28` (10.5). */

const SAFE = 2 ** 53;

/** A number or, where it would not be exact, a BigInt; they compare with one another. */
export type Exact = number | bigint;

/** Positions of points, with the hashes that rank them. */
export class Points {
  readonly x: number[] = [];
  readonly y: number[] = [];
  private readonly hash: number[] = [];

  add(x: number, y: number): number {
    let h = (Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca77)) >>> 0;
    h = Math.imul(h ^ (h >>> 15), 0xc2b2ae3d);
    h = Math.imul(h ^ (h >>> 13), 0xc2b2ae3d);
    this.x.push(x);
    this.y.push(y);
    return this.hash.push((h ^ (h >>> 16)) >>> 0) - 1;
  }

  get count(): number {
    return this.x.length;
  }

  /** Negative if `a` is of lower rank than `b` (10.5.2(1)). */
  rank(a: number, b: number): number {
    return this.hash[a]! - this.hash[b]! || this.x[a]! - this.x[b]! || this.y[a]! - this.y[b]!;
  }

  /** Twice the area of a triangle, positive anticlockwise. */
  area(a: number, b: number, c: number): Exact {
    const { x, y } = this, p = (x[b]! - x[a]!) * (y[c]! - y[a]!), q = (y[b]! - y[a]!) * (x[c]! - x[a]!);
    if (Math.abs(p) + Math.abs(q) < SAFE) return p - q;
    return BigInt(x[b]! - x[a]!) * BigInt(y[c]! - y[a]!) - BigInt(y[b]! - y[a]!) * BigInt(x[c]! - x[a]!);
  }

  /** Whether `d` lies in the circle through the anticlockwise triangle `a`, `b`, `c` (10.5.3). */
  inCircle(a: number, b: number, c: number, d: number): boolean {
    const { x, y } = this, xd = x[d]!, yd = y[d]!;
    const ua = x[a]! - xd, va = y[a]! - yd, ub = x[b]! - xd, vb = y[b]! - yd, uc = x[c]! - xd, vc = y[c]! - yd;
    const sa = ua * ua + va * va, sb = ub * ub + vb * vb, sc = uc * uc + vc * vc;
    const A = ub * vc - vb * uc, B = uc * va - vc * ua, C = ua * vb - va * ub;
    const D = sa * A + sb * B + sc * C;
    const most = sa * (Math.abs(ub * vc) + Math.abs(vb * uc)) + sb * (Math.abs(uc * va) + Math.abs(vc * ua)) +
      sc * (Math.abs(ua * vb) + Math.abs(va * ub));
    if (Math.abs(D) > most * 2 ** -48 || most < SAFE && D !== 0) return D > 0;
    if (most < SAFE) return this.raised([a, A], [b, B], [c, C], [d, -(A + B + C)]);
    const [Ua, Va, Ub, Vb, Uc, Vc] = [ua, va, ub, vb, uc, vc].map(BigInt) as [bigint, bigint, bigint, bigint, bigint, bigint];
    const a2 = Ub * Vc - Vb * Uc, b2 = Uc * Va - Vc * Ua, c2 = Ua * Vb - Va * Ub;
    const exact = (Ua * Ua + Va * Va) * a2 + (Ub * Ub + Vb * Vb) * b2 + (Uc * Uc + Vc * Vc) * c2;
    return exact ? exact > 0n : this.raised([a, a2], [b, b2], [c, c2], [d, -(a2 + b2 + c2)]);
  }

  /** What the weights of four points on a circle say (10.5.3(2)). */
  private raised(...weights: [number, Exact][]): boolean {
    let best = -1, weight: Exact = 0;
    for (const [p, w] of weights) if (w && (best < 0 || this.rank(p, best) < 0)) [best, weight] = [p, w];
    return weight > 0;
  }

  /** The corners of the convex hull of some points, anticlockwise from that of lowest rank; fewer than 3 on a line. */
  hull(points: readonly number[]): number[] {
    const { x, y } = this, order = [...points].sort((p, q) => x[p]! - x[q]! || y[p]! - y[q]!), hull: number[] = [];
    for (const list of [order, order.slice().reverse()]) {
      const from = hull.length;
      for (const p of list) {
        while (hull.length > from + 1 && this.area(hull[hull.length - 2]!, hull[hull.length - 1]!, p) <= 0) hull.pop();
        hull.push(p);
      }
      hull.pop();
    }
    let low = 0;
    hull.forEach((p, i) => {
      if (this.rank(p, hull[low]!) < 0) low = i;
    });
    return [...hull.slice(low), ...hull.slice(0, low)];
  }
}
