/** The contour of a decoded state (clause 9). */
import { EDGES, pattern } from "./cubes.js";
import type { Decoder } from "./decoder.js";
import { apart, Crossings, EdgeIndex, leafVertices } from "./edges.js";
import type { GridFile } from "./gridfile.js";
import { cutOut } from "./holes.js";
import { roundsOf, smooth, type Ways } from "./smooth.js";
import { Cells, KNOWN, SIGN } from "./store.js";
import { Leaves, type Tube } from "./tube.js";

/** A contour: curves (n = 2) or a surface (n = 3). */
export interface Drawing {
  n: number;
  /** Coordinates of a point: `n`, or 3 of curves on a surface in space. */
  d: number;
  /** Points in samples (9.5), of explicit domains in the coordinates of these, `d` numbers each. */
  points: Float64Array<ArrayBuffer>;
  /** Segments or triangles, `n` points each; samples above lie on the left, or behind (9.6). */
  cells: Uint32Array<ArrayBuffer>;
  /** Whether the mesh is the full grid. */
  full: boolean;
  /** Of a surface of points, whether the first two coordinates of these are indices of samples. */
  sampled?: boolean;
  /** Pairs of points, behind the end of a periodic axis and at its beginning, that are one point of a mapped grid (9.9(4)). */
  seam?: Uint32Array;
  /** If they were asked for, the ends of the edges that points lie on, `2*n` numbers each; -1 of points that lie on none. */
  ends?: Int32Array;
  /** Periods of the coordinates of points that have been placed on a mapped grid, 0 of those that do not wrap. */
  periods?: number[];
}

/** Numbers that grow. */
class List {
  data: Float64Array = new Float64Array(1024);
  length = 0;
  push(...values: number[]): void {
    if (this.length + values.length > this.data.length) {
      const old = this.data;
      this.data = new Float64Array(2 * old.length);
      this.data.set(old);
    }
    for (const x of values) this.data[this.length++] = x;
  }
}

/** A tube with the leaves that are drawn at the moment: in a round the middles that have come are bisected, in a copy (9.1(1)). */
function atPresent(t: Tube): Tube {
  const { round, grid, n, meter, leaves } = t;
  if (!round) return t;
  const { level, active: { data: active }, coded } = round, drawn = t.copy(), side = 2 ** grid.k + 1;
  const bisected = new Cells(meter, side, side, n === 2 ? 1 : side), own = (drawn.leaves = new Leaves(meter)), next = new Leaves(meter);
  for (let i = 0; i < coded; i += 4) {
    if (active[i + 3]) bisected.add(active[i]!, active[i + 1]!, active[i + 2]!);
    drawn.bisectActive({ ...round, next }, i);
  }
  const g = grid.edge(level) / 2, { middle } = grid.phases[level % n]!;
  const add = ({ data: d, length }: Leaves, stays: (cls: number, x: number, y: number, z: number) => boolean): void => {
    for (let i = 0; i < length; i += 4) {
      const cls = d[i]! & 255, x = d[i + 1]!, y = d[i + 2]!, z = d[i + 3]!;
      if (d[i]! >> 8 !== level || stays(cls, x, y, z)) own.add(d[i]! >> 8, cls, x, y, z);
    }
  };
  add(leaves, (cls, x, y, z) =>
    !bisected.find(x + middle[3 * cls]! * g, y + middle[3 * cls + 1]! * g, z + middle[3 * cls + 2]! * g));
  for (const made of [round.next, next]) add(made, () => true);
  return drawn;
}

/** Points on edges. */
class Points {
  readonly at = new List();
  private readonly ids: EdgeIndex;
  /** Places by the number of the crossing; and those that are being looked for. */
  private readonly places: number[] = [];
  private readonly busy = new Set<number>();

  constructor(private readonly t: Tube, private readonly scale: number | undefined,
              private readonly crossings: Crossings | undefined) {
    this.ids = new EdgeIndex(t);
  }

