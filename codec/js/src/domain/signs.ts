/** Signs told along the contour: components, gates, what lies behind (10.3). */
import type { Complex } from "./complex.js";
import type { Contour } from "./isovalue.js";
import { clip } from "./integers.js";
import { LAYERS, type Opinions } from "./models.js";

const { at: C, sets } = LAYERS;

/** Cells that have both signs and are found from one another; symbols come from a run, or all signs are known. */
export class Walk {
  private readonly visited: Uint8Array;
  private readonly estimate: Int32Array;
  private readonly leaves: Int32Array;
  private count = 0;
  private readonly gates: number[] = [];
  private past = 0;

  constructor(private readonly contour: Contour, private readonly mesh: Complex) {
    this.visited = new Uint8Array(mesh.T);
    this.estimate = new Int32Array(mesh.V);
    this.leaves = new Int32Array(mesh.T);
  }

  /** A layer of signs (10.3.1); `error` makes the error of a component that cannot be. */
  decode(o: Opinions, error: (what: string) => Error): Int32Array {
    const { mesh: { T }, visited } = this;
    for (let least = 0; least < T; ) {
      if (!o.coder.bit(C.COMPONENT)) break;
      const cell = o.plain(least, T);
      if (visited[cell]) throw error("a component begins in a cell that was visited");
      this.begin(cell, o);
      if (!this.mixed(cell)) throw error("a component begins with a cell of one sign");
      this.visit(cell);
      this.follow(o);
      least = cell + 1;
    }
    return this.leaves.slice(0, this.count);
  }

  /** Leaves of signs that are known (10.8.6). */
  find(): Int32Array {
    for (let cell = 0; cell < this.mesh.T; cell++) {
      if (this.visited[cell] || !this.mixed(cell)) continue;
      this.visit(cell);
      this.follow(undefined);
    }
    return this.leaves.slice(0, this.count);
  }

  private mixed(cell: number): boolean {
    const { mesh: { n, cells }, contour: { sign } } = this;
    let seen = 0;
    for (let i = 0; i <= n; i++) seen |= 1 << sign[cells[(n + 1) * cell + i]!]!;
    return (seen & 3) === 3;
  }

  /** Signs of the vertices of a component's first cell. */
  private begin(cell: number, o: Opinions): void {
    const { mesh: { n, cells }, contour, contour: { sign, given } } = this;
    for (let i = 0; i <= n; i++) {
      const v = cells[(n + 1) * cell + i]!;
      if (sign[v]! >= 0) continue;
      let k = 0, a = 0;
      for (let j = 0; j <= n; j++) {
        const s = sign[cells[(n + 1) * cell + j]!]!;
        if (s >= 0) k++;
        if (s > 0) a++;
      }
      let s = given ? given[v]! : -1;
      if (s < 0) s = k === n && (a === 0 || a === n) ? (a === 0 ? 1 : 0) : o.coder.bit(C.FIRST + 4 * k + a);
      contour.sign[v] = s;
      this.estimate[v] = s ? 1024 : -1024;
    }
  }

  private visit(cell: number): void {
    const { mesh: { n, cells, neighbours }, contour: { sign }, visited } = this, from = (n + 1) * cell;
    visited[cell] = 1;
    this.leaves[this.count++] = cell;
    for (let i = 0; i <= n; i++) {
      const other = neighbours[from + i]!;
      if (other < 0 || visited[other]) continue;
      let seen = 0;
      for (let j = 0; j <= n; j++) if (j !== i) seen |= 1 << sign[cells[from + j]!]!;
      if ((seen & 3) === 3) this.gates.push(from + i);
    }
  }

  private follow(o: Opinions | undefined): void {
    const { mesh: { n, cells, neighbours }, contour: { sign }, gates, visited } = this;
    for (let gate = gates.pop(); gate !== undefined; gate = gates.pop()) {
      const i = gate % (n + 1), L = (gate - i) / (n + 1), t = neighbours[gate]!;
      if (visited[t]) continue;
      for (let j = 0; o && j <= n; j++) {
        const v = cells[(n + 1) * t + j]!;
        if (sign[v]! < 0) this.behind(L, i, v, o);
      }
      this.visit(t);
    }
  }

  /** The sum over the star of `v` that `ring` is made of, of signs now or then. */
  private more(v: number, sign: Int8Array): number {
    const { mesh: { n, cells, first, stars }, contour: { mesh } } = this;
    let sum = 0;
    for (let j = first[v]!; j < first[v + 1]!; j++) {
      const from = (n + 1) * stars[j]!;
      for (let c = from; c <= from + n; c++) {
        const s = sign[cells[c]!]!;
        if (s >= 0) sum += 2 * s - 1;
      }
    }
    return clip(mesh.n === 3 ? sum >> 1 : sum, -4, 4);
  }

  /** The sign of `v` behind the gate (`L`, `i`) (10.3.3). */
  private behind(L: number, i: number, v: number, o: Opinions): void {
    const { mesh, mesh: { n, cells }, contour, contour: { sign, given, then }, estimate } = this;
    const f: number[] = [];
    for (let j = 0; j <= n; j++) f.push(estimate[cells[(n + 1) * L + j]!]!);
    const g = mesh.beyond(L, i, v, f), above = g > 0 ? 1 : 0, size = Math.min(Math.abs(g), 2048);
    const known = given ? given[v]! : -1;
    let bit: number;
    if (known >= 0) bit = known === above ? 1 : 0;
    else {
      const sure = Math.min(size >> 8, 7), more = this.more(v, sign), ring = above ? 4 + more : 4 - more;
      const turned = above ? this.past & 7 : 7 - (this.past & 7), left = sign[cells[(n + 1) * L + i]!]!;
      o.coder.meter.step(mesh.first[v + 1]! - mesh.first[v]!);
      o.context(C.SIGN_SURE + 3 * sure + (ring > 4 ? 2 : ring === 4 ? 1 : 0)).context(C.SIGN_RING + 9 * sure + ring)
        .context(C.SIGN_PAST + 2 * this.past + above)
        .context(C.SIGN_BOTH + 3 * (8 * ring + turned) + (sure > 3 ? 2 : left === above ? 1 : 0));
      if (then) {
        const was = this.more(v, then), x = 3 * (above ? 4 + was : 4 - was) + contour.was(v, above);
        o.context(C.SIGN_THEN + 27 * contour.agreed + x).context(C.SIGN_THEN_SURE + 27 * sure + x);
      }
      bit = o.bit(sets.SIGN + sure);
    }
    const s = bit ? above : 1 - above, near = bit ? Math.max(size, 307) : 307;
    contour.learn(v, s);
    estimate[v] = s ? near : -near;
    this.past = ((this.past << 1) & 63) | s;
  }
}
