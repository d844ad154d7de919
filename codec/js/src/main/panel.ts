/** What an isovalue sees of the one of the frame before, in the main profile (7.18). */
import { bits } from "../bits.js";
import type { Meter } from "../errors.js";
import type { Grid } from "../grid.js";
import { CONTEXTS } from "../models.js";
import { KNOWN, SIGN, type Store } from "../store.js";

/** Softened signs of the samples of a block: `near` of all, then `wide` of all. */
type Block = Uint8Array;

/** Signs of an isovalue that is complete, softened where it is known (7.18.1). */
class Softened {
  /** Signs of passed blocks, filled; undefined for others. */
  private readonly filled = new Map<number, Uint8Array | undefined>();
  private readonly blocks = new Map<number, Block>();
  private readonly s: number;
  private readonly edge: number;
  /** Samples of a block. */
  readonly size: number;

  constructor(private readonly store: Store, private readonly grid: Grid, private readonly meter: Meter) {
    this.s = grid.n === 2 ? 5 : 3;
    this.edge = 1 << this.s;
    this.size = this.edge ** grid.n;
  }

  /** The place of a position in its block. */
  inside(x: number, y: number, z: number): number {
    const m = this.edge - 1;
    return this.grid.n === 2 ? ((x & m) << 5) | (y & m) : ((x & m) << 6) | ((y & m) << 3) | (z & m);
  }

  /** The block of a position, undefined if it is not passed. */
  block(x: number, y: number, z: number): Block | undefined {
    const page = this.store.page(x, y, z);
    if (!page) return undefined;
    const old = this.blocks.get(page);
    if (old) return old;
    if (!this.fill(x, y, z)) return undefined;
    this.meter.take(2 * this.size);
    this.meter.step(4 * this.size);
    const made = this.smooth((x >> this.s) << this.s, (y >> this.s) << this.s, this.grid.n === 2 ? 0 : (z >> this.s) << this.s);
    this.blocks.set(page, made);
    return made;
  }

  /** Filling (7.18.1(2)): the signs of the block of a position, if it is passed. */
  private fill(px: number, py: number, pz: number): Uint8Array | undefined {
    const page = this.store.page(px, py, pz), { n, last } = this.grid, { edge } = this;
    if (!page || this.filled.has(page)) return this.filled.get(page);
    const bx = px & -edge, by = py & -edge, bz = n === 2 ? 0 : pz & -edge;
    const endX = Math.min(edge, last[0] + 1 - bx), endY = Math.min(edge, last[1] + 1 - by);
    const endZ = n === 2 ? 1 : Math.min(edge, last[2] + 1 - bz);
    const NONE = 2, signs = new Uint8Array(this.size).fill(NONE);
    let passed = false;
    const each = (visit: (at: number, x: number, y: number, z: number) => void): void => {
      for (let x = 0; x < endX; x++) for (let y = 0; y < endY; y++) for (let z = 0; z < endZ; z++)
        visit(this.inside(x, y, z), x, y, z);
    };
    each((at, x, y, z) => {
      const flags = this.store.get(bx + x, by + y, bz + z);
      if (!(flags & KNOWN)) return;
      passed = true;
      signs[at] = flags & SIGN ? 1 : 0;
    });
    if (passed) {
      const take = (at: number, x: number, y: number, z: number, way: number): void => {
        if (signs[at] !== NONE) return;
        if (n === 3 && z + way >= 0 && z + way < endZ) signs[at] = signs[this.inside(x, y, z + way)]!;
        if (signs[at] === NONE && y + way >= 0 && y + way < endY) signs[at] = signs[this.inside(x, y + way, z)]!;
        if (signs[at] === NONE && x + way >= 0 && x + way < endX) signs[at] = signs[this.inside(x + way, y, z)]!;
      };
      each((at, x, y, z) => take(at, x, y, z, -1));
      for (let x = endX - 1; x >= 0; x--) for (let y = endY - 1; y >= 0; y--) for (let z = endZ - 1; z >= 0; z--)
        take(this.inside(x, y, z), x, y, z, 1);
    }
    if (passed) this.meter.take(this.size);
    const found = passed ? signs : undefined;
    this.filled.set(page, found);
    return found;
  }

  /** Smoothing (7.18.1(3)) of the passed block that begins at a position. */
  private smooth(bx: number, by: number, bz: number): Block {
    const { grid, edge } = this, { n, last } = grid, REACH = 3, width = edge + 2 * REACH, depth = n === 2 ? 1 : width;
    const own = this.fill(bx, by, bz)!, into = (x: number, b: number): number => Math.min(Math.max(x, b), b + edge - 1);
    const clamp = (x: number, a: number): number => Math.min(Math.max(x, 0), last[a]!);
    let sum = new Float64Array(width * width * depth), other = new Float64Array(sum.length);
    let at = 0;
    for (let i = 0; i < width; i++) for (let j = 0; j < width; j++) for (let k = 0; k < depth; k++, at++) {
      const x = clamp(bx + i - REACH, 0), y = clamp(by + j - REACH, 1), z = n === 2 ? 0 : clamp(bz + k - REACH, 2);
      const there = this.fill(x, y, z);
      sum[at] = there ? there[this.inside(x, y, z)]!
        : own[this.inside(into(x, bx), into(y, by), n === 2 ? 0 : into(z, bz))]!;
    }
    const block = new Uint8Array(2 * this.size), strides = [width * depth, depth, 1];
    for (let round = 1; round <= REACH; round++) {
      for (let a = 0; a < n; a++) {
        // what lies at the ends of this list is wrong by one position more each round, and not looked at
        const by = strides[a]!;
        for (let i = by; i < sum.length - by; i++) other[i] = 2 * sum[i]! + sum[i - by]! + sum[i + by]!;
        [sum, other] = [other, sum];
      }
      if (round === 2) continue;
      const one = 4 ** (n * round), to = round === 1 ? 0 : this.size;
      for (let x = 0; x < edge; x++) for (let y = 0; y < edge; y++) for (let z = 0; z < (n === 2 ? 1 : edge); z++) {
        const from = (x + REACH) * strides[0]! + (y + REACH) * strides[1]! + (n === 2 ? 0 : z + REACH);
        block[to + this.inside(x, y, z)] = Math.floor((32 * sum[from]! + one / 2) / one);
      }
    }
    return block;
  }
}

