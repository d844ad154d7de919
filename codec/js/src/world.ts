/** Drawings in the coordinates of the world (3.7.2(2), 9.9), as lines, as GeoJSON. */
import type { Coordinates } from "./coordinates.js";
import type { Drawing } from "./draw.js";
import type { Metadata } from "./metadata.js";
import { mod } from "./nodes.js";

export { coordinatesOf } from "./nodes.js";
export type { Coordinate, Coordinates } from "./coordinates.js";

/** The rows of a placement (3.7.2(2)), or the coordinates of a mapped grid (3.7.4). */
export type Where = number[][] | Coordinates;

/** The placement as rows of a matrix, three of a plane in space; undefined if there is none that can be used (3.7.2(2)). */
export function placement(metadata: Metadata, n: number): number[][] | undefined {
  const words = metadata["placement"]?.split(" ") ?? [];
  if ((words.length !== n * (n + 1) && words.length !== 3 * (n + 1)) || !words.every((w) => /^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$/.test(w)))
    return undefined;
  const numbers = words.map(Number);
  if (!numbers.every((x) => x === 0 || (Math.abs(x) >= 1e-30 && Math.abs(x) <= 1e30))) return undefined;
  const rows = Array.from({ length: words.length / (n + 1) }, (_, r) => numbers.slice(r * (n + 1), (r + 1) * (n + 1)));
  // numbers of at least 1e-30 are whole multiples of 2**-153: determinants are exact
  const m = rows.map((row) => row.map((x) => BigInt(x * 2 ** 153)));
  const minor = (r: number, s: number, a: number, b: number): bigint => m[r]![a]! * m[s]![b]! - m[r]![b]! * m[s]![a]!;
  const zero = n === 2
    ? pairs(rows).every(([r, s]) => minor(r, s, 0, 1) === 0n)
    : m[0]![0]! * minor(1, 2, 1, 2) - m[0]![1]! * minor(1, 2, 0, 2) + m[0]![2]! * minor(1, 2, 0, 1) === 0n;
  return zero ? undefined : rows;
}

/** Two of the coordinates of a plane: x and y; of one in space also x and z, y and z. */
function pairs(rows: unknown[]): [number, number][] {
  return rows.length < 3 ? [[0, 1]] : [[0, 1], [0, 2], [1, 2]];
}

/** The place in the world of a point in samples, `n` numbers from `at` on. */
type Locate = (points: ArrayLike<number>, at: number) => number[];

function byRows(rows: number[][], n: number): Locate {
  return (points, at) => rows.map((row) => {
    let x = row[n]!;
    for (let a = 0; a < n; a++) x += row[a]! * points[at + a]!;
    return x;
  });
}

/** 9.9(3). */
function byNodes({ coordinates }: Coordinates): Locate {
  return (points, at) => coordinates.map(({ axes, nodes, values, period, origin, unit }) => {
    const strides = [nodes[1] * nodes[2], nodes[2], 1], half = Math.floor(period / 2);
    let low = 0;
    const steps: number[] = [], parts: number[] = [];
    for (const a of axes) {
      const i = Math.max(0, Math.min(Math.floor(points[at + a]!), nodes[a]! - 2));
      low += i * strides[a]!;
      if (nodes[a]! < 2) continue;
      steps.push(strides[a]!);
      parts.push(points[at + a]! - i);
    }
    const w = values[low]!;
    let sum = 0;
    for (let corner = 1; corner < 1 << steps.length; corner++) {
      let to = low, weight = 1;
      steps.forEach((by, j) => {
        const on = (corner >> j) & 1;
        if (on) to += by;
        weight *= on ? parts[j]! : 1 - parts[j]!;
      });
      const far = values[to]! - w;
      sum += weight * (period ? mod(mod(far, period) + half, period) - half : far);
    }
    return origin + unit * (w + sum);
  });
}

/** Where the axes of samples run: rows of a placement, or what a step in the middle of a mapped grid makes. */
function directions(where: Where, n: number): number[][] {
  if (Array.isArray(where)) return where;
  const locate = byNodes(where), { coordinates } = where;
  const at = [0, 1, 2].slice(0, n).map((a) => Math.max(0, ...coordinates.map((c) => (c.nodes[a]! >> 1) - 1)));
  const from = locate(at, 0);
  return at.map((_, a) => locate(at.map((x, b) => (a === b ? x + 1 : x)), 0).map((x, r) => x - from[r]!));
}

