/** The kernels as they run: a module, what it says its kernels take, and its memory. */
import type { Meter } from "../errors.js";

/** Bytes of an entry of an array, by its type. */
const BYTES = { bool: 1, int8: 1, uint8: 1, int16: 2, int32: 4, int64: 8 } as const;
export type Dtype = keyof typeof BYTES;

/** Bytes of an argument's slot, and of what lies below the arguments: results and a fault. */
const SLOT = 8, RESULTS = 64, FAULT = 64, SLOTS = 8192;
/** Statuses of a kernel that came back: with a number, without. */
const FINE = [0, -2];

/** An array in the memory of a machine, its last axis the fastest. */
export class Arr {
  readonly size: number;
  constructor(readonly dtype: Dtype, readonly at: number, readonly shape: readonly number[]) {
    this.size = shape.reduce((product, length) => product * length, 1);
  }

  /** Bytes of an entry, and of all. */
  get unit(): number {
    return BYTES[this.dtype];
  }

  get bytes(): number {
    return this.size * this.unit;
  }

  /** Rows from `first` on. */
  rows(first: number, count = this.shape[0]! - first): Arr {
    const [, ...rest] = this.shape, row = rest.reduce((product, length) => product * length, this.unit);
    return new Arr(this.dtype, this.at + first * row, [count, ...rest]);
  }
}

/** Integers that kernels read and change by name. All begin with 0. */
export class Registers<Name extends string> {
  constructor(private readonly machine: Machine, private readonly names: readonly string[], readonly array: Arr) {}

  get size(): number {
    return this.array.size;
  }

  private place(name: Name): number {
    const place = this.names.indexOf(name);
    if (place < 0) throw new Error(`no register ${name}`);
    return place;
  }

  get(name: Name): number {
    return this.machine.number(this.array, this.place(name));
  }

  set(name: Name, value: number): void {
    this.machine.enter(this.array, this.place(name), value);
  }

  clear(): void {
    this.machine.words(this.array).fill(0);
  }
}

/** What a kernel takes. Members of a record are in the order in which it declares them. */
export type Value = number | Arr | Registers<string> | RecordOf;
// eslint-disable-next-line @typescript-eslint/no-explicit-any
type RecordOf = object & { readonly [member: string]: any };

type Kinds = readonly string[];
/** By entry what it takes and whether it returns a number; by record the types of its members; by sort of registers their names. */
type Layouts = readonly [Record<string, readonly [Kinds, boolean]>, Record<string, Kinds>, Record<string, readonly string[]>];

/** A module of kernels and what it says of itself. */
export class Kernels {
  readonly layouts: Layouts;
  /** Tables of the mesh of two and of three axes. */
  readonly mesh: Int16Array;

  constructor(readonly module: WebAssembly.Module) {
    const [layouts] = WebAssembly.Module.customSections(module, "isocodec");
    const [mesh] = WebAssembly.Module.customSections(module, "isocodec.mesh");
    if (!layouts || !mesh) throw new TypeError("not a module of isocodec's kernels");
    this.layouts = JSON.parse(new TextDecoder().decode(layouts));
    this.mesh = new Int16Array(mesh);
  }
}

type Entry = (results: number, fault: number, slots: number) => number;

/** A module with a memory of its own, which `meter` counts. */
export class Machine {
  readonly memory: WebAssembly.Memory;
  private readonly entries: Record<string, Entry>;
  private readonly scratch: number;
  /** Where memory has not been used yet; and what lies below and is free, by address. */
  private end: number;
  private readonly free: [at: number, size: number][] = [];
  private all!: Int32Array;

  constructor(readonly kernels: Kernels, private readonly meter: Meter) {
    const { exports } = new WebAssembly.Instance(kernels.module);
    this.entries = exports as Record<string, Entry>;
    this.memory = exports["memory"] as WebAssembly.Memory;
    this.scratch = Math.ceil((exports["__heap_base"] as WebAssembly.Global).value / 16) * 16;
    this.end = this.scratch + RESULTS + FAULT + SLOTS;
    this.reach(this.end);
  }

  private reach(end: number): void {
    const size = this.memory.buffer.byteLength;
    if (end > size) {
      const pages = Math.ceil((end - size) / 65536);
      // a RangeError if there is no more memory; by so much that what grows step by step does so seldom
      this.memory.grow(Math.max(pages, Math.min(size / 131072, 65536 - size / 65536)));
    }
    if (this.all?.buffer !== this.memory.buffer) this.all = new Int32Array(this.memory.buffer);
  }

  /** A new array, all 0; `counted` if it is part of what has been decoded. */
  array(dtype: Dtype, shape: readonly number[], counted = true): Arr {
    const found = new Arr(dtype, 0, shape), size = Math.ceil(found.bytes / 16) * 16;
    if (!size) return found;
    if (counted) this.meter.take(size);
    const place = this.free.findIndex(([, room]) => room >= size);
    let at = this.end;
    if (place < 0) {
      this.reach(at + size);
      this.end += size;
    } else {
      const [from, room] = this.free[place]!;
      at = from;
      if (room === size) this.free.splice(place, 1);
      else this.free[place] = [from + size, room - size];
      new Uint8Array(this.memory.buffer, at, size).fill(0);
    }
    return new Arr(dtype, at, shape);
  }

