/** Bases: origin, components, localisation, traversal (5.3, 5.8.1 to 5.8.3, 5.9.4). */
import { COMPONENT, CURVE, FIRST, LEVEL, LEVEL_PATH, ORIGIN, PATH, ROOT, SEED, SURFACE } from "./models.js";
import { coordinates, places, sorted } from "./order.js";
import { Trail } from "./parabola.js";
import { EXPLICIT, KNOWN, OUT, SIGN, Ints } from "./store.js";
import type { Pass, Tube } from "./tube.js";

/** What kind of base. */
export const UNIFORM = 0, ADAPTIVE = 1, LEAVES = 2;

/** Simplices by their four numbers, for the marks of those visited. */
class Visited {
  private table = new Int32Array(64);
  constructor(private readonly t: Tube) {}

  private slot(key: number, x: number, y: number, z: number, table: Int32Array): number {
    let h = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca77) ^ Math.imul(z, 0xc2b2ae3d) ^ Math.imul(key, 0x27d4eb2f);
    h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
    h = Math.imul(h ^ (h >>> 12), 0x297a2d39);
    const mask = table.length - 1, d = this.t.leaves.data;
    let i = (h ^ (h >>> 15)) & mask;
    for (; table[i] !== 0; i = (i + 1) & mask) {
      const at = 4 * (table[i]! - 1);
      if (d[at] === key && d[at + 1] === x && d[at + 2] === y && d[at + 3] === z) break;
    }
    return i;
  }

  has(level: number, cls: number, x: number, y: number, z: number): boolean {
    return this.table[this.slot(256 * level + cls, x, y, z, this.table)] !== 0;
  }

  /** Mark the last leaf. */
  add(): void {
    const d = this.t.leaves.data, count = this.t.leaves.length / 4;
    if (2 * count > this.table.length) {
      const size = 4 * this.table.length;
      this.t.meter.take(4 * (size - this.table.length));
      this.table = new Int32Array(size);
      for (let i = 0; i < count - 1; i++) this.put(d, i);
    }
    this.put(d, count - 1);
  }

  private put(d: Int32Array, i: number): void {
    this.table[this.slot(d[4 * i]!, d[4 * i + 1]!, d[4 * i + 2]!, d[4 * i + 3]!, this.table)] = i + 1;
  }
}

/** Leaves as seeds: by level, by the order of their middles, of unit cells by that of their lowest corners, by their vertices (5.9.4(2)). */
function seedsOf({ leaves: { data: d, length }, grid, n }: Tube): Uint32Array {
  const count = length / 4, levels = new Uint32Array(count), at = new Int32Array(3 * count), sums = new Int32Array(3 * count);
  for (let i = 0; i < count; i++) {
    const level = (levels[i] = d[4 * i]! >> 8), cls = d[4 * i]! & 255, { middle, off } = grid.phases[level % n]!;
    const g = grid.edge(level) / 2;
    for (let a = 0; a < 3; a++) {
      const from = d[4 * i + 1 + a]!;
      at[3 * i + a] = Math.floor((from + middle[3 * cls + a]! * g) / Math.max(g, 1));
      for (let j = 0; j <= n; j++) sums[3 * i + a]! += from + off[12 * cls + 3 * j + a]! * g;
    }
  }
  return sorted(count, [levels, ...places(n, at), ...coordinates(sums)]);
}

export class Base {
  private readonly visited: Visited;
  /** Gates: level, class, period, vertex opposite, 1 if it was pushed from the first simplex. */
  private readonly stack: Ints;
  private readonly trail = new Trail();
  /** First leaf of the component, the last one visited, and whether the second branch has been taken (7.3(2)). */
  private first = 0;
  private turned = false;
  private history = 0;
  private before = 0;
  private seed = 0;
  /** Simplex in question: that behind a gate, or the one that localisation has come to. */
  private level = 0;
  private cls = 0;
  private x = 0;
  private y = 0;
  private z = 0;
  private o = 0;

