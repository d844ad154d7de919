/** Metadata and promises (3.7.2, 3.7.3). */

export type Metadata = Record<string, string>;

export interface Promises {
  topology: boolean;
  /** Layers, counted from 1 within the isovalue, and the distance that each keeps: in samples, on a mesh in units of
   * positions. */
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
