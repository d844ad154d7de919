/** Geometry by offsets (5.7, 5.9.6), its guesses and candidates (7.8, 7.14). */
import { Crossings, EdgeIndex } from "./edges.js";
import { OFFSET, OFFSET_LEAN, OFFSET_NEAR } from "./models.js";

import { KNOWN, SIGN } from "./store.js";
import type { Pass, Tube } from "./tube.js";
import { gridEdges } from "./values.js";

const MOST = 2 ** 24;

export class Offsets {
  /** The list of edges, with their parts and numbers. */
  edges: EdgeIndex;
  parts = new Int32Array(0);
  number = new Int32Array(0);
  private listed = -1;
  private crossings: Crossings | undefined;
  /** For n = 2 off the full grid: the crossing of each edge of the list, and the edge of the list of each crossing. */
  private crossing = new Int32Array(0);
  private place = new Int32Array(0);
  /** Off the full grid: vertices by position; sums of places counted from there, and how many (7.14.4(1)). */
  private vertices: EdgeIndex | undefined;
  private sums = new Float64Array(0);
  private counts = new Int32Array(0);
  recent: number[] = [];
  /** Candidates by slot: their place, 1 if known finely; NaN where there is none. */
  readonly at = new Float64Array(14);
  readonly fine = new Uint8Array(14);

  constructor(private readonly t: Tube) {
    this.edges = new EdgeIndex(t);
  }

  /** The list of edges (5.7.2). */
  private relist(): void {
    const { t } = this, full = t.onFullGrid;
    if (this.listed === t.changes) return;
    this.listed = t.changes;
    const edges = new EdgeIndex(t), old = this.edges;
    let all = new EdgeIndex(t), rings: Crossings["rings"] = [];
    if (full) {
      gridEdges(t, (px, py, pz, qx, qy, qz) => all.add(px, py, pz, qx, qy, qz));
      this.crossings = this.vertices = undefined;
    } else {
      ({ index: all, rings } = this.crossings = new Crossings(t, t.leaves));
      this.vertices = new EdgeIndex(t);
    }
    this.crossing = new Int32Array(full ? 0 : all.count);
    this.place = new Int32Array(full ? 0 : all.count).fill(-1);
    for (const id of all.inOrder()) {
      if (rings[id]) continue;
      const o = 6 * id, e = all.ends, place = edges.add(e[o]!, e[o + 1]!, e[o + 2]!, e[o + 3]!, e[o + 4]!, e[o + 5]!);
      if (full) continue;
      this.place[id] = place;
      this.crossing[place] = id;
    }
    const count = edges.count;
    t.meter.take(8 * count);
    const parts = new Int32Array(count).fill(1), number = new Int32Array(count);
    for (let id = 0, o = 0; id < count; id++, o += 6) {
      const e = edges.ends;
      const before = old.find(e[o]!, e[o + 1]!, e[o + 2]!, e[o + 3]!, e[o + 4]!, e[o + 5]!);
      if (before >= 0) {
        parts[id] = this.parts[before]!;
        number[id] = this.number[before]!;
      }
    }
    this.edges = edges;
    this.parts = parts;
    this.number = number;
    if (this.vertices) {
      this.sums = new Float64Array(2 * count);
      this.counts = new Int32Array(2 * count);
      for (let id = 0; id < count; id++) if (parts[id]! > 1) this.count(id, 1);
    }
  }

  /** Number of a vertex, for sums: one that ends an edge of the list has one once it is asked for. */
  private vertex(o: number): number {
    const e = this.edges.ends, x = e[o]!, y = e[o + 1]!, z = e[o + 2]!;
    return this.vertices!.add(x, y, z, x, y, z);
  }

  /** Add the place of an edge to the sums of its ends, or take it away (`way` -1). */
  private count(id: number, way: number): void {
    const place = this.placeOf(id), length = this.length(id), low = this.vertex(6 * id), high = this.vertex(6 * id + 3);
    this.sums[low]! += way * place * length;
    this.counts[low]! += way;
    this.sums[high]! += way * (4096 - place) * length;
    this.counts[high]! += way;
  }

  /** Greatest difference of the coordinates of an edge's ends. */
  private span(id: number): number {
    const e = this.edges.ends, o = 6 * id;
    return Math.max(Math.abs(e[o + 3]! - e[o]!), Math.abs(e[o + 4]! - e[o + 1]!), Math.abs(e[o + 5]! - e[o + 2]!));
  }

