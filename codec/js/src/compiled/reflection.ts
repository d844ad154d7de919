/** The state of compiled passes as a tube of this package, which is what is drawn and told. */
import { Coder, Input } from "../coder.js";
import type { Meter } from "../errors.js";
import type { Grid } from "../grid.js";
import { Offsets } from "../offsets.js";
import { KNOWN, SIGN } from "../store.js";
import { Leaves, Tube } from "../tube.js";
import { Values } from "../values.js";
import type { Estimates } from "./estimates.js";
import type { Arr, Machine } from "./machine.js";
import type { CounterNames, State } from "./state.js";
import { visit } from "./store.js";

/** Bits of a point of the mesh: it is in it; it was known when it was added. */
const IN = 1, OLD = 8;
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

  constructor(private readonly m: Machine, private readonly grid: Grid, meter: Meter, isovalue: number, scaled: boolean) {
    // kernels have counted vertices
    meter.vertices = Infinity;
    this.tube = new Tube(grid, meter, new Coder(new Input(), meter), undefined, isovalue, scaled);
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
    this.list(st, !["", "base", "values", "offsets"].includes(running));
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

  /** The leaves that are drawn; while a round goes on those that it has bisected are left out. */
  private list(st: State, round: boolean): void {
    const { tube, m } = this, { counters } = st, done = counters.get("done_leaves");
    const leaves = (tube.leaves = new Leaves(tube.meter)), own = m.registers<CounterNames>("Counters", m.array("int64", [counters.size], false));
    const room = m.array("int32", [counters.get("held") + counters.get("leaves") + counters.get("mixed"), 5], false);
    const add = (rows: Arr, count: number, skip: number, bisected: (level: number, cls: number, x: number, y: number, z: number) => boolean): void => {
      own.set("leaves", count);
      m.words(room)[0] = -1;
      m.call("tube_leaf_list__one_by_one", { ...st, leaf: rows, counters: own }, room);
      const found = m.words(room), total = this.total(rows, count);
      for (let i = 5 * skip; i < 5 * total; i += 5) {
        const level = found[i + 4]!, s = 2 * this.grid.edge(level), [cls, x, y, z] = this.classes[level % this.grid.n]![found[i]!]!;
        const bx = s * (found[i + 1]! + x), by = s * (found[i + 2]! + y), bz = s * (found[i + 3]! + z);
        if (!bisected(level, cls, bx, by, bz)) leaves.add(level, cls, bx, by, bz);
      }
    };
    const child = counters.get("child"), first = m.words(st.leaf)[5 * done]!;
    const skip = round && child > 0 && first < 0 ? ones(((-1 - first) >> CHILDREN) & ((1 << child) - 1)) : 0;
    add(st.leaf.rows(done), counters.get("leaves") - done, skip, round ? this.bisected(st) : () => false);
    add(st.below, counters.get("next"), 0, () => false);
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

  /** Whether the round has bisected a leaf: its middle is known, and was not before. */
  private bisected(st: State): (level: number, cls: number, x: number, y: number, z: number) => boolean {
    const { tube: { store }, grid: { n, phases, last, full }, grid } = this, { counters } = st;
    const present = counters.get("level"), before = counters.get("before_round"), asks = counters.get("asks") === 1;
    const added = new Set<string>();
    if (asks) visit(this.m, st.mesh, IN, (x, y, z, entry) => entry & OLD || added.add(`${x},${y},${z}`));
    return (level, cls, bx, by, bz) => {
      if (level !== present || level >= full) return false;
      const { middle } = phases[level % n]!, g = grid.edge(level) / 2;
      const w = [bx, by, bz].map((b, a) => b + middle[3 * cls + a]! * g);
      if (asks && !added.has(w.join())) return false;
      const [x, y, z] = w.map((p, a) => Math.min(Math.max(p, 0), last[a]!)) as [number, number, number];
      const id = store.get(x, y, z) & KNOWN ? this.ids[store.at(x, y, z)]! : 0;
      return id > (asks ? 0 : before);
    };
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
