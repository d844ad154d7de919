/** Coordinates of the nodes of mapped grids (3.7.4(3) to (6), 9.9(2)). */
import { Coder, Input } from "./coder.js";
import type { Coordinate, CoordinateChunk, Coordinates } from "./coordinates.js";
import type { Decoder } from "./decoder.js";
import { IsoError, type Limits, Meter } from "./errors.js";

const decoded = new WeakMap<CoordinateChunk, Coordinates | false>();

/** Where the samples of a mapped grid lie, if a chunk of coordinates has come that is not malformed. */
export function coordinatesOf(decoder: Decoder): Coordinates | undefined {
  const chunk = decoder.grid?.place;
  if (!chunk) return undefined;
  if (!decoded.has(chunk)) decoded.set(chunk, decodeCoordinates(chunk, decoder.meter.limits) ?? false);
  return decoded.get(chunk) || undefined;
}

/** Contexts of a coordinate (3.7.4(5)): zeros, signs, exponents. */
const NEGATIVE = 27, EXPONENT = 30, CONTEXTS = 81;
/** Differences of more than this take predictions beyond the integers of a double. */
const WIDE = 2 ** 49;

/** Decode the run; undefined if it is malformed. An error of the kind "limit" if the nodes take more memory than that. */
function decodeCoordinates(chunk: CoordinateChunk, limits: Limits): Coordinates | undefined {
  // what the run may ask for is bounded by its bytes and, for the nodes, by memory
  const meter = new Meter({ ...limits, work: Infinity }), input = new Input(), coder = new Coder(input, meter);
  input.push(chunk.run);
  input.ended = true;
  coder.begin(0, chunk.run.length);
  try {
    const coordinates = chunk.coordinates.map((c): Coordinate => {
      coder.models = { p: new Uint16Array(CONTEXTS).fill(32768), seen: new Uint8Array(CONTEXTS).fill(1) };
      meter.take(8 * c.nodes[0] * c.nodes[1] * c.nodes[2]);
      const values = residuals(coder, c.nodes, c.period);
      return { ...c, values };
    });
    if (coder.shifts + 4 < chunk.run.length) return undefined;
    for (const c of coordinates) close(c, chunk.periodic);
    return { periodic: chunk.periodic, coordinates };
  } catch (error) {
    if (error instanceof IsoError && error.kind === "malformed") return undefined;
    throw error;
  }
}

function malformed(what: string): IsoError {
  return new IsoError("malformed", "3.7.4", 0, what);
}

/** The values of one coordinate (3.7.4(3) to (5)). */
function residuals(coder: Coder, nodes: readonly number[], W: number): Float64Array {
  const strides = [nodes[1]! * nodes[2]!, nodes[2]!, 1], values = new Float64Array(nodes[0]! * strides[0]!);
  let h = 1;
  while (2 * h < Math.max(...nodes)) h *= 2;
  for (; h >= 1; h /= 2) {
    const g = h === 1 ? 0 : h === 2 ? 1 : 2;
    for (let a = 0; a < 3; a++) {
      if (nodes[a]! <= h) continue;
      const step = [0, 1, 2].map((b) => (b < a ? h : 2 * h)) as [number, number, number];
      const by = h * strides[a]!;
      let c = 0;
      for (let x = a === 0 ? h : 0; x < nodes[0]!; x += step[0])
        for (let y = a === 1 ? h : 0; y < nodes[1]!; y += step[1])
          for (let z = a === 2 ? h : 0; z < nodes[2]!; z += step[2]) {
            const at = x * strides[0]! + y * strides[1]! + z, i = (a === 0 ? x : a === 1 ? y : z) / h;
            const r = residual(coder, g, c);
            c = 3 * (c % 3) + Math.min(Math.abs(r), 2);
            values[at] = predicted(values, at, by, i, Math.floor((nodes[a]! - 1) / h), W, r);
          }
    }
  }
  return values;
}

function residual(coder: Coder, g: number, c: number): number {
  if (coder.bit(9 * g + c)) return 0;
  const negative = coder.bit(NEGATIVE + g);
  let e = 0;
  while (coder.bit(EXPONENT + e)) if (++e > 50) throw malformed("a residual is too large");
  let r = 1;
  for (; e; e--) r = 2 * r + coder.raw(32768);
  return negative ? -r : r;
}

/** The value of the node `i * h` along an axis, `last * h` the last one (3.7.4(4)); nodes `h` further lie `by` apart. */
function predicted(values: Float64Array, at: number, by: number, i: number, last: number, W: number, r: number): number {
  const b = values[at - by]!, half = Math.floor(W / 2);
  const d = (m: number): number => {
    const far = values[at + m * by]! - b;
    return W ? mod(mod(far, W) + half, W) - half : far;
  };
  // what is needed of d(-3), d(1), d(3), d(-5), their weights, what is added, and the shift
  const terms: [number, number][] = [];
  let more = 0, shift = 0;
  if (i >= 3 && i + 3 <= last) terms.push([9, d(1)], [-1, d(-3)], [-1, d(3)]), (more = 8), (shift = 4);
  else if (i + 3 <= last) terms.push([6, d(1)], [-1, d(3)]), (more = 4), (shift = 3);
  else if (i >= 3 && i + 1 <= last) terms.push([3, d(1)], [-1, d(-3)]), (more = 4), (shift = 3);
  else if (i + 1 <= last) terms.push([1, d(1)]), (more = 1), (shift = 1);
  else if (i >= 5) terms.push([3, d(-5)], [-10, d(-3)]), (more = 4), (shift = 3);
  else if (i >= 3) terms.push([-1, d(-3)]), (more = 1), (shift = 1);
  let value: number;
  if (terms.some(([, far]) => Math.abs(far) >= WIDE)) {
    let sum = BigInt(more);
    for (const [weight, far] of terms) sum += BigInt(weight) * BigInt(far);
    value = Number(BigInt(b) + (sum >> BigInt(shift)) + 16n * BigInt(r));
  } else {
    let sum = more;
    for (const [weight, far] of terms) sum += weight * far;
    value = b + Math.floor(sum / 2 ** shift) + 16 * r;
  }
  if (Math.abs(value) >= 2 ** 52) throw malformed("a value is too large");
  return value;
}

/** The remainder of a division rounded down. */
export function mod(x: number, W: number): number {
  const rest = x % W;
  return rest < 0 ? rest + W : rest;
}

/** Periodic axes, and continuity of a coordinate that wraps (9.9(2)). */
function close({ nodes, values, period }: Coordinate, periodic: readonly number[]): void {
  const strides = [nodes[1] * nodes[2], nodes[2], 1], half = Math.floor(period / 2);
  /** Goes along an axis: calls `line` with the place of each first node. */
  const lines = (a: number, line: (from: number, by: number, count: number) => void): void => {
    const by = strides[a]!, count = nodes[a]!;
    for (let at = 0; at < values.length; at += by * count) for (let i = 0; i < by; i++) line(at + i, by, count);
  };
  for (const a of periodic) lines(a, (from, by, count) => (values[from + by * (count - 1)] = values[from]!));
  if (!period) return;
  for (let a = 0; a < 3; a++) {
    lines(a, (from, by, count) => {
      let was = values[from]!;
      for (let i = 1; i < count; i++) {
        const at = from + by * i, value = values[at]!;
        values[at] = values[at - by]! + mod(mod(value - was, period) + half, period) - half;
        was = value;
      }
    });
  }
}
