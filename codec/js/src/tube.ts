/** The state of one isovalue (5.1): known vertices, the mesh, leaves; what follows from an earlier isovalue (5.9). */
import type { Coder } from "./coder.js";
import type { Meter } from "./errors.js";
import { DiamondView, type Grid } from "./grid.js";
import type { Mixing } from "./main/mixing.js";
import type { MainProfile } from "./main/profile.js";
import { Models, type Weighed } from "./models.js";
import type { Offsets } from "./offsets.js";
import type { Rounds } from "./refine.js";
import { type Shift, shiftOf } from "./shift.js";
import { EXPLICIT, Ints, KNOWN, OUT, SIGN, Store } from "./store.js";
import { MIDDLE } from "./tables.js";
import type { Values } from "./values.js";

/** A pass: yields whenever the symbol that it needs is not there. */
export type Pass = Generator<void, void, void>;

/** Whether samples are missing, once a mask is complete (5.10.2). */
export interface Missing {
  missing(x: number, y: number, z: number): boolean;
}

/** Leaves, four numbers each: `256 * level + class` and the corner of the period. */
export class Leaves extends Ints {
  add(level: number, cls: number, x: number, y: number, z: number): void {
    this.room(4);
    const d = this.data, i = this.length;
    d[i] = 256 * level + cls;
    d[i + 1] = x;
    d[i + 2] = y;
    d[i + 3] = z;
    this.length = i + 4;
  }
}

/** Bit from which the signs of what is known of a diamond stand. */
const SIGNS = 16;

/** A round that goes on (5.4). */
export interface Round {
  readonly level: number;
  /**
   * Active middles in order, four numbers each: the position; the corners and the middle that are known, as bits, and their
   * signs (`seen`), 0 before its turn and if it is kept.
   */
  readonly active: Ints;
  /** Entries of those that are coded. */
  coded: number;
  /** Leaves that it has made. */
  readonly next: Leaves;
}

/** Known corners and signs, inferred ones included, as a round notes them. */
export const seen = (known: number, signs: number): number => known | (signs << SIGNS);

export class Tube {
  readonly n: number;
  readonly store: Store;
  readonly view: DiamondView;
  /** Known vertices in the order in which they became known, three coordinates each. */
  readonly known: Ints;
  /** Explicit vertices, likewise. */
  readonly explicit: Ints;
  models: Models;
  uniform = -1;
  base = 0;
  /** Uniform level by complete layers, what annex B calls `level`. */
  shown = -1;
  adapted = false;
  leaves: Leaves;
  round: Round | undefined;
  baseDone = false;
  hasBase = false;
  /** Changes of the mesh, so that lists are made anew when they have to be. */
  changes = 0;
  values: Values | undefined;
  offsets: Offsets | undefined;
  rounds: Rounds | undefined;
  /** New components so far. */
  born = 0;
  calm = [3584, 3584];
  agreed = 3584;
  mask: Missing | undefined;
  readonly side: number;
  /** How many steps it lies above the isovalue that it leans on, where they are few enough. */
  readonly shift: Shift | undefined;
  /** What the main profile has beside. */
  readonly main: Mixing | undefined;
  private readonly marks: Ints;

  constructor(readonly grid: Grid, readonly meter: Meter, readonly coder: Coder, main: MainProfile | undefined,
              readonly isovalue: number, readonly scale: number | undefined, learned?: Weighed, public lean?: Tube, private readonly framed = false) {
    this.n = grid.n;
    this.store = new Store(meter, grid.n, grid.k);
    this.view = new DiamondView(grid);
    this.known = new Ints(meter);
    this.explicit = new Ints(meter, 0);
    this.marks = new Ints(meter, 0);
    this.leaves = new Leaves(meter);
    this.models = learned?.models ?? new Models(undefined);
    this.side = lean && isovalue > lean.isovalue ? 1 : -1;
    this.main = learned && main?.begin(this, framed, learned);
    if (lean && !framed) this.shift = shiftOf(isovalue, lean.isovalue, scale);
  }

  /** A copy that a round can be ended on. */
  copy(): Tube {
    // the vertices that become known on it are not listed
    const own: Partial<Tube> = { store: this.store.copy(), view: new DiamondView(this.grid), known: new Ints(this.meter) };
    return Object.assign(Object.create(Tube.prototype), this, own);
  }

