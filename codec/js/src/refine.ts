/** Rounds of refinement, uniform and adaptive, and new components (5.4, 5.5, 5.8.4). */
import { BORDER, CONTINUE, CROSSED, HOLE, LEAF, SPLIT, TREE, TURNED } from "./models.js";
import { Trail } from "./parabola.js";
import { ADDED, EXPLICIT, KNOWN, NEW, OLD, OUT, SIGN } from "./store.js";
import { MIDDLE } from "./tables.js";
import { Leaves, type Pass, type Tube } from "./tube.js";

function popcount(x: number): number {
  let count = 0;
  for (; x; x &= x - 1) count++;
  return count;
}

export class Rounds {
  private readonly trail = new Trail();
  private next!: Leaves;
  private level = 0;
  private adaptive = false;
  private settled = 0;
  private histories = [0, 0];
  private splits = 0;
  /** Cubes of the round along each axis. */
  private cubes: [number, number, number] = [0, 0, 0];
  /** What `candidate` found of its slot: the middle, its nearness, its earlier sign. */
  private wx = 0;
  private wy = 0;
  private wz = 0;
  private nearness = 0;

  constructor(private readonly t: Tube) {}

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
    const { t } = this, { grid, view, store } = t;
    this.level = level;
    this.adaptive = adaptive;
    this.next = new Leaves(t.meter);
    t.settle(this.settled);
    this.settled = t.known.length;
    const round = (t.round = { level, next: this.next, turn: 0, adaptive });
    if (births) yield* this.components();
    this.histories = [0, 0];
    this.splits = 0;
    this.trail.clear();
    const leaves = t.leaves, phase = grid.phases[level % t.n]!, g = grid.edge(level) / 2;
    for (; round.turn < leaves.length; round.turn += 4) {
      const d = leaves.data, i = round.turn, key = d[i]!, bx = d[i + 1]!, by = d[i + 2]!, bz = d[i + 3]!;
      const cls = key & 255;
      t.meter.step(4);
      if (key >> 8 !== level) {
        this.next.add(key >> 8, cls, bx, by, bz);
        continue;
      }
      const x = bx + phase.middle[3 * cls]! * g, y = by + phase.middle[3 * cls + 1]! * g;
      const z = bz + phase.middle[3 * cls + 2]! * g;
      if (adaptive) {
        let marks = store.get(x, y, z);
        if (!(marks & (ADDED | OUT))) {
          const found = t.unbarred(level, x, y, z);
          if (!found) t.mark(x, y, z, OUT);
          else {
            let bit: number;
            while ((bit = this.split(x, y, z)) < 0) yield;
            if (bit) {
              t.add(found);
              t.mark(x, y, z, ADDED | (t.see(x, y, z) & KNOWN ? OLD : 0));
            } else t.mark(x, y, z, OUT);
          }
          marks = store.get(x, y, z);
        }
        if (marks & OUT) {
          this.next.add(level, cls, bx, by, bz);
          continue;
        }
        if (marks & OLD) {
          this.again(cls, x, y, z);
          continue;
        }
        if (t.see(x, y, z) & KNOWN) continue;
      } else {
        const marks = t.see(x, y, z);
        if (marks & NEW) continue;
        if (marks & KNOWN) {
          this.again(cls, x, y, z);
          continue;
        }
      }
      view.look(level, x, y, z);
      while (this.middle(x, y, z) < 0) yield;
    }
    t.leaves = this.next;
    t.round = undefined;
  }

  /** Sign of the middle of the diamond in `view`, and its bisection (5.4.3(3) to (5)). */
  private middle(x: number, y: number, z: number): number {
    const { t } = this, { view, coder, n } = t, level = this.level, r = level % n;
    const { known, above } = t.corners(), d = view.diamond;
    const earlier = t.earlier(x, y, z);
    let sign = t.follows(earlier, x, y, z);
    const first = above & 1, second = (above >> 1) & 1, crossed = first !== second;
    const assumed = crossed ? 0 : first;
    const signs = assumed ? above | (view.corners & ~known) : above;
    const ring = view.corners & ~3, size = popcount(ring), count = popcount(signs & ring);
    const [e0x, e0y, e1x, e1y] = [view.x + d.corner[0]! * (view.edge / 2), view.y + d.corner[1]! * (view.edge / 2),
      view.x + d.corner[3]! * (view.edge / 2), view.y + d.corner[4]! * (view.edge / 2)];
    const g = view.edge / 2;
    if (sign < 0) {
      const apart = t.lean && earlier >= 0 ? t.apart(known, above) : 0;
      let context: number, guess: number, said = 0, curve = -1, meaning: number;
      const history = this.histories[crossed ? 1 : 0]!, hole = t.missing(x, y, z);
      if (crossed) {
        const odd = Math.min(count, size - count);
        let kase = 0;
        if (n === 2) {
          kase = this.trail.choose(false, 2, (2 * x) / g, (2 * y) / g, (e0x + x) / g, (e0y + y) / g, (e1x + x) / g,
            (e1y + y) / g);
          if (kase) curve = kase < 0 ? 1 - first : first;
        }
        guess = 2 * count > size ? 1 : 2 * count < size ? 0 : kase ? curve : first;
        said = kase === 0 ? 0 : curve === guess ? 1 : 2;
        const b = earlier < 0 ? 0 : 1 + 2 * Math.min(apart, 2) + ((earlier & 1) === guess ? 1 : 0);
        context = CROSSED + (((b * 3 + r) * 10 + odd) * 3 + said) * 4 + history;
        if (hole) context = HOLE + 12 + 4 * said + Math.min(odd, 3);
        meaning = guess;
      } else {
        guess = first;
        const turned = first ? size - count : count;
        const b = earlier < 0 ? 0 : 1 + 2 * Math.min(apart, 2) + ((earlier & 1) === guess ? 1 : 0);
        context = BORDER + ((b * 3 + r) * 10 + turned) * 4 + history;
        if (hole) context = HOLE + 24 + turned;
        meaning = 1 - first;
      }
      const bit = t.main
        ? t.main.refinement(level, x, y, z, history, curve, [first, second], earlier, apart, context, meaning) : coder.bit(context);
      if (bit < 0) return bit;
      sign = bit ? meaning : 1 - meaning;
      this.histories[crossed ? 1 : 0] = 2 * (history & 1) + bit;
      const calm = t.calm, i = crossed ? 1 : 0;
      calm[i]! += ((sign === guess ? 4096 : 0) - calm[i]!) >> 5;
      if (earlier >= 0 && apart === 0) t.agreed += ((sign === (earlier & 1) ? 4096 : 0) - t.agreed) >> 5;
    }
    if (crossed && n === 2) {
      const px = ((sign === first ? e1x : e0x) + x) / g, py = ((sign === first ? e1y : e0y) + y) / g;
      const trail = this.trail;
      if (trail.length && (trail.lastX - px) ** 2 + (trail.lastY - py) ** 2 > 64) trail.clear();
      trail.push(px, py);
    }
    this.whole(x, y, z, sign, known, signs);
    return sign;
  }

  /** The middle becomes known, and all members are bisected (5.4.2). */
  private whole(x: number, y: number, z: number, sign: number, known: number, signs: number): void {
    const { t } = this, { view } = t;
    t.learn(x, y, z, sign);
    t.bisect(view.members, known | MIDDLE, sign ? signs | MIDDLE : signs, this.next);
  }

  /** A leaf whose middle was known before (5.4.4). */
  private again(cls: number, x: number, y: number, z: number): void {
    const { t } = this, { view } = t;
    view.look(this.level, x, y, z);
    const { known, above } = t.corners(), d = view.diamond;
    const assumed = (above & 3) === 3;
    const signs = assumed ? above | (view.corners & ~known) : above;
    const all = signs | (t.see(x, y, z) & SIGN ? MIDDLE : 0);
    let mixed = 0;
    for (let m = 0; m < d.members; m++) {
      const mask = d.mask[m]! & (MIDDLE - 1), s = signs & mask;
      if ((view.members >> m) & 1 && s !== 0 && s !== mask) mixed |= 1 << m;
    }
    const own = 1 << t.grid.phases[this.level % t.n]!.member[cls]!;
    let which = own;
    if ((mixed & -mixed) === own) {
      t.bisect(view.members & ~mixed, known | MIDDLE, all, this.next);
      which = own;
    }
    const after = t.corners();
    t.bisect(which, after.known | MIDDLE, all, this.next);
  }

  /** The symbol SPLIT (7.9(2)). */
  private split(x: number, y: number, z: number): number {
    const { t } = this, { view, coder } = t, level = this.level;
    view.look(level, x, y, z);
    const { above } = t.corners(), ring = view.corners & ~3, size = popcount(ring), count = popcount(above & ring);
    const crossed = (above & 1) !== ((above >> 1) & 1) ? 1 : 0, odd = Math.min(count, size - count, 3);
    const context = SPLIT + (((level % t.n) * 2 + crossed) * 4 + odd) * 8 + this.splits;
    const bit = t.main ? t.main.question(3, level, x, y, z, this.splits, context) : coder.bit(context);
    if (bit >= 0) this.splits = 2 * (this.splits & 3) + bit;
    return bit;
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
        const context = t.missing(x, y, z) ? HOLE + 36 + 2 * nearness + Math.min(hits, 1)
          : LEAF + ((1 + r) * 5 + nearness) * 3 + Math.min(hits, 2);
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
          while ((bit = t.coder.bit(TURNED)) < 0) yield;
          if (bit) sign = 1 - sign;
        }
      }
      if (this.adaptive) {
        t.add(t.ancestors(level, x, y, z)!);
        t.mark(x, y, z, ADDED);
        view.look(level, x, y, z);
      }
      t.born++;
      t.main?.born(x, y, z);
      this.whole(x, y, z, 1 - sign, known, sign ? view.corners : 0);
    }
  }
}
