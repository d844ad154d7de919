/** Rounds in which vertices of a mesh collapse into neighbours (10.8.1, 10.8.2). */
import type { Meter } from "../errors.js";
import type { Complex } from "./complex.js";
import { sha256 } from "./sha256.js";
import { determinantIsPositive, Shapes } from "./shapes.js";

/** A round: vertices that went, in order, their targets, and the faces of their nodes; `ends` has where each's end. */
export interface Round {
  vertices: Int32Array;
  targets: Int32Array;
  faces: Int32Array;
  ends: Int32Array;
}

/** The cells that are left after some rounds, `n + 1` vertices each, and the cells of the mesh that they came from. */
export interface Remaining {
  corners: Int32Array;
  source: Int32Array;
}

export class Hierarchy {
  readonly rounds: Round[] = [];
  /** Three coordinates of each vertex, from the least along each axis. */
  readonly positions: Float64Array;
  /** The cells of the mesh as they run here. */
  readonly real: Int32Array;
  private readonly m: number;
  private readonly cells: Int32Array;
  private readonly alive: Uint8Array;
  /** Lists of the places of each vertex in `cells`; -1 at their ends. */
  private readonly head: Int32Array;
  private readonly tail: Int32Array;
  private readonly following: Int32Array;
  private readonly degree: Int32Array;
  private readonly stays: Uint8Array;
  private readonly blocked: Int32Array;
  private readonly linked: Int32Array;
  private readonly edge: Int32Array;
  private readonly star: Int32Array;
  private readonly most: number;
  private readonly shapes: Shapes;
  private clock = 0;
  private around = 0;
  private limit = 97;
  private order: Int32Array;
  private there: number;
  private number = 0;
  private done = false;

  constructor(private readonly mesh: Complex, private readonly meter: Meter) {
    const { V, T, n, d, positions, cells, neighbours } = mesh, m = (this.m = n + 1);
    let open = 0;
    for (const other of neighbours) if (other < 0) open++;
    meter.take(64 * (V + 1) + (12 * m + 1) * (T + open));
    meter.step(V + T);
    const p = (this.positions = new Float64Array(3 * V));
    for (let k = 0; k < d; k++) {
      let least = Infinity;
      for (let v = 0; v < V; v++) least = Math.min(least, positions[d * v + k]!);
      for (let v = 0; v < V; v++) p[3 * v + k] = positions[d * v + k]! - least;
    }
    const real = (this.real = cells.slice()), all = (this.cells = new Int32Array(m * (T + open)));
    if (n === d) for (let t = 0; t < T; t++) {
      const last = m * t + n, swap = (): void => {
        [real[last - 1], real[last]] = [real[last]!, real[last - 1]!];
      };
      swap();
      // it was not negative
      if (!determinantIsPositive(p, n, real, m * t)) swap();
    }
    all.set(real);
    let at = m * T;
    for (let face = 0; face < m * T; face++) {
      if (neighbours[face]! >= 0) continue;
      const from = face - (face % m);
      for (let i = from; i < from + m; i++) if (i !== face) all[at++] = cells[i]!;
      all[at++] = V;
    }
    this.alive = new Uint8Array(T + open).fill(1);
    this.head = new Int32Array(V + 1).fill(-1);
    this.tail = new Int32Array(V + 1).fill(-1);
    this.following = new Int32Array(m * (T + open));
    this.degree = new Int32Array(V + 1);
    this.stays = new Uint8Array(V + 1);
    this.blocked = new Int32Array(V + 1).fill(-1);
    this.linked = new Int32Array(V + 1);
    this.edge = new Int32Array(V + 1);
    this.most = n === 2 ? 16 : 64;
    this.star = new Int32Array(this.most);
    this.shapes = new Shapes(p, n, d);
    for (let i = 0; i < all.length; i++) {
      this.append(all[i]!, i);
      this.degree[all[i]!]!++;
    }
    this.findStays();
    const key = (v: number): number => Math.imul(v, 2654435761) >>> 0;
    const used = Array.from({ length: V }, (_, v) => v).filter((v) => this.degree[v]);
    this.there = used.length;
    this.order = Int32Array.from(used.filter((v) => !this.stays[v]).sort((p, q) => key(p) - key(q)));
  }

  /** Make rounds until there are `count`; false if there are not so many. */
  make(count: number): boolean {
    while (!this.done && this.rounds.length < count) this.round();
    return this.rounds.length >= count;
  }