  constructor(private readonly t: Tube, private readonly kind: number, level: number) {
    this.visited = new Visited(t);
    this.stack = new Ints(t.meter);
    t.uniform = t.base = kind === LEAVES ? t.lean!.uniform : level;
    t.hasBase = true;
    if (kind === ADAPTIVE) t.adapted = true;
    if (kind === LEAVES) {
      t.adapted = t.lean!.adapted;
      const { data, length } = t.lean!.explicit;
      for (let i = 0; i < length; i += 3) t.add({ list: [data[i]!, data[i + 1]!, data[i + 2]!] });
    }
  }

  *decode(): Pass {
    const { t } = this, { coder } = t;
    if (this.kind === LEAVES) yield* this.seeds();
    let bit: number;
    if (!(t.see(0, 0, 0) & KNOWN)) {
      const earlier = t.earlier(0, 0, 0);
      let sign = t.follows(earlier, 0, 0, 0);
      if (sign < 0) while ((sign = coder.bit(ORIGIN + (earlier < 0 ? 0 : 1 + (earlier & 1)))) < 0) yield;
      t.learn(0, 0, 0, sign);
    }
    let root = 0, before = false;
    const path = new Uint8Array(64);
    const roots = t.n === 2 ? 2 : 6;
    for (;;) {
      while ((bit = coder.bit(COMPONENT)) < 0) yield;
      if (bit === 0) break;
      let tight = before;
      const from = root;
      for (; root < roots - 1; root++) {
        while ((bit = coder.bit(ROOT)) < 0) yield;
        if (bit) break;
      }
      if (root !== from) tight = false;
      before = true;
      this.set(0, root, 0, 0, 0);
      for (let l = 0; ; l++) {
        if (this.kind === UNIFORM) {
          if (l === t.uniform) break;
        } else {
          const w = this.middle();
          let answer: number;
          while ((answer = this.ask(l, w[0], w[1], w[2], LEVEL_PATH + l, 0)) < 0) yield;
          if (!answer) break;
        }
        const left = this.childExists(0), right = this.childExists(1);
        if (!right) bit = 0;
        else if (!left || (tight && path[l] === 1)) bit = 1;
        else while ((bit = coder.bit(PATH + (tight ? 1 : 0))) < 0) yield;
        if (tight && bit !== path[l]) tight = false;
        path[l] = bit;
        this.child(bit);
      }
      if (!t.grid.exists(this.level, this.cls, this.x, this.y, this.z) ||
        this.visited.has(this.level, this.cls, this.x, this.y, this.z))
        throw this.t.meter.wrong("5.3.2", "a component begins where it cannot");
      yield* this.firstSigns();
      if (!this.mixed()) throw this.t.meter.wrong("5.3.3", "a component begins with a simplex of one sign");
      yield* this.traverse();
    }
    t.baseDone = true;
    t.changes++;
  }

  private set(level: number, cls: number, x: number, y: number, z: number): void {
    this.level = level;
    this.cls = cls;
    this.x = x;
    this.y = y;
    this.z = z;
  }

  private readonly point: [number, number, number] = [0, 0, 0];

  /** Vertex `j` of the simplex in question. */
  private vertex(j: number): [number, number, number] {
    const c = this.t.grid.edge(this.level), o = 12 * this.cls + 3 * j, { off } = this.t.grid.phases[this.level % this.t.n]!;
    const p = this.point;
    p[0] = this.x + (off[o]! * c) / 2;
    p[1] = this.y + (off[o + 1]! * c) / 2;
    p[2] = this.z + (off[o + 2]! * c) / 2;
    return p;
  }

  /** Middle of the simplex in question, below the full grid. */
  private middle(): [number, number, number] {
    const g = this.t.grid.edge(this.level) / 2, { middle } = this.t.grid.phases[this.level % this.t.n]!;
    const o = 3 * this.cls, p = this.point;
    p[0] = this.x + middle[o]! * g;
    p[1] = this.y + middle[o + 1]! * g;
    p[2] = this.z + middle[o + 2]! * g;
    return p;
  }

  private child(which: number): void {
    const phase = this.t.grid.phases[this.level % this.t.n]!, i = 2 * this.cls + which;
    const s = 2 * this.t.grid.edge(this.level + 1);
    this.x += s * phase.childShift[3 * i]!;
    this.y += s * phase.childShift[3 * i + 1]!;
    this.z += s * phase.childShift[3 * i + 2]!;
    this.cls = phase.child[i]!;
    this.level++;
  }

