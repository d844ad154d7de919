/** Where a curve goes on: extrapolation of points and choice between two edges (7.3.1). */

/** Weights of the stiff and of the free parabola by the number of points, with their denominators at the end. */
const ONWARD: Float64Array[] = [], FREE: Float64Array[] = [];

for (let m = 0; m <= 20; m++) {
  const onward = new Float64Array(m + 1);
  let s2 = 0, s3 = 0, s4 = 65536;
  for (let t = -m; t < 0; t++) {
    s2 += t * t;
    s3 += t * t * t;
    s4 += t * t * t * t;
  }
  for (let i = 0; i < m; i++) {
    const t = i - m;
    onward[i] = t * (s4 - s3 + (s2 - s3) * t);
  }
  onward[m] = s2 * s4 - s3 * s3;
  ONWARD.push(onward);
  // the gate's point is the last one of M; what comes before the first one has no weight
  const free = new Float64Array(m + 1), M = Math.min(m + 1, 20);
  for (let i = 0; i < M - 1; i++) free[m + 1 - M + i] = 3 * ((M - 1) * (M - 2) - (8 * M - 6) * i + 10 * i * i);
  free[m] = M * (M - 1) * (M - 2);
  FREE.push(free);
}

/** Up to 20 points, the last ones, and the first 20 since `clear`. */
export class Trail {
  private readonly x = new Float64Array(32);
  private readonly y = new Float64Array(32);
  private readonly firstX: number[] = [];
  private readonly firstY: number[] = [];
  private from = 0;
  length = 0;

  clear(): void {
    this.length = this.from = this.firstX.length = this.firstY.length = 0;
  }

  push(x: number, y: number): void {
    const at = (this.from + this.length) & 31;
    this.x[at] = x;
    this.y[at] = y;
    if (this.length < 20) this.length++;
    else this.from++;
    if (this.firstX.length < 20) {
      this.firstX.push(x);
      this.firstY.push(y);
    }
  }

  /** Replace all by the first 20 points since `clear`, in reverse order (7.3(2)). */
  turn(): void {
    const x = this.firstX.slice().reverse(), y = this.firstY.slice().reverse();
    this.clear();
    x.forEach((value, i) => this.push(value, y[i]!));
  }

  /** Whether the free parabola agrees with the case that `choose` returned last: 1 or 0. */
  agree = 0;

  /**
   * The case of 7.3.1(4): negative if A is nearer; sets `agree`. Differences are multiplied by 2 and divided by `unit`,
   * rounding down.
   */
  choose(unit: number, gx: number, gy: number, ax: number, ay: number, bx: number, by: number): number {
    const m = this.length;
    this.agree = 0;
    if (m < 1) return 0;
    const w = ONWARD[m]!, D = w[m]!, v = FREE[m]!;
    let aheadX = 0, aheadY = 0, freeX = 0, freeY = 0;
    for (let i = 0; i < m; i++) {
      const at = (this.from + i) & 31;
      const fx = Math.floor((2 * (this.x[at]! - gx)) / unit), fy = Math.floor((2 * (this.y[at]! - gy)) / unit);
      const x = fx < -1023 ? -1023 : fx > 1023 ? 1023 : fx, y = fy < -1023 ? -1023 : fy > 1023 ? 1023 : fy;
      aheadX += w[i]! * x;
      aheadY += w[i]! * y;
      freeX += v[i]! * x;
      freeY += v[i]! * y;
    }
    const toAx = Math.floor((2 * (ax - gx)) / unit), toAy = Math.floor((2 * (ay - gy)) / unit);
    const toBx = Math.floor((2 * (bx - gx)) / unit), toBy = Math.floor((2 * (by - gy)) / unit);
    const dx = toBx - toAx, dy = toBy - toAy, gap = toAx * toAx + toAy * toAy - toBx * toBx - toBy * toBy;
    const lead = 2 * (aheadX * dx + aheadY * dy) + D * gap;
    const free = 2 * (freeX * dx + freeY * dy) + v[m]! * gap;
    if (m > 1 && free > 0 === lead > 0) this.agree = 1;
    const span = D * (dx * dx + dy * dy), size = Math.abs(lead);
    const result = size >= span ? 3 : 2 * size >= span ? 2 : 1;
    return lead > 0 ? result : -result;
  }
}
