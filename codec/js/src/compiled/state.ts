/** The state that kernels work on: known vertices and the tubular neighbourhood (5.1). */
import type { Grid } from "../grid.js";
import type { Meter } from "../errors.js";
import type { Arr, Machine, Registers } from "./machine.js";
import { noNumbers, type Numbers } from "./numbers.js";
import { newBoard, newCounts, newFlags, newStore, PAGES, release, roomy, spare, type Store } from "./store.js";

export type CounterNames = "level" | "edge" | "vertices" | "leaves" | "next" | "active" | "coded" | "bisected" | "done_leaves" | "mixed" | "held" | "most_mixed" |
  "base_level" | "uniform" | "finest" | "error" | "work" | "step_work" | "most_work" | "asks" | "adapted" | "room" |
  "side" | "down" | "up" | "told" | "seeded" | "meshes" | "agreed" | "masked" | "row";
export type Counters = Registers<CounterNames>;
type WalkNames = "gates" | "last_root" | "more";
type Walk = Registers<WalkNames>;

export interface GridRecord {
  readonly tables: Arr;
  readonly last0: number;
  readonly last1: number;
  readonly last2: number;
  readonly exponent: number;
}

/** What is known of an earlier isovalue (5.9), or of the mask (5.10). */
export interface Lean {
  readonly grid: GridRecord;
  readonly counters: Counters;
  readonly valueBits: Arr;
  readonly known: Store;
  readonly mesh: Store;
  readonly number: Arr;
  readonly left: Arr;
  readonly numbers: Numbers;
}

/** An entry of `known` is 0 of an unknown vertex, else 2 plus the sign; `vertex` has position and sign a row. */
export interface State {
  readonly grid: GridRecord;
  readonly counters: Counters;
  readonly tally: Arr;
  readonly calm: Arr;
  readonly valueBits: Arr;
  readonly known: Store;
  readonly vertex: Arr;
  readonly leaf: Arr;
  readonly below: Arr;
  readonly active: Arr;
  readonly mesh: Store;
  readonly crowd: Store;
  readonly censuses: Arr;
  readonly board: Store;
  readonly path: Arr;
  readonly chosen: { readonly inside: Arr; readonly outside: Store };
  readonly lean: Lean;
  readonly hole: Lean;
  readonly soft: Store;
  readonly truth: Arr;
  readonly base: Walk;
  readonly refinement: Walk;
  readonly tree: Walk;
  readonly value: Walk;
  readonly digit: Walk;
  readonly turns: Arr;
  readonly trail: Arr;
  readonly early: Arr;
  readonly candidates: Arr;
  readonly window: Arr;
  readonly near: Arr;
  readonly scratch: Arr;
  readonly stack: Arr;
}

/** In the counter `side`: the isovalue leans on one of an earlier frame. */
export const FRAME = 2;
/** How often something has been so, as it begins. */
const MOSTLY = 3584;
/** Syntax elements, and predictions. */
const TALLY = 14;
/** Rows that lists begin with; ancestors of a vertex; entries of the stack, and of a gate on it. */
const ROWS = 2048, ANCESTORS = 4096, STACK = 4096, GATE = 7;
/** What one step of a pass adds at most: vertices, simplices, pages of the crowd; gates that a grown stack has room for. */
const VERTICES = 16, LEAVES = 24, CELLS = 26, GATES = 128;
/** Simplices of a mesh at most: their numbers are integers of 32 bits. */
const MOST_LEAVES = 2 ** 28;
/** Entries of turns, censuses, trail, early points, candidates, window, scratch. */
const SIZES = [80, 80, 40, 40, 80, 10, 128];
/** Entries of the part of the board that is copied. */
const NEAR = 20480;

/** States of a file: what all of them share. */
export class States {
  private readonly grid: GridRecord;
  /** What kernels see where there is no earlier isovalue. */
  readonly noLean: Lean;
  private readonly chosen: State["chosen"];
  private readonly noBoard: Store;
  private readonly noStore: Store;

  constructor(private readonly m: Machine, private readonly meter: Meter, { n, last, k }: Grid) {
    const { mesh } = m.kernels, half = mesh.length / 2, tables = m.small("int16", mesh.subarray((n - 2) * half, (n - 1) * half), false);
    this.grid = { tables, last0: last[0], last1: last[1], last2: last[2], exponent: k };
    const none = m.array("int64", [0]);
    const known = newFlags(m, n);
    this.noLean = {
      grid: { tables, last0: 0, last1: 0, last2: 0, exponent: 0 }, counters: m.registers("Counters"), valueBits: m.array("int64", [2]),
      known, mesh: newFlags(m, n), number: none, left: none, numbers: noNumbers(m, known),
    };
    this.noBoard = newBoard(m, n);
    this.chosen = { inside: m.array("uint8", [0, 0, 1]), outside: newFlags(m, n) };
    this.noStore = newStore(m, n);
  }

