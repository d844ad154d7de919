/** The box and its root cube: levels, existence, clamping, diamonds at the border (clause 4). */
import { type Diamond, MIDDLE, type Phase, phases } from "./tables.js";

export class Grid {
  readonly n: number;
  readonly k: number;
  /** Level of the full grid. */
  readonly full: number;
  readonly last: [number, number, number];
  readonly phases: Phase[];

  constructor(readonly shape: readonly number[]) {
    this.n = shape.length;
    this.last = [shape[0]! - 1, shape[1]! - 1, (shape[2] ?? 1) - 1];
    let k = 0;
    while (2 ** k < Math.max(...shape) - 1) k++;
    this.k = k;
    this.full = this.n * k;
    this.phases = phases(this.n);
  }

  /** Edge of the cubes of a level. */
  edge(level: number): number {
    return 1 << (this.k - Math.floor(level / this.n));
  }

  /** Whether a simplex exists (4.6(3), (4)). */
  exists(level: number, cls: number, x: number, y: number, z: number): boolean {
    const c = this.edge(level), { low, high, off } = this.phases[level % this.n]!;
    const [lastX, lastY, lastZ] = this.last, i = 3 * cls;
    if (2 * x + low[i]! * c >= 0 && 2 * y + low[i + 1]! * c >= 0 && 2 * x + high[i]! * c <= 2 * lastX &&
      2 * y + high[i + 1]! * c <= 2 * lastY && (this.n === 2 ||
      (2 * z + low[i + 2]! * c >= 0 && 2 * z + high[i + 2]! * c <= 2 * lastZ))) return true;
    const bx = (2 * x) / c, by = (2 * y) / c, bz = (2 * z) / c;
    const capX = Math.ceil((2 * lastX) / c), capY = Math.ceil((2 * lastY) / c), capZ = Math.ceil((2 * lastZ) / c);
    const at = (j: number, b: number, cap: number): number => {
      const u = b + off[12 * cls + j]!;
      return u < 0 ? 0 : u > cap ? cap : u;
    };
    const x0 = at(0, bx, capX), y0 = at(1, by, capY);
    const ax = at(3, bx, capX) - x0, ay = at(4, by, capY) - y0, dx = at(6, bx, capX) - x0, dy = at(7, by, capY) - y0;
    if (this.n === 2) return ax * dy !== ay * dx;
    const z0 = at(2, bz, capZ), az = at(5, bz, capZ) - z0, dz = at(8, bz, capZ) - z0;
    const ex = at(9, bx, capX) - x0, ey = at(10, by, capY) - y0, ez = at(11, bz, capZ) - z0;
    return ax * (dy * ez - dz * ey) - ay * (dx * ez - dz * ex) + az * (dx * ey - dy * ex) !== 0;
  }

  /** Level of a lattice point of the root cube (4.7(1)). */
  levelOf(x: number, y: number, z: number): number {
    const all = x | y | z, size = 2 ** this.k;
    const low = all & -all;
    if (all === 0 || low >= size) return -1;
    const odd = ((x & low) !== 0 ? 1 : 0) + ((y & low) !== 0 ? 1 : 0) + ((z & low) !== 0 ? 1 : 0);
    return this.n * (this.k - (31 - Math.clz32(low))) - odd;
  }
}

/** The diamond of a middle: what the last call of `look` found. */
export class DiamondView {
  diamond!: Diamond;
  level = 0;
  edge = 0;
  /** The middle, and the corner of its period. */
  x = 0;
  y = 0;
  z = 0;
  bx = 0;
  by = 0;
  bz = 0;
  /** Whether all corners lie in the box, and all members exist. */
  inner = false;
  /** Members that exist, as bits, and their corners (4.6(6)). */
  members = 0;
  corners = 0;
  /** Places of the corners, clamped. */
  readonly cx = new Int32Array(10);
  readonly cy = new Int32Array(10);
  readonly cz = new Int32Array(10);

  constructor(readonly grid: Grid) {}

  look(level: number, x: number, y: number, z: number): void {
    const { grid } = this, n = grid.n, r = level % n, c = grid.edge(level), g = c / 2;
    const mx = (x / g) & 3, my = (y / g) & 3, mz = n === 2 ? 0 : (z / g) & 3;
    const d = (this.diamond = grid.phases[r]!.diamonds[16 * mx + 4 * my + mz]!);
    this.level = level;
    this.edge = c;
    this.x = x;
    this.y = y;
    this.z = z;
    const bx = (this.bx = x - mx * g), by = (this.by = y - my * g), bz = (this.bz = z - mz * g);
    const [lastX, lastY, lastZ] = grid.last;
    let inner = true;
    for (let i = 0; i < d.corners; i++) {
      const px = x + d.corner[3 * i]! * g, py = y + d.corner[3 * i + 1]! * g, pz = z + d.corner[3 * i + 2]! * g;
      const qx = px < 0 ? 0 : px > lastX ? lastX : px, qy = py < 0 ? 0 : py > lastY ? lastY : py;
      const qz = pz < 0 ? 0 : pz > lastZ ? lastZ : pz;
      if (qx !== px || qy !== py || qz !== pz) inner = false;
      this.cx[i] = qx;
      this.cy[i] = qy;
      this.cz[i] = qz;
    }
    this.inner = inner;
    this.members = (1 << d.members) - 1;
    this.corners = (1 << d.corners) - 1;
    if (inner) return;
    this.members = this.corners = 0;
    for (let m = 0; m < d.members; m++) {
      const s = 2 * c;
      if (grid.exists(level, d.cls[m]!, bx + s * d.shift[3 * m]!, by + s * d.shift[3 * m + 1]!,
        bz + s * d.shift[3 * m + 2]!)) {
        this.members |= 1 << m;
        this.corners |= d.mask[m]! & (MIDDLE - 1);
      }
    }
  }
}
