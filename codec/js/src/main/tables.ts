/** The tables of the main profile (7.10). */

/** Columns of a row of `weight`, kinds of symbols, networks. */
export const KINDS = 49;
const WIDTH = 48, NETWORKS = 9;

/** The tables of the main profile for one number of axes. */
export interface Tables {
  squash: Uint16Array;
  stretch: Int16Array;
  /** Two columns in one number, the second `2**26` times its value: sums of rows add both at once. */
  weight: Float64Array;
  out: Float64Array;
  mix: Float64Array;
  /** Context, probability, counter of each context that does not begin as 7.1 states. */
  begin: Uint16Array;
}

export const PAIR = 2 ** 26;

function stretches(squash: Uint16Array): Int16Array {
  const table = new Int16Array(4096).fill(2047);
  for (let p = 0, x = 0; p < 4096; p++) {
    while (x < 4095 && squash[x]! < 16 * p + 8) x++;
    table[p] = Math.min(x, 4094) - 2047;
  }
  return table;
}

/** Read `isospec/main.bin` (7.10(1)). */
export function readTables(bytes: Uint8Array, n: number): Tables {
  if (bytes.length !== 894696) throw new RangeError("the tables of the main profile have 894696 bytes");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 0;
  const u16 = (count: number): Uint16Array => Uint16Array.from({ length: count }, () => view.getUint16((at += 2) - 2));
  const i32 = (count: number): Float64Array => Float64Array.from({ length: count }, () => view.getInt32((at += 4) - 4));
  const squash = u16(4095);
  for (const m of [2, 3]) {
    const rows = m === 2 ? 3474 : 5417;
    if (m !== n) {
      at += 2 * WIDTH * rows + 4 * NETWORKS * (WIDTH + 1) + 16 * KINDS;
      at += 2 + 6 * view.getUint16(at);
      continue;
    }
    const weight = new Float64Array((rows * WIDTH) / 2);
    for (let i = 0; i < weight.length; i++, at += 4) weight[i] = view.getInt16(at) + PAIR * view.getInt16(at + 2);
    const out = i32(NETWORKS * (WIDTH + 1)), mix = i32(KINDS * 4);
    const begin = u16(3 * u16(1)[0]!);
    return { squash, stretch: stretches(squash), weight, out, mix, begin };
  }
  throw new RangeError("two or three axes");
}
