/** The order of lattice points and samples: block by block (4.8). */

/** Edges of a block along the axes (log2), by axes less 2. */
const BLOCK: readonly (readonly [number, number, number])[] = [[6, 6, 0], [3, 3, 6]];
/** The same of the blocks that crossed edges lie in (5.7.2(1)). */
const EDGE_BLOCK: typeof BLOCK = [[2, 2, 0], [3, 3, 6]];
/** Bits of a digit: rows are sorted by one at a time. */
const DIGIT = 12, DIGITS = 1 << DIGIT;

/** Numbers of rows, sorted by columns of numbers below 2^32, the first one first; those that are alike stay as they are. */
export function sorted(count: number, columns: readonly Uint32Array[]): Uint32Array {
  let rows = new Uint32Array(count), next = new Uint32Array(count);
  for (let i = 0; i < count; i++) rows[i] = i;
  for (let c = columns.length - 1; c >= 0; c--) {
    const column = columns[c]!, most = column.reduce((p, q) => Math.max(p, q), 0);
    for (let shift = 0; shift < 32 && most >>> shift; shift += DIGIT) {
      const place = new Uint32Array(DIGITS + 1);
      for (let i = 0; i < count; i++) place[((column[i]! >>> shift) & (DIGITS - 1)) + 1]!++;
      for (let i = 1; i < DIGITS; i++) place[i]! += place[i - 1]!;
      for (let i = 0; i < count; i++) {
        const row = rows[i]!;
        next[place[(column[row]! >>> shift) & (DIGITS - 1)]!++] = row;
      }
      [rows, next] = [next, rows];
    }
  }
  return rows;
}

/** Columns to sort points by in order: of each its block and its place in that. Rows of `width` numbers have it from `from` on. */
export function places(n: number, rows: ArrayLike<number>, width = 3, from = 0, blocks = BLOCK): Uint32Array[] {
  const count = rows.length / width, [sx, sy, sz] = blocks[n - 2]!;
  const found = Array.from({ length: n + 1 }, () => new Uint32Array(count)), inside = found[n]!;
  for (let i = 0, o = from; i < count; i++, o += width) {
    const x = rows[o]!, y = rows[o + 1]!, z = rows[o + 2]!;
    found[0]![i] = x >> sx;
    found[1]![i] = y >> sy;
    if (n === 3) found[2]![i] = z >> sz;
    inside[i] = ((x & ((1 << sx) - 1)) << (sy + sz)) | ((y & ((1 << sy) - 1)) << sz) | (z & ((1 << sz) - 1));
  }
  return found;
}

/** Columns of the coordinates of points, likewise. */
export function coordinates(rows: ArrayLike<number>, width = 3, from = 0): Uint32Array[] {
  return [from, from + 1, from + 2].map((o) => {
    const column = new Uint32Array(rows.length / width);
    for (let i = 0; i < column.length; i++) column[i] = rows[width * i + o]!;
    return column;
  });
}

/** Numbers of edges, three coordinates of the lower and three of the upper end each, in order. */
export function edgesInOrder(n: number, ends: ArrayLike<number>): Uint32Array {
  return sorted(ends.length / 6, [...places(n, ends, 6, 0, EDGE_BLOCK), ...coordinates(ends, 6, 3)]);
}

/** Numbers of lower ends of edges, three coordinates each, in order. */
export function lowerEndsInOrder(n: number, points: ArrayLike<number>): Uint32Array {
  return sorted(points.length / 3, places(n, points, 3, 0, EDGE_BLOCK));
}

/** Numbers of points, three coordinates each, in order. */
export function inOrder(n: number, points: ArrayLike<number>): Uint32Array {
  return sorted(points.length / 3, places(n, points));
}

/** The same, of points that are alike only the first one's. */
export function eachOnce(n: number, points: ArrayLike<number>): Uint32Array {
  const rows = inOrder(n, points);
  let count = 0;
  for (const row of rows) {
    const at = 3 * row, last = count ? 3 * rows[count - 1]! : -1;
    if (last < 0 || points[at] !== points[last] || points[at + 1] !== points[last + 1] || points[at + 2] !== points[last + 2])
      rows[count++] = row;
  }
  return rows.subarray(0, count);
}