  /** Estimate of the value at a position, less the isovalue (9.5(3)); NaN if there is none. */
  private estimate(x: number, y: number, z: number): number {
    const { t, scale } = this, values = t.values, id = values ? values.id(x, y, z) : -1;
    if (id < 0) return NaN;
    const above = t.store.get(x, y, z) & SIGN, missing = values!.missing[id]!;
    const all = above ? values!.above : values!.below;
    if (missing > 0 && missing >= all) return NaN;
    const N = 2 ** missing * (values!.number[id]! + 0.5) - 0.5;
    if (scale !== undefined) return above ? scale * (N + 0.5) : -scale * (N + 0.5);
    const over = t.isovalue - Math.floor(t.isovalue);
    return above ? 1 + N - over : -N - over;
  }

  /** The fraction of the way from an edge's lower end (9.5(2) to (4)). */
  private plain(e: Int32Array, o: number): number {
    const { offsets } = this.t;
    if (offsets) {
      const id = offsets.edges.find(e[o]!, e[o + 1]!, e[o + 2]!, e[o + 3]!, e[o + 4]!, e[o + 5]!);
      if (id >= 0 && offsets.parts[id]! > 1) return (offsets.number[id]! + 0.5) / offsets.parts[id]!;
    }
    const at = this.linear(e, o);
    return Number.isFinite(at) ? Math.min(1, Math.max(0, at)) : 0.5;
  }

  /** The same by the values at both ends, not limited; NaN or infinite where these do not determine it. */
  private linear(e: Int32Array, o: number): number {
    if (!this.t.values) return NaN;
    const low = this.estimate(e[o]!, e[o + 1]!, e[o + 2]!), high = this.estimate(e[o + 3]!, e[o + 4]!, e[o + 5]!);
    return -low / (high - low);
  }

  /** The same with what is implied (9.5(1), (5)). */
  private place(e: Int32Array, o: number, id: number): number {
    const ring = this.crossings?.rings[id];
    if (!ring || this.busy.has(id)) return this.plain(e, o);
    if (Number.isFinite(this.linear(e, o))) return this.plain(e, o);
    this.busy.add(id);
    const { store } = this.t, first = store.get(e[o]!, e[o + 1]!, e[o + 2]!) & SIGN;
    let sum = 0, count = 0;
    for (let i = 0, j = ring.length - 3; i < j; i += 3, j -= 3) {
      const [f, atLow] = this.corner(e, o, ring, i, first), [f2, atLow2] = this.corner(e, o, ring, j, first);
      const x = atLow ? 0 : 1 - f, x2 = atLow2 ? f2 : 1;
      sum += (x * f2 + x2 * f) / (f + f2);
      count++;
    }
    this.busy.delete(id);
    const t = sum / count;
    return Number.isFinite(t) ? t : 0.5;
  }

  /** `f(y)` of a corner of the ring, and whether it differs in sign from the lower end. */
  private corner(e: Int32Array, o: number, ring: Int32Array, i: number, first: number): [number, boolean] {
    const x = ring[i]!, y = ring[i + 1]!, z = ring[i + 2]!;
    const differs = (this.t.store.get(x, y, z) & SIGN) !== first, at = differs ? o : o + 3;
    const px = e[at]!, py = e[at + 1]!, pz = e[at + 2]!;
    const forwards = px !== x ? px < x : py !== y ? py < y : pz < z;
    const edge = forwards ? Int32Array.of(px, py, pz, x, y, z) : Int32Array.of(x, y, z, px, py, pz);
    const id = this.crossings!.index.find(px, py, pz, x, y, z);
    const place = id < 0 ? this.plain(edge, 0) : (this.places[id] ??= this.place(edge, 0, id));
    return [forwards ? place : 1 - place, differs];
  }

