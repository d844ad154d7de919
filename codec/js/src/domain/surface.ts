/** Surfaces over the plane: points, their numbers, triangles (10.9). */
import type { Drawing } from "../draw.js";
import type { IsoError } from "../errors.js";
import type { Reader, Steps } from "../reader.js";
import type { Session } from "../session.js";
import { type Exact, Points } from "./circles.js";
import { Delaunay, type Place } from "./delaunay.js";
import { bits } from "../bits.js";
import { Opinions } from "./models.js";
import { readPositions, SURFACE } from "./positions.js";

const { at: C, sets } = SURFACE;

/** What the payload says before its run (10.9.1). */
interface Head {
  W: number;
  H: number;
  /** Exponent and origin of scattered points. */
  scattered: readonly [number, number, number] | undefined;
  offset: number;
  step: number;
  largest: number;
  palette: number[] | undefined;
  /** About how many points each layer adds. */
  layers: number[];
}

const power = (x: number, e: number): number => x * 2 ** (e >> 1) * 2 ** (e - (e >> 1));

/** Read the head; the first byte of the payload comes next. */
function* readHead(r: Reader): Steps<Head> {
  const error = (): IsoError => r.error("10.9.1", "the head of a surface is not well formed");
  const upTo = function* (low: number, high: number): Steps<number> {
    const x = yield* r.varint("10.9.1");
    if (x < low || x > high) throw error();
    return x;
  };
  const signed = function* (most: bigint): Steps<number> {
    const u = BigInt(yield* r.wide("10.9.1")), x = u & 1n ? -(u + 1n) / 2n : u / 2n;
    if (x > most || x < -most) throw error();
    return Number(x);
  };
  const number = function* (): Steps<number> {
    const x = yield* signed(2n ** 53n), y = x && power(x, yield* signed(1100n));
    if (!Number.isFinite(y)) throw error();
    return y;
  };
  const head = yield* r.byte("10.9.1");
  if (head & 12) throw error();
  const W = yield* upTo(1, 2 ** 28), H = yield* upTo(1, 2 ** 28);
  const scattered = head & 1 ? [yield* signed(1100n), yield* signed(2n ** 61n), yield* signed(2n ** 61n)] as const : undefined;
  const offset = yield* number(), step = yield* number();
  if (!(step > 0)) throw error();
  const largest = yield* upTo(0, 65535), palette = head & 2 ? [0] : undefined, layers: number[] = [];
  for (let k = 0; palette && k < largest; k++) palette.push(palette[k]! + (yield* upTo(1, 2 ** 40)));
  for (let more = yield* upTo(1, 64); more; more--) layers.push(yield* upTo(1, 2 ** 28));
  return { W, H, scattered, offset, step, largest, palette, layers };
}

export class Surface {
  private head: Head | undefined;
  held: unknown;
  private readonly points = new Points();
  /** By point; a point has its number when it is in the triangulation. */
  private readonly number: number[] = [];
  private readonly miss: number[] = [];
  private triangles: Delaunay | undefined;
  /** Points that are there, in the order in which they came. */
  private readonly there: number[] = [];

  constructor(private readonly s: Session) {}

  /** Decode the payload, as it comes. */
  *decode(): Steps {
    const { s, s: { r, coder } } = this, head = yield* this.readHead();
    if (!head) return;
    coder.begin(r.at, r.stop - r.at);
    const o = new Opinions(coder, SURFACE.make());
    for (const [l, c] of head.layers.entries()) {
      const from = this.points.count, positions = yield* readPositions(o, head.W, head.H, c, Infinity, () => this.wrong(""));
      positions.x.forEach((x, i) => this.points.add(x, positions.y[i]!));
      s.meter.take(64 * positions.x.length);
      s.meter.step(16 * positions.x.length);
      const hull = this.hull(from);
      this.miss.fill(0);
      yield* this.layer(o, from, l ? [] : hull);
    }
    yield* s.finish(s.coder);
  }

  /** What is wrong with the head is said once the chunk's checksums are verified (10.1.1(4)). */
  private *readHead(): Steps<Head | undefined> {
    try {
      return (this.head = yield* readHead(this.s.r));
    } catch (error) {
      this.held = error;
      return undefined;
    }
  }

  private wrong(what: string): IsoError {
    return this.s.r.error("10.9.3", what);
  }

  /** The corners of the hull of all points; `from` is the first one of the layer, whose positions are checked (10.9.3(6)). */
  private hull(from: number): number[] {
    const { points, points: { x, y } } = this, taken = new Map<number, Set<number>>();
    for (let p = 0; p < points.count; p++) {
      const column = taken.get(x[p]!) ?? new Set();
      if (column.has(y[p]!)) throw this.wrong("a position that an earlier layer has");
      taken.set(x[p]!, column.add(y[p]!));
    }
    const hull = points.hull(x.map((_, p) => p));
    if (hull.length < 3) throw this.wrong("all positions lie on a line");
    if (from && hull.some((p) => p >= from)) throw this.wrong("a corner of the hull in a later layer");
    return hull;
  }

