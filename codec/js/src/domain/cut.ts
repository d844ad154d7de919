/** Signs that come where the curve needs them (10.8.7). */
import type { Meter } from "../errors.js";
import { Complex, neighboursOf } from "./complex.js";
import type { Hierarchy } from "./hierarchy.js";
import type { Contour } from "./isovalue.js";
import { Levels } from "./levels.js";
import { LAYERS, type Opinions } from "./models.js";

const { at: C } = LAYERS;

/** The cells of the closed mesh that there are at any time, and all nodes, the first that went first. */
export class Cells {
  readonly nodes: number;
  readonly vertices: Int32Array;
  readonly targets: Int32Array;
  /** The faces of node `i` are those from `ends[i - 1]` to `ends[i]`, `n` vertices each. */
  readonly faces: Int32Array;
  readonly ends: Int32Array;
  /** Cells, `n + 1` vertices each, those of the mesh that they came from, and their makers, -1 for none. */
  readonly corners: number[] = [];
  readonly source: number[] = [];
  readonly maker: number[] = [];
  /** The node in whose patch each cell lies, -1 for none. */
  readonly breaker: number[] = [];
  /** The patch of each node. */
  readonly patches: number[][];

  constructor(mesh: Complex, { real, rounds }: Hierarchy, meter: Meter) {
    const { V, n, neighbours, cells } = mesh, m = n + 1, closed = Array.from(real);
    for (let face = 0; face < neighbours.length; face++) {
      if (neighbours[face]! >= 0) continue;
      const from = face - (face % m);
      for (let i = from; i < from + m; i++) if (i !== face) closed.push(cells[i]!);
      closed.push(V);
    }
    const joined = (parts: readonly Int32Array[]): Int32Array => {
      const all = new Int32Array(parts.reduce((sum, part) => sum + part.length, 0));
      let at = 0;
      for (const part of parts) {
        all.set(part, at);
        at += part.length;
      }
      return all;
    };
    const vertices = (this.vertices = joined(rounds.map((round) => round.vertices)));
    const targets = (this.targets = joined(rounds.map((round) => round.targets)));
    this.faces = joined(rounds.map((round) => round.faces));
    let faces = 0;
    this.ends = joined(rounds.map(({ ends }) => {
      const from = faces;
      faces += ends.at(-1)!;
      return ends.map((end) => from + end);
    }));
    const N = (this.nodes = vertices.length), gone = new Int32Array(V + 1).fill(N);
    vertices.forEach((v, i) => (gone[v] = i));
    // each face makes a cell of a patch at most
    meter.take((8 * m + 32) * (closed.length / m + faces) + 64 * N);
    meter.step(closed.length / m + faces);
    this.patches = Array.from({ length: N }, () => []);
    for (let c = 0; c < closed.length; c += m) {
      const own = closed.slice(c, c + m);
      for (let breaker = -1; ; ) {
        let node = N;
        for (const v of own) node = Math.min(node, gone[v]!);
        if (breaker >= 0) this.patches[breaker]!.push(this.source.length);
        this.corners.push(...own);
        this.source.push(c / m);
        this.maker.push(node < N ? node : -1);
        this.breaker.push(breaker);
        if (node === N || own.includes(targets[node]!)) break;
        own[own.indexOf(vertices[node]!)] = targets[node]!;
        breaker = node;
      }
    }
  }
}

export class Cut extends Levels {
  /** The cells of the mesh that those of the cut came from. */
  source: Int32Array = new Int32Array(0);
  private readonly inside: Uint8Array;
  private begun = false;

  constructor(contour: Contour, mesh: Complex, hierarchy: Hierarchy, private readonly all: Cells) {
    super(contour, mesh, hierarchy, hierarchy.rounds.length);
    this.inside = new Uint8Array(all.nodes);
  }