  private childExists(which: number): boolean {
    const { level, cls, x, y, z } = this;
    this.child(which);
    const there = this.t.grid.exists(this.level, this.cls, this.x, this.y, this.z);
    this.set(level, cls, x, y, z);
    return there;
  }

  private mixed(): boolean {
    let signs = 0;
    for (let j = 0; j <= this.t.n; j++) {
      const [x, y, z] = this.vertex(j);
      signs |= this.t.see(x, y, z) & SIGN ? 2 : 1;
    }
    return signs === 3;
  }

  /** Of the vertices: 1 if some is known and below, plus 2 if some is known and above; plus 4 for each unknown one. */
  private seen(): number {
    let signs = 0, unknown = 0;
    for (let j = 0; j <= this.t.n; j++) {
      const [x, y, z] = this.vertex(j), flags = this.t.see(x, y, z);
      if (flags & KNOWN) signs |= flags & SIGN ? 2 : 1;
      else unknown += 4;
    }
    return signs + unknown;
  }

  private *firstSigns(): Pass {
    const { t } = this;
    for (let j = 0; j <= t.n; j++) {
      const signs = this.seen(), [x, y, z] = this.vertex(j);
      if (t.see(x, y, z) & KNOWN) continue;
      let sign: number;
      if (signs >> 2 === 1 && (signs & 3) !== 3) sign = (signs & 3) === 1 ? 1 : 0;
      else {
        const earlier = t.earlier(x, y, z);
        sign = t.follows(earlier, x, y, z);
        const context = FIRST + ((earlier < 0 ? 0 : 1 + (earlier & 1)) * 2 + (j > 0 ? 1 : 0)) * 4 + (signs & 3);
        if (sign < 0) while ((sign = t.coder.bit(context)) < 0) yield;
      }
      const p = this.vertex(j);
      t.learn(p[0], p[1], p[2], sign);
    }
  }

  private *seeds(): Pass {
    const { t } = this, { data } = t.lean!.leaves;
    for (const row of seedsOf(t.lean!)) {
      const i = 4 * row;
      this.set(data[i]! >> 8, data[i]! & 255, data[i + 1]!, data[i + 2]!, data[i + 3]!);
      t.meter.step(4);
      for (let j = 0; j <= t.n; j++) {
        const signs = this.seen() & 3, [x, y, z] = this.vertex(j);
        if (t.see(x, y, z) & KNOWN) continue;
        const earlier = t.earlier(x, y, z);
        let sign = t.follows(earlier, x, y, z);
        if (sign < 0) {
          const context = SEED + ((earlier & 1) * 4 + signs) * 2 + this.seed;
          const seed = (): number => t.main ? t.main.seed(context, x, y, z, t.grid.edge(this.level), earlier) : t.coder.bit(context);
          while ((sign = seed()) < 0) yield;
          this.seed = sign;
        }
        t.learn(x, y, z, sign);
      }
      if (this.mixed() && !this.visited.has(this.level, this.cls, this.x, this.y, this.z)) yield* this.traverse();
    }
  }

  /** Whether a middle is in the mesh: 1 or 0, or -1 without the symbol (5.8.1(3)). `what` is that of 7.16. */
  private ask(level: number, x: number, y: number, z: number, context: number, what: number): number {
    const { t } = this;
    if (level < t.uniform) return 1;
    if (level === t.grid.full) return 0;
    const flags = t.store.get(x, y, z);
    if (flags & EXPLICIT) return 1;
    if (this.kind === LEAVES || flags & OUT) return 0;
    const found = t.ancestors(level, x, y, z);
    if (found) {
      const { list, ends } = found;
      for (let i = 3; i < list.length; i += 3) {
        if (!(t.store.get(list[i]!, list[i + 1]!, list[i + 2]!) & OUT)) continue;
        if (i >= ends[1]!) t.leave(x, y, z);
        return 0;
      }
    } else {
      t.leave(x, y, z);
      return 0;
    }
    const bit = t.main ? t.main.question(what, level, x, y, z, this.before, context) : t.coder.bit(context);
    if (bit < 0) return bit;
    this.before = 2 * (this.before & 1) + bit;
    if (bit) t.add(found);
    else t.leave(x, y, z);
    return bit;
  }