  /** The number of the point of an edge. */
  point(ax: number, ay: number, az: number, bx: number, by: number, bz: number): number {
    const { ids, at } = this, before = ids.count, id = ids.add(ax, ay, az, bx, by, bz);
    if (ids.count === before) return this.numbers[id]!;
    const e = ids.ends, o = 6 * id;
    let t: number;
    if (this.crossings) {
      const crossing = this.crossings.index.find(ax, ay, az, bx, by, bz);
      t = crossing < 0 ? this.plain(e, o) : (this.places[crossing] ??= this.place(e, o, crossing));
    } else t = this.plain(e, o);
    t = apart(t);
    const number = at.length / this.t.n;
    for (let a = 0; a < this.t.n; a++) at.push(e[o + a]! + t * (e[o + 3 + a]! - e[o + a]!));
    return (this.numbers[id] = number);
  }
  private readonly numbers: number[] = [];

  /** How points on the full grid may move (9.10(2)). */
  ways(points: Float64Array): Ways {
    const { ids, numbers, t: { n, offsets } } = this, count = points.length / n, all = (): Float64Array => new Float64Array(count);
    const low = new Int32Array(n * count), way = new Int32Array(n * count), t = all(), from = all(), to = all();
    for (let id = 0; id < ids.count; id++) {
      const o = 6 * id, e = ids.ends, v = numbers[id]!, place = this.plain(e, o);
      for (let a = 0; a < n; a++) way[n * v + a] = e[o + 3 + a]! - (low[n * v + a] = e[o + a]!);
      const sent = offsets ? offsets.edges.find(e[o]!, e[o + 1]!, e[o + 2]!, e[o + 3]!, e[o + 4]!, e[o + 5]!) : -1;
      const half = sent >= 0 && offsets!.parts[sent]! > 1 ? 0.5 / offsets!.parts[sent]! : Number.isFinite(this.linear(e, o)) ? 0 : 0.5;
      const least = apart(place - half), most = apart(place + half), margin = (most - least) / 64;
      t[v] = apart(place);
      from[v] = least + margin;
      to[v] = most - margin;
    }
    return { low, way, t, from, to };
  }

  /** The ends of the edges of all points. */
  ends(): Int32Array {
    const { ids, numbers, at, t: { n } } = this, found = new Int32Array(2 * at.length).fill(-1);
    for (let id = 0; id < ids.count; id++)
      for (const end of [0, 1]) found.set(ids.ends.subarray(6 * id + 3 * end, 6 * id + 3 * end + n), (2 * numbers[id]! + end) * n);
    return found;
  }

  /** Pairs of points on the same edge at both ends of periodic axes. */
  seam(periodic: readonly number[]): Uint32Array {
    const { ids, numbers } = this, { last } = this.t.grid, e = ids.ends, pairs: number[] = [];
    for (let id = 0; id < ids.count; id++) {
      const ends = Array.from(e.subarray(6 * id, 6 * id + 6)) as [number, number, number, number, number, number];
      const over = periodic.filter((a) => ends[a] === last[a] && ends[3 + a] === last[a]);
      if (!over.length) continue;
      for (const a of over) ends[a] = ends[3 + a] = 0;
      const other = ids.find(...ends);
      if (other >= 0 && other !== id) pairs.push(numbers[id]!, numbers[other]!);
    }
    return Uint32Array.from(pairs);
  }
}

/**
 * The contour of an isovalue as it is known at the moment, in a series that of the present frame or of another one; points
 * are moved where the file asks for it (9.10), if `even`.
 */
export function draw(decoder: Decoder, isovalue = 0, frame = decoder.frames.length - 1, ends = false, even = true): Drawing {
  const { grid, domain, meter, meter: { memory, vertices, blocks } } = decoder;
  try {
    if (domain) return domain.draw(isovalue, frame);
    const contour = grid?.series.frames[frame]?.[isovalue];
    if (contour?.strand) return drawn(grid!, contour.strand.tube, ends, even ? roundsOf(decoder.metadata) : 0);
    const n = grid?.grid.n ?? 2;
    return { n, d: n, points: new Float64Array(0), cells: new Uint32Array(0), full: false };
  } finally {
    // what drawing took is no part of the state
    meter.memory = memory;
    meter.vertices = vertices;
    meter.blocks = blocks;
  }
}

