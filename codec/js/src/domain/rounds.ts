/** Rounds in which vertices of a mesh of triangles are removed (10.8.1). */
import type { Meter } from "../errors.js";
import type { Complex } from "./complex.js";
import { turn } from "./integers.js";

/** A round: the vertices that it removed, in order, and their rings; `ends` has where each ring ends. */
export interface Round {
  vertices: number[];
  rings: number[];
  ends: number[];
}

/** Squared lengths are numbers where these are exact, else BigInt; both compare. */
type Square = number | bigint;

export class Rounds {
  readonly rounds: Round[] = [];
  /** Triangles of all rounds, three vertices each, counter-clockwise; rounds from and before which they are there. */
  readonly corners: number[];
  readonly born: number[];
  readonly died: number[] = [];
  private readonly across: number[];
  /** How many triangles a vertex has, one of them, and the last round that it was in a ring of. */
  private readonly uses: Int32Array;
  private readonly one: Int32Array;
  private readonly touched: Int32Array;
  private left: number[];
  private done = false;
  private readonly wide: boolean;

  constructor(private readonly mesh: Complex, private readonly meter: Meter) {
    const { V, T, positions, cells, neighbours } = mesh;
    meter.take(20 * V + 48 * T);
    meter.step(V + T);
    this.corners = Array.from(cells);
    this.across = Array.from(neighbours);
    this.born = new Array<number>(T).fill(0);
    this.uses = new Int32Array(V);
    this.one = new Int32Array(V).fill(-1);
    this.touched = new Int32Array(V).fill(-1);
    let far = 0;
    for (const x of positions) far = Math.max(far, Math.abs(x - positions[0]!), Math.abs(x - positions[1]!));
    this.wide = far >= 2 ** 25;
    for (let t = 0; t < T; t++) {
      const [a, b, c] = [this.corners[3 * t]!, this.corners[3 * t + 1]!, this.corners[3 * t + 2]!];
      if (this.turn(a, b, c) < 0) {
        [this.corners[3 * t + 1], this.corners[3 * t + 2]] = [c, b];
        const other = this.across[3 * t + 1]!;
        this.across[3 * t + 1] = this.across[3 * t + 2]!;
        this.across[3 * t + 2] = other;
      }
      for (const v of [a, b, c]) {
        this.uses[v]!++;
        this.one[v] = t;
      }
    }
    const key = (v: number): number => Math.imul(v, 2654435761) >>> 0;
    this.left = Array.from({ length: V }, (_, v) => v).filter((v) => this.uses[v]).sort((p, q) => key(p) - key(q) || p - q);
  }

  /** Make rounds until there are `count`; false if there are not so many. */
  make(count: number): boolean {
    while (!this.done && this.rounds.length < count) this.round();
    return this.rounds.length >= count;
  }

  private turn(a: number, b: number, c: number): number {
    const { positions: p } = this.mesh, x = p[2 * a]!, y = p[2 * a + 1]!;
    return turn(p[2 * b]! - x, p[2 * b + 1]! - y, p[2 * c]! - x, p[2 * c + 1]! - y);
  }

  /** The square of the distance of two vertices. */
  square(a: number, b: number): Square {
    const { positions: p } = this.mesh, x = p[2 * b]! - p[2 * a]!, y = p[2 * b + 1]! - p[2 * a + 1]!;
    return this.wide ? BigInt(x) * BigInt(x) + BigInt(y) * BigInt(y) : x * x + y * y;
  }

  private round(): void {
    const { meter, touched } = this, number = this.rounds.length, round: Round = { vertices: [], rings: [], ends: [] };
    meter.step(this.left.length);
    const kept: number[] = [];
    for (const v of this.left) {
      const fan = touched[v] === number ? undefined : this.fan(v);
      const cut = fan && this.cut(fan.map((t) => this.corners[3 * t + this.slot(t, v, 1)]!));
      if (!cut) {
        kept.push(v);
        continue;
      }
      this.remove(v, fan!, cut, number);
      round.vertices.push(v);
      const ring = fan!.map((t) => this.corners[3 * t + this.slot(t, v, 1)]!), low = ring.indexOf(Math.min(...ring));
      for (let i = 0; i < ring.length; i++) {
        const u = ring[(low + i) % ring.length]!;
        round.rings.push(u);
        touched[u] = number;
      }
      round.ends.push(round.rings.length);
    }
    this.done = round.vertices.length === 0;
    if (this.done) return;
    this.left = kept;
    this.rounds.push(round);
  }

