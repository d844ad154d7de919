/** Geometry by values (10.1.4(3), 10.6.2, 10.6.3(2)). */
import { type Shift, shiftOf } from "../shift.js";
import type { Crossings } from "./crossings.js";
import { Drift } from "./drift.js";
import { clip } from "./integers.js";
import type { Contour } from "./isovalue.js";
import { LAYERS, type Opinions } from "./models.js";
import { beyondFace } from "./offsets.js";

const { at: C, sets } = LAYERS, MOST = 2 ** 44;

export class Numbers {
  /** By vertex; -1 without a number. */
  readonly number: Float64Array;
  /** Earlier isovalues with numbers, the nearest first, and how many steps this one lies above each. */
  private readonly earlier: { readonly sign: Int8Array; readonly number: Float64Array; readonly shift: Shift }[] = [];

  constructor(private readonly contour: Contour, private readonly edges: Crossings, private readonly above: number,
              private readonly below: number, scale: number | undefined) {
    this.number = new Float64Array(contour.mesh.V).fill(-1);
    for (let other = contour.lean; other; other = other.lean) {
      const { sign, values } = other, shift = values && shiftOf(contour.isovalue, other.isovalue, scale);
      if (shift) this.earlier.push({ sign, number: values.number, shift });
    }
  }

  decode(o: Opinions): void {
    const { contour, contour: { mesh, sign }, edges, number } = this, value = new Float64Array(mesh.V).fill(NaN);
    const spread = [0, 0, 0, 0], drift = contour.before && new Drift();
    for (let i = 0; i < 2 * edges.count; i++) {
      const v = (i & 1 ? edges.high : edges.low)[i >> 1]!, t = edges.leaf[i >> 1]!, up = sign[v] === 1;
      if (number[v]! >= 0) continue;
      let N: number;
      const [least, most, part] = this.possible(v, up);
      if (least >= 0) N = least + (most > least && o.coder.bit(C.HIGHER + part) === sign[v] ? 1 : 0);
      else {
        const [kase, guess] = this.guess(value, v, t), size = Math.min(Math.floor(Math.abs(guess) / 2), MOST);
        const bits = up ? this.above : this.below, count = 2 ** bits;
        if (!spread[kase]) spread[kase] = bits >= 40 ? 2 ** 48 : Math.max(Math.floor(count / 8) * 256, 256);
        const place = drift ? this.before(v) : undefined;
        const second = place === undefined ? undefined : drift!.guess(place, up, spread[kase]!), more = second ? 4 : 0;
        N = o.near(count, 256 * size + 128, spread[kase]!, sets.VALUE + 8 * (kase + more), C.VALUE + 32 * (kase + more), second);
        if (place !== undefined) drift!.see(256 * Math.min(N, MOST) + 128 - place, up);
        const by = Math.floor((256 * Math.min(Math.abs(N - size), MOST) - spread[kase]!) / 16);
        spread[kase] = Math.min(Math.max(spread[kase]! + by, 64), 2 ** 48);
      }
      number[v] = N;
      value[v] = (up ? 1 : -1) * (2 * Math.min(N, MOST) + 1);
    }
  }

  /** The least and the greatest number that those at earlier isovalues leave, -1 without one; and the class of HIGHER. */
  private possible(v: number, up: boolean): readonly [number, number, number] {
    let low = -1, high = -1, part = 0;
    for (const { sign, number, shift } of this.earlier) {
      const N = number[v]!, end = sign[v] ? N + 1 : -N;
      if (N < 0) continue;
      const least = clip(up ? end - shift.up - 1 : shift.down - end, 0, 2 ** 52 - 1);
      const most = clip(up ? end - shift.down - 1 : shift.up - end, 0, 2 ** 52 - 1);
      if (low < 0 || least > high || most < low) [low, high, part] = [least, most, shift.sixteenths];
      else [low, high] = [Math.max(low, least), Math.min(high, most)];
    }
    return [low, high, part];
  }

  /** The case and the guess of a vertex (10.6.2(3)). */
  private guess(value: Float64Array, v: number, t: number): [number, number] {
    const { mesh, mesh: { n, first, stars, cells }, sign } = this.contour, f = beyondFace(mesh, value, t, v);
    if (f && f > 0 === (sign[v] === 1)) return [2, f];
    let sum = 0, count = 0;
    for (let j = first[v]!; j < first[v + 1]!; j++) {
      for (let c = (n + 1) * stars[j]!; c < (n + 1) * (stars[j]! + 1); c++) {
        const x = value[cells[c]!]!;
        if (x !== x) continue;
        sum += Math.floor(Math.abs(x) / 256);
        count++;
      }
    }
    const mean = count ? Math.floor(sum / count) * 256 : 0;
    return !mean ? [0, 0] : f ? [3, mean / 2] : [1, mean];
  }

  /** The number then, in 1/256, negative on the other side; undefined without one. */
  private before(v: number): number | undefined {
    const { before, sign } = this.contour, N = before?.values?.number[v] ?? -1;
    if (N < 0) return undefined;
    const P = 256 * Math.min(N, MOST) + 128;
    return before!.sign[v] === sign[v] ? P : -P;
  }
}