  /** Forget what only further layers need: none will come. */
  finish(): void {
    this.lean = this.rounds = undefined;
    this.main?.finish();
  }

  get onFullGrid(): boolean {
    return this.uniform === this.grid.full;
  }

  /** Marks at the clamped image of a lattice point. */
  see(x: number, y: number, z: number): number {
    const [lastX, lastY, lastZ] = this.grid.last;
    return this.store.get(x < 0 ? 0 : x > lastX ? lastX : x, y < 0 ? 0 : y > lastY ? lastY : y,
      z < 0 ? 0 : z > lastZ ? lastZ : z);
  }

  /** A lattice point of the root cube becomes known, if it is not. */
  learn(x: number, y: number, z: number, sign: number): void {
    const [lastX, lastY, lastZ] = this.grid.last;
    const px = x > lastX ? lastX : x, py = y > lastY ? lastY : y, pz = z > lastZ ? lastZ : z;
    const at = this.store.make(px, py, pz), flags = this.store.flags;
    if (flags[at]! & KNOWN) return;
    flags[at]! |= KNOWN | (sign ? SIGN : 0);
    const known = this.known;
    known.room(3);
    known.data[known.length] = px;
    known.data[known.length + 1] = py;
    known.data[known.length + 2] = pz;
    known.length += 3;
    this.meter.vertex();
  }

  /** The sign of a lattice point that is known or follows in the mesh so far (5.5.4(3)). */
  infer(x: number, y: number, z: number): number {
    const B = this.base, { grid, n } = this, C = grid.edge(B);
    for (let steps = 1; ; steps++) {
      const flags = this.see(x, y, z);
      if (flags & KNOWN) {
        this.meter.step(steps);
        return flags & SIGN ? 1 : 0;
      }
      if ((steps & 1023) === 0) {
        this.meter.step(1024);
        steps = 0;
      }
      const all = x | y | z, u = all & -all;
      if (2 * u === C && grid.levelOf(x, y, z) < B) {
        if (x & u) x -= u;
        if (y & u) y -= u;
        if (z & u) z -= u;
      } else if (u < C && u !== 0) {
        const q = 3 * u;
        if (x & u) x += (x & q) === q ? u : -u;
        if (y & u) y += (y & q) === q ? u : -u;
        if (z & u) z += (z & q) === q ? u : -u;
      } else if (B % n > 0) {
        const v = C / 2;
        x += x > 0 ? -v : v;
        y += y > 0 ? -v : v;
        if (n === 3) z += z > 0 ? -v : v;
      } else if (x > 0) x -= C;
      else if (y > 0) y -= C;
      else z -= C;
    }
  }

  /** The earlier sign of a lattice point, plus 2 if something may follow from it; -1 if it is not known (5.9.3(1), 5.11). */
  earlier(x: number, y: number, z: number): number {
    const other = this.lean;
    if (!other) return -1;
    const [lastX, lastY, lastZ] = this.grid.last;
    x = x > lastX ? lastX : x;
    y = y > lastY ? lastY : y;
    z = z > lastZ ? lastZ : z;
    const flags = other.store.get(x, y, z);
    if (flags & KNOWN) return (flags & SIGN ? 1 : 0) + (this.framed ? 0 : 2);
    if (this.grid.levelOf(x, y, z) >= other.uniform) return -1;
    return other.infer(x, y, z) + (other.adapted || this.framed ? 0 : 2);
  }

  /** The sign that follows from the earlier isovalue, -1 if none does (5.9.3); `earlier` is that of the point. */
  follows(earlier: number, x: number, y: number, z: number): number {
    if (earlier < 2) return -1;
    const sign = earlier - 2;
    if (this.side === 1 && sign === 0) return 0;
    if (this.side === -1 && sign === 1) return 1;
    const range = this.bounds(x, y, z, sign);
    if (!range) return -1;
    if (range[0] > this.shift!.up) return 1;
    return range[1] <= this.shift!.down ? 0 : -1;
  }

  /** Offsets of the earlier isovalue that ours follow from (5.9.6). */
  get leanOffsets(): Offsets | undefined {
    return this.framed ? undefined : this.lean?.offsets;
  }

