/** The logistic function of 7.10(1) and its inverse (7.11(1)), in integers: explicit domains need no table of a file. */

/** `squash(x)` is entry `x + 2047`. */
export const squash = new Uint16Array(4095);
/** `stretch(p)` is entry `p >> 4`. */
export const stretch = new Int16Array(4096).fill(2047);

/** `2**128 / exp(1/256)`, by its series. */
function fall(): bigint {
  let term = 1n << 128n, sum = term;
  for (let i = 1n; term; i++) {
    term /= -256n * i;
    sum += term;
  }
  return sum;
}

const by = fall();
for (let x = 0, power = 1n << 128n; x <= 2047; x++) {
  const one = 1n << 128n, whole = one + power;
  const p = Number(((one << 17n) + whole) / (2n * whole));
  squash[2047 + x] = Math.min(p, 65504);
  squash[2047 - x] = Math.max(65536 - p, 32);
  power = (power * by) >> 128n;
}
for (let p = 0, x = 0; p < 4096; p++) {
  while (x < 4095 && squash[x]! < 16 * p + 8) x++;
  stretch[p] = Math.min(x, 4094) - 2047;
}
