/** Coordinates of mapped grids: what a chunk says before its run (3.7.4(1), (2)). */

/** One coordinate of all nodes. */
export interface Coordinate {
  /** The axes that it varies along. */
  axes: number[];
  origin: number;
  unit: number;
  /** Its period in units, 0 of a coordinate that does not wrap. */
  period: number;
  /** Nodes along each axis, three numbers; 1 where it does not vary. */
  nodes: [number, number, number];
  /** The value at each node, in lexicographic order, in units from the origin (9.9(2)). */
  values: Float64Array;
}

/** Where the samples of a mapped grid lie. */
export interface Coordinates {
  /** The axes of which the first and the last samples are the same. */
  periodic: number[];
  /** x, y and, with three axes, z. */
  coordinates: Coordinate[];
}

/** A payload that follows 3.7.4(1) and (2); its run is decoded when it is asked for. */
export interface CoordinateChunk {
  periodic: number[];
  coordinates: Omit<Coordinate, "values">[];
  run: Uint8Array;
}

/** Read a payload up to its run; undefined if it does not follow 3.7.4(1) and (2). */
export function readCoordinates(payload: Uint8Array, shape: readonly number[]): CoordinateChunk | undefined {
  const n = shape.length, view = new DataView(payload.buffer, payload.byteOffset, payload.length);
  const axesOf = (bits: number): number[] => shape.map((_, a) => a).filter((a) => (bits >> a) & 1);
  const coordinates: CoordinateChunk["coordinates"] = [];
  let at = 1, count = 0;
  if (payload[0] === undefined || payload[0] >= 1 << n) return undefined;
  for (let r = 0; r < n; r++) {
    if (at + 17 > payload.length) return undefined;
    const bits = payload[at]!, axes = axesOf(bits & 7), origin = view.getFloat64(at + 1), unit = view.getFloat64(at + 9);
    if (bits > 15 || (bits & 7) >= 1 << n || !axes.length) return undefined;
    if (!Number.isFinite(origin) || !(unit > 0 && unit < Infinity)) return undefined;
    at += 17;
    let period = 0;
    if (bits & 8) {
      for (let i = 0; ; i++) {
        const byte = payload[at++];
        if (byte === undefined || (i === 0 && byte === 128)) return undefined;
        period = period * 128 + (byte & 127);
        if (period >= 2 ** 32) return undefined;
        if (byte < 128) break;
      }
      if (period === 0) return undefined;
    }
    const nodes = [0, 1, 2].map((a) => (axes.includes(a) ? shape[a]! : 1)) as [number, number, number];
    count += nodes[0] * nodes[1] * nodes[2];
    coordinates.push({ axes, origin, unit, period, nodes });
  }
  const run = payload.slice(at);
  return count > 2 ** 14 * (run.length + 1) ? undefined : { periodic: axesOf(payload[0]), coordinates, run };
}
