/** The tables of the main profile (7.10). */
import { AROUND, CLASS, type Contexts } from "../models.js";

/** Kinds of symbols that have a network; sets of weights of value bits, which follow on theirs, and opinions of these. */
export const KINDS = 46, VALUE_SETS = 4, VALUE_OPINIONS = 12;
/** Columns of a row of `weight`, networks. */
const WIDTH = 48, NETWORKS = 8;

/** The tables of the main profile for one number of axes. */
export interface Tables {
  /** Bytes of the file that were read. */
  size: number;
  squash: Uint16Array;
  stretch: Int16Array;
  /** Two columns in one number, the second `2**26` times its value: sums of rows add both at once. */
  weight: Float64Array;
  out: Float64Array;
  /** Weights of opinions: four for each kind, then those of value bits (7.15(3)). */
  mix: Float64Array;
  /** Context, probability, counter of each context that does not begin as 7.1 states. */
  begin: Uint16Array;
}

export const PAIR = 2 ** 26;

/** First rows of the networks of refinement signs, by axes and phase, and of that of new components. */
export const SIGN_ROW: Readonly<Record<number, readonly number[]>> = { 2: [0, 296], 3: [0, 362, 702] };
export const TREE_ROW: Readonly<Record<number, number>> = { 2: 592, 3: 1126 };

/** Begin contexts that do not begin as 7.1 states: those of classes of opinions (7.11(2)), and those that are trained. */
export function begin({ squash, begin: told }: Tables, { p, seen }: Contexts): void {
  for (let c = 0; c < 32 * KINDS; c++) {
    p[CLASS + c] = squash[128 * (c & 31) + 64]!;
    seen[CLASS + c] = 0;
  }
  for (let i = 0; i < told.length; i += 3) {
    p[told[i]!] = told[i + 1]!;
    seen[told[i]!] = told[i + 2]!;
  }
}

function stretches(squash: Uint16Array): Int16Array {
  const table = new Int16Array(4096).fill(2047);
  for (let p = 0, x = 0; p < 4096; p++) {
    while (x < 4095 && squash[x]! < 16 * p + 8) x++;
    table[p] = Math.min(x, 4094) - 2047;
  }
  return table;
}

/** Rows of each network, and columns of a row that the file has: in those behind, all weights are 0. */
const ROWS: Readonly<Record<number, readonly number[]>> = {
  2: [296, 296, 0, 310, 720, 514, 236, 594],
  3: [362, 340, 424, 328, 720, 775, 332, 1506],
};
const COLUMNS: readonly number[] = [48, 48, 48, 48, 32, 24, 16, 24];

/** Numbers of some bits each, the most significant bit first; every list of them begins with a byte. */
class Bits {
  at = 0;

  constructor(private readonly view: DataView) {}

  list(count: number, width: number): Int32Array {
    let held = 0, bits = 0;
    return Int32Array.from({ length: count }, () => {
      while (bits < width) {
        held = (held << 8) | this.view.getUint8(this.at++);
        bits += 8;
      }
      bits -= width;
      const found = held >> bits;
      held &= (1 << bits) - 1;
      return found;
    });
  }

  signed(count: number, bytes: 2 | 4): Float64Array {
    const { view } = this;
    return Float64Array.from({ length: count }, () => {
      this.at += bytes;
      return bytes === 2 ? view.getInt16(this.at - 2) : view.getInt32(this.at - 4);
    });
  }
}

/** Read `isospec/main.bin` (7.10(1)), of which files in the plane need the first `size` bytes only. */
export function readTables(bytes: Uint8Array, n: number): Tables {
  if (n !== 2 && n !== 3) throw new RangeError("two or three axes");
  const file = new Bits(new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength));
  const squash = new Uint16Array(4095).fill(32768);
  file.list(2047, 8).forEach((more, i) => {
    squash[2048 + i] = squash[2047 + i]! + more;
    squash[2046 - i] = 65536 - squash[2048 + i]!;
  });
  for (let m = 2; ; m++) {
    const rows = ROWS[m]!, weight = new Float64Array((rows.reduce((a, b) => a + b) * WIDTH) / 2);
    let first = 0;
    rows.forEach((count, k) => {
      const columns = COLUMNS[k]!, exponents = file.list(count, 2), told = file.list(count * columns, 4);
      for (let i = 0; i < told.length; i++) {
        const row = Math.floor(i / columns), column = i % columns;
        const value = ((told[i]! << 28) >> 28) * 2 ** exponents[row]!;
        weight[(WIDTH * (first + row) + column - (column & 1)) / 2]! += column & 1 ? PAIR * value : value;
      }
      first += count;
    });
    const out = new Float64Array(NETWORKS * (WIDTH + 1));
    COLUMNS.forEach((columns, k) => {
      out.set(file.signed(columns, 2), k * (WIDTH + 1));
      out.set(file.signed(1, 4), k * (WIDTH + 1) + WIDTH);
    });
    const mix = new Float64Array(4 * KINDS + VALUE_SETS * VALUE_OPINIONS).fill(16384);
    mix.set(file.signed(4 * KINDS, 4));
    const begin: number[] = [];
    file.list(AROUND, 1).forEach((trained, context) => {
      if (trained) begin.push(context, 0, 0);
    });
    for (let i = 0; i < begin.length; i += 3) {
      const [logit, seen] = file.list(2, 8);
      begin[i + 1] = squash[16 * logit! + 7]!;
      begin[i + 2] = seen!;
    }
    if (m === 3 && file.at !== bytes.length) throw new RangeError(`the tables of the main profile have ${file.at} bytes`);
    if (m === n) return { size: file.at, squash, stretch: stretches(squash), weight, out, mix, begin: Uint16Array.from(begin) };
  }
}