  /** `lo` and `hi` of 5.9.3(3) for a point that has a number at the earlier isovalue, and the bits missing there. */
  bounds(x: number, y: number, z: number, sign: number): [number, number, number] | undefined {
    const other = this.lean;
    if (!other?.values || this.shift === undefined) return undefined;
    const [lastX, lastY, lastZ] = this.grid.last;
    const id = other.values.id(x > lastX ? lastX : x, y > lastY ? lastY : y, z > lastZ ? lastZ : z);
    if (id < 0) return undefined;
    const missing = other.values.missing[id]!, number = other.values.number[id]!;
    if (missing >= (sign ? other.values.above : other.values.below)) return undefined;
    const a = number * 2 ** missing, b = (number + 1) * 2 ** missing - 1;
    return sign ? [a + 1, b + 1, missing] : [-b, -a, missing];
  }

  /** Put a lattice point into `E`. */
  private explain(x: number, y: number, z: number): void {
    const at = this.store.make(x, y, z);
    this.store.flags[at]! |= EXPLICIT;
    this.explicit.push(x);
    this.explicit.push(y);
    this.explicit.push(z);
  }

  /** Mark a lattice point as not in the mesh until the next adaptive layer begins. */
  leave(x: number, y: number, z: number): void {
    const at = this.store.make(x, y, z);
    if (!(this.store.flags[at]! & OUT)) this.marks.push(at);
    this.store.flags[at]! |= OUT;
  }

  forgetMarks(): void {
    const { data, length } = this.marks;
    for (let i = 0; i < length; i++) this.store.flags[data[i]!]! &= ~OUT;
    this.marks.length = 0;
  }

  /** Parents of a middle of a level above 0 (4.7(3)), three coordinates each, appended to `list`. */
  private parents(level: number, x: number, y: number, z: number, list: number[]): void {
    const { view, grid } = this, phase = grid.phases[level % this.n]!;
    view.look(level, x, y, z);
    const d = view.diamond, c = view.edge, from = list.length;
    for (let m = 0; m < d.members; m++) {
      if (!((view.members >> m) & 1)) continue;
      const o = 12 * d.cls[m]! + 3 * phase.newest;
      const px = view.bx + (4 * d.shift[3 * m]! + phase.off[o]!) * (c / 2);
      const py = view.by + (4 * d.shift[3 * m + 1]! + phase.off[o + 1]!) * (c / 2);
      const pz = view.bz + (4 * d.shift[3 * m + 2]! + phase.off[o + 2]!) * (c / 2);
      let there = false;
      for (let i = from; i < list.length; i += 3)
        there ||= list[i] === px && list[i + 1] === py && list[i + 2] === pz;
      if (!there) list.push(px, py, pz);
    }
  }

  /**
   * The ancestors of a middle that are not in the mesh, level by level downwards from its own, itself first; undefined
   * if it is too deep (4.7(6)). `ends` has the end of each generation in the list.
   */
  ancestors(level: number, x: number, y: number, z: number): { list: number[]; ends: number[] } | undefined {
    const list = [x, y, z], ends = [3], parents: number[] = [];
    let from = 0;
    for (let l = level; l > 0 && from < list.length; l--) {
      const to = list.length;
      if (l - 1 < this.uniform) break;
      for (let i = from; i < to; i += 3) {
        parents.length = 0;
        this.parents(l, list[i]!, list[i + 1]!, list[i + 2]!, parents);
        this.meter.step(32);
        for (let j = 0; j < parents.length; j += 3) {
          const px = parents[j]!, py = parents[j + 1]!, pz = parents[j + 2]!;
          if (this.store.get(px, py, pz) & EXPLICIT) continue;
          let there = false;
          for (let h = to; h < list.length; h += 3)
            there ||= list[h] === px && list[h + 1] === py && list[h + 2] === pz;
          if (!there) list.push(px, py, pz);
          if (list.length > 3 * 4096) return undefined;
        }
        if (((i - from) & 15) === 0) this.meter.step((list.length - to) >> 5);
      }
      from = to;
      ends.push(list.length);
    }
    return { list, ends };
  }

  /** Add a middle with all ancestors that `ancestors` found. */
  add(found: { list: number[] }): void {
    for (let i = 0; i < found.list.length; i += 3) this.explain(found.list[i]!, found.list[i + 1]!, found.list[i + 2]!);
    this.changes++;
  }

