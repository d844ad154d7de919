/** Geometry by offsets (10.6.1, 10.6.3(1), 10.6.4). */
import { bits } from "../bits.js";
import type { Complex } from "./complex.js";
import type { Crossings } from "./crossings.js";
import type { Contour } from "./isovalue.js";
import { clip, mulDiv, shr } from "./integers.js";
import { LAYERS, type Opinions } from "./models.js";
import { Drift } from "./drift.js";
import { Rise } from "./rise.js";

const { at: C, sets } = LAYERS;

/** How many parts an edge has. */
function partsOf(mesh: Complex, a: number, b: number, step: number): number {
  const { d, positions } = mesh, by: number[] = [];
  let D = 1, q = 0;
  for (let k = 0; k < d; k++) {
    by.push(positions[d * b + k]! - positions[d * a + k]!);
    D = Math.max(D, Math.abs(by[k]!));
  }
  const r = Math.max(bits(D) - 22, 0);
  for (const x of by) q += shr(x, r) ** 2;
  // the root of q * 2**16 from that of q: 256*s + t
  const s = Math.floor(Math.sqrt(q));
  const left = 65536 * (q - s * s);
  let t = s ? Math.floor(left / (512 * s)) : 0;
  while (512 * s * t + t * t > left) t--;
  const length = (256 * s + t + 1) * 2 ** r;
  // a product of a small number and a power of two may be beyond those that quotients are exact of
  const parts = length < 2 ** 53 ? Math.ceil(length / step) : Number((BigInt(length) + BigInt(step) - 1n) / BigInt(step));
  return clip(parts, 1, 2 ** 24);
}

/** The size that a value is put on the side of its sign with. */
const sided = (f: number, above: boolean): number => {
  const size = clip(above ? f : -f, 16, 2 ** 24);
  return above ? size : -size;
};

export class Offsets {
  readonly number: number[] = [];
  readonly parts: number[] = [];
  /** By vertex; NaN where none is known. */
  readonly value: Float64Array;

  constructor(private readonly contour: Contour, readonly edges: Crossings, private readonly step: number) {
    this.value = new Float64Array(contour.mesh.V).fill(NaN);
  }

  decode(o: Opinions): void {
    const { contour, contour: { mesh, sign }, edges, value } = this, drift = contour.before && new Drift();
    let lean = contour.lean;
    while (lean && !lean.offsets) lean = lean.lean;
    const rise = lean && new Rise(lean.offsets!);
    const known = (v: number): boolean => value[v] === value[v];
    for (let e = 0; e < edges.count; e++) {
      const a = edges.low[e]!, b = edges.high[e]!, up = sign[a] === 1;
      const parts = partsOf(mesh, a, b, this.step);
      if (!known(a) && !known(b)) value[a] = up ? 16384 : -16384;
      let kase = 1, beyond = 0;
      if (!known(a) || !known(b)) [kase, beyond] = this.guess(value, edges.leaf[e]!, known(a) ? b : a);
      const fa = known(a) ? value[a]! : beyond, fb = known(b) ? value[b]! : beyond;
      let guess = 32768;
      if (kase) {
        const left = sided(fa, up), right = sided(fb, !up);
        guess = Math.floor((left * 65536) / (left - right));
      }
      const width = Math.max(Math.floor((parts * 256) / (kase ? 8 : 2)), 64);
      const near = shr(guess * parts, 8), risen = rise?.guess(a, b, !up, parts, width), place = drift ? this.before(a, b, parts) : undefined;
      const second = place === undefined ? undefined : drift!.guess(place, !up, width), more = second ? 4 : 0;
      const set = risen ? 4 + risen[0] : kase + more;
      const N = risen ? o.near(parts, risen[1], risen[2], sets.OFFSET + 8 * set, C.OFFSET + 32 * set, [near, width])
        : o.near(parts, near, width, sets.OFFSET + 8 * set, C.OFFSET + 32 * set, second);
      if (place !== undefined) drift!.see(256 * N + 128 - place, !up);
      this.number.push(N);
      this.parts.push(parts);
      const m = this.place(e);
      rise?.see(a, b, m, risen && [risen[0], Math.abs(256 * N + 128 - risen[1])]);
      if (!known(b)) value[b] = sided(value[a]! - Math.floor((value[a]! * 65536) / m), !up);
      else if (!known(a)) value[a] = sided(mulDiv(-value[b]!, m, 65536 - m), up);
    }
  }

  /** The case and the value of the end `x` of an edge of the leaf `t`, which has none yet. */
  private guess(value: Float64Array, t: number, x: number): [number, number] {
    const { mesh, sign } = this.contour, f = beyondFace(mesh, value, t, x);
    return !f ? [0, 0] : [f > 0 === (sign[x] === 1) ? 2 : 3, f];
  }

  /** The place of the crossing in the frame before, in 1/256 of our parts (10.6.3(1)). */
  private before(a: number, b: number, parts: number): number | undefined {
    const { before, sign } = this.contour, offsets = before?.offsets;
    if (!offsets || before!.sign[a] !== sign[a]) return undefined;
    const e = offsets.edges.find(a, b);
    if (e < 0) return undefined;
    return shr(offsets.place(e) * parts, 8);
  }

  /** Where an edge is crossed, in `2**-16` of it (10.6.1(5)). */
  place(e: number): number {
    return clip(Math.floor(((2 * this.number[e]! + 1) * 65536) / (2 * this.parts[e]!)), 1, 65535);
  }
}

/** What is linear in the neighbour of `t` behind the face that lacks `x`, at `x`; undefined without it or its values. */
export function beyondFace(mesh: Complex, value: Float64Array, t: number, x: number): number | undefined {
  const { n, cells, neighbours } = mesh, from = (n + 1) * t;
  let i = 0;
  while (cells[from + i] !== x) i++;
  const N = neighbours[from + i]!;
  if (N < 0) return undefined;
  const f: number[] = [];
  let o = 0;
  for (let j = 0; j <= n; j++) {
    const v = cells[(n + 1) * N + j]!;
    f.push(value[v]!);
    if (value[v] !== value[v]) return undefined;
    if (neighbours[(n + 1) * N + j] === t) o = j;
  }
  return mesh.beyond(N, o, x, f);
}
