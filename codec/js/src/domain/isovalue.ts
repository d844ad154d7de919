/** What is known of one isovalue of a mesh (10.1.3 to 10.1.5). */
import type { Meter } from "../errors.js";
import type { Isovalue } from "../series.js";
import type { Complex } from "./complex.js";
import type { Cut } from "./cut.js";
import type { Levels } from "./levels.js";
import { layerModels, type Models } from "./models.js";
import type { Numbers } from "./values.js";
import type { Offsets } from "./offsets.js";

export class Contour implements Isovalue {
  /** By vertex: 1 above, 0 below, -1 not known. */
  sign = new Int8Array(0);
  /** Its own from its first layer on; what they begin as a copy of. */
  private own: Models | undefined;
  private readonly from: Models | undefined;
  /** The isovalue that this one leans on, if it is of its frame; how many it leans on, directly and through others. */
  readonly lean: Contour | undefined;
  readonly depth: number;
  /** Signs that follow from these, by vertex; -1 where none does. */
  given: Int8Array | undefined;
  /** The isovalue of the frame before, if this one leans on it, and its signs then: -1 where they are not known. */
  before: Contour | undefined;
  then: Int8Array | undefined;
  /** Whether the last two signs were those then (10.1.5(3)). */
  agreed = 0;
  /** The cells of both signs in the order in which they were visited, if all signs are there. */
  leaves: Int32Array | undefined;
  /** Rounds that have not come back yet, and the signs of 10.8 so far; none without layers of levels. */
  levels: Levels | undefined;
  /** The nodes that have come back; none without layers of a cut. */
  cut: Cut | undefined;
  offsets: Offsets | undefined;
  values: Numbers | undefined;

  /** `mesh`: what the curve lies on. */
  constructor(public mesh: Complex, readonly isovalue: number, lean: Contour | undefined, framed: boolean) {
    // that one gets no more layers
    this.from = lean && (lean.own ?? lean.from);
    this.lean = framed ? undefined : lean;
    this.before = framed ? lean : undefined;
    this.depth = this.lean ? this.lean.depth + 1 : 0;
  }

  /** The first layer begins: an isovalue without any takes no memory. */
  begin(meter: Meter): void {
    if (this.own) return;
    const { V, T } = this.mesh;
    // models, and a byte for each sign, given sign and sign then; looking at all of them is work
    meter.take(3 * V + 16384);
    meter.step(V + T);
    this.sign = new Int8Array(V).fill(-1);
    this.own = this.from?.copy() ?? layerModels();
    if (this.lean) this.given = this.follow();
    this.then = this.before?.everywhere();
  }

  get models(): Models {
    return this.own!;
  }

  /** Forget what only further layers need: none will come. */
  finish(): void {
    this.before = undefined;
  }

  /** 10.1.4(2). */
  private follow(): Int8Array {
    const given = new Int8Array(this.mesh.V).fill(-1);
    for (let other = this.lean; other; other = other.lean) {
      const { isovalue, sign } = other;
      const above = isovalue > this.isovalue ? 1 : -2, below = isovalue < this.isovalue ? 0 : -2;
      for (let v = 0; v < sign.length; v++) if (sign[v]! === above || sign[v]! === below) given[v] = sign[v]!;
    }
    return given;
  }

  /** Whether all signs are there that are told (10.1.3(2)). */
  get whole(): boolean {
    return this.leaves !== undefined;
  }

  /** The signs of all vertices that one comes to (10.1.5(2)). */
  everywhere(): Int8Array {
    const { V } = this.mesh, then = this.sign.slice(), queue = new Int32Array(V);
    if (!this.whole) return new Int8Array(V).fill(-1);
    if (this.cut) return then;
    let end = 0;
    for (let v = 0; v < V; v++) if (then[v]! >= 0) queue[end++] = v;
    this.spread(then, queue, end);
    return then;
  }

  /** Vertices of the first `end` of a queue pass their signs on to all that have none and that one comes to. */
  private spread(signs: Int8Array, queue: Int32Array, end: number): void {
    const { n, first, stars, cells } = this.mesh;
    for (let i = 0; i < end; i++) {
      const v = queue[i]!;
      for (let j = first[v]!; j < first[v + 1]!; j++) {
        for (let c = (n + 1) * stars[j]!; c < (n + 1) * (stars[j]! + 1); c++) {
          const u = cells[c]!;
          if (signs[u]! >= 0) continue;
          signs[u] = signs[v]!;
          queue[end++] = u;
        }
      }
    }
  }

  /** Signs of parts of the mesh without a known vertex (10.3.1(4)); `decode` gives that of one. */
  parts(decode: () => number, meter: Meter): void {
    meter.step(this.mesh.V + this.mesh.T);
    const { mesh: { V, first }, given, sign } = this, signs = this.everywhere(), queue = new Int32Array(V);
    for (let v = 0; v < V; v++) {
      if (signs[v]! >= 0 || first[v] === first[v + 1]) continue;
      const known = given ? given[v]! : -1;
      sign[v] = signs[v] = known >= 0 ? known : decode();
      queue[0] = v;
      this.spread(signs, queue, 1);
    }
  }

  /** `then(v, s)` of 10.1.5(3). */
  was(v: number, s: number): number {
    const then = this.then![v]!;
    return then < 0 ? 0 : then === s ? 1 : 2;
  }

  /** A sign is there that `agreed` takes note of. */
  learn(v: number, sign: number): void {
    this.sign[v] = sign;
    if (this.then && this.then[v]! >= 0) this.agreed = ((this.agreed << 1) & 2) | (this.then[v] === sign ? 1 : 0);
  }
}