  private length(id: number): number {
    return this.t.onFullGrid ? 1 : this.span(id);
  }

  private placeOf(id: number): number {
    return Math.floor(((2 * this.number[id]! + 1) * 2048) / this.parts[id]!);
  }

  /** A layer (5.7.3). */
  *layer(Q: number, q: number): Pass {
    this.relist();
    const { t, edges, parts, number } = this, { coder, n } = t, full = t.onFullGrid;
    this.recent = [];
    for (let id = 0; id < edges.count; id++) {
      const o = 6 * id, e = edges.ends;
      const s = this.span(id), wanted = Math.min(Math.ceil((s * Q) / 2 ** q), MOST);
      t.meter.step(4);
      for (;;) {
        let R = Math.ceil(wanted / parts[id]!);
        if (R > 63) R = 27;
        if (R <= 1) break;
        const rising = t.store.get(e[o + 3]!, e[o + 4]!, e[o + 5]!) & SIGN ? 1 : 0;
        const again = parts[id]! > 1 ? 1 : 0;
        let low = 0, high = R, leanPart = -1;
        const other = t.leanOffsets;
        if (!again && s === 1 && other) {
          const there = other.edges.find(e[o]!, e[o + 1]!, e[o + 2]!, e[o + 3]!, e[o + 4]!, e[o + 5]!);
          if (there >= 0 && other.parts[there]! > 1) {
            const N = other.number[there]!, P = other.parts[there]!;
            const bound = (rising === 1) === (t.side === 1) ? Math.floor((N * R) / P)
              : Math.floor(((N + 1) * R - 1) / P);
            leanPart = rising ? bound : R - 1 - bound;
            if (t.side === 1) low = leanPart;
            else high = leanPart + 1;
          }
        }
        if (high - low > 1) this.candidates(id, full);
        const told = rising ? number[id]! : parts[id]! - 1 - number[id]!;
        for (let i = 0; high - low > 1; i++) {
          const split = (low + high) >> 1;
          let context = OFFSET + ((again * 8 + Math.min(i, 7)) * 3 + this.sideOf(0, parts[id]!, R, told, low, split, high)) * 3 +
            this.sideOf(1, parts[id]!, R, told, low, split, high);
          let nearer = -1;
          if (leanPart >= 0) {
            nearer = t.side === 1 ? split - leanPart : leanPart + 1 - split;
            context = OFFSET_LEAN + Math.min(32 - Math.clz32(nearer), 7) * 16 + Math.min(high - low, 15);
          }
          let bit: number;
          if (t.main) {
            const symbol = { id, i, rising, told, R, low, split, high, again, nearer };
            while ((bit = t.main.offset(this, symbol, context)) < 0) yield;
          } else {
            const slot = this.guess(full);
            if (slot < 0) while ((bit = coder.bit(context)) < 0) yield;
            else {
              const at = rising ? this.at[slot]! : 4096 - this.at[slot]!, P = parts[id]!;
              const far = Math.floor(((at * P * R - (told * R + split) * 4096) * 4) / ((high - low) * 4096));
              const near = 8 + (far < -8 ? -8 : far > 7 ? 7 : far);
              const below = OFFSET_NEAR + ((again * 4 + Math.min(i, 3)) * 2 + this.fine[slot]!) * 16 + near;
              while ((bit = coder.below(below, context)) < 0) yield;
            }
          }
          if (bit) low = split;
          else high = split;
        }
        if (this.vertices && parts[id]! > 1) this.count(id, -1);
        number[id] = number[id]! * R + (rising ? low : R - 1 - low);
        parts[id] = parts[id]! * R;
        if (this.vertices && n) this.count(id, 1);
        const place = rising ? this.placeOf(id) : 4096 - this.placeOf(id);
        this.recent = [place, ...this.recent.filter((x) => x !== place)].slice(0, 4);
      }
    }
  }

  /** `side_of` of 7.8(1). */
  private sideOf(i: number, parts: number, R: number, told: number, low: number, split: number, high: number): number {
    if (i >= this.recent.length) return 0;
    const part = Math.floor((this.recent[i]! * parts * R) / 4096) - told * R;
    return part < low || part >= high ? 0 : part < split ? 1 : 2;
  }