function drawn(file: GridFile, tube: Tube, ends: boolean, rounds: number): Drawing {
  const t = atPresent(tube), { n, grid, leaves } = t, { missing, periodic } = file;
  const full = (t.baseDone && t.onFullGrid) || (n === 3 && wholeCubes(t, leaves));
  const whole = missing ? (x: number, y: number, z: number): boolean => {
    for (let i = 0; i < 1 << n; i++) if (missing.missing(x + (i & 1), y + ((i >> 1) & 1), z + (i >> 2))) return false;
    return true;
  } : undefined;
  const points = new Points(t, file.header.scale, full ? undefined : new Crossings(t, leaves));
  const cells = new List();
  if (full) (n === 2 ? squares : cubes)(t, leaves, points, cells, whole);
  else if (n === 2) {
    const [inSquares, others] = wholeSquares(t, leaves);
    squares(t, inSquares, points, cells, undefined);
    simplices(t, others, points, cells);
  } else simplices(t, leaves, points, cells);
  const drawing: Drawing = {
    n, d: n, full, points: points.at.data.slice(0, points.at.length),
    cells: Uint32Array.from(cells.data.subarray(0, cells.length)),
  };
  if (rounds && t.baseDone && t.onFullGrid) smooth(n, drawing.points, drawing.cells, points.ways(drawing.points), rounds);
  if (ends) drawing.ends = points.ends();
  if (periodic.length) drawing.seam = points.seam(periodic);
  return whole && !full ? cutOut(drawing, whole, grid.last, t.meter) : drawing;
}

type Whole = ((x: number, y: number, z: number) => boolean) | undefined;

/** A piece for each leaf (9.2). */
function simplices(t: Tube, leaves: Leaves, points: Points, cells: List): void {
  const { n } = t, p = new Int32Array(12), all = (2 << n) - 1;
  const on = (i: number, j: number): number => points.point(p[3 * i]!, p[3 * i + 1]!, p[3 * i + 2]!, p[3 * j]!,
    p[3 * j + 1]!, p[3 * j + 2]!);
  const by = (i: number, j: number, a: number): number => p[3 * j + a]! - p[3 * i + a]!;
  for (let l = 0; l < leaves.length / 4; l++) {
    const signs = leafVertices(t, leaves, l, p);
    if (signs === 0 || signs === all) continue;
    let up = 0;
    for (let j = 0; j <= n; j++) up += (signs >> j) & 1;
    if (n === 3 && up === 2) {
      const above = [0, 1, 2, 3].filter((j) => (signs >> j) & 1), below = [0, 1, 2, 3].filter((j) => !((signs >> j) & 1));
      const [u, v] = above as [number, number], [s, w] = below as [number, number];
      const ring = [on(u, s), on(u, w), on(v, w), on(v, s)];
      if (turn(by, u, v, s, w) < 0) ring.reverse();
      cells.push(ring[0]!, ring[1]!, ring[2]!, ring[0]!, ring[2]!, ring[3]!);
      continue;
    }
    const lone = up === 1 ? signs : all & ~signs, i = 31 - Math.clz32(lone);
    const others = [0, 1, 2, 3].filter((j) => j !== i && j <= n);
    const ring = others.map((j) => on(i, j));
    const [a, b, c] = others as [number, number, number];
    const way = n === 2 ? by(i, a, 0) * by(i, b, 1) - by(i, a, 1) * by(i, b, 0) : turn(by, i, a, b, c);
    if (way > 0 !== (up === 1)) ring.reverse();
    cells.push(...ring);
  }
}

