/**
 * Tables of the mesh (clauses 4.1 to 4.5): for each phase the simplices of one period of the lattice, their children,
 * neighbours and parents, and the diamonds. Everything follows from the paths of 4.5(2) and the bisection of 4.2.
 *
 * A simplex is its class (its number in the period) and the corner of its period; offsets are in units of `g`, in which
 * the period is 4. Points have three coordinates; with two axes the last one is 0.
 */

/** All simplices that share a subdivision edge (4.4). Corners are bits; the middle is bit `MIDDLE`. */
export interface Diamond {
  members: number;
  /** Class of each member, and its period in periods from that of the middle, three a member. */
  cls: Int32Array;
  shift: Int32Array;
  /** Corners of each member. */
  mask: Int32Array;
  /** Classes, corners and periods (those of the next level, from that of the middle) of the children, two a member. */
  childCls: Int32Array;
  childMask: Int32Array;
  childShift: Int32Array;
  /** Corners less the middle, in units, three a corner: the two ends, then the ring. */
  corners: number;
  corner: Int32Array;
  /** Which end is the anchor (4.4(5)). */
  anchor: 0 | 1;
  /** With three axes, class (7.6(3)) by the signs of the ring, 1 for another one than the anchor's; if the ends differ, behind. */
  classes: Uint8Array;
}

export const MIDDLE = 1 << 12;

export interface Phase {
  count: number;
  /** Vertices: [12 * class + 3 * vertex + axis]; their least and greatest coordinates: [3 * class + axis]. */
  off: Int32Array;
  low: Int32Array;
  high: Int32Array;
  /** Middle of the subdivision edge, [3 * class + axis]. */
  middle: Int32Array;
  /** Children: [2 * class + child]; periods of the next level from the simplex's, three a child. */
  child: Int32Array;
  childShift: Int32Array;
  /** Neighbours: [4 * class + face], their periods, and which of their vertices is opposite. */
  neighbour: Int32Array;
  neighbourShift: Int32Array;
  opposite: Int32Array;
  /** Parent and which of its children this is: [8 * class + parities of the period], the first axis the highest bit. */
  parent: Int32Array;
  which: Int32Array;
  /** Number among the members of its diamond. */
  member: Int32Array;
  /** Number of the newest vertex (4.7(2)), and of the end of the subdivision edge that is not `x_0`. */
  newest: number;
  tag: number;
  /** Diamonds by the middle modulo 4: [16 * m_0 + 4 * m_1 + m_2]. */
  diamonds: (Diamond | undefined)[];
}

type Point = [number, number, number];
type Simplex = Point[];

const plus = (p: Point, q: Point, times = 1): Point => [p[0] + times * q[0], p[1] + times * q[1], p[2] + times * q[2]];
const compare = (p: Point, q: Point): number => p[0] - q[0] || p[1] - q[1] || p[2] - q[2];
const ints = (length: number): Int32Array => new Int32Array(length).fill(-1);

/** The same points moved into the period of the origin, and how far that was, in periods. */
function settle(points: Point[]): [Point[], Point] {
  const at = [0, 1, 2].map((a) => Math.floor(Math.min(...points.map((p) => p[a]!)) / 4)) as Point;
  return [points.map((p) => plus(p, at, -4)), at];
}

