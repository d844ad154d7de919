/** Paged stores of integers on the lattice, as kernels have them. */
import type { Arr, Dtype, Machine } from "./machine.js";

/** `table` holds a key and the number of a page a row. */
export interface Store {
  readonly head: Arr;
  readonly table: Arr;
  readonly pages: Arr;
}

/** Places in the head: number of pages, the page's edge along the axes (log2), pages remembered. */
export const PAGES = 0, SHIFT = 1;
const RECENT = 4, WAYS = 64;
/** Bits of the words of a page's key from which its second and third coordinate stand. */
const SECOND = 23, THIRD = 12;
/** Pages that a store begins with; bytes from which on arrays grow by half of what they have. */
const FIRST = 64, LARGE = 1 << 24;

function empty(m: Machine, n: number, edge: number, used: number, dtype: Dtype): Store {
  const head = m.array("int64", [RECENT + 2 * WAYS]), table = m.array("int64", [4 * FIRST, 2]);
  m.words(head).fill(-1);
  [used, edge, edge, n === 3 ? edge : 0].forEach((x, i) => m.enter(head, i, x));
  m.words(table).fill(-1);
  return { head, table, pages: m.array(dtype, [FIRST, 1 << (n * edge)]) };
}

/** Of vertices: pages of 32 x 32 or 8 x 8 x 8 entries, which take a byte in a store of flags. */
export const newStore = (m: Machine, n: number): Store => empty(m, n, n === 2 ? 5 : 3, 0, "int32");
export const newFlags = (m: Machine, n: number): Store => empty(m, n, n === 2 ? 5 : 3, 0, "uint8");
/** Of cells of all sizes: pages of 8 x 8 or 4 x 4 x 4. */
export const newCounts = (m: Machine, n: number): Store => empty(m, n, n === 2 ? 3 : 2, 0, "int32");
/** Of entries of a byte: pages of 32 x 32 or 16 x 16 x 16, of which the first one stays empty. */
export const newBoard = (m: Machine, n: number): Store => empty(m, n, n === 2 ? 5 : 4, 1, "int8");

/** How many more entries an array of `count`, `size` bytes in all, is given when it has to grow. */
export const spare = (size: number, count: number): number => (size < LARGE ? 3 * count : count >> 1);

/** The same store with room for at least `room` more pages; itself if it has that. */
export function roomy(m: Machine, store: Store, room: number): Store {
  let { head, table, pages } = store;
  const used = m.number(head, PAGES), [count, page] = pages.shape as [number, number];
  if (used + room > count) {
    pages = m.wider(pages, used + Math.max(spare(used * page * pages.unit, used), 4 * room));
    m.release(store.pages);
  }
  let rows = table.shape[0]!;
  if (2 * (used + room) > rows) {
    while (rows <= 2 * (used + room)) rows *= 2;
    table = m.array("int64", [rows, 2]);
    m.words(table).fill(-1);
    m.call("lattice_store__rehash", store.table, table);
    m.release(store.table);
  }
  return { head, table, pages };
}

/** A copy of flags, with `bits` of the entries only. */
export function copied(m: Machine, store: Store, bits: number): Store {
  const copy = { head: m.copy(store.head), table: m.copy(store.table), pages: m.copy(store.pages) };
  mask(m, copy, bits);
  return copy;
}

/** Keep only `bits` of flags. */
export function mask(m: Machine, { head, pages }: Store, bits: number): void {
  const entries = m.bytes(pages), used = m.number(head, PAGES) * pages.shape[1]!;
  for (let i = 0; i < used; i++) entries[i]! &= bits;
}

/** The keys of all pages, by their numbers. */
export function keysOf(m: Machine, { head, table }: Store): Arr {
  const keys = m.array("int64", [m.number(head, PAGES)]), from = m.words(table), to = m.words(keys);
  for (let at = 0; at < from.length; at += 4) {
    if (from[at + 1]! < 0) continue;
    to.set(from.subarray(at, at + 2), 2 * from[at + 2]!);
  }
  return keys;
}

export function release(m: Machine, { head, table, pages }: Store): void {
  [head, table, pages].forEach((array) => m.release(array));
}

/** Call for each entry of flags that has one of `bits`, with its position and the entry. */
export function visit(m: Machine, { head, table, pages }: Store, bits: number, each: (x: number, y: number, z: number, entry: number) => void): void {
  const [a, b, c] = [0, 1, 2].map((axis) => m.number(head, SHIFT + axis)) as [number, number, number];
  const entries = m.bytes(pages), size = pages.shape[1]!, rows = m.words(table);
  for (let at = 0; at < rows.length; at += 4) {
    const low = rows[at]!, high = rows[at + 1]!, page = rows[at + 2]!;
    if (high < 0) continue;
    const x = low & (2 ** SECOND - 1), y = (low >>> SECOND) | ((high & (2 ** THIRD - 1)) << (32 - SECOND)), z = high >> THIRD;
    for (let i = 0; i < size; i++) {
      if (!(entries[page * size + i]! & bits)) continue;
      each(x * 2 ** a + (i >> (b + c)), y * 2 ** b + ((i >> c) & (2 ** b - 1)), z * 2 ** c + (i & (2 ** c - 1)), entries[page * size + i]!);
    }
  }
}
