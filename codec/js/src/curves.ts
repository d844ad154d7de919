/** The curves of files cut into the tiles of maps: of whole files, and of files in tiles, which are read by ranges. */
import GeoJSONVT from "geojson-vt";
import type { Decoder } from "./decoder.js";
import { draw, type Drawing } from "./draw.js";
import type { Limits } from "./errors.js";
import { decodeStream } from "./stream.js";
import { coordinatesOf, placement, toGeoJSON, type Where } from "./world.js";

export interface CurveOptions {
  /** The frame of a series; by default the last one. */
  frame?: number;
  /** Longitude and latitude of a point in the coordinates of the file; needed where these are neither nor Web Mercator. */
  toLonLat?: (x: number, y: number) => [number, number];
  /** Properties of an isovalue's feature beside `isovalue`, `index` and `frame`. */
  properties?: (isovalue: number, index: number) => Record<string, unknown>;
  limits?: Partial<Limits>;
  loadTables?: () => Promise<Uint8Array>;
}

/** A tile of lines, of points in 4096 parts of its side; null where there are none. */
export type Tile = ReturnType<GeoJSONVT["getTile"]>;
/** Gives the tile of a zoom, column and row. */
export type Tiles = (z: number, x: number, y: number, signal?: AbortSignal) => Promise<Tile>;

const RADIUS = 6378137, DEGREES = 180 / Math.PI;
/** Pixels along a side of a tile; parts of the side that are read around it. */
const PIXELS = 512, MARGIN = 1 / 32;

/** How the coordinates of a file become longitude and latitude. */
function projection(crs: string | undefined, options: CurveOptions): (x: number, y: number) => [number, number] {
  if (options.toLonLat) return options.toLonLat;
  if (crs === undefined || /^(EPSG:4326|OGC:CRS84)$/i.test(crs)) return (x, y) => [x, y];
  if (/^EPSG:(3857|900913)$/i.test(crs))
    return (x, y) => [(x / RADIUS) * DEGREES, (2 * Math.atan(Math.exp(y / RADIUS)) - Math.PI / 2) * DEGREES];
  throw new TypeError(`the file is in ${crs}: the option toLonLat has to say what longitude and latitude its points have`);
}

function checked<W extends Where>(n: number | undefined, where: W | undefined): W {
  if (n !== 2) throw new TypeError("tiles have curves only: the file has surfaces");
  if (!where) throw new TypeError("the file does not say where its samples lie");
  return where;
}

/** Cut the drawings of all isovalues, a feature each. */
function cut(drawings: Drawing[], isovalues: readonly number[], frame: number, where: Where, crs: string | undefined, options: CurveOptions): GeoJSONVT {
  const toLonLat = projection(crs, options);
  const features = drawings.map((drawing, index) => {
    const isovalue = isovalues[index]!, properties = { isovalue, index, frame, ...options.properties?.(isovalue, index) };
    const feature = toGeoJSON(drawing, where, properties), { geometry } = feature;
    geometry.coordinates = geometry.coordinates.map((line) => line.map(([x, y]) => toLonLat(x!, y!)));
    return feature;
  });
  return new GeoJSONVT({ type: "FeatureCollection", features }, { maxZoom: 24, indexMaxZoom: 4 });
}

function whole(decoder: Decoder, options: CurveOptions): Tiles {
  const { header, metadata, frames } = decoder, frame = options.frame ?? frames.length - 1, isovalues = (frames[frame] ?? []).map(({ isovalue }) => isovalue);
  const where = checked(header?.n, header?.explicit ? [[1, 0, 0], [0, 1, 0]] : (header && coordinatesOf(decoder)) ?? placement(metadata, 2));
  const index = cut(isovalues.map((_, i) => draw(decoder, i, frame)), isovalues, frame, where, metadata["crs"], options);
  return (z, x, y) => Promise.resolve(index.getTile(z, x, y));
}

