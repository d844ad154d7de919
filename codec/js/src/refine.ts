/** Rounds of refinement, uniform and adaptive, and new components (5.4, 5.5, 5.8.4). */
import { CONTINUE, LEAF, SIGN as SIGNS, SPLIT, TREE, CONTRARY } from "./models.js";
import { eachOnce } from "./order.js";
import { EXPLICIT, Ints, KNOWN, OUT, SIGN } from "./store.js";
import { MIDDLE } from "./tables.js";
import { Leaves, type Pass, type Round, seen, type Tube } from "./tube.js";

function popcount(x: number): number {
  let count = 0;
  for (; x; x &= x - 1) count++;
  return count;
}

/** From a middle to those of its level that are nearest before it, in units of `g`, three each, by axes less 2 and phase (7.9(2)). */
const BEFORE: readonly (readonly (readonly number[])[])[] = [2, 3].map((n) => {
  const straight: number[] = [], across: number[] = [];
  for (let a = 0; a < n; a++) {
    straight.push(...[0, 1, 2].map((i) => (i === a ? -2 : 0)));
    for (let b = a + 1; b < n; b++) for (const way of [-1, 1]) across.push(...[0, 1, 2].map((i) => (i === a ? -1 : i === b ? way : 0)));
  }
  return [straight, across, across];
});

export class Rounds {
  private readonly active: Ints;
  private next!: Leaves;
  private level = 0;
  private adaptive = false;
  /** Cubes of the round along each axis. */
  private cubes: [number, number, number] = [0, 0, 0];
  /** What `candidate` found of its slot: the middle, its nearness, its earlier sign. */
  private wx = 0;
  private wy = 0;
  private wz = 0;
  private nearness = 0;

  constructor(private readonly t: Tube) {
    this.active = new Ints(t.meter);
  }

  /** One uniform round (5.4). */
  *uniform(): Pass {
    yield* this.round(this.t.uniform, false, true);
    this.t.uniform++;
    this.t.changes++;
  }

  /** A layer of adaptive refinement (5.8.4). */
  *adapt(births: boolean): Pass {
    const { t } = this;
    t.adapted = true;
    t.forgetMarks();
    for (let level = t.uniform; level < t.grid.full; level++) {
      let bit: number;
      while ((bit = t.coder.bit(CONTINUE)) < 0) yield;
      if (!bit) break;
      yield* this.round(level, true, births);
    }
    t.changes++;
  }

  private *round(level: number, adaptive: boolean, births: boolean): Pass {
    const { t, active } = this, { view, store } = t;
    this.level = level;
    this.adaptive = adaptive;
    const next = (this.next = new Leaves(t.meter)), round: Round = (t.round = { level, active, coded: 0, next });
    active.length = 0;
    if (births) yield* this.components();
    this.activate();
    const { data } = active;
    for (; round.coded < active.length; round.coded += 4) {
      const x = data[round.coded]!, y = data[round.coded + 1]!, z = data[round.coded + 2]!;
      t.meter.step(4);
      if (adaptive) {
        if (!(store.get(x, y, z) & (EXPLICIT | OUT))) {
          const added = t.unbarred(level, x, y, z);
          let bit = 0;
          if (added) while ((bit = this.split(x, y, z)) < 0) yield;
          if (bit) t.add(added!);
          else t.leave(x, y, z);
        }
        if (store.get(x, y, z) & OUT) continue;
      }
      view.look(level, x, y, z);
      let found: number;
      while ((found = this.middle(x, y, z)) < 0) yield;
      data[round.coded + 3] = found;
    }
    this.corners(round);
    this.keep(next);
    t.leaves = next;
    t.round = undefined;
  }

  /** Middles of the leaves of the level become active (5.4.1). */
  private activate(): void {
    const { t, level, active } = this, { data: d, length } = t.leaves, { middle } = t.grid.phases[level % t.n]!;
    const shift = Math.log2(t.grid.edge(level) / 2), room = new Int32Array((3 * length) / 4);
    let count = 0;
    for (let i = 0; i < length; i += 4) {
      t.meter.step(4);
      if (d[i]! >> 8 !== level) continue;
      for (let a = 0; a < 3; a++) room[count++] = (d[i + 1 + a]! >> shift) + middle[3 * (d[i]! & 255) + a]!;
    }
    for (const row of eachOnce(t.n, room.subarray(0, count))) {
      for (let a = 0; a < 3; a++) active.push(room[3 * row + a]! << shift);
      active.push(0);
    }
  }

