/** Crossings by those of an earlier isovalue of the frame (10.6.4). */
import { clip, shr } from "./integers.js";
import type { Offsets } from "./offsets.js";

export class Rise {
  /** How far the isovalue lies above the earlier one, by vertex; 0 where that is not known. */
  private readonly above: Float64Array;
  private readonly wide = [0, 0];
  /** Of the edge that was asked for last: the difference of the values of its ends, 0 without one, and the place then. */
  private span = 0;
  private then = 0;

  constructor(private readonly other: Offsets) {
    this.above = new Float64Array(other.value.length);
  }

  /** The class, the guess and the width of an edge whose upper end lies above or not; none if there is no guess. */
  guess(a: number, b: number, rising: boolean, parts: number, width: number): readonly [number, number, number] | undefined {
    const { above, other, other: { value } } = this, span = value[b]! - value[a]!, e = other.edges.find(a, b);
    this.then = e < 0 ? 0 : other.place(e);
    // NaN if a value is not known
    this.span = rising ? (span > 0 ? span : 0) : span < 0 ? span : 0;
    const p = above[a]!, q = above[b]!;
    if (!this.span || (!p && !q)) return undefined;
    const by = p && q ? shr(p + q, 1) : p || q, kind = e < 0 ? 1 : 0;
    const place = e < 0 ? Math.floor((by - 65536 * value[a]!) / span) : this.then + Math.floor(by / span);
    return [kind, shr(clip(place, 0, 65536) * parts, 8), this.wide[kind] || width];
  }

  /** The edge is crossed at a place; `missed`: the class of its guess, and how far that was off. */
  see(a: number, b: number, place: number, missed: readonly [number, number] | undefined): void {
    const { above, wide, span, then } = this;
    if (missed) {
      const [kind, by] = missed, old = wide[kind] || by;
      wide[kind] = Math.max(old + Math.floor((by - old) / 16), 64);
    }
    if (!span) return;
    const by = then ? (place - then) * span : place * span + 65536 * this.other.value[a]!;
    for (const v of [a, b]) above[v] = above[v] ? above[v]! + shr(by - above[v]!, 2) : by;
  }
}
