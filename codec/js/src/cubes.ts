/**
 * Surfaces in unit cubes (9.4): for each pattern of signs the triangles between points on the cube's grid edges.
 *
 * The frame of a cube has the corner with the most even sample indices at the origin; corners are numbered by the bits of
 * their coordinates, 4 * x + 2 * y + z.
 */

interface Pattern {
  /** Triples of points: grid edges by number, and from 12 on the points that are added. Clockwise seen from below. */
  triangles: number[];
  /** Grid edges whose mean each added point is. */
  added: number[][];
  /** How many simplices are mixed. */
  mixed: number;
}

/** Ends of the grid edges, as corners; the axis of edge `i` is `i >> 2`. */
export const EDGES: [number, number][] = [];
for (const bit of [4, 2, 1]) for (let c = 0; c < 8; c++) if (!(c & bit)) EDGES.push([c, c | bit]);
const number = new Map(EDGES.map(([a, b], i) => [8 * a + b, i]));

/** The six simplices, as corners from the origin to the far corner. */
const PATHS = [[4, 2, 1], [4, 1, 2], [2, 4, 1], [2, 1, 4], [1, 4, 2], [1, 2, 4]].map(([a, b]) => [0, a!, a! | b!, 7]);

const coordinates = (corner: number): number[] => [(corner >> 2) & 1, (corner >> 1) & 1, corner & 1];

/** Faces of the cube that hold an edge, as bits. */
function faces(a: number, b: number): number {
  let bits = 0;
  coordinates(a).forEach((x, i) => {
    if (x === coordinates(b)[i]) bits |= 1 << (2 * i + x);
  });
  return bits;
}

const middle = EDGES.map(([a, b]) => coordinates(a).map((x, i) => (x + coordinates(b)[i]!) / 2));
const held = EDGES.map(([a, b]) => faces(a, b));

/** Squared length of an inner side, infinite in a face of the cube. */
function cost(p: number, q: number): number {
  if (held[p]! & held[q]!) return Infinity;
  return middle[p]!.reduce((sum, x, i) => sum + (x - middle[q]![i]!) ** 2, 0);
}

function determinant(a: number, b: number, c: number, d: number): number {
  const [u, v, w] = [b, c, d].map((p) => coordinates(p).map((x, i) => x - coordinates(a)[i]!)) as [number[], number[], number[]];
  return u[0]! * (v[1]! * w[2]! - v[2]! * w[1]!) - u[1]! * (v[0]! * w[2]! - v[2]! * w[0]!) +
    u[2]! * (v[0]! * w[1]! - v[1]! * w[0]!);
}

/** The points of a simplex's piece in order around it, the normal to the side below; as keys 8 * end + end. */
export function piece(corners: number[], above: (corner: number) => boolean,
                      orientation: (a: number, b: number, c: number, d: number) => number): [number, number][] {
  const up = corners.filter(above), down = corners.filter((c) => !above(c));
  if (up.length === 2) {
    const [u, v] = up as [number, number], [s, w] = down as [number, number];
    const ring: [number, number][] = [[u, s], [u, w], [v, w], [v, s]];
    return orientation(u, v, s, w) > 0 ? ring : ring.reverse();
  }
  const lone = up.length === 1 ? up[0]! : down[0]!, [a, b, c] = (up.length === 1 ? down : up) as [number, number, number];
  const ring: [number, number][] = [[lone, a], [lone, b], [lone, c]];
  return (orientation(lone, a, b, c) > 0) === (up.length === 1) ? ring : ring.reverse();
}

/** The triangulation of a loop with the least sum of its inner sides, undefined if there is none. */
function disc(loop: number[]): number[] | undefined {
  const m = loop.length, best = new Map<number, [number, number]>();
  const solve = (i: number, j: number): number => {
    if (j - i < 2) return 0;
    const known = best.get(32 * i + j);
    if (known) return known[0];
    let least = Infinity, at = -1;
    for (let h = i + 1; h < j; h++) {
      const sum = (h - i > 1 ? cost(loop[i]!, loop[h]!) : 0) + (j - h > 1 ? cost(loop[h]!, loop[j]!) : 0) +
        solve(i, h) + solve(h, j);
      if (sum < least) {
        least = sum;
        at = h;
      }
    }
    best.set(32 * i + j, [least, at]);
    return least;
  };
  if (solve(0, m - 1) === Infinity) return undefined;
  const triangles: number[] = [];
  const take = (i: number, j: number): void => {
    if (j - i < 2) return;
    const h = best.get(32 * i + j)![1];
    triangles.push(loop[i]!, loop[h]!, loop[j]!);
    take(i, h);
    take(h, j);
  };
  take(0, m - 1);
  return triangles;
}

/** The triangulation between two loops, the second in the other direction. */
function annulus(outer: number[], inner: number[]): number[] {
  let least = Infinity, found: number[] = [];
  const a = (i: number): number => outer[i % outer.length]!;
  for (let start = 0; start < inner.length; start++) {
    const b = (j: number): number => inner[(start - j + 2 * inner.length) % inner.length]!;
    const go = (i: number, j: number, sum: number, triangles: number[]): void => {
      if (sum >= least) return;
      if (i === outer.length && j === inner.length) {
        least = sum;
        found = triangles;
        return;
      }
      if (i < outer.length) go(i + 1, j, sum + cost(a(i + 1), b(j)), [...triangles, a(i), a(i + 1), b(j)]);
      if (j < inner.length) go(i, j + 1, sum + cost(a(i), b(j + 1)), [...triangles, a(i), b(j + 1), b(j)]);
    };
    go(0, 0, 0, []);
  }
  return found;
}

function make(signs: number): Pattern {
  const above = (corner: number): boolean => ((signs >> corner) & 1) === 1;
  const pieces = PATHS.filter((path) => path.some(above) && !path.every(above))
    .map((path) => piece(path, above, determinant).map(([p, q]) => [Math.min(p, q), Math.max(p, q)] as [number, number]));
  // sides in faces of the cube bound the components; two pieces with a common point are of one component
  const next = new Map<number, number>(), component = new Map<number, number>();
  const find = (key: number): number => {
    while (component.get(key) !== key) key = component.get(key)!;
    return key;
  };
  for (const ring of pieces) {
    ring.forEach(([a, b], i) => {
      const [c, d] = ring[(i + 1) % ring.length]!, key = 8 * a + b, other = 8 * c + d;
      for (const k of [key, other]) if (!component.has(k)) component.set(k, k);
      component.set(find(key), find(other));
      if (faces(a, b) & faces(c, d)) next.set(key, other);
    });
  }
  const loops = new Map<number, number[][]>();
  while (next.size) {
    const start = next.keys().next().value!, loop: number[] = [], root = find(start);
    for (let key = start; next.has(key); ) {
      if (number.has(key)) loop.push(number.get(key)!);
      const to = next.get(key)!;
      next.delete(key);
      key = to;
    }
    loops.set(root, [...(loops.get(root) ?? []), loop]);
  }
  const pattern: Pattern = { triangles: [], added: [], mixed: pieces.length };
  for (const [loop, second] of loops.values()) {
    const triangles = second ? annulus(loop!, second) : disc(loop!);
    if (triangles) pattern.triangles.push(...triangles);
    else {
      const at = 12 + pattern.added.length;
      pattern.added.push(loop!);
      loop!.forEach((p, i) => pattern.triangles.push(p, loop![(i + 1) % loop!.length]!, at));
    }
  }
  return pattern;
}

const patterns: Pattern[] = [];

/** The pattern of a cube, by the signs of its corners as bits. */
export const pattern = (signs: number): Pattern => (patterns[signs] ??= make(signs));
