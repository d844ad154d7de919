/** Rows of the networks (7.10), and sums of several rows that are made beforehand, as kernels look them up. */
import { PAIR, SIGN_ROW, type Tables, TREE_ROW } from "../main/tables.js";

/** Weights of a row. */
export const WIDTH = 48;
/** Vertices around a middle, and cells around a node of the tree, that networks see; by axes. */
const AROUND: Record<number, number> = { 2: 96, 3: 112 }, CELLS: Record<number, number> = { 2: 24, 3: 26 };
/** First row for cells, of the network of new components, and rows of a cell: of vertices, of births. */
const CELL_ROW = 94, CELL_CLASSES = 5, BIRTHS = 4;
/** Vertices, one after the other, that have one row together, and what may be known of them. */
const GROUP = 4, CASES = 3 ** GROUP;

const made = new WeakMap<Tables, Int16Array>();

/** All rows, then for each phase those of groups of vertices, then those of cells. */
export function withSums(n: number, tables: Tables): Int16Array {
  const old = made.get(tables);
  if (old) return old;
  const around = AROUND[n]!, cells = CELLS[n]!, half = WIDTH / 2, count = tables.weight.length / half;
  const groups = (around / GROUP) * CASES;
  const all = new Int16Array(WIDTH * (count + n * groups + cells * CELL_CLASSES * BIRTHS));
  tables.weight.forEach((both, i) => {
    const high = Math.round(both / PAIR);
    all[2 * i] = both - PAIR * high;
    all[2 * i + 1] = high;
  });
  let next = count;
  const sum = (rows: readonly number[]): void => {
    for (const row of rows) for (let j = 0; j < WIDTH; j++) all[WIDTH * next + j]! += all[WIDTH * row + j]!;
    next++;
  };
  for (let phase = 0; phase < n; phase++) for (let first = 0; first < around; first += GROUP) for (let kase = 0; kase < CASES; kase++) {
    const rows: number[] = [];
    for (let i = 0, digits = kase; i < GROUP; i++, digits = Math.floor(digits / 3))
      if (digits % 3) rows.push(SIGN_ROW[n]![phase]! + 2 * (first + i) + (digits % 3) - 1);
    sum(rows);
  }
  for (let cell = 0; cell < cells; cell++) {
    const first = TREE_ROW[n]! + CELL_ROW + (CELL_CLASSES + BIRTHS) * cell;
    for (let i = 0; i < CELL_CLASSES * BIRTHS; i++) sum([first + Math.floor(i / BIRTHS), first + CELL_CLASSES + (i % BIRTHS)]);
  }
  made.set(tables, all);
  return all;
}