function turn(by: (i: number, j: number, a: number) => number, i: number, a: number, b: number, c: number): number {
  return by(i, a, 0) * (by(i, b, 1) * by(i, c, 2) - by(i, b, 2) * by(i, c, 1)) -
    by(i, a, 1) * (by(i, b, 0) * by(i, c, 2) - by(i, b, 2) * by(i, c, 0)) +
    by(i, a, 2) * (by(i, b, 0) * by(i, c, 1) - by(i, b, 1) * by(i, c, 0));
}

/** Unit squares (9.3): the segments of both leaves that meet on the diagonal are one. */
function squares(t: Tube, leaves: Leaves, points: Points, cells: List, whole: Whole): void {
  const p = new Int32Array(12), open = new Map<number, number>(), width = t.grid.last[1] + 1;
  for (let l = 0; l < leaves.length / 4; l++) {
    const signs = leafVertices(t, leaves, l, p);
    const x = Math.min(p[0]!, p[6]!), y = Math.min(p[1]!, p[7]!);
    if (whole && !whole(x, y, 0)) continue;
    const one = ((signs ^ (signs >> 1)) & 1) !== 0, two = (((signs >> 1) ^ (signs >> 2)) & 1) !== 0;
    const ccw = (p[3]! - p[0]!) * (p[7]! - p[1]!) - (p[4]! - p[1]!) * (p[6]! - p[0]!) > 0;
    const first = one ? points.point(p[0]!, p[1]!, 0, p[3]!, p[4]!, 0) : -1;
    const second = two ? points.point(p[3]!, p[4]!, 0, p[6]!, p[7]!, 0) : -1;
    if (one && two) {
      // x_1 alone on its side: from (x_1, x_2) to (x_1, x_0) it lies on the left if the leaf runs anticlockwise
      const above = ((signs >> 1) & 1) === 1;
      if (ccw === above) cells.push(second, first);
      else cells.push(first, second);
      continue;
    }
    const key = x * width + y, met = open.get(key), own = one ? first : second;
    if (met === undefined) {
      open.set(key, own);
      continue;
    }
    // this leaf comes second: from its point to the other leaf's, across the diagonal from x_0 to x_2
    const above = (signs & 1) === 1;
    if (ccw === above) cells.push(own, met);
    else cells.push(met, own);
  }
}

/** Leaves in unit squares of which each mixed simplex is drawn, and the others (9.1(2)). */
function wholeSquares(t: Tube, leaves: Leaves): [Leaves, Leaves] {
  const p = new Int32Array(12), width = t.grid.last[1] + 1, halves = new Map<number, number>();
  const parts: [Leaves, Leaves] = [new Leaves(t.meter), new Leaves(t.meter)];
  const d = leaves.data;
  const square = (l: number): number | undefined => {
    if (d[4 * l]! >> 8 !== t.grid.full) return undefined;
    const signs = leafVertices(t, leaves, l, p);
    // both simplices are mixed if the diagonal, from x_0 to x_2, is crossed
    const diagonal = ((signs ^ (signs >> 2)) & 1) !== 0;
    return diagonal ? Math.min(p[0]!, p[6]!) * width + Math.min(p[1]!, p[7]!) : -1;
  };
  for (let l = 0; l < leaves.length / 4; l++) {
    const key = square(l);
    if (key !== undefined && key >= 0) halves.set(key, (halves.get(key) ?? 0) + 1);
  }
  for (let l = 0; l < leaves.length / 4; l++) {
    const key = square(l), done = key !== undefined && (key < 0 ? lone(t, p) : halves.get(key) === 2);
    parts[done ? 0 : 1].add(d[4 * l]! >> 8, d[4 * l]! & 255, d[4 * l + 1]!, d[4 * l + 2]!, d[4 * l + 3]!);
  }
  return parts;
}