  /** A layer; returns the complex of the cut. */
  layer(o: Opinions): Complex {
    const { all, inside } = this, listed: number[] = [], unasked = new Uint8Array(all.nodes);
    o.coder.meter.step(all.source.length + all.nodes);
    if (!this.begun) this.coarse(o);
    this.begun = true;
    for (let i = all.nodes - 1; i >= 0; i--) if (!inside[i]) listed.push(i);
    for (const k of this.sought(o, C.UNASKED, listed.length)) unasked[listed[k]!] = 1;
    let last = 0;
    for (let i = all.nodes - 1; i >= 0; i--) {
      if (inside[i]) continue;
      let comes = unasked[i]!;
      if (!comes && this.crossed(i)) {
        const needs = this.needed(i) >= 0 ? 2 : 0;
        comes = last = o.coder.bit(C.SPLIT + 4 * Math.min(this.mixedFaces(i) >> 1, 5) + needs + last);
      }
      if (comes) this.insert(o, i, unasked);
    }
    return this.complex(o.coder.meter);
  }

  /** The last node that one needs and that is not in the cut, or -1. */
  private needed(i: number): number {
    const { all: { patches, maker }, inside } = this;
    let last = -1;
    for (const c of patches[i]!) if (maker[c]! > last && !inside[maker[c]!]) last = maker[c]!;
    return last;
  }

  /** Known signs among some vertices: 1 for some below, 2 for some above, 3 for both. */
  private sides(corners: ArrayLike<number>, from: number, to: number): number {
    const { contour: { sign }, mesh: { V } } = this;
    let seen = 0;
    for (let c = from; c < to; c++) if (corners[c] !== V && sign[corners[c]!]! >= 0) seen |= 1 << sign[corners[c]!]!;
    return seen;
  }

  private atApex(corners: ArrayLike<number>, from: number, to: number): boolean {
    for (let c = from; c < to; c++) if (corners[c] === this.mesh.V) return true;
    return false;
  }

  /** Whether a real cell of the patch is there and mixed. */
  private crossed(i: number): boolean {
    const { all: { patches, maker, corners }, inside } = this, m = this.mesh.n + 1;
    return patches[i]!.some((c) => (maker[c]! < 0 || inside[maker[c]!]) && !this.atApex(corners, m * c, m * c + m)
      && this.sides(corners, m * c, m * c + m) === 3);
  }

  private mixedFaces(i: number): number {
    const { all: { faces, ends } } = this, { n } = this.mesh;
    let mixed = 0;
    for (let c = n * (ends[i - 1] ?? 0); c < n * ends[i]!; c += n)
      if (!this.atApex(faces, c, c + n) && this.sides(faces, c, c + n) === 3) mixed++;
    return mixed;
  }

  private insert(o: Opinions, node: number, unasked: Uint8Array): void {
    const { all: { vertices, targets, faces, ends }, inside } = this, { n } = this.mesh, waiting = [node];
    for (let i = node; waiting.length; i = waiting.at(-1)!) {
      const needed = this.needed(i);
      if (needed >= 0) {
        waiting.push(needed);
        continue;
      }
      waiting.pop();
      const v = vertices[i]!;
      if (this.returns(o, v, targets[i]!, faces, n * (ends[i - 1] ?? 0), n * ends[i]!) && unasked[i]) this.flip(v);
      inside[i] = 1;
    }
  }

  /** The real cells of the cut (10.8.7(6)). */
  private complex(meter: Meter): Complex {
    const { all: { corners, source, maker, breaker }, inside, mesh: { d, n, V, positions } } = this, m = n + 1, list: number[] = [];
    for (let c = 0; c < source.length; c++) {
      if ((maker[c]! >= 0 && !inside[maker[c]!]) || (breaker[c]! >= 0 && inside[breaker[c]!])) continue;
      if (!this.atApex(corners, m * c, m * c + m)) list.push(c);
    }
    list.sort((p, q) => source[p]! - source[q]!);
    meter.take((8 + 4 * m) * list.length);
    meter.step(16 * list.length);
    const cells = Int32Array.from(list.flatMap((c) => corners.slice(m * c, m * c + m)));
    this.source = Int32Array.from(list, (c) => source[c]!);
    return new Complex(d, n, V, list.length, positions, cells, neighboursOf(n, list.length, cells, meter), meter);
  }
}