  /** Visit the simplex in question (5.3.4(1)). */
  private visit(): void {
    const { t, stack } = this, { level, cls, x, y, z } = this, { n, grid } = t, phase = grid.phases[level % n]!;
    t.leaves.add(level, cls, x, y, z);
    this.visited.add();
    const from = t.leaves.length / 4 - 1 === this.first ? 1 : 0;
    let signs = 0;
    for (let j = 0; j <= n; j++) {
      const p = this.vertex(j);
      if (t.see(p[0], p[1], p[2]) & SIGN) signs |= 1 << j;
    }
    const all = (2 << n) - 1, s = 2 * grid.edge(level);
    for (let i = 0; i <= n; i++) {
      const face = all & ~(1 << i);
      if ((signs & face) === 0 || (signs & face) === face) continue;
      const o = 4 * cls + i, other = phase.neighbour[o]!, sh = phase.neighbourShift;
      const nx = x + s * sh[3 * o]!, ny = y + s * sh[3 * o + 1]!, nz = z + s * sh[3 * o + 2]!;
      if (!grid.exists(level, other, nx, ny, nz) || this.visited.has(level, other, nx, ny, nz)) continue;
      stack.room(7);
      stack.data.set([level, other, nx, ny, nz, phase.opposite[o]!, from], stack.length);
      stack.length += 7;
    }
  }

  /** The leaf behind the gate on top becomes the simplex in question (5.8.3); -1 without a symbol that is needed. */
  private behind(): number {
    const { t, stack } = this, d = stack.data, at = stack.length - 7;
    this.set(d[at]!, d[at + 1]!, d[at + 2]!, d[at + 3]!, d[at + 4]!);
    const i = (this.o = d[at + 5]!);
    if (this.kind === UNIFORM) return 0;
    const l = this.level, r = l % t.n, phase = t.grid.phases[r]!;
    if (l > 0 && i === phase.newest) {
      const p = this.vertex(i);
      const answer = this.ask(l - 1, p[0], p[1], p[2], LEVEL + (2 * r + 1) * 4 + this.before, 1);
      if (answer === 0) {
        // the parent: its period has twice the edge after a whole number of halvings
        const s = 2 * t.grid.edge(l);
        const px = r === 0 ? (this.x / s) & 1 : 0, py = r === 0 ? (this.y / s) & 1 : 0;
        const pz = r === 0 ? (this.z / s) & 1 : 0;
        const key = 8 * this.cls + 4 * px + 2 * py + pz;
        this.o = phase.which[key] === 0 ? t.grid.phases[(l - 1) % t.n]!.tag : 0;
        this.set(l - 1, phase.parent[key]!, this.x - s * px, this.y - s * py, this.z - s * pz);
      }
      return answer;
    }
    if (i === 0 || i === phase.tag) {
      const p = l < t.grid.full ? this.middle() : this.point;
      const answer = this.ask(l, p[0], p[1], p[2], LEVEL + 2 * r * 4 + this.before, 2);
      if (answer === 1) {
        this.child(i === 0 ? 1 : 0);
        this.o = t.grid.phases[this.level % t.n]!.newest;
      }
      return answer;
    }
    return 0;
  }

  /** Of a point of the plane: 0 if it is not known, 1 if it has the sign, else 2. */
  private like(x: number, y: number, sign: number): number {
    const flags = this.t.see(x, y, 0);
    return flags & KNOWN ? ((flags & SIGN ? 1 : 0) === sign ? 1 : 2) : 0;
  }

