/** What geometry has told: numbers of the values at vertices, or parts of crossed edges (5.6, 5.7, 5.9). */
import { Crossings } from "../edges.js";
import { inOrder, lowerEndsInOrder } from "../order.js";
import type { Shift } from "../shift.js";
import type { Tube } from "../tube.js";
import { STEPS } from "../values.js";
import { chain } from "./chain.js";
import type { Coder } from "./coder.js";
import { Arr, type Machine } from "./machine.js";
import { numbered, release as letGo, surroundings } from "./numbers.js";
import type { State } from "./state.js";
import { keysOf } from "./store.js";

/** Positions on an edge are counted in parts of this. */
const UNIT = 4096;
/** No number is as large; numbers from this one on are not taken over from another isovalue (5.9.5). */
const UNBOUNDED = 2 ** 62, MOST_TAKEN = 2 ** 53;
/** Corners of a diamond and its middle. */
const CORNERS = 11;

/** Samples of a row of a block, rows of a block, blocks around one and that block, rows around a row. */
const ROW = 64, ROWS = 64, AROUND = 27, BESIDE = [11, 23];

/** Rows of the samples of a list, in order. */
interface ValueRows {
  readonly first: Arr;
  readonly rank: Arr;
  readonly beside: Arr;
  readonly around: Arr;
}

const noRows = (m: Machine): ValueRows => ({
  first: m.array("int32", [0]), rank: m.array("uint8", [0, ROW]), beside: m.array("int32", [0, 0]), around: m.array("int32", [0]),
});

/** What an isovalue leans on: its estimates and its state; how many steps it lies below, if they are few enough. */
export interface Earlier {
  readonly on: { readonly estimates: Estimates; readonly state: State };
  readonly shift: Shift | undefined;
}

export class Estimates {
  hasValues = false;
  /** Bits of numbers above and below. */
  bits: readonly [number, number] = [0, 0];
  /** By vertex: its number so far, and the bits that are missing. */
  number: Arr;
  left: Arr;
  /** Vertices at both ends of the edges that carry offsets, the lower one first; parts of each, and the number of its part. */
  edges: Arr;
  parts: Arr;
  offset: Arr;
  private readonly none: Arr;
  private least: Arr;
  private most: Arr;
  private active: Arr;
  /** Rows of the list of vertices on the full grid. */
  private rows: ValueRows;
  private told: Arr;
  private full = false;
  private plane = 0;
  private leafRows: Arr;
  private leafLevels: Arr;
  /** Meshes that the lists of vertices, of edges and of leaves are of. */
  private activeMesh = -1;
  private edgesMesh = -1;
  private leavesMesh = -1;
  /** What offsets look up: places and what is around by edge, sums of places by vertex, the chain of crossings. */
  private beside: { around: Arr; near: Arr; chain: Arr };
  private length: Arr;
  private rising: Arr;
  private earlierParts: Arr;
  private pitch: [parts: number, unit: number] = [1, 0];

  /** `reflected` gives the tube as it is known at present. */
  constructor(private readonly m: Machine, private readonly n: number, private earlier: Earlier | undefined, private readonly reflected: () => Tube) {
    const none = (this.none = m.array("int64", [0]));
    this.number = this.left = this.least = this.most = this.active = this.told = this.length = none;
    this.parts = this.offset = none;
    this.rows = noRows(m);
    this.edges = this.earlierParts = m.array("int64", [0, 2]);
    this.leafRows = m.array("int64", [0, n + 1]);
    this.leafLevels = none;
    this.rising = m.array("bool", [0]);
    this.beside = { around: m.array("int32", [0, 2 * n]), near: m.array("int64", [0, 2]), chain: m.array("int64", [0, 4]) };
  }

  /** Another array in the place of one that goes. */
  private instead(old: Arr, found: Arr): Arr {
    this.m.release(old);
    return found;
  }