/** Whether the other half of the square of a leaf with the vertices `p`, its diagonal not crossed, is of one sign. */
function lone(t: Tube, p: Int32Array): boolean {
  const flags = t.store.get(p[0]! + p[6]! - p[3]!, p[1]! + p[7]! - p[4]!, 0), end = t.store.get(p[0]!, p[1]!, 0);
  return !(flags & KNOWN) || ((flags ^ end) & SIGN) === 0;
}

/** The unit cubes that leaves of the full grid lie in, by their least corners, and how many leaves each has. */
function cubesOf(t: Tube, leaves: Leaves): { index: EdgeIndex; counts: number[] } {
  const p = new Int32Array(12), index = new EdgeIndex(t), counts: number[] = [];
  for (let l = 0; l < leaves.length / 4; l++) {
    leafVertices(t, leaves, l, p);
    const x = Math.min(p[0]!, p[9]!), y = Math.min(p[1]!, p[10]!), z = Math.min(p[2]!, p[11]!);
    const id = index.add(x, y, z, x, y, z);
    counts[id] = (counts[id] ?? 0) + 1;
  }
  return { index, counts };
}

/** Signs of the corners of a cube in its frame, which begins at the corner with even indices. */
function cornerSigns(t: Tube, x: number, y: number, z: number): number {
  const at = (corner: number): number => t.store.get(x + (((corner >> 2) & 1) ^ (x & 1)),
    y + (((corner >> 1) & 1) ^ (y & 1)), z + ((corner & 1) ^ (z & 1)));
  const origin = at(0) & SIGN;
  let signs = 0;
  for (let corner = 0; corner < 8; corner++) {
    const flags = at(corner);
    if (flags & KNOWN ? flags & SIGN : origin) signs |= 1 << corner;
  }
  return signs;
}

/** Whether all leaves are of the full grid, and all mixed simplices of their cubes are there (9.1(2)). */
function wholeCubes(t: Tube, leaves: Leaves): boolean {
  for (let i = 0; i < leaves.length; i += 4) if (leaves.data[i]! >> 8 !== t.grid.full) return false;
  const { index, counts } = cubesOf(t, leaves), e = index.ends;
  return counts.every((count, id) => count === pattern(cornerSigns(t, e[6 * id]!, e[6 * id + 1]!, e[6 * id + 2]!)).mixed);
}

/** Unit cubes (9.4). */
function cubes(t: Tube, leaves: Leaves, points: Points, cells: List, whole: Whole): void {
  const { index, counts } = cubesOf(t, leaves);
  const point = new Int32Array(16);
  for (let id = 0; id < index.count; id++) {
    const x = index.ends[6 * id]!, y = index.ends[6 * id + 1]!, z = index.ends[6 * id + 2]!;
    if (whole && !whole(x, y, z)) continue;
    const ox = x & 1, oy = y & 1, oz = z & 1;
    const at = (corner: number): [number, number, number] =>
      [x + (((corner >> 2) & 1) ^ ox), y + (((corner >> 1) & 1) ^ oy), z + ((corner & 1) ^ oz)];
    const signs = cornerSigns(t, x, y, z);
    const found = pattern(signs);
    if (counts[id] !== found.mixed) continue;
    for (let i = 0; i < 12; i++) {
      const [a, b] = EDGES[i]!;
      if (((signs >> a) ^ (signs >> b)) & 1) point[i] = points.point(...at(a), ...at(b));
    }
    found.added.forEach((loop, i) => {
      point[12 + i] = points.at.length / 3;
      const mean = [0, 1, 2].map((a) => loop.reduce((sum, edge) => sum + points.at.data[3 * point[edge]! + a]!, 0) / loop.length);
      points.at.push(...mean);
    });
    const mirrored = (ox + oy + oz) & 1, { triangles } = found;
    for (let i = 0; i < triangles.length; i += 3) {
      const a = point[triangles[i]!]!, b = point[triangles[i + 1]!]!, c = point[triangles[i + 2]!]!;
      if (mirrored) cells.push(a, c, b);
      else cells.push(a, b, c);
    }
  }
}
