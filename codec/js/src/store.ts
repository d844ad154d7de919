/** Positions and what is marked there: blocks of the lattice, found through a directory. */
import type { Meter } from "./errors.js";

/** Numbers cells of a lattice from 1 on, in the order in which they are added. */
export class Cells {
  count = 0;
  private dense: Int32Array | undefined;
  private keys = new Int32Array(0);
  private slots = 0;

  constructor(private readonly meter: Meter, private readonly nx: number, private readonly ny: number,
              private readonly nz: number, most = 1 << 18) {
    const size = nx * ny * nz;
    if (size <= most) {
      meter.take(4 * size);
      this.dense = new Int32Array(size);
    }
  }

  copy(): Cells {
    const copy: Cells = Object.assign(Object.create(Cells.prototype), this);
    copy.dense = this.dense?.slice();
    copy.keys = this.keys.slice();
    return copy;
  }

  private slot(x: number, y: number, z: number): number {
    let h = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca77) ^ Math.imul(z, 0xc2b2ae3d);
    h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
    h = Math.imul(h ^ (h >>> 12), 0x297a2d39);
    const keys = this.keys, mask = this.slots - 1;
    let i = (h ^ (h >>> 15)) & mask;
    for (;;) {
      const at = 4 * i;
      if (keys[at + 3] === 0 || (keys[at] === x && keys[at + 1] === y && keys[at + 2] === z)) return at;
      i = (i + 1) & mask;
    }
  }

  /** The number of a cell, 0 if it has none. */
  find(x: number, y: number, z: number): number {
    if (this.dense) {
      if (x >>> 0 >= this.nx || y >>> 0 >= this.ny || z >>> 0 >= this.nz) return 0;
      return this.dense[(x * this.ny + y) * this.nz + z]!;
    }
    return this.slots ? this.keys[this.slot(x, y, z) + 3]! : 0;
  }

  /** The number of a cell, a new one if it had none. */
  add(x: number, y: number, z: number): number {
    if (this.dense && x >>> 0 < this.nx && y >>> 0 < this.ny && z >>> 0 < this.nz)
      return (this.dense[(x * this.ny + y) * this.nz + z] ||= ++this.count);
    if (2 * this.count >= this.slots) this.grow();
    const keys = this.keys, at = this.slot(x, y, z);
    if (keys[at + 3] === 0) {
      keys[at] = x;
      keys[at + 1] = y;
      keys[at + 2] = z;
      keys[at + 3] = ++this.count;
    }
    return keys[at + 3]!;
  }

  private grow(): void {
    const old = this.keys, size = Math.max(16, 2 * this.slots);
    this.meter.take(16 * (size - this.slots));
    this.keys = new Int32Array(4 * size);
    this.slots = size;
    for (let i = 0; i < old.length; i += 4) {
      if (old[i + 3]) this.keys.set(old.subarray(i, i + 4), this.slot(old[i]!, old[i + 1]!, old[i + 2]!));
    }
  }
}

/** A list of integers that grows. */
export class Ints {
  data: Int32Array;
  length = 0;
  constructor(private readonly meter: Meter, start = 64) {
    this.data = new Int32Array(start);
  }

  /** Make room for `more` entries; `data` may be another array then. */
  room(more: number): void {
    const need = this.length + more;
    if (need <= this.data.length) return;
    const size = Math.max(need, 2 * this.data.length);
    this.meter.take(4 * (size - this.data.length));
    const old = this.data;
    this.data = new Int32Array(size);
    this.data.set(old);
  }

  push(x: number): void {
    if (this.length === this.data.length) this.room(1);
    this.data[this.length++] = x;
  }
}

export const KNOWN = 1, SIGN = 2, EXPLICIT = 4, OUT = 8;

/**
 * Marks of lattice points. `at` gives the place of a point in `flags` (some place that holds 0 if nothing is marked near
 * it), `make` one that can be written.
 */
export class Store {
  flags: Uint8Array;
  private cells: Cells;
  private readonly sx: number;
  private readonly sy: number;
  private readonly mz: number;
  private readonly s: number;
  private readonly m: number;
  private readonly bits: number;
  private lastX = -1;
  private lastY = -1;
  private lastZ = -1;
  private lastPage = 0;

  constructor(private readonly meter: Meter, readonly n: number, k: number) {
    this.s = n === 2 ? 5 : 3;
    this.m = (1 << this.s) - 1;
    this.bits = n === 2 ? 10 : 9;
    this.sx = n === 2 ? 5 : 6;
    this.sy = n === 2 ? 0 : 3;
    this.mz = n === 2 ? 0 : 7;
    const blocks = (2 ** k >> this.s) + 1;
    this.cells = new Cells(meter, blocks, blocks, n === 2 ? 1 : blocks);
    this.flags = new Uint8Array(4 << this.bits);
    meter.take(4 << this.bits);
  }

  copy(): Store {
    const copy: Store = Object.assign(Object.create(Store.prototype), this);
    copy.cells = this.cells.copy();
    copy.flags = this.flags.slice();
    return copy;
  }

  private inside(x: number, y: number, z: number, page: number): number {
    const m = this.m;
    return (page << this.bits) | ((x & m) << this.sx) | ((y & m) << this.sy) | (z & this.mz);
  }

  at(x: number, y: number, z: number): number {
    const s = this.s, px = x >> s, py = y >> s, pz = z >> s;
    if (px !== this.lastX || py !== this.lastY || pz !== this.lastZ) {
      this.lastPage = this.cells.find(px, py, pz);
      this.lastX = px;
      this.lastY = py;
      this.lastZ = pz;
    }
    return this.inside(x, y, z, this.lastPage);
  }

  /** The number of the block of a position, 0 if nothing is marked in it. */
  page(x: number, y: number, z: number): number {
    return this.cells.find(x >> this.s, y >> this.s, z >> this.s);
  }

  get(x: number, y: number, z: number): number {
    return this.flags[this.at(x, y, z)]!;
  }

  make(x: number, y: number, z: number): number {
    const s = this.s, before = this.cells.count;
    const page = this.cells.add(x >> s, y >> s, z >> s);
    if (this.cells.count !== before) {
      this.lastX = -1;
      this.meter.block();
      const need = (page + 1) << this.bits;
      if (need > this.flags.length) {
        const size = Math.max(need, Math.min(2 * this.flags.length, 2 ** 30));
        this.meter.take(size - this.flags.length);
        const old = this.flags;
        this.flags = new Uint8Array(size);
        this.flags.set(old);
      }
    }
    return this.inside(x, y, z, page);
  }
}