  /** Vertex numbers of the leaves of a mesh that is complete. */
  private leaves(st: State): Arr {
    const { m, n } = this, { counters } = st, meshes = counters.get("meshes");
    if (meshes === this.leavesMesh) return this.leafRows;
    this.leavesMesh = meshes;
    const room = counters.get("held"), corners = m.array("int64", [CORNERS]);
    m.release(this.leafRows);
    m.release(this.leafLevels);
    this.leafRows = m.array("int64", [room, n + 1]);
    this.leafLevels = m.array("int64", [room]);
    const numbers = numbered(m, st), leaves = st.leaf.rows(0, counters.get("leaves"));
    const used = m.call("tube_leaf_vertices_vertex_numbers", st, numbers, leaves, corners, this.leafRows, this.leafLevels);
    letGo(m, numbers);
    m.release(corners);
    return (this.leafRows = this.kept(this.leafRows, used));
  }

  /** The first rows of an array; the others are given back. */
  private kept(array: Arr, count: number): Arr {
    const first = array.rows(0, count), from = Math.ceil((first.at + first.bytes) / 16) * 16;
    const rest = Math.ceil((array.at + array.bytes) / 16) * 16 - from;
    if (count && rest > 0) this.m.release(new Arr("int8", from, [rest]));
    else if (!count) this.m.release(array);
    return first;
  }

  /** Find the vertices that geometry by values refines now (5.6.2). */
  private activate(st: State, full: boolean): void {
    const { m } = this, count = st.counters.get("vertices");
    m.release(this.active);
    if (full) {
      const active = m.array("int64", [count]), links = this.linked(st), order = this.ordered(st, upTo(count), inOrder);
      this.active = this.kept(active, m.call("passes_carriers_grid_ends", st, links, order, active));
      [links, order].forEach((array) => m.release(array));
    } else {
      const leaves = this.leaves(st), found = new Set(Array.from({ length: leaves.size }, (_, i) => m.number(leaves, i)));
      this.active = this.ordered(st, [...found], inOrder);
    }
    this.activeMesh = st.counters.get("meshes");
    this.setRows(noRows(m));
  }

  private setRows(rows: ValueRows): void {
    Object.values(this.rows).forEach((array) => this.m.release(array));
    this.rows = rows;
  }

  /** Make the rows of the list of vertices on the full grid: samples near one of them follow from these. */
  private listRows(st: State): void {
    const { m, n, active } = this, counts = m.array("int64", [2]);
    m.call("models_value_rows_count_rows", st, active, counts);
    const count = m.number(counts, 0), blocks = m.number(counts, 1);
    const rows = {
      first: m.array("int32", [count + 1]), rank: m.array("uint8", [count + 1, ROW]), beside: m.array("int32", [count, BESIDE[n - 2]!]),
      around: m.array("int32", [STEPS[n - 2]!.length / 3]),
    };
    const key = m.array("int64", [blocks]), row = m.array("int32", [blocks, ROWS]), near = m.array("int64", [AROUND]);
    m.call("models_value_rows_enter_rows", st, active, key, row, rows);
    m.call("models_value_rows_enter_beside", st, key, row, near, rows.beside);
    [counts, key, row, near].forEach((array) => m.release(array));
    this.setRows(rows);
  }

  /** For each vertex what is known of the next samples along each axis. */
  private linked(st: State): Arr {
    const { m, n } = this, links = m.array("int32", [st.counters.get("vertices"), 2 * n]);
    const numbers = numbered(m, st), keys = keysOf(m, st.known), room = surroundings(m, n);
    m.call("passes_carriers__link", numbers, keys, room, links);
    letGo(m, numbers);
    for (const array of [keys, ...Object.values(room)]) m.release(array);
    return links;
  }

  /** Vertices in an order of their positions. */
  private ordered(st: State, vertices: ArrayLike<number>, order: (n: number, points: Int32Array) => ArrayLike<number>): Arr {
    const rows = this.m.words(st.vertex), points = new Int32Array(3 * vertices.length);
    for (let i = 0; i < vertices.length; i++) for (let a = 0; a < 3; a++) points[3 * i + a] = rows[4 * vertices[i]! + a]!;
    const found = order(this.n, points), sorted = new Int32Array(found.length);
    for (let i = 0; i < found.length; i++) sorted[i] = vertices[found[i]!]!;
    return this.m.numbers(sorted);
  }