  /** Slot of the guess of 7.8(2), -1 if there is none. */
  private guess(full: boolean): number {
    const { at } = this, there = (slot: number): boolean => at[slot] === at[slot];
    if (full) return there(0) ? 0 : -1;
    if (this.t.n === 3) return there(0) ? 0 : there(9) ? 9 : -1;
    for (const slot of [4, 1, 2, 3, 0]) if (there(slot)) return slot;
    return -1;
  }

  private set(slot: number, x: number, fine: number): void {
    this.at[slot] = x < -4096 ? -4096 : x > 8192 ? 8192 : x;
    this.fine[slot] = fine;
  }

  /** All candidates of an edge but those of RECENT (7.14.3, 7.14.4). */
  private candidates(id: number, full: boolean): void {
    this.at.fill(NaN);
    const { n } = this.t, e = this.edges.ends, o = 6 * id;
    if (full || n === 3) {
      let a = -1, axes = 0;
      for (let i = 0; i < n; i++) if (e[o + i] !== e[o + 3 + i]) {
        a = i;
        axes++;
      }
      if (axes === 1) this.alongAxes(id, a);
    }
    if (full) return;
    this.byVertex(id, n === 2 ? 0 : 9);
    if (n === 2) this.byNeighbours(id);
  }

  /** Crossings met on one side: their distances, places, and whether they are known finely. */
  private readonly far = new Float64Array(4);
  private readonly on = new Float64Array(4);
  private readonly sure = new Uint8Array(4);

  /** `follow` of 7.14.3(1): how many crossings there are, from place `from` on. */
  private follow(id: number, a: number, b: number, way: number, from: number, length: number): number {
    const { t } = this, e = this.edges.ends, o = 6 * id, last = t.grid.last;
    const low = [e[o]!, e[o + 1]!, e[o + 2]!], high = [e[o + 3]!, e[o + 4]!, e[o + 5]!];
    const startA = low[a]!, startB = low[b]!;
    let along = a, across = b, step = way;
    for (let j = 0; j < 2; j++) {
      const lowTo = low[across]! + step * length, highTo = high[across]! + step * length;
      if (lowTo < 0 || lowTo > last[across]! || highTo < 0 || highTo > last[across]!) return j;
      const lowFlags = t.store.get(low[0]!, low[1]!, low[2]!), highFlags = t.store.get(high[0]!, high[1]!, high[2]!);
      const lowAt = low[across]!, highAt = high[across]!;
      low[across] = lowTo;
      high[across] = highTo;
      const lowNext = t.store.get(low[0]!, low[1]!, low[2]!), highNext = t.store.get(high[0]!, high[1]!, high[2]!);
      if (!(lowNext & KNOWN) || !(highNext & KNOWN)) return j;
      const atLow = ((lowFlags ^ lowNext) & SIGN) !== 0, atHigh = ((highFlags ^ highNext) & SIGN) !== 0;
      if (atLow && atHigh) return j;
      if (atLow || atHigh) {
        // both ends of the side that is crossed differ along `across` only
        const at = atHigh ? high[along]! : low[along]!, one = atHigh ? highAt : lowAt, two = atHigh ? highTo : lowTo;
        low[along] = high[along] = at;
        low[across] = step === 1 ? one : two;
        high[across] = step === 1 ? two : one;
        step = atHigh ? 1 : -1;
        [along, across] = [across, along];
      }
      const met = this.edges.find(low[0]!, low[1]!, low[2]!, high[0]!, high[1]!, high[2]!);
      if (met < 0) return j;
      const place = this.placeOf(met);
      const atA = (low[a]! - startA) * 4096, atB = (low[b]! - startB) * 4096;
      const onA = atA / length + (along === a ? place : 0), onB = atB / length + (along === b ? place : 0);
      this.far[from + j] = way * onB;
      this.on[from + j] = onA;
      this.sure[from + j] = this.parts[met]! > 1 ? 1 : 0;
    }
    return 2;
  }

