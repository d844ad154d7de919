/** Meshes in the file, cell by cell (10.10). */
import type { Coder } from "../coder.js";
import type { IsoError, Meter } from "../errors.js";
import { Complex } from "./complex.js";
import { clip, mulDiv, rootOfSquares, shr } from "./integers.js";
import { Layout, Opinions } from "./models.js";

const LAYOUT = new Layout([
  ["CLOSED", 48, 32768, 0], ["CLOSED_PAST", 64, 32768, 0], ["KNOWN", 48, 32768, 0], ["KNOWN_COUNT", 48, 32768, 0],
  ["WHICH", 192, 32768, 0], ["FAR", 1, 32768, 0], ["AGAIN", 1, 32768, 0], ["PLACE", 192, 32768, 0],
], [["CLOSED", 4], ["KNOWN", 5], ["PLACE", 48]], 22000);
const { at: C, sets } = LAYOUT;

/** The least `c` from 0 to 10 with `f < 2**c`, or 11. */
function near(f: number): number {
  let c = 0;
  while (c < 11 && f >= 2 ** c) c++;
  return c;
}

/** What is behind a face: a border, or what a neighbour has; faces are open as long as neither is known. */
const OPEN = -2, BORDER = -1;

/** A longer copy of an array, of at most `most` entries, for whole vertices and cells; what is new has the value `fill`. */
function longer<A extends Int32Array | Float64Array>(old: A, most: number, fill: number, meter: Meter): A {
  const size = Math.min(most, Math.max(768, 2 * old.length));
  meter.take(old.BYTES_PER_ELEMENT * (size - old.length));
  const found = new (old.constructor as new (size: number) => A)(size).fill(fill) as A;
  found.set(old);
  return found;
}

/** A mesh whose arrays grow with the vertices and cells that come: what a file states may be much more. */
export class CodedMesh {
  private positions = new Float64Array(0);
  private cells = new Int32Array(0);
  private neighbours = new Int32Array(0);
  private vertices = 0;
  private count = 0;
  /** Faces that wait, and the first of them. */
  private readonly waiting: number[] = [];
  private first = 0;
  /** Cells of a vertex, the latest first: the place of its corner in `cells`, and by place the next one. */
  private latest = new Int32Array(0);
  private next = new Int32Array(0);
  private readonly o: Opinions;
  private past = 0;
  private readonly miss = [0, 0];
  private readonly spread: (number | undefined)[] = [];
  /** Expected position behind a face, the reflection, the even place. */
  private readonly expected: number[][] = [];
  private readonly candidates: { v: number; distance: number }[] = [];

  constructor(private readonly coder: Coder, private readonly d: number, private readonly n: number, private readonly V: number,
              private readonly T: number, private readonly extent: readonly number[],
              private readonly error: (clause: string, what: string) => IsoError) {
    this.o = new Opinions(coder, LAYOUT.make());
  }

  decode(): Complex {
    const { d, n, V, T, waiting } = this, cell = new Int32Array(n + 1);
    while (this.count < T) {
      for (let i = 0; i <= n; i++) cell[i] = this.told(undefined);
      this.take(cell);
      while (this.first < waiting.length && this.count < T) {
        const face = waiting[this.first++]!;
        if (this.neighbours[face] === OPEN) this.open(face, cell);
      }
    }
    const { neighbours } = this;
    if (this.vertices < V) throw this.error("10.10.1", "a mesh has fewer vertices than it states");
    for (let i = 0; i < neighbours.length; i++) if (neighbours[i] === OPEN) neighbours[i] = BORDER;
    return new Complex(d, n, V, T, this.positions, this.cells, neighbours, this.coder.meter);
  }

  /** Take a cell (10.10.2). */
  private take(cell: Int32Array): void {
    if ((this.n + 1) * this.count === this.cells.length) {
      const { coder: { meter } } = this, most = (this.n + 1) * this.T;
      this.cells = longer(this.cells, most, 0, meter);
      this.neighbours = longer(this.neighbours, most, OPEN, meter);
      this.next = longer(this.next, most, 0, meter);
    }
    const { n, cells, neighbours, latest, next } = this, m = n + 1, own = this.count, from = m * own;
    for (let i = 0; i <= n; i++) for (let j = 0; j < i; j++)
      if (cell[i] === cell[j]) throw this.error("10.10.2", "a cell has a vertex twice");
    for (let i = 0; i <= n; i++) {
      const v = cell[i === 0 ? 1 : 0]!;
      let found = -1;
      for (let at = latest[v]!; at >= 0 && found < 0; at = next[at]!) {
        const other = Math.floor(at / m);
        this.coder.meter.step(1);
        for (let j = 0; j <= n && found < 0; j++) if (this.same(cell, i, m * other, j)) found = m * other + j;
      }
      if (found < 0) {
        // eight bytes each
        this.coder.meter.take(8);
        this.waiting.push(from + i);
        continue;
      }
      if (neighbours[found] !== OPEN) throw this.error("10.10.2", "a face has more than two cells");
      if (cells[found] === cell[i]) throw this.error("10.10.2", "two cells have the same vertices");
      neighbours[found] = own;
      neighbours[from + i] = Math.floor(found / m);
    }
    for (let i = 0; i <= n; i++) {
      const v = cell[i]!;
      cells[from + i] = v;
      next[from + i] = latest[v]!;
      latest[v] = from + i;
    }
    this.count++;
  }

