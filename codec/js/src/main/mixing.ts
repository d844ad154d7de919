/** Symbols of the main profile: mixing (7.11), what their networks see, the panel of frames (7.18). */
import { bits } from "../bits.js";
import { CLASS, type Weighed } from "../models.js";
import type { Offsets } from "../offsets.js";
import { TRUST } from "../trust.js";
import type { Tube } from "../tube.js";
import type { Values } from "../values.js";
import { Crowd } from "./crowd.js";
import { LEANS, type OffsetSymbol, offsetRows, ValueOpinions } from "./geometry.js";
import { Panel } from "./panel.js";
import { componentRows, questionRows, refinementRows, rows, signRows } from "./rows.js";
import { KINDS, PAIR, type Tables, VALUE_OPINIONS, VALUE_SETS } from "./tables.js";

/** What an isovalue has beside its contexts. */
export class Mixing {
  /** Weights of opinions by kind; those of the panel, of an isovalue that leans on one of the frame before. */
  readonly mix: Float64Array;
  private readonly weights: Float64Array | undefined;
  /** What is seen of the isovalue of the frame before. */
  private panel: Panel | undefined;
  private crowd: Crowd | undefined;

  constructor(private readonly t: Tube, private readonly tables: Tables, { mix, panel }: Weighed, framed: boolean) {
    if (framed) this.weights = panel;
    if (framed && t.lean) this.panel = new Panel(t.lean.store, t.store, t.grid, t.meter);
    this.mix = mix!;
  }

  /** Forget what only further layers need. */
  finish(): void {
    this.panel = this.crowd = undefined;
  }

  /** A round with new components begins. */
  count(): void {
    (this.crowd ??= new Crowd(this.t)).count();
  }

  /** A new component, at a position. */
  born(x: number, y: number, z: number): void {
    const [lastX, lastY, lastZ] = this.t.grid.last;
    this.crowd?.born(Math.min(x, lastX), Math.min(y, lastY), Math.min(z, lastZ));
  }

  /** A refinement sign (7.12): 1 stands for `meaning`; `here` is the sign of the anchor, `corners` as in `refinementRows`. */
  refinement(level: number, x: number, y: number, z: number, crossed: number, corners: number, here: number, earlier: number,
             apart: number, context: number, meaning: number): number {
    const { t } = this, r = level % t.n, count = refinementRows(t, level, x, y, z, crossed, corners, here, earlier, apart);
    const panel = earlier < 0 ? undefined : this.panel, kind = 2 * r + crossed;
    panel?.look(kind, x, y, z, t.grid.edge(level), earlier & 1, meaning);
    return this.mixed(count, r, kind + (earlier >= 0 ? 6 : 0), context, meaning !== here, panel);
  }

  /** A question about the mesh (7.16): 0 to 2 of a base, 3 whether to split. */
  question(what: number, level: number, x: number, y: number, z: number, history: number, context: number): number {
    return this.mixed(questionRows(this.t, what, level, x, y, z, history), 6, 36 + what, context, false);
  }

  /** The sign of vertex `o` of a simplex, at `v`, in a base (7.17). */
  sign(level: number, cls: number, x: number, y: number, z: number, o: number, predicted: number, kase: number,
       earlier: number, context: number, v: readonly [number, number, number]): number {
    const { t } = this, r = level % t.n, panel = earlier < 0 ? undefined : this.panel;
    panel?.look(6 + r, ...v, t.grid.edge(level), earlier & 1, predicted);
    const count = signRows(t, level, cls, x, y, z, o, predicted, kase, earlier);
    return this.mixed(count, 7, 40 + r + (earlier >= 0 ? 3 : 0), context, false, panel);
  }

  /** A node of the tree of new components, or a slot (`height` -1) (7.13). */
  component(level: number, height: number, root: boolean, child: number, hits: number, nearness: number,
            qx: number, qy: number, qz: number, context: number): number {
    const { t } = this, count = componentRows(t, this.crowd!, level, height, root, child, hits, nearness, qx, qy, qz);
    return this.mixed(count, 3, (height > 0 || root ? 12 : height === 0 ? 13 : 14) + (t.lean ? 3 : 0), context, false);
  }

  /** What is said of a value bit: logits, then those of the contexts. */
  private readonly about = new ValueOpinions();

  /** A bit of a vertex's number on the full grid (7.15). */
  value(values: Values, number: number, plane: number, context: number): number {
    const { t: { coder, n }, about: { said, contexts }, mix, tables: { squash, stretch } } = this;
    this.about.list(values, n, number, plane, context);
    const count = LEANS + n + 2;
    for (let i = LEANS; i < count; i++) said[i] = this.opinion(contexts[i - LEANS]!, stretch);
    const o = 4 * KINDS + VALUE_OPINIONS * Math.min(bits(number), VALUE_SETS - 1);
    let sum = 0;
    for (let i = 0; i < count; i++) sum += mix[o + i]! * said[i]!;
    const p = squash[logit(sum) + 2047]!, bit = coder.raw(p);
    if (bit < 0) return bit;
    const error = 40 * (65536 * bit - p);
    for (let i = 0; i < count; i++) mix[o + i] = moved(mix[o + i]!, (error * said[i]!) / 1048576);
    for (let i = LEANS; i < count; i++) coder.update(contexts[i - LEANS]!, bit);
    return bit;
  }

