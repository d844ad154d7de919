/** How many steps one isovalue lies above another (5.9.1). */

/** The exact number of steps, rounded down and up; and the part of a step beyond, in whole sixteenths. */
export interface Shift {
  readonly down: number;
  readonly up: number;
  readonly sixteenths: number;
}

const MOST = 2n ** 52n;

/** A number times `2**1074`: every finite double is a whole one then. */
function whole(x: number): bigint {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, x);
  const bits = view.getBigUint64(0), exponent = (bits >> 52n) & 2047n, fraction = bits & (2n ** 52n - 1n);
  const size = exponent === 0n ? fraction : (fraction + 2n ** 52n) << (exponent - 1n);
  return bits >> 63n ? -size : size;
}

/** Steps from one isovalue up to another, of a scale or of integers; none if they are `2**52` or more. */
export function shiftOf(isovalue: number, other: number, scale: number | undefined): Shift | undefined {
  const by = scale === undefined ? BigInt(Math.floor(isovalue)) - BigInt(Math.floor(other)) : whole(isovalue) - whole(other);
  const step = scale === undefined ? 1n : whole(scale), rest = by % step;
  const down = by / step - (rest < 0n ? 1n : 0n), up = by / step + (rest > 0n ? 1n : 0n);
  const sixteenths = Number((16n * (by - down * step)) / step);
  return down > -MOST && up < MOST ? { down: Number(down), up: Number(up), sixteenths } : undefined;
}