  /** Whether face `i` of a cell has the vertices of face `j` of the one at `from`. */
  private same(cell: Int32Array, i: number, from: number, j: number): boolean {
    const { n, cells } = this;
    for (let a = 0; a <= n; a++) {
      if (a === j) continue;
      const at = cell.indexOf(cells[from + a]!);
      if (at < 0 || at === i) return false;
    }
    return true;
  }

  /** Coordinate `k` of the vertex at a place of `cells`. */
  private x(at: number, k: number): number {
    return this.positions[this.d * this.cells[at]! + k]!;
  }

  /** An open face (10.10.3); `cell` takes the new one. */
  private open(face: number, cell: Int32Array): void {
    const { n, o, cells, neighbours, candidates } = this, m = n + 1, i = face % m, from = face - i;
    this.expect(from, i);
    this.offer(from, i);
    let edge = 0;
    for (let j = 0; j <= n; j++) if (neighbours[from + j] === BORDER) edge++;
    const k = candidates.length, A = k ? near(candidates[0]!.distance) : 11;
    const closed = o.context(C.CLOSED + 4 * A + edge).context(C.CLOSED_PAST + 16 * edge + this.past).bit(sets.CLOSED + edge);
    this.past = ((this.past << 1) & 15) | closed;
    if (closed) {
      neighbours[face] = BORDER;
      return;
    }
    const B = k > 1 ? near(candidates[1]!.distance) : 11;
    if (k && o.context(C.KNOWN + 4 * A + Math.floor(B / 3)).context(C.KNOWN_COUNT + 4 * A + k - 1).bit(sets.KNOWN)) {
      let which = 0;
      for (; which < k - 1; which++) {
        const f = candidates[which]!.distance, g = candidates[which + 1]!.distance;
        const far = g > f ? Math.min(Math.floor((4 * g) / (f + 1)) - 4, 3) : 0;
        if (o.context(C.WHICH + 4 * (12 * which + near(f)) + far).bit(sets.KNOWN + 1 + which)) break;
      }
      cell[0] = candidates[which]!.v;
    } else cell[0] = this.told(from);
    let at = 1;
    for (let j = 0; j <= n; j++) if (j !== i) cell[at++] = cells[from + j]!;
    this.take(cell);
  }

  /** The expected positions (10.10.3(1)). */
  private expect(from: number, o: number): void {
    const { n, d, extent, miss } = this, reflection: number[] = [], even: number[] = [];
    for (let k = 0; k < d; k++) {
      let S = 0;
      for (let i = 0; i <= n; i++) if (i !== o) S += this.x(from + i, k);
      reflection.push(clip(Math.floor((2 * S) / n) - this.x(from + o, k), 0, extent[k]! - 1));
    }
    if (n === 2) {
      const a = from + ((o + 1) % 3), b = from + ((o + 2) % 3), l = from + o, shift = this.shift(from);
      const u: number[] = [], w: number[] = [];
      let uu = 0, uw = 0;
      for (let k = 0; k < d; k++) {
        u.push(this.x(b, k) - this.x(a, k));
        w.push(this.x(l, k) - this.x(a, k));
        const by = shr(u[k]!, shift);
        uu += by * by;
        uw += by * shr(w[k]!, shift);
      }
      const h = u.map((x, k) => mulDiv(uw, x, Math.max(uu, 1)) - w[k]!);
      const U = rootOfSquares(u[0]!, u[1]!, u[2] ?? 0), H = Math.max(rootOfSquares(h[0]!, h[1]!, h[2] ?? 0), 1);
      const otherA = this.other(a, from + o), otherB = this.other(b, from + o);
      for (let k = 0; k < d; k++) {
        const p = this.x(a, k), q = this.x(b, k), ends = this.positions[d * otherA + k]! - p + this.positions[d * otherB + k]! - q;
        even.push(clip(shr(128 * (p + q) + 128 * h[k]! + 80 * mulDiv(h[k]!, U, H) + 32 * ends, 8), 0, extent[k]! - 1));
      }
    }
    this.expected[0] = n === 2 && miss[1]! < miss[0]! ? even : reflection;
    this.expected[1] = reflection;
    this.expected[2] = even;
  }

