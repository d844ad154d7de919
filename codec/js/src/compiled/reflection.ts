/** The state of compiled passes as a tube of this package, which is what is drawn and told. */
import { Coder, Input } from "../coder.js";
import type { Meter } from "../errors.js";
import type { Grid } from "../grid.js";
import { Offsets } from "../offsets.js";
import { Ints, KNOWN, SIGN } from "../store.js";
import { MIDDLE } from "../tables.js";
import { Leaves, seen, Tube } from "../tube.js";
import { Values } from "../values.js";
import type { Estimates } from "./estimates.js";
import type { Arr, Machine } from "./machine.js";
import type { CounterNames, State } from "./state.js";
import { visit } from "./store.js";

/** Bit of a point of the mesh that is in it. */
const IN = 1;
/** Where a row of active middles says what was seen; negative if it is kept. */
const SEEN = 3;
/** Of a row of leaves that are children of a diamond: from which bit they stand. */
const CHILDREN = 6;
/** Where vertices of simplices stand in the tables of the mesh; classes there, and numbers of a class. */
const VERTEX = 8, CLASSES = 192, WIDTH = 12;

/** By phase and the kernels' class: this package's, and its period in periods from that of the kernels. */
type Classes = readonly (readonly (readonly [cls: number, x: number, y: number, z: number])[])[];

function classes({ n, phases }: Grid, mesh: Int16Array): Classes {
  const from = (n - 2) * (mesh.length / 2) + VERTEX;
  return phases.map(({ count, off }, r) => {
    const own = new Map(Array.from({ length: count }, (_, cls) => [off.subarray(WIDTH * cls, WIDTH * cls + 3 * n + 3).join(), cls]));
    return Array.from({ length: count }, (_, cls) => {
      const at = from + (r * CLASSES + cls) * WIDTH, points = [...mesh.subarray(at, at + 3 * n + 3)];
      const shift = [0, 1, 2].map((a) => Math.floor(Math.min(...points.filter((_, i) => i % 3 === a)) / 4)) as [number, number, number];
      return [own.get(points.map((x, i) => x - 4 * shift[i % 3]!).join())!, ...shift] as const;
    });
  });
}

/** Values that compiled passes have found. */
class Found extends Values {
  /** By place in the store the number of the vertex, plus 1; by that number what has come, and the bits that are missing. */
  set(ids: Int32Array<ArrayBuffer>, number: Float64Array<ArrayBuffer>, missing: Uint8Array<ArrayBuffer>): void {
    this.ids = ids;
    this.number = number;
    this.missing = missing;
  }
}

/** The tube of a strand; `meter` is its own, since what is drawn and told is no part of the decoded state. */
export class Reflection {
  private values: Found | undefined;
  private readonly tube: Tube;
  private readonly classes: Classes;
  /** By place in the tube's store: the number of the vertex, plus 1. */
  private ids = new Int32Array(0);
  private known = 0;

  constructor(private readonly m: Machine, private readonly grid: Grid, meter: Meter, isovalue: number, scale: number | undefined) {
    this.tube = new Tube(grid, meter, new Coder(new Input(), meter), undefined, isovalue, scale);
    this.classes = classes(grid, m.kernels.mesh);
  }

  /** The tube as it is at present; `running` names the pass that goes on. */
  of(st: State, estimates: Estimates, running: string, shown: number): Tube {
    const { tube } = this, { counters } = st, begun = counters.get("edge") > 0;
    tube.uniform = begun ? counters.get("uniform") : -1;
    tube.base = counters.get("base_level");
    tube.adapted = counters.get("adapted") === 1;
    tube.hasBase = begun;
    tube.baseDone = begun && running !== "base";
    tube.shown = shown;
    this.learn(st);
    this.list(st, running);
    this.explain(st);
    this.value(estimates);
    this.cross(st, estimates);
    tube.changes++;
    return tube;
  }

  /** Vertices that have become known since. */
  private learn(st: State): void {
    const { tube: { store, known }, m } = this, count = st.counters.get("vertices"), rows = m.words(st.vertex);
    known.room(3 * (count - this.known));
    for (let v = this.known, i = 4 * v; v < count; v++, i += 4) {
      const x = rows[i]!, y = rows[i + 1]!, z = rows[i + 2]!;
      const at = store.make(x, y, z);
      if (at >= this.ids.length) {
        const ids = new Int32Array(store.flags.length);
        ids.set(this.ids);
        this.ids = ids;
      }
      store.flags[at]! |= rows[i + 3] ? KNOWN | SIGN : KNOWN;
      this.ids[at] = v + 1;
      known.data[known.length++] = x;
      known.data[known.length++] = y;
      known.data[known.length++] = z;
    }
    this.known = count;
  }