  /** Begin a layer of values, down to `plane` missing bits. */
  beginValues(st: State, full: boolean, plane: number, bits: readonly [number, number]): void {
    const { m } = this, count = st.counters.get("vertices"), old = this.number.size;
    this.bits = bits;
    if (st.counters.get("meshes") !== this.activeMesh) this.activate(st, full);
    this.full = full;
    this.plane = plane;
    if (count > old) {
      this.number = this.instead(this.number, m.wider(this.number, count));
      this.left = this.instead(this.left, m.wider(this.left, count));
      const rows = m.words(st.vertex);
      for (let v = old; v < count; v++) m.enter(this.left, v, bits[rows[4 * v + 3] ? 0 : 1]);
      this.take(st, old, count);
    }
    // what offsets said of the crossings, values say better
    if (!this.hasValues) this.forgetEdges();
    this.hasValues = true;
    m.enter(st.valueBits, 0, bits[1]);
    m.enter(st.valueBits, 1, bits[0]);
  }

  private forgetEdges(): void {
    for (const array of [this.edges, this.parts, this.offset]) this.m.release(array);
    this.edges = this.m.array("int64", [0, 2]);
    this.parts = this.offset = this.none;
  }

  /** Numbers of the vertices of another isovalue at those from `first` to `end` of this one's, -1 for none. */
  private numbersAt(other: State, positions: readonly number[]): Arr {
    const { m } = this, count = positions.length / 3, place = m.numbers(positions, [count, 3]), found = m.array("int64", [count]), numbers = numbered(m, other);
    m.call("tube_ranks_enter_numbers_at", numbers, place, found);
    letGo(m, numbers);
    m.release(place);
    return found;
  }

  /** What the earlier isovalue knows of the values of vertices (5.9.5). */
  private take(st: State, first: number, end: number): void {
    const { m, earlier } = this;
    if (!earlier || earlier.shift === undefined || !earlier.on.estimates.number.size) return;
    const { on: { estimates: before, state: other }, shift: { down, up } } = earlier, had = this.most.size;
    this.least = this.instead(this.least, m.wider(this.least, end));
    this.most = this.instead(this.most, m.wider(this.most, end));
    // the earlier isovalue may have had no values when the vertices before got their numbers
    for (let v = had; v < first; v++) m.enter(this.most, v, UNBOUNDED);
    const positions: number[] = [];
    for (let v = first, rows = m.words(st.vertex); v < end; v++) positions.push(rows[4 * v]!, rows[4 * v + 1]!, rows[4 * v + 2]!);
    const there = this.numbersAt(other, positions);
    for (let v = first; v < end; v++) {
      m.enter(this.most, v, UNBOUNDED);
      const u = m.number(there, v - first);
      if (u < 0 || u >= before.number.size) continue;
      const sign = m.words(other.vertex)[4 * u + 3]!, left = m.number(before.left, u);
      if (left >= before.bits[sign ? 0 : 1]) continue;
      const low = m.number(before.number, u) * 2 ** left, high = low + 2 ** left - 1;
      // steps between the earlier isovalue and the value, then numbers on this one's side
      const [from, to] = sign ? [low + 1, high + 1] : [-high, -low];
      const [least, most] = m.words(st.vertex)[4 * v + 3] ? [from - up - 1, to - down - 1] : [down - to, up - from];
      if (Math.max(Math.abs(least), Math.abs(most)) >= MOST_TAKEN) continue;
      if (left === 0 && least === most) {
        m.enter(this.number, v, least);
        m.enter(this.left, v, 0);
      }
      m.enter(this.least, v, least);
      m.enter(this.most, v, most);
    }
    m.release(there);
  }

  /** Go on with a layer of values. */
  codeValues(st: State, cd: Coder): number {
    const { m, active } = this;
    if (this.full && !this.rows.first.size) {
      this.listRows(st);
      this.told = this.instead(this.told, m.array("int64", [active.size + 1]));
      m.call("passes_values_enter_told", st, active, this.number, this.left, this.told);
    }
    const nearby = { rows: this.rows, told: this.told, least: this.least, most: this.most };
    return m.call("passes_values_values", st, cd, nearby, active, this.number, this.left, this.plane, this.none);
  }

