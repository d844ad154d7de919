/** Numbers of the known vertices by position, as kernels have them. */
import type { Arr, Machine } from "./machine.js";
import type { State } from "./state.js";
import { PAGES, type Store } from "./store.js";

/** Entries of a page, one after the other, of which the first one's rank is kept. */
const GROUP = 16;
/** Pages around one. */
const AROUND = 11;

/** `first` counts the known vertices before each group of entries; `vertex` has their numbers page by page. */
export interface Numbers {
  readonly known: Store;
  readonly first: Arr;
  readonly vertex: Arr;
}

/** The numbers of no vertices. */
export const noNumbers = (m: Machine, known: Store): Numbers =>
  ({ known, first: m.array("int32", [0, known.pages.shape[1]! / GROUP]), vertex: m.array("int32", [0]) });

/** The numbers of the vertices known now. */
export function numbered(m: Machine, st: State): Numbers {
  const { known } = st, pages = m.number(known.head, PAGES), groups = known.pages.shape[1]! / GROUP;
  const numbers = { known, first: m.array("int32", [pages, groups]), vertex: m.array("int32", [st.counters.get("vertices")]) };
  m.call("tube_ranks__enter_numbers", numbers, st.vertex);
  return numbers;
}

export function release(m: Machine, { first, vertex }: Numbers): void {
  m.release(first);
  m.release(vertex);
}

/** Room for a page and the last vertices before it along each axis. */
export function surroundings(m: Machine, n: number): { near: Arr; local: Arr; rows: Arr } {
  const side = n === 2 ? 33 : 9;
  return { near: m.array("int64", [AROUND]), local: m.array("int32", [side ** n]), rows: m.array("int64", [2, side ** (n - 1)]) };
}