  /** Whether a middle is barred in a round of an adaptive layer (5.8.4(4)); what `add` takes, if not. */
  unbarred(level: number, x: number, y: number, z: number): { list: number[] } | undefined {
    const found = this.ancestors(level, x, y, z);
    if (!found) return undefined;
    const { list, ends } = found, { view } = this;
    for (let g = 1; g < ends.length; g++) {
      for (let i = ends[g - 1]!; i < ends[g]!; i += 3) {
        view.look(level - g, list[i]!, list[i + 1]!, list[i + 2]!);
        const signs = this.cornerSigns();
        if ((signs & 3) === 3) return undefined;
      }
    }
    return found;
  }

  /** Of the corners of the diamond in `view`: 1 if some is known and below, plus 2 if some is known and above. */
  private cornerSigns(): number {
    const { view, store } = this;
    let signs = 0;
    for (let i = 0; i < view.diamond.corners; i++) {
      if (!((view.corners >> i) & 1)) continue;
      const flags = store.get(view.cx[i]!, view.cy[i]!, view.cz[i]!);
      if (flags & KNOWN) signs |= flags & SIGN ? 2 : 1;
    }
    return signs;
  }

  /** The known corners of the diamond in `view`, and those above, as bits. */
  corners(): { known: number; above: number } {
    const { view, store } = this, result = this.found;
    result.known = result.above = 0;
    for (let i = 0; i < view.diamond.corners; i++) {
      if (!((view.corners >> i) & 1)) continue;
      const flags = store.get(view.cx[i]!, view.cy[i]!, view.cz[i]!);
      if (flags & KNOWN) {
        result.known |= 1 << i;
        if (flags & SIGN) result.above |= 1 << i;
      }
    }
    return result;
  }
  private readonly found = { known: 0, above: 0 };

  /** Signs of the corners of the diamond in `view`; those that are not known have that of the anchor (5.4.3). */
  assumed(known: number, above: number): number {
    const { corners, diamond: { anchor } } = this.view;
    return (above >> anchor) & 1 ? above | (corners & ~known) : above;
  }

  /** Known corners of the diamond in `view` that are known at the earlier isovalue, which there is, with another sign (7.1(2)). */
  apart(known: number, above: number): number {
    const { view } = this, other = this.lean!;
    let count = 0;
    for (let i = 0; i < view.diamond.corners; i++) {
      if (!((known >> i) & 1)) continue;
      const flags = other.store.get(view.cx[i]!, view.cy[i]!, view.cz[i]!);
      if (flags & KNOWN && ((flags & SIGN) !== 0) !== (((above >> i) & 1) !== 0)) count++;
    }
    return count;
  }

  /**
   * Bisect the diamond in `view`, of which `known` corners and the middle are known, with the signs of `above`, inferred
   * ones included (5.4.3, 5.5.4). False if another one has given a corner another sign.
   */
  bisect(known: number, above: number, next: Leaves): boolean {
    const { view, grid, store } = this, d = view.diamond, level = view.level + 1, s = 2 * grid.edge(level);
    let agree = true;
    for (let child = 0; child < 2 * d.members; child++) {
      if (!((view.members >> (child >> 1)) & 1)) continue;
      const mask = d.childMask[child]!, signs = above & mask;
      if (signs === 0 || signs === mask) continue;
      const i = 3 * child;
      const x = view.bx + s * d.childShift[i]!, y = view.by + s * d.childShift[i + 1]!;
      const z = view.bz + s * d.childShift[i + 2]!, cls = d.childCls[child]!;
      if (!view.inner && !grid.exists(level, cls, x, y, z)) continue;
      for (let more = mask & ~known & (MIDDLE - 1); more; more &= more - 1) {
        const j = 31 - Math.clz32(more & -more), sign = (above >> j) & 1;
        this.learn(view.cx[j]!, view.cy[j]!, view.cz[j]!, sign);
        if ((store.get(view.cx[j]!, view.cy[j]!, view.cz[j]!) & SIGN ? 1 : 0) !== sign) agree = false;
        known |= 1 << j;
      }
      next.add(level, cls, x, y, z);
    }
    return agree;
  }

  /** Bisect the diamond of the active middle at entry `i`; as `bisect`. */
  bisectActive({ level, active: { data }, next }: Round, i: number): boolean {
    const found = data[i + 3]!;
    if (!found) return true;
    this.view.look(level, data[i]!, data[i + 1]!, data[i + 2]!);
    return this.bisect(found & ((1 << SIGNS) - 1), found >>> SIGNS, next);
  }
}
