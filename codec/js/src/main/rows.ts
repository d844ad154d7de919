/** Rows that the networks of the main profile see of signs, new components and questions (7.12, 7.13, 7.16, 7.17). */
import { bits } from "../bits.js";
import { EXPLICIT, KNOWN, OUT, SIGN } from "../store.js";
import type { Tube } from "../tube.js";
import type { Crowd } from "./crowd.js";
import { SIGN_ROW, TREE_ROW } from "./tables.js";

/** Rows that a network sees; what fills them says how many. */
export const rows = new Int32Array(1024);

/** Differences of 7.12(3) in the frame of a phase, three each. */
function around(n: number, r: number): number[][] {
  const list: number[][] = [], reach = 8;
  for (let x = -reach; x <= reach; x++) for (let y = -reach; y <= reach; y++) {
    for (let z = n === 2 ? 0 : -reach; z <= (n === 2 ? 0 : reach); z++) {
      const d = [x, y, z].slice(0, n);
      let odd = 0;
      d.forEach((by, i) => (odd += (by + (i < n - r ? 1 : 0)) & 1));
      if ((x || y || z) && (odd === 0 || odd >= n - r)) list.push([x, y, z]);
    }
  }
  const size = (d: number[]): number => d[0]! ** 2 + d[1]! ** 2 + d[2]! ** 2;
  list.sort((p, q) => size(p) - size(q) || p[0]! - q[0]! || p[1]! - q[1]! || p[2]! - q[2]!);
  return list.slice(0, n === 2 ? 96 : 112);
}

/** The same on the lattice, by phase and by the middle modulo 4: three coordinates each, in units. */
interface Frame {
  d: Int8Array;
  reach: number;
  /** The anchor's difference from the middle. */
  away: [number, number, number];
}

const frames: (Frame | undefined)[][] = [];

function frame(n: number, r: number, mx: number, my: number, mz: number): Frame {
  const table = (frames[4 * n + r] ??= []), key = 16 * mx + 4 * my + mz;
  const old = table[key];
  if (old) return old;
  const m = [mx, my, mz], axes = [0, 1, 2].slice(0, n);
  const order = [...axes.filter((a) => m[a]! & 1), ...axes.filter((a) => !(m[a]! & 1))];
  const way = axes.map((a) => (m[a] === 3 ? -1 : 1));
  const list = around(n, r), d = new Int8Array(3 * list.length);
  list.forEach((by, i) => order.forEach((a, j) => (d[3 * i + a] = way[a]! * by[j]!)));
  const away: [number, number, number] = [0, 0, 0];
  for (const a of axes) if (m[a]! & 1) away[a] = -way[a]!;
  return (table[key] = { d, reach: Math.max(...d.map(Math.abs)), away });
}

/** 7.13(3). */
function rarity(t: Tube): number {
  return Math.min(bits(Math.floor((t.known.length / 3 + 1) / (t.born + 1))) - 1, 12);
}

/** Rows of a refinement sign (7.12); `corners` is the row of its part for classes of corners. */
export function refinementRows(t: Tube, level: number, x: number, y: number, z: number, crossed: number,
                               corners: number, here: number, earlier: number, apart: number): number {
  const { n, store } = t, r = level % n, c = t.grid.edge(level), g = c / 2;
  const f = frame(n, r, (x / g) & 3, (y / g) & 3, n === 2 ? 0 : (z / g) & 3), d = f.d, count = n === 2 ? 96 : 112;
  const to = SIGN_ROW[n]![r]!, list = rows;
  let seen = 0;
  const [lastX, lastY, lastZ] = t.grid.last, reach = f.reach * g;
  const same = here ? SIGN | KNOWN : KNOWN;
  if (x >= reach && y >= reach && x + reach <= lastX && y + reach <= lastY &&
    (n === 2 || (z >= reach && z + reach <= lastZ))) {
    const flags = store.flags;
    for (let i = 0, j = 0; i < count; i++, j += 3) {
      const mark = flags[store.at(x + d[j]! * g, y + d[j + 1]! * g, z + d[j + 2]! * g)]! & 3;
      if (mark & 1) list[seen++] = to + 2 * i + (mark === same ? 1 : 0);
    }
  } else {
    for (let i = 0, j = 0; i < count; i++, j += 3) {
      const mark = t.see(x + d[j]! * g, y + d[j + 1]! * g, z + d[j + 2]! * g) & 3;
      if (mark & 1) list[seen++] = to + 2 * i + (mark === same ? 1 : 0);
    }
  }
  const rest = to + 2 * count;
  list[seen++] = rest + Math.min(bits(c) - 1, 8);
  list[seen++] = rest + 9 + rarity(t);
  list[seen++] = rest + 22 + (t.calm[crossed]! >> 8);
  if (earlier >= 0)
    list[seen++] = rest + 38 + 30 * ((earlier & 1) === here ? 1 : 0) + 10 * Math.min(apart, 2) +
      bits((4096 - t.agreed) >> 4);
  list[seen++] = rest + 98 + corners;
  return seen;
}