  private alongAxes(id: number, a: number): void {
    const { n } = this.t, { far, on, sure, at, fine } = this, length = this.length(id);
    let sum = 0, count = 0, all = 1;
    for (let i = 0; i < n - 1; i++) {
      const b = (a + 1 + i) % n, slot = 1 + 4 * i;
      const ahead = this.follow(id, a, b, 1, 0, length), back = this.follow(id, a, b, -1, 2, length);
      if (ahead > 0 && back > 0 && far[0]! + far[2]! > 0)
        this.set(slot, Math.floor((on[0]! * far[2]! + on[2]! * far[0]!) / (far[0]! + far[2]!)), sure[0]! & sure[2]!);
      for (let s = 0; s < 2; s++) {
        const f = 2 * s;
        if ((s ? back : ahead) === 2 && far[f + 1]! - far[f]! >= 512)
          this.set(slot + 1 + s, on[f]! - Math.floor(((on[f + 1]! - on[f]!) * far[f]!) / (far[f + 1]! - far[f]!)),
            sure[f]! & sure[f + 1]!);
      }
      this.cubic(slot);
      for (const best of [slot + 3, slot, slot + 1, slot + 2]) {
        if (at[best] !== at[best]) continue;
        sum += at[best]!;
        count++;
        all &= fine[best]!;
        break;
      }
    }
    if (count) this.set(0, Math.floor(sum / count), all);
  }

  /** CUBIC of the three candidates from `slot` on, if they are there. */
  private cubic(slot: number): void {
    const { at, fine } = this, x = 4 * at[slot]! + at[slot + 1]! + at[slot + 2]!;
    if (x === x) this.set(slot + 3, Math.floor(x / 6), fine[slot]! & fine[slot + 1]! & fine[slot + 2]!);
  }

  /** VERTEX (7.14.4(1)). */
  private byVertex(id: number, slot: number): void {
    const { sums, counts } = this, low = this.vertex(6 * id), high = this.vertex(6 * id + 3), length = this.length(id);
    if (counts[low] && counts[high]) {
      const lowMean = Math.floor(sums[low]! / counts[low]!), highMean = Math.floor(sums[high]! / counts[high]!);
      if (lowMean + highMean > 0) this.set(slot, Math.floor((4096 * lowMean) / (lowMean + highMean)), 1);
    } else if (counts[low]) this.set(slot, Math.floor(sums[low]! / (counts[low]! * length)), 0);
    else if (counts[high]) this.set(slot, 4096 - Math.floor(sums[high]! / (counts[high]! * length)), 0);
  }

  /** Candidates of the neighbours on either side, n = 2 (7.14.4(2), (3)). */
  private byNeighbours(id: number): void {
    const all = this.crossings!, own = this.crossing[id]!;
    const met = [-1, -1, -1, -1];
    for (let side = 0; side < 2; side++) {
      let crossing = own, leaf = all.edgeLeaves[2 * own + side]!;
      for (let j = 0; j < 2 && leaf >= 0; ) {
        crossing = all.leafEdges[2 * leaf]! === crossing ? all.leafEdges[2 * leaf + 1]! : all.leafEdges[2 * leaf]!;
        if (this.place[crossing]! >= 0) met[2 * side + j++] = this.place[crossing]!;
        leaf = all.edgeLeaves[2 * crossing]! === leaf ? all.edgeLeaves[2 * crossing + 1]! : all.edgeLeaves[2 * crossing]!;
      }
    }
    this.meet(id, met[0]!, met[2]!, 1);
    this.meet(id, met[0]!, met[1]!, 2);
    this.meet(id, met[2]!, met[3]!, 3);
    this.cubic(1);
  }

  private meet(id: number, first: number, second: number, slot: number): void {
    if (first < 0 || second < 0) return;
    const e = this.edges.ends, o = 6 * id, length = this.length(id), x = e[o]!, y = e[o + 1]!;
    const point = (of: number, a: number, origin: number): number => {
      const p = 6 * of + a;
      return Math.floor(((e[p]! - origin) * 4096 + (e[p + 3]! - e[p]!) * this.placeOf(of)) / length);
    };
    const px = point(first, 0, x), py = point(first, 1, y);
    const slopeX = point(second, 0, x) - px, slopeY = point(second, 1, y) - py;
    const runX = Math.floor(((e[o + 3]! - x) * 4096) / length), runY = Math.floor(((e[o + 4]! - y) * 4096) / length);
    const turn = runX * slopeY - runY * slopeX;
    if (turn === 0 || 8 * Math.abs(turn) < 4096 * Math.max(Math.abs(slopeX), Math.abs(slopeY))) return;
    this.set(slot, Math.floor(((px * slopeY - py * slopeX) * 4096) / turn),
      this.parts[first]! > 1 && this.parts[second]! > 1 ? 1 : 0);
  }
}