  /** A middle becomes known, if it is not: what is known of its diamond then, or -1 without the symbol (5.4.2). */
  private middle(x: number, y: number, z: number): number {
    const { t } = this, { view } = t, { known, above } = t.corners(), d = view.diamond, marks = t.see(x, y, z);
    const here = (above >> d.anchor) & 1, signs = t.assumed(known, above);
    let sign = marks & SIGN ? 1 : 0;
    if (!(marks & KNOWN)) {
      if ((sign = this.sign(x, y, z, known, above, here, signs)) < 0) return sign;
      t.learn(x, y, z, sign);
    }
    return seen(known | MIDDLE, sign ? signs | MIDDLE : signs);
  }

  /** Sign of the middle of the diamond in `view`: `here` is that of its anchor, `signs` are those of its corners (5.4.2). */
  private sign(x: number, y: number, z: number, known: number, above: number, here: number, signs: number): number {
    const { t } = this, { view, coder, n } = t, level = this.level, r = level % n, d = view.diamond;
    const earlier = t.earlier(x, y, z);
    let sign = t.follows(earlier, x, y, z);
    if (sign >= 0) return sign;
    const apart = t.lean && earlier >= 0 ? t.apart(known, above) : 0;
    const first = n === 2 ? above & 1 : here, other = first ? view.corners & ~signs : signs;
    const crossed = (n === 2 ? other >> 1 : other >> (1 - d.anchor)) & 1, ring = other >> 2;
    const size = d.corners - 2, count = popcount(ring), turned = crossed && 2 * count > size;
    const guess = turned ? 1 - first : first, meaning = crossed ? guess : 1 - first;
    const kind = n === 3 ? d.classes[(crossed << size) + ring]! : first === here ? count : 2 - count;
    const pattern = n === 2 ? this.pattern(x, y, first, ring) : kind + [0, 20, 29][r]!;
    const bank = earlier < 0 ? 0 : 1 + 2 * Math.min(apart, 2) + ((earlier & 1) === guess ? 1 : 0);
    const context = SIGNS + (7 * crossed + bank) * 80 + pattern;
    const corners = kind + crossed * (n === 2 ? 3 : [20, 9, 51][r]!);
    const bit = t.main ? t.main.refinement(level, x, y, z, crossed, corners, here, earlier, apart, context, meaning)
      : coder.bit(context);
    if (bit < 0) return bit;
    sign = bit ? meaning : 1 - meaning;
    const calm = t.calm;
    calm[crossed]! += ((sign === guess ? 4096 : 0) - calm[crossed]!) >> 5;
    if (earlier >= 0 && apart === 0) t.agreed += ((sign === (earlier & 1) ? 4096 : 0) - t.agreed) >> 5;
    return sign;
  }

  /** `pattern` of 7.6(2), with the signs of the ring that are not `first`, that of end 0. */
  private pattern(x: number, y: number, first: number, ring: number): number {
    const { t } = this, g = t.grid.edge(this.level) / 2, wx = x / g, wy = y / g;
    const other = (dx: number, dy: number): number => {
      const marks = t.see(x + dx * g, y + dy * g, 0);
      return marks & KNOWN && (marks & SIGN ? 1 : 0) !== first ? 1 : 0;
    };
    if (this.level % 2 === 0) return 16 * (((wx ^ wy) >> 1) & 1) + 8 * other(-2, 0) + 4 * other(0, -2) + ring;
    return 32 + 16 * (wx & 1) + 8 * other(-1, 1) + 4 * other(-1, -1) + ring;
  }

  /** The diamonds of the active middles are bisected (5.4.3). */
  private corners(round: Round): void {
    const { t } = this, { next } = round, before = next.length;
    for (let i = 0; i < round.coded; i += 4) {
      if (t.bisectActive(round, i)) continue;
      next.length = before;
      throw t.meter.wrong("5.4.3", "two diamonds give a corner different signs");
    }
  }

