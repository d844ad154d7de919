/** Signs that come level by level (10.8.3 to 10.8.5). */
import { bits } from "../bits.js";
import type { Complex } from "./complex.js";
import type { Contour } from "./isovalue.js";
import { RingFit } from "./fit.js";
import type { Hierarchy, Remaining } from "./hierarchy.js";
import { LAYERS, type Opinions } from "./models.js";

const { at: C, sets } = LAYERS, BOUNDS = [2, 5, 10, 16, 26, 38, 54, 77, 109, 160];

export class Levels {
  private past = 0;
  /** Whether the last signs were those of the fit. */
  private right = 0;
  private readonly fit: RingFit;
  private shown: Remaining | undefined;

  /** `left` rounds are to come back. */
  constructor(protected readonly contour: Contour, protected readonly mesh: Complex, readonly hierarchy: Hierarchy, public left: number) {
    this.fit = new RingFit(hierarchy.positions, mesh.V);
  }

  /** The cells that are there. */
  get remaining(): Remaining {
    return (this.shown ??= this.hierarchy.remaining(this.left));
  }

  /** The share of the vertices around `v` that lie above (10.8.3(3)). */
  private share(v: number, around: readonly number[], sign: Int8Array): number {
    const p = this.hierarchy.positions, distances: bigint[] = [], above: boolean[] = [];
    for (const u of around) {
      if (sign[u]! < 0) continue;
      let square = 0n;
      for (let k = 0; k < 3; k++) square += BigInt(p[3 * u + k]! - p[3 * v + k]!) ** 2n;
      distances.push(square);
      above.push(sign[u] === 1);
    }
    if (!above.length) return -1;
    let m = distances.reduce((x, y) => (y < x ? y : x)), s = 0n, sum = 0n, all = 0n;
    while (m >> s >= 2n ** 40n) s++;
    m = (m >> s) << 16n;
    distances.forEach((d, i) => {
      const w = m / (d >> s || 1n);
      all += w;
      if (above[i]) sum += w;
    });
    // without a distance no weight is left
    return all ? Number((16n * sum) / all) : 0;
  }

  /** Signs of the vertices that are left (10.8.3). */
  coarse(o: Opinions): void {
    const { contour, contour: { sign, given, then }, mesh: { V, n }, fit } = this, m = n + 1, p = this.hierarchy.positions;
    const beside = new Map<number, Set<number>>(), { corners } = this.remaining;
    for (let c = 0; c < corners.length; c += m) for (let i = c; i < c + m; i++) {
      const list = beside.get(corners[i]!) ?? new Set();
      for (let j = c; j < c + m; j++) if (j !== i) list.add(corners[j]!);
      beside.set(corners[i]!, list);
    }
    o.coder.meter.step(V);
    let far = 0, pairs = 0;
    for (const [v, list] of beside) for (const u of list) {
      far += Math.max(Math.abs(p[3 * u]! - p[3 * v]!), Math.abs(p[3 * u + 1]! - p[3 * v + 1]!), Math.abs(p[3 * u + 2]! - p[3 * v + 2]!));
      pairs++;
    }
    const height = Math.floor(Math.floor(far / Math.max(pairs, 1)) / 2), queue: number[] = [];
    for (const start of [...beside.keys()].sort((x, y) => x - y)) {
      queue.push(start);
      for (let i = 0; i < queue.length; i++) {
        const v = queue[i]!;
        if (sign[v]! >= 0) continue;
        const around = [...beside.get(v)!].sort((x, y) => x - y);
        o.coder.meter.step(around.length);
        let s = given ? given[v]! : -1;
        if (s < 0) {
          const share = this.share(v, around, sign);
          s = o.coder.bit(then ? C.COARSE_THEN + 3 * (4 * (share + 1) + contour.agreed) + contour.was(v, 1)
            : C.COARSE + 8 * (share + 1) + (this.past & 7));
        }
        contour.learn(v, s);
        this.past = ((this.past << 1) & 63) | s;
        fit.height[v] = s ? height : -height;
        fit.trust[v] = 180;
        fit.tilt[v] = s ? 128 : -128;
        for (const u of around) if (sign[u]! < 0) queue.push(u);
      }
      queue.length = 0;
    }
  }

  /** Signs of the vertices of the rounds down to `to` (10.8.5). */
  back(o: Opinions, to: number): void {
    this.shown = undefined;
    for (; this.left > to; this.left--) this.round(o, this.left - 1);
  }

  private round(o: Opinions, number: number): void {
    const { contour: { sign, then }, mesh: { n } } = this;
    const { vertices, targets, faces, ends } = this.hierarchy.rounds[number]!, candidates: number[] = [];
    for (let i = vertices.length - 1; i >= 0; i--) {
      const v = vertices[i]!;
      if (!this.returns(o, v, targets[i]!, faces, n * (ends[i - 1] ?? 0), n * ends[i]!)) continue;
      if (then && then[v]! >= 0 && then[v] !== sign[v]) {
        if (o.coder.bit(C.NEW_THEN + this.changed())) this.flip(v);
      } else candidates.push(v);
    }
    for (const i of this.sought(o, C.NEW, candidates.length)) this.flip(candidates[i]!);
  }

  /** A vertex comes back; whether it has the sign of its ring and might have the other one. */
  protected returns(o: Opinions, v: number, target: number, faces: Int32Array, from: number, to: number): boolean {
    const { contour: { sign, given }, fit } = this;
    fit.make(v, faces, from, to);
    const { ring, count } = fit, first = sign[ring[0]!]!, known = given ? given[v]! : -1;
    o.coder.meter.step(count);
    for (let j = 0; j < count; j++) if (sign[ring[j]!] !== first) {
      this.between(o, v, target, known);
      return false;
    }
    this.follow(v, first);
    if (known < 0) return true;
    if (known !== first) this.flip(v);
    return false;
  }

