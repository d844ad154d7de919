/** Signs that come level by level (10.8.2, 10.8.3). */
import type { Complex } from "./complex.js";
import type { Contour } from "./isovalue.js";
import { bits } from "../bits.js";
import { LAYERS, type Opinions } from "./models.js";
import type { Rounds } from "./rounds.js";

const { at: C, sets } = LAYERS;

export class Levels {
  private past = 0;

  /** `left` rounds are to come back. */
  constructor(private readonly contour: Contour, private readonly mesh: Complex, readonly rounds: Rounds, public left: number) {}

  /** The share of the vertices around `v` that lie above, by their signs now or then (10.8.2(3)). */
  private share(v: number, around: readonly number[], sign: Int8Array): number {
    const distances: bigint[] = [], near: number[] = [], above: boolean[] = [];
    for (const u of around) {
      if (sign[u]! < 0) continue;
      const square = this.rounds.square(v, u);
      if (typeof square === "bigint") distances.push(square);
      else near.push(square);
      above.push(sign[u] === 1);
    }
    if (!above.length) return -1;
    const weights = near.length ? near : distances.map(Number);
    const least = near.length ? Math.min(...near) : Number(distances.reduce((p, q) => (q < p ? q : p)));
    if (!near.length || least >= 2 ** 37) {
      const all = near.length ? near.map(BigInt) : distances;
      let m = all.reduce((p, q) => (q < p ? q : p)), s = 0n;
      while (m >> s >= 2n ** 40n) s++;
      m = (m >> s) << 16n;
      all.forEach((d, i) => (weights[i] = Number(m / (d >> s || 1n))));
    } else near.forEach((d, i) => (weights[i] = Math.floor((least * 65536) / Math.max(d, 1))));
    let sum = 0, all = 0;
    weights.forEach((w, i) => {
      all += w;
      if (above[i]) sum += w;
    });
    // without a distance no weight is left
    return all ? Math.floor((16 * sum) / all) : 0;
  }

  /** Signs of the vertices that are left (10.8.2). */
  coarse(o: Opinions): void {
    const { contour, contour: { sign, given, then }, rounds: { corners }, mesh: { V } } = this;
    const beside = new Map<number, Set<number>>();
    for (const t of this.rounds.triangles(this.left)) {
      for (let i = 0; i < 3; i++) {
        const v = corners[3 * t + i]!, list = beside.get(v) ?? new Set();
        list.add(corners[3 * t + ((i + 1) % 3)]!).add(corners[3 * t + ((i + 2) % 3)]!);
        beside.set(v, list);
      }
    }
    o.coder.meter.step(V);
    const queue: number[] = [];
    for (const start of [...beside.keys()].sort((p, q) => p - q)) {
      queue.push(start);
      for (let i = 0; i < queue.length; i++) {
        const v = queue[i]!;
        if (sign[v]! >= 0) continue;
        const around = [...beside.get(v)!].sort((p, q) => p - q);
        o.coder.meter.step(around.length);
        let s = given ? given[v]! : -1;
        if (s < 0) {
          const share = this.share(v, around, sign);
          s = o.coder.bit(then ? C.COARSE_THEN + 3 * (4 * (share + 1) + contour.agreed) + contour.was(v, 1)
            : C.COARSE + 8 * (share + 1) + (this.past & 7));
        }
        contour.learn(v, s);
        this.past = ((this.past << 1) & 63) | s;
        for (const u of around) if (sign[u]! < 0) queue.push(u);
      }
      queue.length = 0;
    }
  }

  /** Signs of the vertices of the rounds down to `to` (10.8.3). */
  back(o: Opinions, to: number): void {
    for (; this.left > to; this.left--) this.round(o, this.left - 1);
  }

  private round(o: Opinions, number: number): void {
    const { contour, contour: { sign, given, then }, rounds } = this, { vertices, rings, ends } = rounds.rounds[number]!;
    const candidates: number[] = [];
    for (let i = 0; i < vertices.length; i++) {
      const v = vertices[i]!, ring = rings.slice(ends[i - 1] ?? 0, ends[i]);
      o.coder.meter.step(ring.length);
      const first = sign[ring[0]!]!, told = given ? given[v]! : -1;
      let turned = 0;
      if (then) for (const u of ring) if (then[u]! >= 0 && then[u] !== sign[u]) turned++;
      turned = Math.min(turned, 3);
      if (ring.some((u) => sign[u] !== first)) {
        const s = told >= 0 ? told : this.between(o, v, ring, turned);
        contour.learn(v, s);
        this.past = ((this.past << 1) & 63) | s;
      } else if (told >= 0) sign[v] = told;
      else if (then && then[v]! >= 0 && then[v] !== first) sign[v] = o.coder.bit(C.NEW_THEN + turned) ? 1 - first : first;
      else {
        sign[v] = first;
        candidates.push(v);
      }
    }
    if (candidates.length && o.coder.bit(C.NEW + Math.min(bits(candidates.length), 15)))
      this.told(o, candidates, 0, candidates.length);
  }

  /** The sign of a vertex whose ring has both. */
  private between(o: Opinions, v: number, ring: readonly number[], turned: number): number {
    const { contour, contour: { sign, then } } = this, share = this.share(v, ring, sign), k = ring.length;
    let changes = 0, a = 0;
    ring.forEach((u, i) => {
      if (sign[u] !== sign[ring[(i + 1) % k]!]) changes++;
      a += sign[u]!;
    });
    o.context(C.LEVEL_RING + 2 * share + (changes > 2 ? 1 : 0)).context(C.LEVEL_COUNT + 9 * k + a)
      .context(C.LEVEL_PAST + 8 * (share >> 1) + (this.past & 7));
    if (then) {
      const y = 3 * contour.agreed + contour.was(v, 1);
      o.context(C.LEVEL_THEN_SHARE + 12 * (this.share(v, ring, then) + 1) + y)
        .context(C.LEVEL_THEN + 12 * (5 * turned + (share >> 2)) + y);
    }
    return o.bit(sets.LEVEL + (share >> 1));
  }

  /** Which candidates of a list that has new components are some (10.8.3(4)). */
  private told(o: Opinions, list: readonly number[], low: number, high: number): void {
    if (high - low === 1) {
      this.contour.sign[list[low]!] = 1 - this.contour.sign[list[low]!]!;
      return;
    }
    const middle = (low + high) >> 1, some = (count: number): boolean => o.coder.bit(C.NEW + Math.min(bits(count), 15)) === 1;
    const left = some(middle - low), right = !left || some(high - middle);
    if (left) this.told(o, list, low, middle);
    if (right) this.told(o, list, middle, high);
  }
}