  /** Begin a layer of offsets, to at least `parts` parts in `2**unit` samples of an edge. */
  beginOffsets(st: State, full: boolean, parts: number, unit: number): void {
    this.pitch = [parts, unit];
    if (st.counters.get("meshes") !== this.edgesMesh) this.listEdges(st, full);
  }

  /** Go on with a layer of offsets. */
  codeOffsets(st: State, cd: Coder): number {
    const crossings = {
      edges: this.edges, number: this.offset, parts: this.parts, length: this.length, rising: this.rising, earlier: this.earlierParts,
    };
    return this.m.call("passes_offsets_offsets", st, cd, this.beside, crossings, ...this.pitch, this.none, this.none);
  }

  /** Make the list of edges that carry offsets anew; those that stay keep theirs. */
  private listEdges(st: State, full: boolean): void {
    const { m, n } = this, count = st.counters.get("vertices"), before = { edges: this.edges, parts: this.parts, offset: this.offset };
    this.edgesMesh = st.counters.get("meshes");
    let crossings: Crossings | undefined, listed: number[] = [], links: Arr | undefined;
    if (full) {
      const room = m.array("int64", [n * count, 2]), order = this.ordered(st, upTo(count), lowerEndsInOrder);
      links = this.linked(st);
      this.edges = this.kept(room, m.call("passes_carriers_grid_edges", st, links, order, room));
      m.release(order);
    } else {
      const tube = this.reflected();
      crossings = new Crossings(tube, tube.leaves);
      listed = [...crossings.index.inOrder()].filter((id) => !crossings!.rings[id]);
      const e = crossings.index.ends, ends = this.numbersAt(st, listed.flatMap((id) => [...e.subarray(6 * id, 6 * id + 6)]));
      this.edges = m.numbers(Array.from({ length: ends.size }, (_, i) => m.number(ends, i)), [listed.length, 2]);
      m.release(ends);
    }
    const size = this.edges.shape[0]!;
    this.parts = m.numbers(new Uint8Array(size).fill(1));
    this.offset = m.array("int64", [size]);
    const old = new Map(this.keys(before.edges, count).map((each, i) => [each, i]));
    if (old.size) this.keys(this.edges, count).forEach((each, i) => {
      const j = old.get(each);
      if (j === undefined) return;
      m.enter(this.parts, i, m.number(before.parts, j));
      m.enter(this.offset, i, m.number(before.offset, j));
    });
    Object.values(before).forEach((array) => m.release(array));
    this.describe(st);
    const { beside } = this, axes = n === 3 || full;
    if (links) {
      m.call("models_crossings_nearby__join_grid", this.edges, links, beside.around);
      m.release(links);
    } else {
      const leaving = m.array("int32", [axes ? count : 0, n]);
      m.words(leaving).fill(-1);
      const numbers = numbered(m, st);
      m.call("models_crossings_nearby__join_leaves", st, numbers, this.edges, this.length, leaving, beside.around);
      letGo(m, numbers);
      m.release(leaving);
    }
    beside.near = this.instead(beside.near, full ? m.array("int64", [0, 2]) : this.sums(count));
    beside.chain = this.instead(beside.chain, axes ? m.array("int64", [0, 4]) : m.numbers(chain(crossings!, listed), [size, 4]));
  }

  private keys(edges: Arr, count: number): number[] {
    const ends = this.m.words(edges);
    return Array.from({ length: edges.shape[0]! }, (_, i) => ends[4 * i]! * count + ends[4 * i + 2]!);
  }