/** The point that a function takes to a place, by Newton's method from `start`; undefined if it is not found. */
function inverse(at: (i: number, j: number) => [number, number], [lon, lat]: [number, number], [i, j]: [number, number]): [number, number] | undefined {
  for (let k = 0; k < 20; k++) {
    const [x, y] = at(i, j), [a, c] = at(i + 1, j), [b, d] = at(i, j + 1), turn = (a - x) * (d - y) - (b - x) * (c - y);
    const di = ((d - y) * (lon - x) - (b - x) * (lat - y)) / turn, dj = ((a - x) * (lat - y) - (c - y) * (lon - x)) / turn;
    i += di;
    j += dj;
    if (Math.abs(di) + Math.abs(dj) < 0.01) return [i, j];
  }
  return undefined;
}

/** Of a file in tiles, what a tile of the map shows is read, as fine as its pixels: one after another, as they share much. */
async function windows(url: string, options: CurveOptions): Promise<Tiles> {
  const { openTiles } = await import("./tiles/file.js"), { limits = {}, loadTables } = options;
  const file = await openTiles(url, { limits, ...(loadTables ? { loadTables } : {}) }), { n, shape, isovalues, metadata } = file.head;
  const rows = checked(n, placement(metadata, 2)), toLonLat = projection(metadata["crs"], options), all = isovalues.map((_, i) => i);
  const at = (i: number, j: number): [number, number] => {
    const [x, y] = rows.map(([a, b, c]) => a! * i + b! * j + c!);
    return toLonLat(x!, y!);
  };
  let turn: Promise<unknown> = Promise.resolve();
  const read = async (z: number, x: number, y: number, signal: AbortSignal | undefined): Promise<Tile> => {
    const points = [-MARGIN, 0.5, 1 + MARGIN].flatMap((u) => [-MARGIN, 0.5, 1 + MARGIN].map((v) => {
      const lat = Math.atan(Math.sinh(Math.PI * (1 - (2 * (y + v)) / 2 ** z))) * DEGREES;
      return inverse(at, [((x + u) / 2 ** z - 0.5) * 360, lat], [shape[0]! / 2, shape[1]! / 2]);
    }));
    const box = shape.map((s, axis): [number, number] => {
      // where a projection does not reach, all is read
      const known = points.map((point) => point?.[axis] ?? NaN), ends: [number, number] = [Math.min(...known), Math.max(...known)];
      return Number.isFinite(ends[0] + ends[1]) ? ends : [0, s - 1];
    });
    if (box.some(([from, to], axis) => to < 0 || from > shape[axis]! - 1)) return null;
    const within = (2 * Math.max(...box.map(([from, to]) => to - from))) / PIXELS;
    const drawings = await file.windows(box, all, { within, ...(signal ? { signal } : {}) });
    return cut(drawings, isovalues, 0, rows, metadata["crs"], options).getTile(z, x, y);
  };
  return (z, x, y, signal) => {
    const tile = turn.then(() => read(z, x, y, signal));
    turn = tile.catch(() => undefined);
    return tile;
  };
}

/** Open a file: one in tiles, or else all of it is decoded. */
export async function open(url: string, options: CurveOptions): Promise<Tiles> {
  const answer = await fetch(url);
  if (!answer.ok || !answer.body) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
  const reader = answer.body.getReader(), first = await reader.read();
  if (first.value?.[3] === 0x54) {
    await reader.cancel();
    return windows(url, options);
  }
  let next: Promise<ReadableStreamReadResult<Uint8Array>> = Promise.resolve(first);
  const stream = new ReadableStream<Uint8Array>({
    async pull(controller) {
      const { done, value } = await next;
      if (done) return controller.close();
      controller.enqueue(value);
      next = reader.read();
    },
    cancel: () => reader.cancel(),
  });
  const { limits = {}, frame, loadTables } = options;
  const each = decodeStream(stream, { limits, keepFrames: frame !== undefined, ...(loadTables ? { loadTables } : {}) });
  for (;;) {
    const { done, value } = await each.next();
    if (!done) continue;
    // of a file that ends too early what was decoded is shown
    if (value.error && value.error.kind !== "truncated") throw value.error;
    return whole(value, options);
  }
}