  /** Give back an array that `array` has made. */
  release(array: Arr, counted = true): void {
    const { free } = this;
    let { at } = array, size = Math.ceil(array.bytes / 16) * 16;
    if (!size) return;
    if (counted) this.meter.memory -= size;
    let place = free.findIndex(([from]) => from > at);
    if (place < 0) place = free.length;
    const before = free[place - 1], after = free[place];
    if (after && after[0] === at + size) {
      size += after[1];
      free.splice(place, 1);
    }
    if (before && before[0] + before[1] === at) {
      at = before[0];
      size += before[1];
      free.splice(--place, 1);
    }
    free.splice(place, 0, [at, size]);
  }

  registers<Name extends string>(kind: string, array = this.array("int64", [this.kernels.layouts[2][kind]!.length])): Registers<Name> {
    return new Registers(this, this.kernels.layouts[2][kind]!, array);
  }

  /** The memory of an array in words of four bytes, until more is used. */
  words(array: Arr): Int32Array {
    return this.all.subarray(array.at >> 2, (array.at + array.bytes) >> 2);
  }

  bytes(array: Arr): Uint8Array {
    return new Uint8Array(this.memory.buffer, array.at, array.bytes);
  }

  /** Entry `i` of an array of eight bytes each, exact below `2**53`. */
  number(array: Arr, i: number): number {
    const at = (array.at >> 2) + 2 * i;
    return this.all[at + 1]! * 4294967296 + (this.all[at]! >>> 0);
  }

  enter(array: Arr, i: number, value: number): void {
    const at = (array.at >> 2) + 2 * i;
    this.all[at] = value;
    this.all[at + 1] = Math.floor(value / 4294967296);
  }

  /** A new array of eight bytes each with these entries. */
  numbers(values: ArrayLike<number>, shape: readonly number[] = [values.length], counted = true): Arr {
    const found = this.array("int64", shape, counted);
    for (let i = 0; i < values.length; i++) this.enter(found, i, values[i]!);
    return found;
  }

  /** A new array of few bytes an entry. */
  small(dtype: "int16" | "int32", values: ArrayLike<number>, counted = true): Arr {
    const found = this.array(dtype, [values.length], counted), { buffer } = this.memory;
    new (dtype === "int16" ? Int16Array : Int32Array)(buffer, found.at, values.length).set(values);
    return found;
  }

  /** Another array, of `length` rows, that begins with those of `array`. */
  wider(array: Arr, length: number): Arr {
    const found = this.array(array.dtype, [length, ...array.shape.slice(1)]);
    this.bytes(found).set(this.bytes(array).subarray(0, found.bytes));
    return found;
  }

  /** A copy of an array. */
  copy(array: Arr): Arr {
    return this.wider(array, array.shape[0]!);
  }

  /** Run a kernel, named as in the library; what it returns. */
  call(name: string, ...values: readonly Value[]): number {
    const entry = this.entries[`iso_${name}`], layout = this.kernels.layouts[0][`iso_${name}`];
    if (!entry || !layout || layout[0].length !== values.length) throw new Error(`no kernel ${name} of ${values.length} arguments`);
    const { scratch } = this;
    let slot = scratch + RESULTS + FAULT;
    layout[0].forEach((kind, i) => (slot = this.put(slot, kind, values[i]!)));
    const status = entry(scratch, scratch + RESULTS, scratch + RESULTS + FAULT);
    if (!FINE.includes(status)) throw new Error(`kernel ${name}: status ${status}`);
    return layout[1] ? this.all[(scratch >> 2) + 1]! * 4294967296 + (this.all[scratch >> 2]! >>> 0) : 0;
  }

  /** Write a value into slots; where the next one begins. */
  private put(slot: number, kind: string, value: Value): number {
    const write = (x: number): void => {
      this.all[slot >> 2] = x;
      this.all[(slot >> 2) + 1] = Math.floor(x / 4294967296);
      slot += SLOT;
    };
    if (typeof value === "number") write(value);
    else if (value instanceof Registers) [value.array.at, value.array.size].forEach(write);
    else if (value instanceof Arr) {
      if (`${value.dtype}[${value.shape.length}d]` !== kind) throw new TypeError(`${value.dtype}[${value.shape.length}d] instead of ${kind}`);
      [value.at, value.size, ...value.shape].forEach(write);
      let stride: number = value.bytes;
      for (const length of value.shape) write((stride = length ? stride / length : 0));
    } else {
      const kinds = this.kernels.layouts[1][kind], members = Object.values(value) as Value[];
      if (kinds?.length !== members.length) throw new TypeError(`a record of ${members.length} members instead of ${kind}`);
      kinds.forEach((member, i) => (slot = this.put(slot, member, members[i]!)));
    }
    return slot;
  }
}