  /** The least shift that leaves differences of any two vertices of a cell below `2**13`. */
  private shift(from: number): number {
    let far = 0, shift = 0;
    for (let k = 0; k < this.d; k++) for (let i = 1; i <= this.n; i++)
      for (let j = 0; j < i; j++) far = Math.max(far, Math.abs(this.x(from + i, k) - this.x(from + j, k)));
    while (shr(far, shift) >= 8192) shift++;
    return shift;
  }

  /** The other end of the open face that has the vertex at `at` and is not `face`; the vertex itself without one (n = 2). */
  private other(at: number, face: number): number {
    const { cells, neighbours, latest, next, coder } = this, v = cells[at]!;
    for (let corner = latest[v]!; corner >= 0; corner = next[corner]!) {
      const from = corner - (corner % 3);
      coder.meter.step(1);
      for (let i = 0; i < 3; i++) {
        const f = from + i;
        if (f !== face && f !== corner && neighbours[f] === OPEN) return cells[from + (3 - i - (corner - from))]!;
      }
    }
    return v;
  }

  /** The candidates (10.10.3(2)). */
  private offer(from: number, o: number): void {
    const { n, d, cells, neighbours, latest, next, candidates, coder } = this, m = n + 1, face: number[] = [];
    for (let i = 0; i <= n; i++) if (i !== o) face.push(cells[from + i]!);
    const l = cells[from + o]!;
    let size = 0;
    for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) size += this.square(face[i]!, (k) => this.positions[d * face[j]! + k]!);
    size = (n === 3 ? Math.floor(size / 3) : size) + 1;
    candidates.length = 0;
    for (const v of face) {
      for (let corner = latest[v]!; corner >= 0; corner = next[corner]!) {
        const start = corner - (corner % m);
        coder.meter.step(1);
        for (let j = 0; j <= n; j++) {
          if (neighbours[start + j] !== OPEN) continue;
          let other = -1, apart = 0;
          for (let a = 0; a <= n; a++) {
            if (a === j || face.includes(cells[start + a]!)) continue;
            other = cells[start + a]!;
            apart++;
          }
          if (apart !== 1 || other === l || candidates.some((c) => c.v === other)) continue;
          const distance = Math.floor((8 * this.square(other, (k) => this.expected[0]![k]!)) / size);
          let at = candidates.length;
          while (at > 0 && candidates[at - 1]!.distance > distance) at--;
          candidates.splice(at, 0, { v: other, distance });
          if (candidates.length > 4) candidates.pop();
        }
      }
    }
  }

  private square(v: number, of: (k: number) => number): number {
    let sum = 0;
    for (let k = 0; k < this.d; k++) sum += (this.positions[this.d * v + k]! - of(k)) ** 2;
    return sum;
  }

  /** A vertex that is no candidate (10.10.4), behind a face of the cell at `from`, if there is one. */
  private told(from: number | undefined): number {
    const { o, d, extent, spread, miss } = this, v = this.vertices, behind = from !== undefined;
    if (v && o.coder.bit(behind ? C.FAR : C.AGAIN)) return o.plain(0, v);
    if (v >= this.V) throw this.error("10.10.1", "a mesh has more vertices than it states");
    if (v === this.latest.length) this.latest = longer(this.latest, this.V, -1, this.coder.meter);
    if (d * v === this.positions.length) this.positions = longer(this.positions, d * this.V, 0, this.coder.meter);
    const { positions } = this;
    for (let k = 0; k < d; k++) {
      const kase = behind ? 3 + k : k, size = extent[k]!;
      const guess = behind ? this.expected[0]![k]! : v ? positions[d * (v - 1) + k]! : size >> 1;
      spread[kase] ??= Math.max(Math.floor((256 * size) / (behind ? 32 : 8)), 64);
      const x = o.near(size, 256 * guess + 128, spread[kase]!, sets.PLACE + 8 * kase, C.PLACE + 32 * kase);
      positions[d * v + k] = x;
      spread[kase] = Math.max(spread[kase]! + Math.floor((256 * Math.abs(x - guess) - spread[kase]!) / 32), 64);
      for (let i = 0; behind && this.n === 2 && i < 2; i++)
        miss[i]! += Math.floor((256 * Math.abs(x - this.expected[1 + i]![k]!) - miss[i]!) / 32);
    }
    return this.vertices++;
  }
}