  /** A symbol of a digit (7.14). */
  offset(offsets: Offsets, symbol: OffsetSymbol, context: number): number {
    const { t } = this, off = t.onFullGrid ? 0 : 1, { i, again, nearer } = symbol, count = offsetRows(offsets, t, symbol);
    const kind = nearer >= 0 ? 30 + Math.min(i, 2) + 3 * off : 18 + Math.min(i, 2) + 3 * again + 6 * off;
    return this.mixed(count, 4 + off, kind, context, false);
  }

  private opinion(context: number, stretch: Int16Array): number {
    const { p, seen } = this.t.models;
    return (stretch[p[context]! >> 4]! * TRUST[seen[context]!]!) >> 8;
  }

  /** The sum of the rows, cut off below 0, weighed by the network (7.11(2)). */
  private network(network: number, count: number): number {
    const { weight, out } = this.tables;
    let total = out[49 * network + 48]!;
    for (let j = 0; j < 24; j += 8) {
      let s0 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0, s5 = 0, s6 = 0, s7 = 0;
      for (let i = 0; i < count; i++) {
        const at = 24 * rows[i]! + j;
        s0 += weight[at]!;
        s1 += weight[at + 1]!;
        s2 += weight[at + 2]!;
        s3 += weight[at + 3]!;
        s4 += weight[at + 4]!;
        s5 += weight[at + 5]!;
        s6 += weight[at + 6]!;
        s7 += weight[at + 7]!;
      }
      const o = 49 * network + 2 * j;
      total += pair(s0, out, o) + pair(s1, out, o + 2) + pair(s2, out, o + 4) + pair(s3, out, o + 6) +
        pair(s4, out, o + 8) + pair(s5, out, o + 10) + pair(s6, out, o + 12) + pair(s7, out, o + 14);
    }
    return total;
  }

  /** Opinions of a panel's contexts. */
  private readonly opinions = new Int32Array(7);

  /** The opinions of a panel, weighed (7.18.3(3)). */
  private ask(panel: Panel, said: number): number {
    const { opinions, weights, tables } = this;
    panel.choose(said);
    let sum = 0;
    for (let i = 0; i < 7; i++) {
      opinions[i] = this.opinion(panel.contexts[i]!, tables.stretch);
      sum += weights![7 * panel.kind + i]! * opinions[i]!;
    }
    return sum;
  }

  private teach(panel: Panel, error: number, bit: number): void {
    const { weights } = this;
    for (let i = 0; i < 7; i++) {
      const o = 7 * panel.kind + i;
      weights![o] = moved(weights![o]!, (error * this.opinions[i]!) / 2097152);
      this.t.coder.update(panel.contexts[i]!, bit);
    }
  }

  /** A seed in a context (5.9.4(2)), which the panel looks at, too, if there is one (7.18.3(4)). */
  seed(context: number, x: number, y: number, z: number, edge: number, earlier: number): number {
    const { panel, tables: { squash, stretch } } = this;
    if (!panel) return this.t.coder.bit(context);
    panel.look(9, x, y, z, edge, earlier & 1, 1);
    const said = this.opinion(context, stretch), p = squash[logit(65536 * said + this.ask(panel, said)) + 2047]!;
    const bit = this.t.coder.raw(p);
    if (bit < 0) return bit;
    this.teach(panel, 40 * (65536 * bit - p), bit);
    this.t.coder.update(context, bit);
    return bit;
  }

  /** A symbol that is mixed (7.11), of the first `count` rows; `panel` is that of 7.18, if it has one. */
  private mixed(count: number, network: number, kind: number, context: number, flip: boolean, panel?: Panel): number {
    const { tables: { squash, stretch }, mix: m } = this;
    let said = Math.floor(this.network(network, count) / 256);
    said = said < -2047 ? -2047 : said > 2047 ? 2047 : said;
    if (flip) said = -said;
    const group = CLASS + 32 * kind + ((said + 2047) >> 7);
    const said1 = this.opinion(context, stretch), said2 = this.opinion(group, stretch);
    const o = 4 * kind;
    let sum = m[o]! * said + m[o + 1]! * said1 + m[o + 2]! * said2 + m[o + 3]! * 256;
    if (panel) sum += this.ask(panel, said);
    const p = squash[logit(sum) + 2047]!;
    const bit = this.t.coder.raw(p);
    if (bit < 0) return bit;
    const error = 40 * (65536 * bit - p);
    for (let j = 0; j < 4; j++) {
      const by = j === 0 ? said : j === 1 ? said1 : j === 2 ? said2 : 256;
      m[o + j] = moved(m[o + j]!, (error * by) / 1048576);
    }
    if (panel) this.teach(panel, error, bit);
    this.t.coder.update(context, bit);
    this.t.coder.update(group, bit);
    return bit;
  }
}

function logit(sum: number): number {
  const x = Math.floor(sum / 65536);
  return x < -2047 ? -2047 : x > 2047 ? 2047 : x;
}

/** A weight after a step, rounded down (7.11(1)). */
function moved(weight: number, by: number): number {
  const w = weight + Math.floor(by);
  return w < -4194304 ? -4194304 : w > 4194304 ? 4194304 : w;
}

/** Both columns of a sum, each cut off below 0, weighed. */
function pair(sum: number, out: Float64Array, at: number): number {
  const high = Math.round(sum / PAIR), low = sum - PAIR * high;
  return (low > 0 ? out[at]! * low : 0) + (high > 0 ? out[at + 1]! * high : 0);
}
