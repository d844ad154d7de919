/** Integer arithmetic on numbers, exact where products go beyond those that a number holds (1.2(4), annex A). */

const SAFE = 2 ** 53;

/** `a * b // c`, for a `c` other than 0. */
export function mulDiv(a: number, b: number, c: number): number {
  const product = a * b;
  if (Math.abs(product) < SAFE) return Math.floor(product / c);
  const x = BigInt(a) * BigInt(b), y = BigInt(c), q = x / y;
  return Number(x % y !== 0n && x < 0n !== y < 0n ? q - 1n : q);
}

/** `(a_0*x_0 + a_1*x_1 + ..) // c`. */
export function sumDiv(a: readonly number[], x: readonly number[], c: number): number {
  let sum = 0, size = 0;
  for (let i = 0; i < a.length; i++) {
    const product = a[i]! * x[i]!;
    sum += product;
    size += Math.abs(product);
  }
  if (size < SAFE) return Math.floor(sum / c);
  const y = BigInt(c), all = a.reduce((s, by, i) => s + BigInt(by) * BigInt(x[i]!), 0n), q = all / y;
  return Number(all % y !== 0n && all < 0n !== y < 0n ? q - 1n : q);
}

/** The whole part of the square root of a sum of squares. */
export function rootOfSquares(x: number, y: number, z: number): number {
  const sum = x * x + y * y + z * z;
  // below 2**52 the root of one less than a square is not rounded up to a whole number
  if (sum < SAFE / 2) return Math.floor(Math.sqrt(sum));
  const [a, b, c] = [BigInt(x), BigInt(y), BigInt(z)], all = a * a + b * b + c * c;
  let r = BigInt(Math.floor(Math.sqrt(sum))) + 2n;
  while (r * r > all) r--;
  return Number(r);
}

/** `x >> k`, of numbers beyond 32 bits, too. */
export const shr = (x: number, k: number): number => Math.floor(x / 2 ** k);

export const clip = (x: number, low: number, high: number): number => (x < low ? low : x > high ? high : x);

/** The sign of `u_0*v_1 - u_1*v_0`, of differences below `2**53`. */
export function turn(u0: number, u1: number, v0: number, v1: number): number {
  const a = u0 * v1, b = u1 * v0, d = a - b;
  if (Math.abs(a) + Math.abs(b) < SAFE || Math.abs(d) > (Math.abs(a) + Math.abs(b)) * 2 ** -50) return d;
  const exact = BigInt(u0) * BigInt(v1) - BigInt(u1) * BigInt(v0);
  return exact > 0n ? 1 : exact < 0n ? -1 : 0;
}