  /** Leaves of other levels stay, and those whose middle is kept. */
  private keep(next: Leaves): void {
    const { t, level, adaptive } = this, { data: d, length } = t.leaves, { middle } = t.grid.phases[level % t.n]!;
    const g = t.grid.edge(level) / 2;
    const kept = (cls: number, x: number, y: number, z: number): boolean =>
      (t.store.get(x + middle[3 * cls]! * g, y + middle[3 * cls + 1]! * g, z + middle[3 * cls + 2]! * g) & OUT) !== 0;
    for (let i = 0; i < length; i += 4) {
      const cls = d[i]! & 255, x = d[i + 1]!, y = d[i + 2]!, z = d[i + 3]!;
      if (d[i]! >> 8 !== level || (adaptive && kept(cls, x, y, z))) next.add(d[i]! >> 8, cls, x, y, z);
    }
  }

  /** The symbol SPLIT (7.9(2)). */
  private split(x: number, y: number, z: number): number {
    const { t } = this, { view, coder } = t, level = this.level;
    view.look(level, x, y, z);
    const { above } = t.corners(), ring = view.corners & ~3, size = popcount(ring), count = popcount(above & ring);
    const crossed = (above & 1) !== ((above >> 1) & 1) ? 1 : 0, odd = Math.min(count, size - count, 3), nearby = this.nearby(x, y, z);
    const context = SPLIT + (((level % t.n) * 2 + crossed) * 4 + odd) * 8 + nearby;
    return t.main ? t.main.question(3, level, x, y, z, nearby, context) : coder.bit(context);
  }

  /** `nearby` of 7.9(2). */
  private nearby(x: number, y: number, z: number): number {
    const { t: { n, store, grid }, level } = this, r = level % n, g = grid.edge(level) / 2, by = BEFORE[n - 2]![r]!;
    let total = 4;
    for (let i = 0; i < by.length; i += 3) {
      const px = x + by[i]! * g, py = y + by[i + 1]! * g, pz = z + by[i + 2]! * g;
      if (px < 0 || py < 0 || pz < 0 || ((px / g) & 1) + ((py / g) & 1) + ((pz / g) & 1) !== n - r) continue;
      const marks = store.get(px, py, pz);
      total += (marks & EXPLICIT ? 1 : 0) - (marks & OUT ? 1 : 0);
    }
    return Math.min(total, 7);
  }

  /** Slots of a cube (5.5.2); sets the middle of slot `i`. */
  private slot(qx: number, qy: number, qz: number, i: number): void {
    const { n } = this.t, r = this.level % n, g = this.t.grid.edge(this.level) / 2;
    let ox = 0, oy = 0, oz = 0;
    if (r === 0) ox = oy = oz = 1;
    else if (n - r === 1) {
      ox = i === 0 ? 1 : 0;
      oy = i === 1 ? 1 : 0;
      oz = i === 2 ? 1 : 0;
    } else {
      ox = i === 0 ? 0 : 1;
      oy = i === 1 ? 0 : 1;
      oz = i === 2 ? 0 : 1;
    }
    this.wx = (2 * qx + ox) * g;
    this.wy = (2 * qy + oy) * g;
    this.wz = n === 2 ? 0 : (2 * qz + oz) * g;
  }

  /** Whether a slot is a candidate (5.5.1). */
  private candidate(qx: number, qy: number, qz: number, i: number): boolean {
    const { t, level } = this, { view, store } = t;
    this.slot(qx, qy, qz, i);
    const x = this.wx, y = this.wy, z = this.wz;
    t.meter.step(4);
    if (t.see(x, y, z) & KNOWN) return false;
    if (store.get(x, y, z) & EXPLICIT) return false;
    view.look(level, x, y, z);
    if (!view.members) return false;
    const { known, above } = t.corners();
    if (above !== 0 && above !== known) return false;
    if (!view.inner) {
      const [lastX, lastY, lastZ] = t.grid.last;
      const px = Math.min(x, lastX), py = Math.min(y, lastY), pz = Math.min(z, lastZ);
      for (let j = 0; j < view.diamond.corners; j++) {
        if ((view.corners >> j) & 1 && view.cx[j] === px && view.cy[j] === py && view.cz[j] === pz) return false;
      }
    }
    const count = popcount(known), sign = above ? 1 : 0;
    this.nearness = Math.min(count + 1, 3) >> 1;
    if (count >= 3) this.nearness = 2;
    if (count) {
      const earlier = t.earlier(x, y, z);
      if (t.follows(earlier, x, y, z) === sign) return false;
      if (earlier >= 0 && (earlier & 1) !== sign) this.nearness += 2;
    }
    if (this.adaptive && level > t.uniform && !t.unbarred(level, x, y, z)) return false;
    return true;
  }

