/** Metadata and promises (3.7.2, 3.7.3). */

export type Metadata = Record<string, string>;

export interface Promises {
  topology: boolean;
  /** Layers, counted from 1 within the isovalue, and the distance in samples that each keeps. */
  distances: { layer: number; distance: number }[];
}

/** The members of a metadata chunk that are strings; none if it is malformed. */
export function readMetadata(payload: Uint8Array): Metadata {
  const found: Metadata = Object.create(null);
  try {
    const value: unknown = JSON.parse(new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(payload));
    if (value && typeof value === "object" && !Array.isArray(value)) {
      for (const [name, text] of Object.entries(value)) if (typeof text === "string") found[name] = text;
    }
  } catch {
    return Object.create(null);
  }
  return found;
}

/** A chunk of promises, undefined if it is malformed. */
export function readPromises(payload: Uint8Array): Promises | undefined {
  const numbers: number[] = [];
  for (let at = 0; at < payload.length; ) {
    let value = 0;
    for (let i = 0; ; i++) {
      const byte = payload[at++];
      if (byte === undefined || (i === 0 && byte === 128) || i === 9) return undefined;
      value = value * 128 + (byte & 127);
      if (byte < 128) break;
    }
    numbers.push(value);
  }
  if (numbers.length % 2 === 0 || numbers[0]! > 1 || numbers.slice(1).includes(0)) return undefined;
  const distances: Promises["distances"] = [];
  let layer = 0;
  for (let i = 1; i < numbers.length; i += 2)
    distances.push({ layer: (layer += numbers[i]!), distance: numbers[i + 1]! / 1000 });
  return { topology: numbers[0] === 1, distances };
}

/** The placement as rows of a matrix, undefined if there is none that can be used (3.7.2(2)). */
export function placement(metadata: Metadata, n: number): number[][] | undefined {
  const words = metadata["placement"]?.split(" ") ?? [];
  if (words.length !== n * (n + 1) || !words.every((w) => /^-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$/.test(w)))
    return undefined;
  const numbers = words.map(Number);
  if (!numbers.every((x) => x === 0 || (Math.abs(x) >= 1e-30 && Math.abs(x) <= 1e30))) return undefined;
  const rows = Array.from({ length: n }, (_, r) => numbers.slice(r * (n + 1), (r + 1) * (n + 1)));
  // numbers of at least 1e-30 are whole multiples of 2**-153: the determinant is exact
  const m = rows.map((row) => row.map((x) => BigInt(x * 2 ** 153)));
  const minor = (a: number, b: number): bigint => m[1]![a]! * (m[2]?.[b] ?? 1n) - m[1]![b]! * (m[2]?.[a] ?? 1n);
  const [a, b, c] = m[0]!;
  const determinant = n === 2 ? a! * m[1]![1]! - b! * m[1]![0]! : a! * minor(1, 2) - b! * minor(0, 2) + c! * minor(0, 1);
  return determinant === 0n ? undefined : rows;
}