  /** How many of the ring have another sign than then, at most 3. */
  private changed(): number {
    const { contour: { sign, then }, fit: { ring, count } } = this;
    let changed = 0;
    if (then) for (let i = 0; i < count; i++) if (then[ring[i]!]! >= 0 && then[ring[i]!] !== sign[ring[i]!]) changed++;
    return Math.min(changed, 3);
  }

  /** The share of the ring that has the sign `above`, of known ones; -1 without any. */
  private agreeing(sign: Int8Array, above: number): number {
    const { ring, count, weight } = this.fit;
    let some = 0, all = 0;
    for (let i = 0; i < count; i++) {
      const s = sign[ring[i]!]!;
      if (s < 0) continue;
      all += weight[i]!;
      if (s === above) some += weight[i]!;
    }
    return all ? Math.min(Math.floor((16 * some) / all), 15) : -1;
  }

  /** The sign of a vertex whose ring has both. */
  private between(o: Opinions, v: number, target: number, known: number): void {
    const { contour, contour: { sign, then }, fit, fit: { ring, count, far, value } } = this, above = value > 0 ? 1 : 0;
    const t = fit.mean(fit.trust), g = fit.mean(fit.tilt);
    let right = known === above ? 1 : 0;
    if (known < 0) {
      const ratio = Math.floor((4 * Math.abs(value)) / far), share = this.agreeing(sign, above);
      let size = 0, like = 0;
      for (const bound of BOUNDS) if (ratio >= bound) size++;
      for (let i = 0; i < count; i++) if (sign[ring[i]!] === above) like++;
      const tilt = Math.min(Math.floor(((256 + (above ? g : -g)) * 6) / 256), 11);
      const slope = Math.min(Math.floor((6 * fit.slope) / 16384), 7);
      o.context(C.LEVEL_FIT + 8 * size + Math.min(t >> 5, 7)).context(C.LEVEL_RING + 12 * share + tilt)
        .context(C.LEVEL_SHARE + 2 * (16 * size + share) + (sign[target] === above ? 1 : 0))
        .context(C.LEVEL_TILT + 12 * size + tilt).context(C.LEVEL_COUNT + 31 * Math.min(count, 30) + Math.min(like, 30))
        .context(C.LEVEL_PAST + 16 * size + this.right).context(C.LEVEL_SLOPE + 3 * (8 * size + slope) + Math.min((3 * t) >> 8, 2));
      if (then) {
        const y = 3 * contour.agreed + contour.was(v, above);
        o.context(C.LEVEL_THEN_SHARE + 12 * (this.agreeing(then, above) + 1) + y)
          .context(C.LEVEL_THEN + 12 * (4 * this.changed() + (share >> 2)) + y);
      }
      right = o.bit(sets.LEVEL + size);
    }
    this.right = ((this.right << 1) & 15) | right;
    const s = right ? above : 1 - above;
    contour.learn(v, s);
    this.learn(v, s, right, t, g);
  }

  /** What is learnt from a sign (10.8.5(3)). */
  private learn(v: number, s: number, right: number, t: number, g: number): void {
    const { contour: { sign }, fit: { ring, count, far, value, unit, height, trust, tilt, distance } } = this, z = s ? 256 : -256;
    let size = Math.floor((3 * far * unit) / 5);
    if (right) size = Math.max(size, Math.floor((Math.abs(value) * unit) / 16));
    trust[v] = (t + 256 * right) >> 1;
    tilt[v] = (g + z) >> 1;
    for (let i = 0; i < count; i++) {
      const u = ring[i]!;
      trust[u]! += (77 * (256 * right - trust[u]!)) >> 8;
      tilt[u]! += (77 * (z - tilt[u]!)) >> 8;
      if (sign[u] === s) continue;
      const a = distance[i]! * unit, l = Math.abs(height[u]!);
      size = Math.min(size, a);
      if (5 * l > 3 * a) height[u] = Math.floor((15 * l + 21 * a) / 50) * (sign[u] ? 1 : -1);
    }
    height[v] = s ? size : -size;
  }

  /** A vertex has the sign of its ring (10.8.5(4)). */
  private follow(v: number, s: number): void {
    const { contour: { sign }, fit, fit: { far, value, unit } } = this;
    let size = Math.floor((3 * far * unit) / 10);
    if (value > 0 === (s === 1)) size = Math.max(size, Math.floor((Math.abs(value) * unit) / 16));
    sign[v] = s;
    fit.height[v] = s ? size : -size;
    fit.trust[v] = fit.mean(fit.trust);
    fit.tilt[v] = fit.mean(fit.tilt);
  }

  /** A vertex has another sign than its ring. */
  protected flip(v: number): void {
    const { contour: { sign }, fit: { height } } = this, size = Math.floor((3 * Math.abs(height[v]!)) / 10);
    sign[v] = 1 - sign[v]!;
    height[v] = sign[v] ? size : -size;
  }

  /** Which of a list of `all` are sought, ascending (10.8.5(5)). */
  protected sought(o: Opinions, context: number, all: number): number[] {
    const found: number[] = [], some = (count: number): boolean => o.coder.bit(context + Math.min(bits(count), 15)) === 1;
    const halve = (low: number, high: number): void => {
      if (high - low === 1) {
        found.push(low);
        return;
      }
      const middle = (low + high) >> 1, left = some(middle - low), right = !left || some(high - middle);
      if (left) halve(low, middle);
      if (right) halve(middle, high);
    };
    if (all && some(all)) halve(0, all);
    return found;
  }
}