  /** The cells after `count` rounds. */
  remaining(count: number): Remaining {
    const { m, real, mesh: { V } } = this, stands = Int32Array.from({ length: V }, (_, v) => v);
    this.meter.take(4 * V);
    for (let r = count - 1; r >= 0; r--)
      this.rounds[r]!.vertices.forEach((v, i) => (stands[v] = stands[this.rounds[r]!.targets[i]!]!));
    const corners: number[] = [], source: number[] = [];
    for (let c = 0; c < real.length; c += m) {
      const own = Array.from(real.subarray(c, c + m), (v) => stands[v]!);
      if (new Set(own).size < m) continue;
      corners.push(...own);
      source.push(c / m);
    }
    return { corners: Int32Array.from(corners), source: Int32Array.from(source) };
  }

  /** The SHA-256 of all nodes (B.1(10)). */
  digest(): string {
    this.make(Infinity);
    const n = this.m - 1, numbers: number[] = [];
    for (const { vertices, targets, faces, ends } of this.rounds) {
      numbers.push(vertices.length);
      vertices.forEach((v, i) => {
        const from = ends[i - 1] ?? 0;
        numbers.push(v, targets[i]!, ends[i]! - from, ...faces.subarray(n * from, n * ends[i]!));
      });
    }
    const data = new DataView(new ArrayBuffer(8 * numbers.length));
    numbers.forEach((x, i) => data.setUint32(8 * i, x, true));
    return Array.from(sha256(new Uint8Array(data.buffer)), (x) => x.toString(16).padStart(2, "0")).join("");
  }

  private append(v: number, place: number): void {
    if (this.head[v]! < 0) this.head[v] = place;
    else this.following[this.tail[v]!] = place;
    this.tail[v] = place;
    this.following[place] = -1;
  }

  /** Vertices whose link is no circle or sphere (10.8.1(5)). */
  private findStays(): void {
    const { m, cells, head, following, degree, linked, mesh: { V } } = this, union = new Int32Array(V + 1);
    for (let v = 0; v < V; v++) {
      const mark = ++this.clock;
      let vertices = 0, parts = 0;
      for (let place = head[v]!; place >= 0; place = following[place]!) {
        const from = place - (place % m);
        let root = -1;
        for (let i = from; i < from + m; i++) {
          let u = cells[i]!;
          if (u === v) continue;
          if (linked[u] !== mark) {
            linked[u] = mark;
            union[u] = u;
            vertices++;
            parts++;
          }
          while (union[u] !== u) u = union[u] = union[union[u]!]!;
          if (root < 0) root = u;
          else if (u !== root) {
            union[u] = root;
            parts--;
          }
        }
      }
      this.stays[v] = parts !== 1 || (m === 3 ? vertices !== degree[v] : 2 * vertices !== degree[v]! + 4) ? 1 : 0;
    }
  }

  private round(): void {
    const { order, degree, blocked, meter, m } = this, vertices: number[] = [], targets: number[] = [], faces: number[] = [],
      ends: number[] = [], number = this.number++;
    meter.step(order.length);
    for (const v of order) {
      if (blocked[v] === number || degree[v]! > this.most) continue;
      const u = this.target(v);
      if (u < 0) continue;
      meter.take(4 * (m - 1) * degree[v]! + 16);
      vertices.push(v);
      targets.push(u);
      this.collapse(v, u, faces, number);
      ends.push(faces.length / (m - 1));
    }
    const gone = vertices.length, few = 16 * gone < this.there, end = this.limit === 70 && 64 * gone < this.there;
    if (gone) {
      this.rounds.push({ vertices: Int32Array.from(vertices), targets: Int32Array.from(targets),
        faces: Int32Array.from(faces), ends: Int32Array.from(ends) });
      this.order = order.filter((v) => degree[v]!);
    }
    this.there -= gone;
    this.done = this.there <= 64 || end;
    if (few) this.limit = 70;
  }

  private holds(t: number, v: number): boolean {
    const { cells, m } = this, c = m * t;
    return cells[c] === v || cells[c + 1] === v || cells[c + 2] === v || (m === 4 && cells[c + 3] === v);
  }

  /** Visit the cells of `v`, and forget those that have gone. */
  private visit(v: number, see: (t: number) => boolean): boolean {
    const { m, alive, head, tail, following } = this;
    let before = -1, looked = 0;
    for (let place = head[v]!; place >= 0; ) {
      const t = (place - (place % m)) / m, after = following[place]!;
      looked++;
      if (!alive[t]) {
        if (before < 0) head[v] = after;
        else following[before] = after;
        if (after < 0) tail[v] = before;
      } else {
        before = place;
        if (!see(t)) {
          this.meter.step(looked);
          return false;
        }
      }
      place = after;
    }
    this.meter.step(looked);
    return true;
  }