  /** The place in triangle `t` of the vertex `by` places behind `v`. */
  private slot(t: number, v: number, by: number): number {
    const { corners } = this;
    return ((corners[3 * t] === v ? 0 : corners[3 * t + 1] === v ? 1 : 2) + by) % 3;
  }

  /** The triangles around an inner vertex with a ring of at most 8, counter-clockwise; undefined if it is not one. */
  private fan(v: number): number[] | undefined {
    const count = this.uses[v]!, start = this.one[v]!, fan: number[] = [];
    if (count < 3 || count > 8) return undefined;
    this.meter.step(1);
    let t = start;
    do {
      fan.push(t);
      // across the side from v to the third vertex: the one that lacks the second
      const next = this.across[3 * t + this.slot(t, v, 1)]!;
      if (next < 0 || this.corners[3 * next + this.slot(next, v, 1)] !== this.corners[3 * t + this.slot(t, v, 2)])
        return undefined;
      t = next;
    } while (t !== start && fan.length < count);
    return t === start && fan.length === count ? fan : undefined;
  }

  /** Triangles that a ring is cut into, three vertices each; undefined if it cannot be cut (10.8.1(5)). */
  private cut(ring: number[]): number[] | undefined {
    const low = ring.indexOf(Math.min(...ring)), left = [...ring.slice(low), ...ring.slice(0, low)], cut: number[] = [];
    while (left.length > 3) {
      let best = -1, line: Square = 0;
      for (let i = 0; i < left.length; i++) {
        const a = left[(i + left.length - 1) % left.length]!, b = left[i]!, c = left[(i + 1) % left.length]!;
        if (this.turn(a, b, c) <= 0) continue;
        if (left.some((p) => p !== a && p !== b && p !== c && this.turn(a, b, p) >= 0 && this.turn(b, c, p) >= 0 &&
          this.turn(c, a, p) >= 0)) continue;
        const length = this.square(a, c);
        if (best < 0 || length < line) [best, line] = [i, length];
      }
      if (best < 0) return undefined;
      cut.push(left[(best + left.length - 1) % left.length]!, left[best]!, left[(best + 1) % left.length]!);
      left.splice(best, 1);
    }
    if (this.turn(left[0]!, left[1]!, left[2]!) <= 0) return undefined;
    cut.push(...left);
    return cut;
  }

  /** Put the triangles `cut` into the place of those around `v`. */
  private remove(v: number, fan: number[], cut: number[], number: number): void {
    const { corners, across, uses, one, born, died } = this, open = new Map<string, number>();
    const side = (p: number, q: number): string => (p < q ? `${p} ${q}` : `${q} ${p}`);
    this.meter.take(48 * fan.length);
    for (const t of fan) {
      died[t] = number + 1;
      const at = this.slot(t, v, 0), behind = across[3 * t + at]!;
      const p = corners[3 * t + ((at + 1) % 3)]!, q = corners[3 * t + ((at + 2) % 3)]!;
      uses[p]!--;
      uses[q]!--;
      let face = -1;
      if (behind >= 0) for (let i = 0; i < 3; i++) if (across[3 * behind + i] === t) face = 3 * behind + i;
      open.set(side(p, q), face);
    }
    uses[v] = 0;
    for (let i = 0; i < cut.length; i += 3) {
      const t = born.length;
      born.push(number + 1);
      for (let j = 0; j < 3; j++) {
        const u = cut[i + j]!, key = side(cut[i + ((j + 1) % 3)]!, cut[i + ((j + 2) % 3)]!), other = open.get(key);
        corners.push(u);
        uses[u]!++;
        one[u] = t;
        if (other === undefined) {
          open.set(key, 3 * t + j);
          across.push(-1);
        } else if (other < 0) across.push(-1);
        else {
          across.push(Math.floor(other / 3));
          across[other] = t;
        }
      }
    }
  }

  /** The triangles that are there after `count` rounds. */
  triangles(count: number): number[] {
    const found: number[] = [];
    for (let t = 0; t < this.born.length; t++)
      if (this.born[t]! <= count && !(this.died[t]! <= count)) found.push(t);
    return found;
  }
}