/** Rows of a question about the mesh (7.16). */
export function questionRows(t: Tube, what: number, level: number, x: number, y: number, z: number,
                             history: number): number {
  const { n, store, grid } = t, r = level % n, g = grid.edge(level) / 2;
  const { d, away } = frame(n, r, (x / g) & 3, (y / g) & 3, n === 2 ? 0 : (z / g) & 3);
  const base = n === 2 ? 2136 : 2949, to = base + 44 + 96 * r;
  const here = t.see(x + away[0] * g, y + away[1] * g, z + away[2] * g) & SIGN;
  let seen = 0;
  rows[seen++] = base + 3 * what + r;
  rows[seen++] = base + 12 + Math.min(n * grid.k - level, 23);
  rows[seen++] = base + 36 + history;
  for (let i = 0; i < 24; i++) {
    const px = x + d[3 * i]! * g, py = y + d[3 * i + 1]! * g, pz = z + d[3 * i + 2]! * g;
    const marks = store.get(px, py, pz), image = t.see(px, py, pz);
    if (marks & EXPLICIT) rows[seen++] = to + 2 * i + 1;
    else if (marks & OUT) rows[seen++] = to + 2 * i;
    if (image & KNOWN) rows[seen++] = to + 48 + 2 * i + ((image & SIGN) === here ? 1 : 0);
  }
  return seen;
}

/** The tuples of 7.17(2). */
const tuples = [2, 3].map((n) => {
  const list: number[] = [];
  for (let x = -3; x <= 3; x++) for (let y = -3; y <= 3; y++) {
    for (let z = n === 2 ? 0 : -3; z <= (n === 2 ? 0 : 3); z++) {
      if ((x || y || z) && (n === 2 || Math.abs(x) + Math.abs(y) + Math.abs(z) <= 3)) list.push(x, y, z);
    }
  }
  return Int8Array.from(list);
});

/** Rows of a base sign: vertex `o` of a simplex (7.17). */
export function signRows(t: Tube, level: number, cls: number, x: number, y: number, z: number, o: number,
                         predicted: number, kase: number, earlier: number): number {
  const { n } = t, r = level % n, c = t.grid.edge(level), { off } = t.grid.phases[r]!, d = tuples[n - 2]!;
  const base = n === 2 ? 2372 : 3281, count = n === 2 ? 48 : 62, to = base + 18 + 2 * count * (r * (n + 1) + o);
  const at = 12 * cls, v = at + 3 * o;
  const e: number[] = [];
  for (let j = 0; j <= n; j++) {
    if (j !== o) for (let a = 0; a < 3; a++) e.push(((off[at + 3 * j + a]! - off[v + a]!) * c) / 2);
  }
  if (n === 2) e.push(0, 0, 0);
  const vx = x + (off[v]! * c) / 2, vy = y + (off[v + 1]! * c) / 2, vz = z + (off[v + 2]! * c) / 2;
  let seen = 0;
  rows[seen++] = base + kase;
  if (earlier >= 0) rows[seen++] = base + 16 + ((earlier & 1) === predicted ? 1 : 0);
  for (let i = 0, j = 0; i < count; i++, j += 3) {
    const p = d[j]!, q = d[j + 1]!, s = d[j + 2]!;
    const mark = t.see(vx + p * e[0]! + q * e[3]! + s * e[6]!, vy + p * e[1]! + q * e[4]! + s * e[7]!,
      vz + p * e[2]! + q * e[5]! + s * e[8]!);
    if (mark & KNOWN) rows[seen++] = to + 2 * i + ((mark & SIGN ? 1 : 0) === predicted ? 1 : 0);
  }
  return seen;
}

/** Rows of a node of the tree of new components, or of a slot (`height` -1), in the cube or node `q` (7.13(3)). */
export function componentRows(t: Tube, crowd: Crowd, level: number, height: number, root: boolean, child: number, hits: number,
                              nearness: number, qx: number, qy: number, qz: number): number {
  const { n, grid } = t, r = level % n, base = TREE_ROW[n]!;
  let seen = 0;
  rows[seen++] = base + (height < 0 ? 24 + r : 3 * Math.min(height, 7) + r);
  if (!root) rows[seen++] = base + 27 + 8 * Math.min(hits, 2) + child;
  rows[seen++] = base + 51 + nearness;
  rows[seen++] = base + 81 + rarity(t);
  const j = bits(grid.edge(level)) - 1 + Math.max(height, 0);
  if (j <= grid.k) {
    crowd.look(j, qx, qy, qz);
    rows[seen++] = base + 57 + crowded(crowd.vertices);
    rows[seen++] = base + 69 + crowded(crowd.births);
    const reach = n === 2 ? 2 : 1, reachZ = n === 2 ? 0 : 1;
    let at = base + 94;
    for (let x = -reach; x <= reach; x++) for (let y = -reach; y <= reach; y++) for (let z = -reachZ; z <= reachZ; z++) {
      if (!(x || y || z)) continue;
      crowd.look(j, qx + x, qy + y, qz + z);
      rows[seen++] = at + Math.min(crowd.vertices, 4);
      rows[seen++] = at + 5 + Math.min(crowd.births, 3);
      at += 9;
    }
  }
  return seen;
}

const crowded = (x: number): number => (x < 4 ? x : Math.min(bits(x), 10) + 1);
