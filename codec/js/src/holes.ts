/** Drawings off the full grid where samples are missing: what does not lie in whole unit cells is left out (9.8(2)). */
import type { Drawing } from "./draw.js";
import type { Meter } from "./errors.js";

type Point = number[];

/** Cut a convex piece by the plane `axis = at`: the parts below and above. */
function cut(piece: Point[], axis: number, at: number): [Point[], Point[]] {
  const low: Point[] = [], high: Point[] = [], closed = piece.length > 2;
  piece.forEach((p, i) => {
    if (p[axis]! <= at) low.push(p);
    if (p[axis]! >= at) high.push(p);
    const q = piece[(i + 1) % piece.length]!;
    if ((closed || i === 0) && (p[axis]! - at) * (q[axis]! - at) < 0) {
      const t = (at - p[axis]!) / (q[axis]! - p[axis]!);
      const met = p.map((x, a) => (a === axis ? at : x + t * (q[a]! - x)));
      low.push(met);
      high.push(met);
    }
  });
  if (!closed) {
    // a segment keeps its direction
    const along = (r: Point): number => r.reduce((sum, x, a) => sum + (x - piece[0]![a]!) * (piece[1]![a]! - piece[0]![a]!), 0);
    for (const part of [low, high]) part.sort((r, s) => along(r) - along(s));
  }
  return [low, high];
}

export function cutOut(drawing: Drawing, whole: (x: number, y: number, z: number) => boolean,
                       last: readonly number[], meter: Meter): Drawing {
  const { n, points, cells } = drawing, out: number[] = [], kept: number[] = [], ids = new Map<string, number>();
  const id = (p: Point): number => {
    const key = p.join();
    const old = ids.get(key);
    if (old !== undefined) return old;
    const made = out.length / n;
    out.push(...p);
    ids.set(key, made);
    return made;
  };
  for (let c = 0; c < cells.length; c += n) {
    let pieces: Point[][] = [Array.from(cells.subarray(c, c + n), (i) => Array.from(points.subarray(n * i, n * i + n)))];
    for (let axis = 0; axis < n; axis++) {
      const parts: Point[][] = [];
      for (const piece of pieces) {
        let rest = piece;
        const xs = piece.map((p) => p[axis]!), to = Math.ceil(Math.max(...xs));
        for (let at = Math.floor(Math.min(...xs)) + 1; at < to; at++) {
          meter.step(16);
          const [low, high] = cut(rest, axis, at);
          if (low.length >= n) parts.push(low);
          rest = high;
        }
        if (rest.length >= n) parts.push(rest);
      }
      pieces = parts;
    }
    for (const piece of pieces) {
      // a piece in a plane of the grid lies in the cells on both sides
      const sides = [0, 1, 2].map((a) => {
        if (a >= n) return [0];
        const mean = piece.reduce((sum, p) => sum + p[a]!, 0) / piece.length, low = Math.floor(mean);
        const flat = piece.every((p) => p[a] === low);
        return (flat ? [low - 1, low] : [low]).filter((x) => x >= 0 && x < last[a]!);
      });
      if (!sides[0]!.some((x) => sides[1]!.some((y) => sides[2]!.some((z) => whole(x, y, z))))) continue;
      const numbers = piece.map(id);
      if (n === 2) kept.push(numbers[0]!, numbers[1]!);
      else for (let i = 2; i < numbers.length; i++) kept.push(numbers[0]!, numbers[i - 1]!, numbers[i]!);
    }
  }
  const cutDrawing: Drawing = { ...drawing, points: Float64Array.from(out), cells: Uint32Array.from(kept) };
  if (drawing.ends) {
    // points that the cutting has made lie on no edge
    const ends = new Int32Array(2 * out.length).fill(-1);
    for (let i = 0; n * i < points.length; i++) {
      const made = ids.get(Array.from(points.subarray(n * i, n * i + n)).join());
      if (made !== undefined) ends.set(drawing.ends.subarray(2 * n * i, 2 * n * i + 2 * n), 2 * n * made);
    }
    cutDrawing.ends = ends;
  }
  if (drawing.seam) {
    const seam = Array.from(drawing.seam, (i) => ids.get(Array.from(points.subarray(n * i, n * i + n)).join()) ?? -1);
    cutDrawing.seam = Uint32Array.from(seam.filter((_, i) => seam[i & ~1]! >= 0 && seam[i | 1]! >= 0));
  }
  return cutDrawing;
}
