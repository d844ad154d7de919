/** Drawings of tiles joined to one (12.7(1)). */
import type { Drawing } from "../draw.js";
import { IsoError } from "../errors.js";
import type { Box } from "./types.js";

/** A tile's drawing, with the ends of its points' edges: where it begins, and how many steps it is wide. */
export interface Piece {
  origin: number[];
  last: number[];
  drawing: Drawing;
}

/** One drawing of all pieces; of `box`, if there is one, the cells that lie in it, in whole or in part. */
export function join(n: number, field: number[], pieces: readonly Piece[], box: Box | undefined, memory: number): Drawing {
  let points = 0, cells = 0;
  for (const { drawing } of pieces) {
    points += drawing.points.length;
    cells += drawing.cells.length;
  }
  if (16 * points + 8 * cells > memory) throw new IsoError("limit", "11.2", 0, "the drawing needs more than the limit of memory");
  const at = new Float64Array(points), joined = new Uint32Array(cells), shared = new Map<string, number>();
  let count = 0, used = 0;
  for (const { origin, last, drawing } of pieces) {
    const ids = new Int32Array(drawing.points.length / n).fill(-1), ends = drawing.ends!;
    const number = (i: number): number => {
      const inner = origin.some((o, a) => {
        const x = ends[2 * n * i + a]!;
        return x === ends[2 * n * i + n + a] && ((x === 0 && o > 0) || (x === last[a] && o + x < field[a]!));
      });
      const key = inner ? origin.concat(origin).map((o, a) => o + ends[2 * n * i + a]!).join() : "", met = inner ? shared.get(key) : undefined;
      if (met !== undefined) return met;
      for (let a = 0; a < n; a++) at[n * count + a] = drawing.points[n * i + a]! + origin[a]!;
      if (inner) shared.set(key, count);
      return count++;
    };
    for (let c = 0; c < drawing.cells.length; c += n) {
      if (box && !meets(drawing, c, origin, box)) continue;
      for (let j = 0; j < n; j++) {
        const i = drawing.cells[c + j]!;
        if (ids[i]! < 0) ids[i] = number(i);
        joined[used++] = ids[i]!;
      }
    }
  }
  return {
    n, d: n, full: pieces.every(({ drawing }) => drawing.full), points: at.slice(0, n * count), cells: joined.slice(0, used),
  };
}

function meets({ n, points, cells }: Drawing, c: number, origin: number[], box: Box): boolean {
  return box.every(([from, to], a) => {
    let low = Infinity, high = -Infinity;
    for (let j = 0; j < n; j++) {
      const x = points[n * cells[c + j]! + a]! + origin[a]!;
      low = Math.min(low, x);
      high = Math.max(high, x);
    }
    return high > from && low < to;
  });
}