  private significance(context: number, height: number, root: boolean, child: number, hits: number, nearness: number,
                       qx: number, qy: number, qz: number): number {
    const { t: { main, coder }, level } = this;
    return main ? main.component(level, height, root, child, hits, nearness, qx, qy, qz, context) : coder.bit(context);
  }

  private *components(): Pass {
    const { t, level } = this, { last } = t.grid, c = t.grid.edge(level), r = level % t.n;
    const cubes = last.map((x) => Math.ceil(x / c) + (r > 0 ? 1 : 0)) as [number, number, number];
    if (t.n === 2) cubes[2] = 1;
    this.cubes = cubes;
    let h = 0;
    while (2 ** h < Math.max(...cubes.slice(0, t.n))) h++;
    t.main?.count();
    let bit: number;
    while ((bit = this.significance(TREE + 3 * h, h, true, 0, 0, 5, 0, 0, 0)) < 0) yield;
    if (bit) yield* h === 0 ? this.cube(0, 0, 0) : this.node(h, 0, 0, 0);
  }

  private *node(height: number, qx: number, qy: number, qz: number): Pass {
    const { t, cubes } = this, { n } = t, slots = this.level % n === 0 ? 1 : n, e = height - 1, last = (1 << n) - 1;
    let hits = 0;
    for (let i = 0; i <= last; i++) {
      const x = 2 * qx + ((i >> (n - 1)) & 1), y = 2 * qy + ((i >> (n - 2)) & 1), z = n === 2 ? 0 : 2 * qz + (i & 1);
      if (x * 2 ** e >= cubes[0] || y * 2 ** e >= cubes[1] || z * 2 ** e >= cubes[2]) continue;
      let nearness = 5, context = TREE + 3 * e + Math.min(hits, 2);
      if (e === 0) {
        nearness = -1;
        for (let j = 0; j < slots; j++) if (this.candidate(x, y, z, j)) nearness = Math.max(nearness, this.nearness);
        if (nearness < 0) continue;
        context = LEAF + nearness * 3 + Math.min(hits, 2);
      }
      let bit = 1;
      if (i < last || hits > 0)
        while ((bit = this.significance(context, e, false, i, hits, nearness, x, y, z)) < 0) yield;
      if (bit) {
        yield* e === 0 ? this.cube(x, y, z) : this.node(e, x, y, z);
        hits++;
      }
    }
  }

  private *cube(qx: number, qy: number, qz: number): Pass {
    const { t, level } = this, { n, view } = t, r = level % n, slots = r === 0 ? 1 : n;
    let hits = 0;
    for (let i = 0; i < slots; i++) {
      let later = hits > 0;
      for (let j = i + 1; j < slots && !later; j++) later = this.candidate(qx, qy, qz, j);
      if (!this.candidate(qx, qy, qz, i)) continue;
      const x = this.wx, y = this.wy, z = this.wz, nearness = this.nearness;
      if (later) {
        const context = LEAF + ((1 + r) * 5 + nearness) * 3 + Math.min(hits, 2);
        let bit: number;
        while ((bit = this.significance(context, -1, false, i, hits, nearness, qx, qy, qz)) < 0) yield;
        if (!bit) continue;
      }
      hits++;
      view.look(level, x, y, z);
      const { known, above } = t.corners();
      let sign = above ? 1 : 0;
      if (!known) {
        const j = view.corners & -view.corners, at = 3 * (31 - Math.clz32(j)), g = view.edge / 2, d = view.diamond;
        sign = t.infer(x + d.corner[at]! * g, y + d.corner[at + 1]! * g, z + d.corner[at + 2]! * g);
        if (t.adapted) {
          let bit: number;
          while ((bit = t.coder.bit(CONTRARY)) < 0) yield;
          if (bit) sign = 1 - sign;
        }
      }
      if (this.adaptive) {
        t.add(t.ancestors(level, x, y, z)!);
        view.look(level, x, y, z);
      }
      t.born++;
      t.main?.born(x, y, z);
      t.learn(x, y, z, 1 - sign);
      t.bisect(known | MIDDLE, sign ? view.corners : MIDDLE, this.next);
    }
  }
}
