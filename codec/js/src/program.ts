/** Layer programs: operations, their arguments, what they build on (3.6). */
import type { IsoError } from "./errors.js";
import type { Bytes, Steps } from "./reader.js";

/** One layer of a program. */
export type Layer =
  | { kind: "base" | "adaptive_base"; level: number }
  | { kind: "leaf_base" | "refine" }
  | { kind: "values"; plane: number }
  | { kind: "offsets"; Q: number; q: number }
  | { kind: "adapt"; births: boolean };

/** What a reader keeps over all programs of an isovalue (3.6.3). */
export class Progress {
  uniform = -1;
  bits: [number, number] | undefined;
  plane = 0;
  parts = 1;
  constructor(readonly full: number, public lean: Progress | undefined) {}
}

/** Read a program. `before` layers came before it in the file. */
export function* readProgram(bytes: Bytes, p: Progress, before: number): Steps<Layer[]> {
  const layers: Layer[] = [];
  const wrong = (what: string): IsoError => bytes.error("3.6", what);
  const add = (layer: Layer): void => {
    if (before + layers.length >= 2 ** 17) throw bytes.error("11.1", "a file has at most 131072 layers");
    layers.push(layer);
  };
  for (let more = true; more; ) {
    const head = yield* bytes.byte("3.6"), operation = (head >> 4) & 7;
    more = (head & 128) !== 0;
    let argument = head & 15;
    const far = argument === 15;
    if (far && (operation === 3 || operation > 5)) throw wrong("no operation goes so far");
    if (argument === 14) argument = yield* bytes.varint("3.6.2");
    const none = p.uniform < 0;
    switch (operation) {
      case 0:
      case 4:
      case 5: {
        if (!none) throw wrong("there has been a base");
        const level = far ? p.full : argument;
        if (level > p.full) throw wrong("a base beyond the full grid");
        p.uniform = level;
        add({ kind: operation === 5 ? "adaptive_base" : "base", level });
        if (operation !== 4) break;
        for (; p.uniform < p.full; p.uniform++) add({ kind: "refine" });
        break;
      }
      case 1: {
        const rounds = far ? p.full - p.uniform : argument;
        if (none || rounds < 1 || p.uniform + rounds > p.full) throw wrong("rounds that cannot be");
        for (let i = 0; i < rounds; i++) add({ kind: "refine" });
        p.uniform += rounds;
        break;
      }
      case 2: {
        if (!p.bits) {
          const byte = yield* bytes.byte("3.6.4"), bits: [number, number] = [byte >> 4, byte & 15];
          for (const i of [0, 1] as const) {
            if (bits[i] !== 15) continue;
            bits[i] = yield* bytes.varint("3.6.4");
            if (bits[i] < 15 || bits[i] > 52) throw bytes.error("3.6.4", "numbers of bits are 52 at most");
          }
          if (none) throw wrong("values before a base");
          p.bits = bits;
          p.plane = Math.max(...bits);
        }
        if (!far && argument > p.plane) throw wrong("more bits than are left");
        const count = far ? p.plane : argument;
        if (count === 0) add({ kind: "values", plane: p.plane });
        for (let i = 0; i < count; i++) add({ kind: "values", plane: --p.plane });
        break;
      }
      case 3: {
        let q = 0;
        const radix = argument + 1;
        if (!none && p.uniform < p.full) {
          q = yield* bytes.byte("3.6.5");
          if (q > 24) throw wrong("a unit beyond 24");
        }
        if (none || p.bits || radix < 2 || radix > 63) throw wrong("offsets that cannot be");
        if (p.uniform === p.full) {
          p.parts *= radix;
          if (p.parts > 2 ** 24) throw wrong("too many parts");
        }
        add({ kind: "offsets", Q: p.uniform === p.full ? p.parts : radix, q });
        break;
      }
      case 6:
        if (none || argument > 1 || p.uniform === p.full) throw wrong("an adaptive layer that cannot be");
        add({ kind: "adapt", births: argument === 1 });
        break;
      default:
        if (argument !== 0 || !none || !p.lean || p.lean.uniform < 0) throw wrong("a leaf base that cannot be");
        p.uniform = p.lean.uniform;
        add({ kind: "leaf_base" });
    }
  }
  return layers;
}