  private *traverse(): Pass {
    const { t, stack, trail } = this, { n, coder, grid } = t;
    this.first = t.leaves.length / 4;
    this.turned = false;
    trail.clear();
    this.visit();
    while (stack.length) {
      while (this.behind() < 0) yield;
      const { level, cls, x, y, z, o } = this;
      if (this.visited.has(level, cls, x, y, z) || !grid.exists(level, cls, x, y, z)) {
        stack.length -= 7;
        continue;
      }
      if (this.kind === ADAPTIVE && level < grid.full) {
        const w = this.middle();
        t.leave(w[0], w[1], w[2]);
      }
      const [vx, vy, vz] = this.vertex(o), known = t.see(vx, vy, vz), r = level % n, c = grid.edge(level);
      const earlier = t.earlier(vx, vy, vz);
      let predicted: number, context: number, kase: number, gx = 0, gy = 0;
      if (n === 2) {
        if (!this.turned && stack.data[stack.length - 1] === 1 && t.leaves.length / 4 - 1 !== this.first) {
          this.turned = true;
          trail.turn();
        }
        const i = o === 0 ? 1 : 0, j = o === 2 ? 1 : 2;
        const [ix, iy] = this.vertex(i), signI = t.see(ix, iy, 0) & SIGN ? 1 : 0;
        const [jx, jy] = this.vertex(j);
        gx = ix + jx;
        gy = iy + jy;
        const result = trail.choose(c, gx, gy, vx + ix, vy + iy, vx + jx, vy + jy);
        predicted = result < 0 ? 1 - signI : signI;
        kase = 4 * Math.abs(result) + this.history;
        // the gate's end on the predicted edge, and the one with the predicted sign
        const [tx, ty, ex, ey] = result < 0 ? [ix, iy, jx, jy] : [jx, jy, ix, iy];
        const across = this.like(ex + tx - vx, ey + ty - vy, predicted) === 1 ? 1 : 0;
        const beyond = this.like(2 * ex - tx, 2 * ey - ty, predicted);
        const back = this.like(2 * ex - vx, 2 * ey - vy, predicted) === 1 ? 1 : 0;
        context = CURVE + (((2 * Math.abs(result) + trail.agree) * 2 + across) * 3 + beyond) * 2 + back;
      } else {
        let above = 0;
        for (let j = 0; j < 4; j++) {
          if (j === o) continue;
          const p = this.vertex(j);
          if (t.see(p[0], p[1], p[2]) & SIGN) above++;
        }
        const gate = above >= 2 ? 1 : 0;
        let total = 0;
        for (let a = 0; a < 3; a++) {
          for (let way = -c; way <= c; way += 2 * c) {
            const flags = t.see(vx + (a === 0 ? way : 0), vy + (a === 1 ? way : 0), vz + (a === 2 ? way : 0));
            if (flags & KNOWN) total += flags & SIGN ? 1 : -1;
          }
        }
        predicted = total > 0 ? 1 : total < 0 ? 0 : gate;
        const phase = grid.phases[r]!, f = 4 * cls + o, s = 2 * c, sh = phase.neighbourShift;
        const q = 12 * phase.neighbour[f]! + 3 * phase.opposite[f]!, off = phase.off;
        const back = t.see(x + s * sh[3 * f]! + (off[q]! * c) / 2, y + s * sh[3 * f + 1]! + (off[q + 1]! * c) / 2,
          z + s * sh[3 * f + 2]! + (off[q + 2]! * c) / 2);
        const behind = (back & (KNOWN | SIGN)) === (KNOWN | SIGN) ? 1 : 0;
        const votes = Math.min(Math.abs(total), 3);
        kase = votes * 4 + (gate === predicted ? 2 : 0) + (behind === predicted ? 1 : 0);
        context = SURFACE + (r * 4 + o) * 16 + kase;
      }
      let sign: number, bit: number;
      if (known & KNOWN) {
        sign = known & SIGN ? 1 : 0;
        coder.update(context, sign === predicted ? 1 : 0);
      } else {
        sign = t.follows(earlier, vx, vy, vz);
        if (sign < 0) {
          if (earlier >= 0) context += ((earlier & 1) === predicted ? 2 : 1) * (n === 2 ? 96 : 192);
          const at = [vx, vy, vz] as const;
          while ((bit = t.main ? t.main.sign(level, cls, x, y, z, o, predicted, kase, earlier, context, at) : coder.bit(context)) < 0)
            yield;
          this.history = 2 * (this.history & 1) + bit;
          sign = bit ? predicted : 1 - predicted;
        }
        t.learn(vx, vy, vz, sign);
      }
      if (n === 2) trail.push(gx, gy);
      stack.length -= 7;
      this.set(level, cls, x, y, z);
      this.visit();
    }
  }
}