function permutations(n: number): number[][] {
  if (n === 2) return [[0, 1], [1, 0]];
  return [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
}

/** The simplices of phase 0 (4.5(2)); those of the first cube come first, in the order of 4.1(2). */
function first(n: number): Simplex[] {
  const all: Simplex[] = [];
  for (let cube = 0; cube < 1 << n; cube++) {
    const far = (a: number): number => (cube >> (n - 1 - a)) & 1;
    for (const order of permutations(n)) {
      const at: Point = [0, 0, 0];
      for (let a = 0; a < n; a++) at[a] = 4 * far(a);
      const path: Simplex = [[...at]];
      for (const a of order) {
        at[a]! += far(a) ? -2 : 2;
        path.push([...at]);
      }
      all.push(path);
    }
  }
  return all;
}

function halves(simplex: Simplex, d: number): [Simplex, Simplex] {
  const z = plus(simplex[0]!, simplex[d]!).map((x) => x / 2) as Point;
  const rest = simplex.slice(d + 1);
  return [[...simplex.slice(0, d), z, ...rest], [...simplex.slice(1, d + 1), z, ...rest]];
}

/** Classes of a ring (7.6(3)), whose readings may begin where `begins` says so; none with two axes, where it has no circle. */
function classes(ring: Point[], members: Simplex[], begins: (p: Point, crossed: boolean) => boolean): Uint8Array {
  const size = ring.length, is = (p: Point, q: Point): boolean => compare(p, q) === 0;
  if (size < 4) return new Uint8Array(0);
  const circle = [0], beside = (i: number, j: number): boolean =>
    members.some((s) => s.some((p) => is(p, ring[i]!)) && s.some((p) => is(p, ring[j]!)));
  for (let i: number; (i = ring.findIndex((_, j) => !circle.includes(j) && beside(circle.at(-1)!, j))) >= 0;) circle.push(i);
  const found = new Uint8Array(2 << size);
  for (const crossed of [false, true]) {
    const least = Array.from({ length: 1 << size }, (_, signs) => {
      let number = Infinity;
      for (let from = 0; from < size; from++) {
        if (!begins(ring[circle[from]!]!, crossed)) continue;
        for (const way of [1, size - 1]) {
          let reading = 0;
          for (let i = 0; i < size; i++) reading = 2 * reading + ((signs >> circle[(from + way * i) % size]!) & 1);
          number = Math.min(number, reading);
        }
      }
      return number;
    });
    const order = [...new Set(least)].sort((p, q) => p - q);
    least.forEach((number, signs) => (found[(crossed ? 1 << size : 0) + signs] = order.indexOf(number)));
  }
  return found;
}

function diamond(d: number, members: { simplex: Simplex; cls: number; shift: Point; middle: Point }[],
                 children: (cls: number, which: number) => { cls: number; shift: Point; double: number }): Diamond {
  const sum = (s: Simplex): Point => s.reduce((p, q) => plus(p, q));
  members.sort((p, q) => compare(sum(p.simplex), sum(q.simplex)));
  const one = members[0]!;
  const ends = [one.simplex[0]!, one.simplex[d]!].sort(compare);
  const odd = [0, 1, 2].filter((a) => one.middle[a]! & 1), anchor = odd.every((a) => ends[0]![a]! % 4 === 0) ? 0 : 1;
  const key = (p: Point): string => p.join();
  const ring = new Map<string, Point>();
  for (const { simplex } of members) for (const p of simplex) ring.set(key(p), p);
  for (const p of ends) ring.delete(key(p));
  const corners = [...ends, ...[...ring.values()].sort(compare)];
  const bits = new Map(corners.map((p, i) => [key(p), 1 << i]));
  bits.set(key(one.middle), MIDDLE);
  const mask = (s: Simplex): number => s.reduce((m, p) => m | bits.get(key(p))!, 0);
  const kids = members.flatMap((m) => halves(m.simplex, d).map((simplex, i) => ({ simplex, m, ...children(m.cls, i) })));
  return {
    members: members.length,
    cls: Int32Array.from(members, (m) => m.cls),
    shift: Int32Array.from(members.flatMap((m) => m.shift)),
    mask: Int32Array.from(members, (m) => mask(m.simplex)),
    childCls: Int32Array.from(kids, (kid) => kid.cls),
    childMask: Int32Array.from(kids, (kid) => mask(kid.simplex)),
    childShift: Int32Array.from(kids.flatMap((kid) => plus(kid.shift, kid.m.shift, kid.double))),
    corners: corners.length,
    corner: Int32Array.from(corners.flatMap((p) => plus(p, one.middle, -1))),
    anchor,
    classes: classes(corners.slice(2), members.map((m) => m.simplex), (p, crossed) => {
      const apart = plus(p, odd.length === 3 ? ends[anchor]! : one.middle, -1).filter((x) => x !== 0).length;
      return apart === 1 || (odd.length === 3 && !crossed);
    }),
  };
}

function build(n: number): Phase[] {
  const lists: Simplex[][] = [first(n)];
  const numbers: Map<string, number>[] = [];
  const phases: Phase[] = [];
  for (let r = 0; r < n; r++) {
    numbers.push(new Map(lists[r]!.map((s, i) => [s.join(";"), i])));
    if (r + 1 === n) break;
    const next = new Map<string, Simplex>();
    for (const s of lists[r]!) for (const half of halves(s, n - r)) {
      const moved = settle(half)[0];
      next.set(moved.join(";"), moved);
    }
    lists.push([...next.values()]);
  }
  for (let r = 0; r < n; r++) {
    const list = lists[r]!, count = list.length, d = n - r;
    const double = r + 1 === n ? 2 : 1;
    const phase: Phase = {
      count, off: new Int32Array(12 * count), low: new Int32Array(3 * count), high: new Int32Array(3 * count),
      middle: new Int32Array(3 * count), child: ints(2 * count), childShift: new Int32Array(6 * count),
      neighbour: ints(4 * count), neighbourShift: new Int32Array(12 * count), opposite: ints(4 * count),
      parent: ints(8 * count), which: ints(8 * count), member: ints(count), newest: r > 0 ? d + 1 : 1, tag: d,
      diamonds: new Array(64),
    };
    phases.push(phase);
    const faces = new Map<string, [number, number, Point]>();
    const groups = new Map<number, { simplex: Simplex; cls: number; shift: Point; middle: Point }[]>();
    list.forEach((s, cls) => {
      s.forEach((p, j) => phase.off.set(p, 12 * cls + 3 * j));
      for (let a = 0; a < 3; a++) {
        phase.low[3 * cls + a] = Math.min(...s.map((p) => p[a]!));
        phase.high[3 * cls + a] = Math.max(...s.map((p) => p[a]!));
      }
      const middle = plus(s[0]!, s[d]!).map((x) => x / 2) as Point;
      phase.middle.set(middle, 3 * cls);
      halves(s, d).forEach((half, i) => {
        const [moved, at] = settle(half.map((p) => p.map((x) => x * double) as Point));
        phase.child[2 * cls + i] = numbers[(r + 1) % n]!.get(moved.join(";"))!;
        phase.childShift.set(at, 6 * cls + 3 * i);
      });
      s.forEach((_, i) => {
        const [face, at] = settle(s.filter((__, j) => j !== i).sort(compare));
        const key = face.join(";"), other = faces.get(key);
        if (!other) {
          faces.set(key, [cls, i, at]);
          return;
        }
        const [cls2, i2, at2] = other;
        phase.neighbour[4 * cls + i] = cls2;
        phase.neighbour[4 * cls2 + i2] = cls;
        phase.opposite[4 * cls + i] = i2;
        phase.opposite[4 * cls2 + i2] = i;
        phase.neighbourShift.set(plus(at, at2, -1), 12 * cls + 3 * i);
        phase.neighbourShift.set(plus(at2, at, -1), 12 * cls2 + 3 * i2);
      });
      const place = middle.map((x) => x & 3) as Point;
      const shift = middle.map((x) => -(x >> 2)) as Point;
      const key = 16 * place[0] + 4 * place[1] + place[2];
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key)!.push({ simplex: s.map((p) => plus(p, shift, 4)), cls, shift, middle: place });
    });
    for (const [key, members] of groups) {
      phase.diamonds[key] = diamond(d, members, (cls, i) => ({
        cls: phase.child[2 * cls + i]!, double,
        shift: [...phase.childShift.subarray(6 * cls + 3 * i, 6 * cls + 3 * i + 3)] as Point,
      }));
      members.forEach((m, i) => (phase.member[m.cls] = i));
    }
  }
  phases.forEach((phase, r) => {
    const next = phases[(r + 1) % n]!;
    for (let c = 0; c < 2 * phase.count; c++) {
      const at = phase.childShift.subarray(3 * c, 3 * c + 3);
      const key = 8 * phase.child[c]! + 4 * at[0]! + 2 * at[1]! + at[2]!;
      next.parent[key] = c >> 1;
      next.which[key] = c & 1;
    }
  });
  return phases;
}

const made: Phase[][] = [];

/** The phases of the mesh with `n` axes. */
export const phases = (n: number): Phase[] => (made[n] ??= build(n));