  /** Numbers of a layer's points (10.9.4); `corners` are those of the hull, in the first layer. */
  private *layer(o: Opinions, from: number, corners: readonly number[]): Steps {
    const { points, there, s: { meter } } = this, all = points.x.map((_, p) => p).slice(from), set = new Set(corners);
    for (const [i, p] of corners.entries())
      yield* i ? this.near(o, p, [[corners[i - 1]!, 1]], 13) : this.raw(o, p);
    if (corners.length) {
      this.triangles = new Delaunay(points, corners, meter);
      there.push(...corners);
    }
    const triangles = this.triangles!, rank = new Map<number, number>();
    [...all].sort((p, q) => points.rank(p, q)).forEach((p, i) => rank.set(p, i));
    for (let low = 0, high = 64; low < all.length; low = high, high *= 4) {
      for (const p of all) {
        if (rank.get(p)! < low || rank.get(p)! >= high || set.has(p)) continue;
        const place = triangles.find(p);
        yield* this.near(o, p, triangles.seen(p, place), this.reach(triangles.seen(p, place), place));
        triangles.insert(p, place);
        there.push(p);
      }
    }
  }

  private reach(seen: readonly [number, Exact][], { side }: Place): number {
    const sum = seen.reduce((all, [, w]) => all + BigInt(w), 0n), reach = sum.toString(2).length;
    return Math.min(side < 0 ? reach >> 1 : reach, 13);
  }

  private *raw(o: Opinions, p: number): Steps {
    let k = 0;
    for (let place = 0; place < bits(this.head!.largest); place++) {
      let bit: number;
      while ((bit = o.coder.bit(C.RAW + place)) < 0) yield;
      k = 2 * k + bit;
    }
    this.take(p, k, 0);
  }

  private take(p: number, k: number, miss: number): void {
    if (k < 0 || k > this.head!.largest) throw this.s.r.error("10.9.4", "a number is out of range");
    this.number[p] = k;
    this.miss[p] = miss;
  }

  /** One number, from what is seen of the point (10.9.4(3), (4), 10.9.5). */
  private *near(o: Opinions, p: number, seen: readonly [number, Exact][], reach: number): Steps {
    const { number, miss: misses, head } = this, m = head!.largest, count = seen.length;
    let weights = seen.map(([, w]) => BigInt(w)), sum = 0n;
    const add = (all: bigint, w: bigint): bigint => all + w;
    while ((sum = weights.reduce(add, 0n)) >= 1n << 24n) weights = weights.map((w) => w >> 1n);
    let mean = 0, low = Infinity, high = 0, missed = 0, lean = 0, heavy = -1, next = 0;
    seen.forEach(([q], i) => {
      const k = number[q]!, w = Number(weights[i]), by = misses[q]!;
      mean += w * k;
      low = Math.min(low, k);
      high = Math.max(high, k);
      missed += Math.abs(by);
      lean += Math.sign(by);
      if (w > heavy || (w === heavy && k < next)) [heavy, next] = [w, k];
    });
    const guess = Math.floor((mean * 256) / Math.max(Number(sum), 1)), spread = Math.min(bits(high - low), 11);
    const miss = Math.min(bits(Math.floor(missed / count)), 8);
    const whole = (guess + 128) >> 8, part = (guess >> 6) & 3, side = next < whole ? 0 : next > whole ? 2 : 1;
    let k = whole, bit: number;
    const zero = (): number => o.context(C.ZERO_SPREAD + spread * 9 + miss).context(C.ZERO_REACH + reach * 9 + miss)
      .context(C.ZERO_PART + (spread * 4 + part) * 3 + count - 1).context(C.ZERO_NEXT + (side * 12 + spread) * 3 + count - 1)
      .bit(sets.ZERO + Math.min(spread, 2));
    while ((bit = zero()) < 0) yield;
    if (!bit) {
      let up = whole <= 0 ? 1 : 0;
      if (whole > 0 && whole < m) {
        const sign = (): number => o.context(C.SIGN_PART + part * 12 + spread).context(C.SIGN_NEXT + side * 9 + miss)
          .context(C.SIGN_PAST + (lean + 3) * 3 + side).bit(sets.SIGN);
        while ((up = sign()) < 0) yield;
      }
      let size = 1, d = 0;
      if ((up ? m - whole : whole) > 1) {
        const longer = (): number => o.context(C.SIZE_MISS + d * 9 + miss).context(C.SIZE_SPREAD + d * 12 + spread)
          .context(C.SIZE_REACH + d * 14 + reach).bit(sets.SIZE + d);
        for (; d < 17; d++) {
          while ((bit = longer()) < 0) yield;
          if (!bit) break;
        }
        for (let place = 0; place < d; place++) {
          while ((bit = o.coder.bit(C.DIGIT + 4 * d + Math.min(place, 3))) < 0) yield;
          size = 2 * size + bit;
        }
      }
      k = up ? whole + size : whole - size;
    }
    this.take(p, k, 8 * k - (guess >> 5));
  }

  /** The lines of annex B. */
  lines(): string[] {
    const { points, there, number, head } = this;
    if (!there.length) return [];
    const ranked = [...there].sort((p, q) => points.rank(p, q));
    return [`surface ${head!.W} ${head!.H} ${there.length}`, ...ranked.map((p) => `s ${points.x[p]} ${points.y[p]} ${number[p]}`)];
  }

  /** Points with their values, three numbers each, and triangles (10.9.6). */
  draw(): Pick<Drawing, "points" | "cells" | "sampled"> {
    const { points: { x, y }, number, there, head } = this, ids = new Map<number, number>();
    const at = new Float64Array(3 * there.length), scattered = head?.scattered;
    there.forEach((p, i) => {
      ids.set(p, i);
      const place = [x[p]!, y[p]!].map((q, a) => (scattered ? power(q + scattered[a + 1]!, scattered[0]) : q));
      at.set([...place, head!.offset + (head!.palette?.[number[p]!] ?? number[p]!) * head!.step], 3 * i);
    });
    return { points: at, sampled: !scattered, cells: Uint32Array.from(this.triangles?.corners ?? [], (p) => ids.get(p)!) };
  }
}