  /** Lengths of edges, which ends are above, places so far, parts at the earlier isovalue. */
  private describe(st: State): void {
    const { m, n } = this, size = this.edges.shape[0]!;
    this.length = this.instead(this.length, m.array("int64", [size]));
    this.rising = this.instead(this.rising, m.array("bool", [size]));
    this.beside.around = this.instead(this.beside.around, m.array("int32", [size, 2 * n]));
    // all of these numbers take four bytes: the first word of each entry says them
    const rows = m.words(st.vertex), rising = m.bytes(this.rising), ends = m.words(this.edges), lengths = m.words(this.length);
    const around = m.words(this.beside.around).fill(-1), numbers = m.words(this.offset), parts = m.words(this.parts);
    for (let i = 0; i < size; i++) {
      const low = 4 * ends[4 * i]!, high = 4 * ends[4 * i + 2]!;
      for (let a = 0; a < 3; a++) lengths[2 * i] = Math.max(lengths[2 * i]!, Math.abs(rows[high + a]! - rows[low + a]!));
      rising[i] = rows[high + 3]!;
      // twice the place, and 1 more if a digit has told of it
      around[2 * n * i] = 2 * Math.floor(((2 * numbers[2 * i]! + 1) * (UNIT / 2)) / parts[2 * i]!) + (parts[2 * i]! > 1 ? 1 : 0);
    }
    this.earlierParts = this.instead(this.earlierParts, m.array("int64", [size, 2]));
    if (this.earlier?.on.estimates.edges.size) this.takeParts(st, this.earlier);
  }

  /** Numbers and parts at the earlier isovalue, of edges between neighbouring samples (5.9.6). */
  private takeParts(st: State, { on: { estimates: before, state: other } }: Earlier): void {
    const { m } = this, size = this.edges.shape[0]!, rows = m.words(st.vertex), positions: number[] = [];
    for (let i = 0; i < 2 * size; i++) positions.push(...rows.subarray(4 * m.number(this.edges, i), 4 * m.number(this.edges, i) + 3));
    const ends = this.numbersAt(other, positions), vertices = other.counters.get("vertices");
    const old = new Map(before.keys(before.edges, vertices).map((each, i) => [each, i]));
    for (let i = 0; i < size; i++) {
      const low = m.number(ends, 2 * i), high = m.number(ends, 2 * i + 1);
      if (low < 0 || high < 0 || m.number(this.length, i) !== 1) continue;
      const j = old.get(low * vertices + high);
      if (j === undefined || m.number(before.parts, j) <= 1) continue;
      m.enter(this.earlierParts, 2 * i, m.number(before.offset, j));
      m.enter(this.earlierParts, 2 * i + 1, m.number(before.parts, j));
    }
    m.release(ends);
  }

  /** By vertex, how far the crossings told on its edges lie from it, and their number (7.14.4(1)). */
  private sums(count: number): Arr {
    const { m, n } = this, found = m.array("int64", [count, 2]);
    for (let i = 0; i < this.edges.shape[0]!; i++) {
      if (m.number(this.parts, i) <= 1) continue;
      const place = m.words(this.beside.around)[2 * n * i]! >> 1, length = m.number(this.length, i);
      [place, UNIT - place].forEach((way, end) => {
        const v = m.number(this.edges, 2 * i + end);
        m.enter(found, 2 * v, m.number(found, 2 * v) + way * length);
        m.enter(found, 2 * v + 1, m.number(found, 2 * v + 1) + 1);
      });
    }
    return found;
  }

  /** No further layer will come: only what has been told is kept. */
  rest(): void {
    const { m, n, beside } = this;
    for (const array of [this.active, this.told, this.least, this.most, this.length, this.rising, this.earlierParts,
      this.leafRows, this.leafLevels, ...Object.values(beside)]) m.release(array);
    this.setRows(noRows(m));
    this.active = this.told = this.least = this.most = this.length = this.leafLevels = this.none;
    this.rising = m.array("bool", [0]);
    this.earlierParts = m.array("int64", [0, 2]);
    this.leafRows = m.array("int64", [0, n + 1]);
    this.beside = { around: m.array("int32", [0, 2 * n]), near: m.array("int64", [0, 2]), chain: m.array("int64", [0, 4]) };
    this.activeMesh = this.edgesMesh = this.leavesMesh = -1;
  }

  /** Let go of the isovalue that this one leans on. */
  part(): void {
    this.earlier = undefined;
  }

  release(): void {
    this.rest();
    for (const array of [this.number, this.left, this.edges, this.parts, this.offset]) this.m.release(array);
  }
}

/** The numbers below `count`. */
function upTo(count: number): Int32Array {
  const found = new Int32Array(count);
  for (let i = 0; i < count; i++) found[i] = i;
  return found;
}