  /** The leaves; a round that goes on, of which those that it has made are told apart. */
  private list(st: State, running: string): void {
    const { tube, m } = this, { counters } = st, done = counters.get("done_leaves"), { meter } = tube;
    const round = running === "refinement", leaves = (tube.leaves = new Leaves(meter)), next = round ? new Leaves(meter) : leaves;
    this.add(st, st.leaf.rows(done), counters.get("leaves") - done, leaves);
    this.add(st, st.below, counters.get("next"), next);
    tube.round = undefined;
    if (!round) return;
    const active = new Ints(meter, 0), level = counters.get("level"), g = this.grid.edge(level) / 2, words = m.words(st.active);
    for (let i = 0, bisected = counters.get("bisected"); i < counters.get("coded"); i++) {
      const [x, y, z] = [0, 1, 2].map((a) => words[5 * i + a]! * g) as [number, number, number];
      for (const p of [x, y, z, words[5 * i + SEEN]! < 0 ? 0 : i < bisected ? MIDDLE : this.seen(level, x, y, z)]) active.push(p);
    }
    tube.round = { level, active, coded: active.length, next };
  }

  /** What is known of the diamond of a middle that is known. */
  private seen(level: number, x: number, y: number, z: number): number {
    const { tube } = this;
    tube.view.look(level, x, y, z);
    const { known, above } = tube.corners(), signs = tube.assumed(known, above);
    return seen(known | MIDDLE, tube.see(x, y, z) & SIGN ? signs | MIDDLE : signs);
  }

  /** Add the leaves that rows stand for, those that lie at a row of samples or behind it. */
  private add(st: State, rows: Arr, count: number, leaves: Leaves): void {
    const { m } = this, total = this.total(rows, count);
    const own = m.registers<CounterNames>("Counters", m.array("int64", [st.counters.size], false));
    const room = m.array("int32", [total, 5], false);
    own.set("leaves", count);
    m.call("tube_leaf_list__one_by_one", { ...st, leaf: rows, counters: own }, room);
    const found = m.words(room);
    for (let i = 0; i < 5 * total; i += 5) {
      const level = found[i + 4]!, s = 2 * this.grid.edge(level), [cls, x, y, z] = this.classes[level % this.grid.n]![found[i]!]!;
      leaves.add(level, cls, s * (found[i + 1]! + x), s * (found[i + 2]! + y), s * (found[i + 3]! + z));
    }
    m.release(room, false);
    m.release(own.array, false);
  }

  /** How many leaves rows stand for. */
  private total(rows: Arr, count: number): number {
    const words = this.m.words(rows);
    let total = 0;
    for (let i = 0; i < count; i++) total += words[5 * i]! >= 0 ? 1 : ones(((-1 - words[5 * i]!) >> CHILDREN) & 65535);
    return total;
  }

  /** Points of the mesh beyond its uniform level. */
  private explain(st: State): void {
    const { explicit } = this.tube;
    explicit.length = 0;
    visit(this.m, st.mesh, IN, (x, y, z) => [x, y, z].forEach((p) => explicit.push(p)));
  }

  private value({ hasValues, bits, number, left }: Estimates): void {
    const { tube, m } = this;
    if (!hasValues) return;
    const values = (tube.values = this.values ??= new Found(tube, ...bits)), count = number.size;
    const all = <T extends Float64Array | Uint8Array>(found: T, array: Arr): T => {
      for (let v = 0; v < count; v++) found[v] = m.number(array, v);
      return found;
    };
    // a vertex that has become known since has no number yet
    values.set(this.ids.map((id) => (id > count ? 0 : id)), all(new Float64Array(count), number), all(new Uint8Array(count), left));
  }

  private cross(st: State, { edges, parts, offset }: Estimates): void {
    const { tube, m } = this, count = edges.shape[0]!;
    tube.offsets = undefined;
    if (!count) return;
    const offsets = (tube.offsets = new Offsets(tube)), rows = m.words(st.vertex);
    const all = (array: Arr): Int32Array<ArrayBuffer> => new Int32Array(count).map((_, i) => m.number(array, i));
    const ends = m.words(edges);
    for (let i = 0; i < count; i++) {
      const low = 4 * ends[4 * i]!, high = 4 * ends[4 * i + 2]!;
      offsets.edges.add(rows[low]!, rows[low + 1]!, rows[low + 2]!, rows[high]!, rows[high + 1]!, rows[high + 2]!);
    }
    offsets.parts = all(parts);
    offsets.number = all(offset);
  }
}

function ones(bits: number): number {
  let count = 0;
  for (; bits; bits &= bits - 1) count++;
  return count;
}