/** Tuples of 7.18.2(2), four numbers each: the differences and what a contradiction counts. */
const tuples = [2, 3].map((n) => {
  const list: number[] = [];
  for (let x = -4; x <= 4; x++) for (let y = -4; y <= 4; y++) for (let z = n === 2 ? 0 : -4; z <= (n === 2 ? 0 : 4); z++) {
    const q = x * x + y * y + z * z;
    if (q > 0 && q <= 17) list.push(x, y, z, Math.floor(640 / (7 + 3 * q)));
  }
  return Int16Array.from(list);
});

/** First numbers of the lists. */
const LISTS = [3610, 330, 608, 6498, 1056, 608].reduce((from, many) => [...from, from[from.length - 1]! + many], [CONTEXTS]);

/** The panel of a symbol: what 7.18.2 sees of it, and its seven contexts. */
export class Panel {
  kind = 0;
  readonly contexts = new Int32Array(7);
  private level = 0;
  private margin = 0;
  private wideLevel = 0;
  private wideMargin = 0;
  private readonly softened: Softened;
  /** By level, what its signs nearby contradict less than one level lower does: `near`, then `wide`. */
  private readonly wrong = new Int32Array(2 * 36);

  /** `before` has what is known of the isovalue of the frame before, `now` of this one. */
  constructor(before: Store, private readonly now: Store, private readonly grid: Grid, meter: Meter) {
    this.softened = new Softened(before, grid, meter);
  }

  /**
   * Look at a vertex: `earlier` is its earlier sign, `target` what a 1 means, `c` the edge of the cubes of its level.
   */
  look(kind: number, x: number, y: number, z: number, c: number, earlier: number, target: number): void {
    const { grid, now, softened, wrong } = this, { last, n } = grid, step = Math.max(c / 2, 1), d = tuples[n - 2]!;
    const { size } = softened;
    x = Math.min(Math.max(x, 0), last[0]);
    y = Math.min(Math.max(y, 0), last[1]);
    z = Math.min(Math.max(z, 0), last[2]);
    wrong.fill(0);
    for (let i = 0; i < d.length; i += 4) {
      const ux = x + step * d[i]!, uy = y + step * d[i + 1]!, uz = z + step * d[i + 2]!;
      if (ux < 0 || uy < 0 || uz < 0 || ux > last[0] || uy > last[1] || uz > last[2]) continue;
      const flags = now.get(ux, uy, uz);
      if (!(flags & KNOWN)) continue;
      const block = softened.block(ux, uy, uz);
      if (!block) continue;
      const at = softened.inside(ux, uy, uz), by = d[i + 3]!;
      for (let list = 0; list < 2; list++) {
        // of a level above j this contradicts those that are below, up to j those that are above
        const near = 36 * list + block[at + list * size]! + 1;
        if (flags & SIGN) wrong[near]! += by;
        else {
          wrong[36 * list]! += by;
          wrong[near]! -= by;
        }
      }
    }
    const block = softened.block(x, y, z), at = softened.inside(x, y, z);
    this.kind = kind;
    for (let list = 0; list < 2; list++) {
      const level = block ? block[at + list * size]! : 32 * earlier;
      let above = Infinity, below = Infinity, sum = 0;
      for (let j = 0; j <= 33; j++) {
        sum += wrong[36 * list + j]!;
        const cost = sum + Math.abs(2 * j - 33);
        if (j <= level) above = Math.min(above, cost);
        else below = Math.min(below, cost);
      }
      const far = Math.min(bits(Math.abs(below - above) >> 3), 9);
      const margin = below > above === (target === 1) ? 9 + far : 9 - far, seen = target ? level : 32 - level;
      if (list) [this.wideLevel, this.wideMargin] = [seen, margin];
      else [this.level, this.margin] = [seen, margin];
    }
  }

  /** Set the contexts, with what the network or the context of a seed says. */
  choose(said: number): void {
    const { kind, level, margin, wideLevel, wideMargin, contexts } = this, half = kind & 1;
    const claim = Math.min((said + 2048) >> 8, 15);
    contexts[0] = LISTS[0]! + (kind * 19 + margin) * 19 + wideMargin;
    contexts[1] = LISTS[1]! + kind * 33 + level;
    contexts[2] = LISTS[2]! + (margin * 16 + claim) * 2 + half;
    contexts[3] = LISTS[3]! + ((margin * 9 + (level >> 2)) * 19 + wideMargin) * 2 + half;
    contexts[4] = LISTS[4]! + (level * 16 + claim) * 2 + half;
    contexts[5] = LISTS[5]! + (wideMargin * 16 + claim) * 2 + half;
    contexts[6] = LISTS[6]! + wideMargin * 33 + wideLevel;
  }
}