  /** What is known of an isovalue of which nothing is told. */
  first(n: number, lean: Lean | undefined): State {
    const { m, noLean } = this, counters = m.registers<CounterNames>("Counters"), base = m.registers<WalkNames>("BaseWalk");
    counters.set("agreed", MOSTLY);
    counters.set("most_mixed", MOST_LEAVES);
    base.set("last_root", -1);
    const [turns, censuses, trail, early, candidates, window, scratch] = SIZES.map((size) => m.array("int64", [size])) as [Arr, Arr, Arr, Arr, Arr, Arr, Arr];
    return {
      grid: this.grid, counters, tally: m.array("int64", [TALLY]), calm: m.numbers([MOSTLY, MOSTLY]), valueBits: m.array("int64", [2]),
      known: newFlags(m, n), vertex: m.array("int32", [ROWS, 4]), leaf: m.array("int32", [ROWS, 5]), below: m.array("int32", [ROWS, 5]),
      active: m.array("int32", [0, 5]), mesh: newFlags(m, n), crowd: newCounts(m, n), censuses, board: newBoard(m, n), path: m.array("int64", [ANCESTORS, 4]), chosen: this.chosen,
      lean: lean ?? noLean, hole: noLean, soft: this.noStore, truth: m.array("bool", [0, 0, 0]), base,
      refinement: m.registers("RefinementWalk"), tree: m.registers("TreeWalk"), value: m.registers("ValueWalk"), digit: m.registers("DigitWalk"),
      turns, trail, early, candidates, window, near: m.array("int8", [NEAR]), scratch, stack: m.array("int64", [STACK]),
    };
  }

  /** The same with room for the next steps of any pass; `walking` says whether it is a base, which needs its stack. */
  wider(st: State, walking: boolean): State {
    const { m, meter } = this, { counters } = st, vertices = counters.get("vertices") + VERTICES, room = counters.get("room");
    if (Math.max(vertices, m.number(st.mesh.head, PAGES) + room) > meter.limits.vertices)
      meter.stop("vertices");
    if (Math.max(counters.get("leaves"), counters.get("mixed")) + LEAVES > MOST_LEAVES)
      meter.stop("simplices");
    const rows = (array: Arr, needed: number): Arr => {
      const length = array.shape[0]!;
      return needed <= length ? array : this.longer(array, Math.max(length + spare(array.bytes, length), needed));
    };
    const deep = walking && (st.base.get("gates") + GATES) * GATE > st.stack.size;
    return {
      ...st, vertex: rows(st.vertex, vertices), leaf: rows(st.leaf, counters.get("leaves") + LEAVES),
      below: rows(st.below, counters.get("next") + LEAVES), stack: deep ? rows(st.stack, st.stack.size + 1) : st.stack,
      known: roomy(m, st.known, VERTICES), mesh: roomy(m, st.mesh, Math.max(VERTICES, room)), crowd: roomy(m, st.crowd, CELLS),
      board: roomy(m, st.board, VERTICES),
    };
  }

  private longer(array: Arr, length: number): Arr {
    const found = this.m.wider(array, length);
    this.m.release(array);
    return found;
  }

  /** The store of visited simplices with room for the next step. */
  roomy(mark: Store): Store {
    return roomy(this.m, mark, VERTICES);
  }

  /** The same without what only further layers need, and no longer than it has to be: a file may have thousands of isovalues. */
  atRest(st: State): State {
    const { m, noLean } = this, none = m.array("int64", [0]);
    for (const store of [st.crowd, st.board, ...(st.soft === this.noStore ? [] : [st.soft])]) release(m, store);
    for (const array of [st.below, st.active, st.path, st.near, st.stack]) m.release(array);
    const trimmed = (store: Store): Store => ({ ...store, pages: this.longer(store.pages, m.number(store.head, PAGES)) });
    return {
      ...st, known: trimmed(st.known), mesh: trimmed(st.mesh), vertex: this.longer(st.vertex, st.counters.get("vertices")),
      leaf: this.longer(st.leaf, st.counters.get("leaves")), crowd: this.noStore, board: this.noBoard, below: m.array("int32", [0, 5]),
      active: m.array("int32", [0, 5]), path: m.array("int64", [0, 4]), near: m.array("int8", [0]), stack: none, soft: this.noStore, lean: noLean,
    };
  }

  /** Give all memory of a state back. */
  release(st: State): void {
    const { m } = this;
    const shared = [this.noStore, this.noBoard];
    for (const store of [st.known, st.mesh, st.crowd, st.board, st.soft]) if (!shared.includes(store)) release(m, store);
    const walks = [st.counters, st.base, st.refinement, st.tree, st.value, st.digit].map((walk) => walk.array);
    for (const array of [...walks, st.tally, st.calm, st.valueBits, st.vertex, st.leaf, st.below, st.active, st.path, st.turns, st.censuses, st.trail, st.early,
      st.candidates, st.window, st.near, st.scratch, st.stack]) m.release(array);
  }
}
