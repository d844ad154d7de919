/** Contours of isovalues of a mesh (10.7, 10.8.6(2)). */
import type { Drawing } from "../draw.js";
import { apart } from "../edges.js";
import type { Complex } from "./complex.js";
import { Crossings } from "./crossings.js";
import type { Contour } from "./isovalue.js";
import type { Meter } from "../errors.js";

/** The coordinates that a position stands for: it plus `origin`, times `factor`, times `2**exponent`. */
export interface Unit {
  origin: readonly number[];
  factor: number;
  exponent: number;
}

/** Whether the vertices of each triangle run as those of the first one of its piece. */
function ways(mesh: Complex): Int8Array {
  const { T, cells, neighbours } = mesh, way = new Int8Array(T), queue: number[] = [];
  for (let start = 0; start < T; start++) {
    if (way[start]) continue;
    way[start] = 1;
    queue.push(start);
    for (let t = queue.pop(); t !== undefined; t = queue.pop()) {
      for (let i = 0; i < 3; i++) {
        const other = neighbours[3 * t + i]!;
        if (other < 0 || way[other]) continue;
        const p = cells[3 * t + ((i + 1) % 3)]!, own = cells.subarray(3 * other, 3 * other + 3), j = own.indexOf(p);
        // the side runs the other way in a neighbour that turns alike
        way[other] = own[(j + 2) % 3] === cells[3 * t + ((i + 2) % 3)] ? way[t]! : -way[t]!;
        queue.push(other);
      }
    }
  }
  return way;
}

export function drawContour(contour: Contour, mesh: Complex, unit: Unit, scale: number | undefined, meter: Meter): Drawing {
  const { n, d } = mesh, { sign, levels, mesh: { cells } } = contour, points: number[] = [], pieces: number[] = [];
  const coarse = levels && levels.left > 0 ? levels.remaining : undefined;
  const list = coarse ? coarse.source.map((_, i) => i) : (contour.leaves ?? new Int32Array(0));
  const corners: ArrayLike<number> = coarse ? coarse.corners : cells, m = n + 1;
  const source = coarse?.source ?? contour.cut?.source;
  const way = n === 2 && d === 3 ? ways(mesh) : undefined;
  meter.take(32 * list.length);
  const x = (v: number, k: number): number => (mesh.positions[d * v + k]! + unit.origin[k]!) * unit.factor * 2 ** unit.exponent;
  const edges = coarse ? undefined : (contour.offsets?.edges ?? new Crossings(contour.mesh, list, sign, meter));
  const at = (p: number, q: number): number => {
    const N = (v: number): number => contour.values?.number[v] ?? -1;
    if (N(p) >= 0 && N(q) >= 0) {
      const over = contour.isovalue - Math.floor(contour.isovalue);
      const f = (v: number): number => scale !== undefined ? (N(v) + 0.5) * (sign[v] ? 1 : -1)
        : sign[v] ? N(v) + 1 - over : -N(v) - over;
      const s = f(p) / (f(p) - f(q));
      if (Number.isFinite(s)) return s;
    }
    const { offsets } = contour, e = offsets ? edges!.find(p, q) : -1;
    return e < 0 ? 0.5 : (2 * offsets!.number[e]! + 1) / (2 * offsets!.parts[e]!);
  };
  const ids = new Map<number, number>();
  const on = (u: number, v: number): number => {
    const p = Math.min(u, v), q = Math.max(u, v), key = p * mesh.V + q, old = ids.get(key);
    if (old !== undefined) return old;
    const s = apart(at(p, q));
    for (let k = 0; k < d; k++) points.push(x(p, k) + s * (x(q, k) - x(p, k)));
    ids.set(key, ids.size);
    return ids.size - 1;
  };
  const by = (u: number, v: number, k: number): number => mesh.positions[d * v + k]! - mesh.positions[d * u + k]!;
  const turn = (u: number, a: number, b: number, c: number): number => by(u, a, 0) * (by(u, b, 1) * by(u, c, 2) -
    by(u, b, 2) * by(u, c, 1)) - by(u, a, 1) * (by(u, b, 0) * by(u, c, 2) - by(u, b, 2) * by(u, c, 0)) + by(u, a, 2) *
    (by(u, b, 0) * by(u, c, 1) - by(u, b, 1) * by(u, c, 0));
  for (const cell of list) {
    const own = Array.from({ length: m }, (_, i) => corners[m * cell + i]!);
    const above = own.filter((v) => sign[v] === 1), below = own.filter((v) => sign[v] === 0);
    if (!above.length || above.length + below.length < m || !below.length) continue;
    if (n === 3 && above.length === 2) {
      const [u, v] = above as [number, number], [s, w] = below as [number, number];
      const ring = [on(u, s), on(u, w), on(v, w), on(v, s)];
      if (turn(u, v, s, w) < 0) ring.reverse();
      pieces.push(ring[0]!, ring[1]!, ring[2]!, ring[0]!, ring[2]!, ring[3]!);
      continue;
    }
    const lone = (above.length === 1 ? above : below)[0]!, i = own.indexOf(lone);
    const others = n === 2 ? [own[(i + 1) % 3]!, own[(i + 2) % 3]!] : own.filter((v) => v !== lone);
    const ring = others.map((v) => on(lone, v)), [a, b, c] = others as [number, number, number];
    const anticlockwise = n === 3 ? turn(lone, a, b, c) : way ? way[source ? source[cell]! : cell]!
      : by(lone, a, 0) * by(lone, b, 1) - by(lone, a, 1) * by(lone, b, 0);
    if (anticlockwise > 0 !== (above.length === 1)) ring.reverse();
    pieces.push(...ring);
  }
  return { n, d, full: !coarse, points: Float64Array.from(points), cells: Uint32Array.from(pieces) };
}
