/** Number of binary digits, 0 of 0, of a number of any size. */
export function bits(x: number): number {
  return x < 2147483648 ? 32 - Math.clz32(x) : 32 + bits(Math.floor(x / 4294967296));
}