  /** The best allowed target of `v`, or -1. */
  private target(v: number): number {
    const { cells, m, linked, star, degree, mesh: { V } } = this, mark = (this.around = ++this.clock), found: number[] = [];
    let count = 0;
    this.visit(v, (t) => {
      star[count++] = t;
      for (let i = m * t; i < m * t + m; i++) {
        const u = cells[i]!;
        if (u === v || linked[u] === mark) continue;
        linked[u] = mark;
        if (u !== V) found.push(u);
      }
      return true;
    });
    star.subarray(0, count).sort();
    const border = linked[V] === mark;
    let best = 0, target = -1;
    for (const u of found) {
      if (degree[u]! > 4 * this.most || (border && !this.has(count, u, V, V))) continue;
      const quality = this.quality(count, v, u, best, target);
      if (quality > 0 && this.linksMeet(count, v, u)) [best, target] = [quality, u];
    }
    return target;
  }

  /** The least quality of the patch of `u`; -1 if it is not allowed by that, or not better than `best` of `target`. */
  private quality(count: number, v: number, u: number, best: number, target: number): number {
    const { star, cells, m, shapes, mesh: { T, d } } = this;
    let worst = Infinity;
    this.meter.step(count);
    for (let i = 0; i < count; i++) {
      const t = star[i]!, c = m * t;
      if (this.holds(t, u)) continue;
      if (t >= T) {
        if (this.turns(c, v, u, this.limit)) return -1;
        continue;
      }
      const p = cells[c]! === v ? u : cells[c]!, q = cells[c + 1]! === v ? u : cells[c + 1]!, r = cells[c + 2]! === v ? u : cells[c + 2]!;
      const found = m === 3 ? shapes.triangle(p, q, r) : shapes.tetrahedron(p, q, r, cells[c + 3]! === v ? u : cells[c + 3]!);
      if (found === 0 || found < best || (found === best && u > target)) return -1;
      if (m === 3 && d === 3 && this.turns(c, v, u, 70)) return -1;
      if (found < worst) worst = found;
    }
    return worst === Infinity ? -1 : worst;
  }

  /** Whether the face opposite the apex of the cell at `c`, or the triangle there, turns too far (10.8.2(4)). */
  private turns(c: number, v: number, u: number, limit: number): boolean {
    const { cells, m, mesh: { V } } = this;
    let x = -1, y = -1;
    for (let j = c; j < c + m; j++) {
      const one = cells[j]!;
      if (one === v || one === V) continue;
      y = x < 0 ? one : x;
      x = one;
    }
    return this.shapes.turns(v, u, x, y, limit);
  }

  /** Whether a cell of the star has three vertices. */
  private has(count: number, a: number, b: number, c: number): boolean {
    const { star } = this;
    for (let i = 0; i < count; i++) {
      const t = star[i]!;
      if (this.holds(t, a) && this.holds(t, b) && this.holds(t, c)) return true;
    }
    return false;
  }

  /** Whether what the links of `v` and `u` share is the link of their edge (10.8.2(2)). */
  private linksMeet(count: number, v: number, u: number): boolean {
    const { star, cells, m, linked, edge, around } = this, mark = ++this.clock, shared: number[] = [];
    for (let i = 0; i < count; i++)
      if (this.holds(star[i]!, u)) for (let j = 0; j < m; j++) edge[cells[m * star[i]! + j]!] = mark;
    return this.visit(u, (t) => {
      if (this.holds(t, v)) return true;
      shared.length = 0;
      for (let j = m * t; j < m * t + m; j++) {
        const x = cells[j]!;
        if (x === u || linked[x] !== around) continue;
        if (edge[x] !== mark) return false;
        shared.push(x);
      }
      if (shared.length < 2) return true;
      this.meter.step(count);
      for (let i = 0; i < shared.length; i++) for (let j = 0; j < i; j++) {
        const a = shared[i]!, b = shared[j]!;
        if (this.has(count, a, b, b) && (m === 3 || !this.has(count, u, a, b))) return false;
      }
      return shared.length < 3 || !this.has(count, shared[0]!, shared[1]!, shared[2]!);
    });
  }

  private collapse(v: number, u: number, faces: number[], number: number): void {
    const { star, cells, m, degree, blocked, alive } = this, count = degree[v]!;
    for (let i = 0; i < count; i++) {
      const t = star[i]!, goes = this.holds(t, u);
      for (let j = m * t; j < m * t + m; j++) {
        const x = cells[j]!;
        if (x !== v) {
          faces.push(x);
          blocked[x] = number;
          if (goes) degree[x]!--;
        } else if (!goes) {
          cells[j] = u;
          this.append(u, j);
          degree[u]!++;
        }
      }
      if (goes) alive[t] = 0;
    }
    degree[v] = 0;
    this.head[v] = -1;
  }
}
