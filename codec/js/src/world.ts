/** Drawings in the coordinates of the world, as lines, as GeoJSON. */
import type { Drawing } from "./draw.js";

/** A drawing whose points are moved by the rows of a placement (3.7.2(2)); cells turn round if it mirrors. */
export function place(drawing: Drawing, rows: number[][]): Drawing {
  const { n } = drawing, points = new Float64Array(drawing.points.length), cells = drawing.cells.slice();
  for (let i = 0; i < points.length; i += n) {
    for (let r = 0; r < n; r++) {
      let x = rows[r]![n]!;
      for (let a = 0; a < n; a++) x += rows[r]![a]! * drawing.points[i + a]!;
      points[i + r] = x;
    }
  }
  const [u, v, w] = rows as [number[], number[], number[]];
  const turn = n === 2 ? u[0]! * v[1]! - u[1]! * v[0]! : u[0]! * (v[1]! * w[2]! - v[2]! * w[1]!) -
    u[1]! * (v[0]! * w[2]! - v[2]! * w[0]!) + u[2]! * (v[0]! * w[1]! - v[1]! * w[0]!);
  if (turn < 0) {
    for (let c = 0; c < cells.length; c += n) {
      const last = cells[c + n - 1]!;
      cells[c + n - 1] = cells[c + n - 2]!;
      cells[c + n - 2] = last;
    }
  }
  return { ...drawing, points, cells };
}

/** Curves as polylines, each a list of numbers of points; closed ones end with their first point. n = 2. */
export function lines(drawing: Drawing): number[][] {
  const { cells, points } = drawing, count = points.length / 2;
  const next = new Int32Array(count).fill(-1), enters = new Uint8Array(count);
  for (let c = 0; c < cells.length; c += 2) {
    next[cells[c]!] = cells[c + 1]!;
    enters[cells[c + 1]!] = 1;
  }
  const found: number[][] = [];
  const follow = (start: number): void => {
    const line = [start];
    for (let at = start, to = next[at]!; to >= 0; to = next[at]!) {
      next[at] = -1;
      line.push(to);
      at = to;
    }
    found.push(line);
  };
  for (let i = 0; i < count; i++) if (next[i]! >= 0 && !enters[i]) follow(i);
  for (let i = 0; i < count; i++) if (next[i]! >= 0) follow(i);
  return found;
}

export interface LineFeature {
  type: "Feature";
  properties: Record<string, unknown>;
  geometry: { type: "MultiLineString"; coordinates: [number, number][][] };
}

/**
 * A feature of all curves of a drawing (n = 2). With `rows` of a placement coordinates are those of the world, in the
 * reference system of the file, else x runs along axis 1 and y along axis 0.
 */
export function toGeoJSON(drawing: Drawing, rows?: number[][], properties: Record<string, unknown> = {}): LineFeature {
  if (drawing.n !== 2) throw new TypeError("GeoJSON has curves only: the drawing is a surface");
  const placed = place(drawing, rows ?? [[0, 1, 0], [1, 0, 0]]), p = placed.points;
  const coordinates = lines(placed).map((line) => line.map((i): [number, number] => [p[2 * i]!, p[2 * i + 1]!]));
  return { type: "Feature", properties, geometry: { type: "MultiLineString", coordinates } };
}