function mirrors(where: Where, n: number): boolean {
  const [u, v, w] = directions(where, n) as [number[], number[], number[]];
  if (n === 2 && Array.isArray(where)) {
    // a plane in space is seen from the axis that it leans towards least
    const turns = pairs(where).map(([r, s]) => where[r]![0]! * where[s]![1]! - where[r]![1]! * where[s]![0]!);
    return turns.reduce((most, turn) => (Math.abs(turn) > Math.abs(most) ? turn : most)) < 0;
  }
  const turn = n === 2 ? u[0]! * v[1]! - u[1]! * v[0]! : u[0]! * (v[1]! * w[2]! - v[2]! * w[1]!) -
    u[1]! * (v[0]! * w[2]! - v[2]! * w[0]!) + u[2]! * (v[0]! * w[1]! - v[1]! * w[0]!);
  return turn < 0;
}

/**
 * A drawing whose points lie where a placement or the coordinates of a mapped grid say; cells turn round if that mirrors.
 * Where a periodic axis closes, points that come to the same place are one.
 */
export function place(drawing: Drawing, where: Where): Drawing {
  const { n, seam } = drawing, cells = drawing.cells.slice();
  const mapped = Array.isArray(where) ? undefined : where, d = mapped ? n : (where as number[][]).length;
  const points = new Float64Array((d * drawing.points.length) / n);
  const locate = mapped ? byNodes(mapped) : byRows(where as number[][], n);
  for (let i = 0; d * i < points.length; i++) points.set(locate(drawing.points, n * i), d * i);
  if (mirrors(where, n)) {
    for (let c = 0; c < cells.length; c += n) {
      const last = cells[c + n - 1]!;
      cells[c + n - 1] = cells[c + n - 2]!;
      cells[c + n - 2] = last;
    }
  }
  const placed: Drawing = { ...drawing, d, points, cells };
  if (!mapped) return placed;
  placed.periods = mapped.coordinates.map((c) => c.unit * c.period);
  if (!seam?.length) return placed;
  const one = new Map<number, number>(), open: number[] = [];
  for (let i = 0; i < seam.length; i += 2) {
    const far = seam[i]!, near = seam[i + 1]!;
    if (placed.periods.every((_, r) => points[n * far + r] === points[n * near + r])) one.set(far, near);
    else open.push(far, near);
  }
  placed.cells = cells.map((i) => one.get(i) ?? i);
  placed.seam = Uint32Array.from(open);
  return placed;
}

/**
 * Curves as polylines, each a list of numbers of points; closed ones end with their first point. n = 2. Of a drawing on a
 * mapped grid they go on where a periodic axis closes; the point there is listed once.
 */
export function lines(drawing: Drawing): number[][] {
  const { cells, points, periods, seam } = drawing, count = points.length / drawing.d;
  const next = new Int32Array(count).fill(-1), enters = new Uint8Array(count);
  for (let c = 0; c < cells.length; c += 2) {
    next[cells[c]!] = cells[c + 1]!;
    enters[cells[c + 1]!] = 1;
  }
  const twins = new Map<number, number>();
  for (let i = 0; periods && seam && i < seam.length; i += 2) {
    const [far, near] = [seam[i]!, seam[i + 1]!];
    twins.set(far, near).set(near, far);
    enters[far] = enters[near] = enters[far]! | enters[near]!;
  }
  const onward = (at: number): number => {
    const own = next[at]! >= 0 ? at : (twins.get(at) ?? at), to = next[own]!;
    next[own] = -1;
    return to;
  };
  const found: number[][] = [];
  const follow = (start: number): void => {
    const line = [start];
    for (let to = onward(start); to >= 0; to = onward(to)) line.push(to);
    found.push(line);
  };
  for (let i = 0; i < count; i++) if (next[i]! >= 0 && !enters[i]) follow(i);
  for (let i = 0; i < count; i++) if (next[i]! >= 0) follow(i);
  return found;
}

export interface LineFeature {
  type: "Feature";
  properties: Record<string, unknown>;
  /** Points of a plane in space have three coordinates. */
  geometry: { type: "MultiLineString"; coordinates: number[][][] };
}

/**
 * A feature of all curves of a drawing (n = 2). With a placement or the coordinates of a mapped grid these are coordinates
 * of the world, in the reference system of the file, else x runs along axis 1 and y along axis 0. Where a coordinate wraps,
 * each line goes from point to point by less than half of the period (9.9(5)).
 */
export function toGeoJSON(drawing: Drawing, where?: Where, properties: Record<string, unknown> = {}): LineFeature {
  if (drawing.n !== 2) throw new TypeError("GeoJSON has curves only: the drawing is a surface");
  const placed = place(drawing, where ?? [[0, 1, 0], [1, 0, 0]]), { d, points, periods = Array.from({ length: d }, () => 0) } = placed;
  const coordinates = lines(placed).map((line) => {
    let last: number[] | undefined;
    return line.map((i): number[] => {
      last = periods.map((W, r) => {
        const x = points[d * i + r]!;
        return W && last ? x - W * Math.round((x - last[r]!) / W) : x;
      });
      return last;
    });
  });
  return { type: "Feature", properties, geometry: { type: "MultiLineString", coordinates } };
}
