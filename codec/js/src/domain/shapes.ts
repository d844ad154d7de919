/** Shapes of cells between integer positions (10.8.2(3), (4)); all numbers are exact below `2**53`. */

/** The whole part of the root of a number below `2**52`, which is not rounded up to a whole one. */
export const root = (x: number): number => Math.floor(Math.sqrt(x));

/** `2**-s` for the least `s` for which `far >> s` is below `2**bits`. */
export function scaleOf(far: number, bits: number): number {
  const bound = 2 ** bits;
  let scale = 1;
  while (far * scale >= bound) scale /= 2;
  return scale;
}

/** Whether the determinant of three sides is positive, of differences of `far` at most, below `2**31`. */
function positive(x0: number, x1: number, x2: number, y0: number, y1: number, y2: number, z0: number, z1: number, z2: number,
                  far: number): boolean {
  const found = x0 * (y1 * z2 - y2 * z1) - x1 * (y0 * z2 - y2 * z0) + x2 * (y0 * z1 - y1 * z0);
  if (far < 65536 || Math.abs(found) > far * far * far * 2 ** -45) return found > 0;
  const [a, b, c, d, e, f, g, h, i] = [x0, x1, x2, y0, y1, y2, z0, z1, z2].map(BigInt) as
    [bigint, bigint, bigint, bigint, bigint, bigint, bigint, bigint, bigint];
  return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0n;
}

/** Whether a product of numbers below `2**31` is greater than another one. */
function greater(a: number, b: number, c: number, d: number): boolean {
  const x = a * b, y = c * d;
  if (Math.abs(x - y) > 4096 || Math.abs(x) < 2 ** 53 && Math.abs(y) < 2 ** 53) return x > y;
  return BigInt(a) * BigInt(b) > BigInt(c) * BigInt(d);
}

/** Whether the determinant of the cell at `c` of `cells` is positive, with three coordinates for each vertex. */
export function determinantIsPositive(p: Float64Array, n: number, cells: Int32Array, c: number): boolean {
  const side = (i: number, k: number): number => p[3 * cells[c + i]! + k]! - p[3 * cells[c]! + k]!;
  return n === 3 ? positive(side(1, 0), side(1, 1), side(1, 2), side(2, 0), side(2, 1), side(2, 2), side(3, 0), side(3, 1),
    side(3, 2), 2 ** 31) : greater(side(1, 0), side(2, 1), side(1, 1), side(2, 0));
}

export class Shapes {
  private readonly planar: boolean;

  constructor(private readonly p: Float64Array, n: number, d: number) {
    this.planar = n === 2 && d === 2;
  }

  private far(a: number, b: number, c: number, e: number): number {
    const { p } = this;
    let far = 0;
    for (let k = 0; k < 3; k++) {
      const x = p[3 * a + k]!;
      far = Math.max(far, Math.abs(p[3 * b + k]! - x), Math.abs(p[3 * c + k]! - x), Math.abs(p[3 * e + k]! - x));
    }
    return far;
  }

  /** The quality of a tetrahedron. */
  tetrahedron(a: number, b: number, c: number, e: number): number {
    const { p } = this, A = 3 * a, B = 3 * b, C = 3 * c, E = 3 * e;
    const u0 = p[B]! - p[A]!, u1 = p[B + 1]! - p[A + 1]!, u2 = p[B + 2]! - p[A + 2]!;
    const v0 = p[C]! - p[A]!, v1 = p[C + 1]! - p[A + 1]!, v2 = p[C + 2]! - p[A + 2]!;
    const w0 = p[E]! - p[A]!, w1 = p[E + 1]! - p[A + 1]!, w2 = p[E + 2]! - p[A + 2]!, far = this.far(a, b, c, e);
    if (!positive(u0, u1, u2, v0, v1, v2, w0, w1, w2, far)) return 0;
    const scale = scaleOf(far, 11);
    const x0 = Math.floor(u0 * scale), x1 = Math.floor(u1 * scale), x2 = Math.floor(u2 * scale);
    const y0 = Math.floor(v0 * scale), y1 = Math.floor(v1 * scale), y2 = Math.floor(v2 * scale);
    const z0 = Math.floor(w0 * scale), z1 = Math.floor(w1 * scale), z2 = Math.floor(w2 * scale);
    const D = x0 * (y1 * z2 - y2 * z1) - x1 * (y0 * z2 - y2 * z0) + x2 * (y0 * z1 - y1 * z0);
    const S = squares(x0, x1, x2) + squares(y0, y1, y2) + squares(z0, z1, z2) + squares(x0 - y0, x1 - y1, x2 - y2) +
      squares(x0 - z0, x1 - z1, x2 - z2) + squares(y0 - z0, y1 - z1, y2 - z2);
    return Math.max(Math.floor((Math.max(D, 0) * 131072) / Math.max(S * root(S), 1)), 1);
  }

  /** The quality of a triangle. */
  triangle(a: number, b: number, c: number): number {
    const { p, planar } = this, A = 3 * a, B = 3 * b, C = 3 * c;
    const u0 = p[B]! - p[A]!, u1 = p[B + 1]! - p[A + 1]!, v0 = p[C]! - p[A]!, v1 = p[C + 1]! - p[A + 1]!;
    if (planar && !greater(u0, v1, u1, v0)) return 0;
    const scale = scaleOf(this.far(a, b, c, c), 12);
    const x0 = Math.floor(u0 * scale), x1 = Math.floor(u1 * scale), x2 = Math.floor((p[B + 2]! - p[A + 2]!) * scale);
    const y0 = Math.floor(v0 * scale), y1 = Math.floor(v1 * scale), y2 = Math.floor((p[C + 2]! - p[A + 2]!) * scale);
    const area = root(squares(x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0));
    if (area === 0 && !planar) return 0;
    const S = squares(x0, x1, x2) + squares(y0, y1, y2) + squares(x0 - y0, x1 - y1, x2 - y2);
    return Math.max(Math.floor((area * 65536) / Math.max(S, 1)), 1);
  }

  /** Whether the triangle `x`, `y`, `v`, or the edge `x`, `v` if `y` is `x`, turns too far with `u` for `v`. */
  turns(v: number, u: number, x: number, y: number, limit: number): boolean {
    const { p } = this, scale = scaleOf(this.far(x, y, v, u), 10);
    const side = (w: number): [number, number, number] => [Math.floor((p[3 * w]! - p[3 * x]!) * scale),
      Math.floor((p[3 * w + 1]! - p[3 * x + 1]!) * scale), Math.floor((p[3 * w + 2]! - p[3 * x + 2]!) * scale)];
    let a = side(v), b = side(u);
    if (x !== y) {
      const [x0, x1, x2] = side(y);
      a = [x1 * a[2] - x2 * a[1], x2 * a[0] - x0 * a[2], x0 * a[1] - x1 * a[0]];
      b = [x1 * b[2] - x2 * b[1], x2 * b[0] - x0 * b[2], x0 * b[1] - x1 * b[0]];
    }
    const along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return along <= 0 || 100 * along < limit * root(squares(...a)) * root(squares(...b));
  }
}

const squares = (x: number, y: number, z: number): number => x * x + y * y + z * z;
