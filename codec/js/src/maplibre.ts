/** Vector tiles of the curves of files, for maps of MapLibre. */
import GeoJSONVT from "geojson-vt";
import { fromGeojsonVt } from "vt-pbf";
import type { Decoder } from "./decoder.js";
import { draw } from "./draw.js";
import type { Limits } from "./errors.js";
import { decodeStream } from "./stream.js";
import { coordinatesOf, type LineFeature, placement, toGeoJSON } from "./world.js";

export interface TileOptions {
  /** Name of the layer of the tiles; "contours" unless it is told. */
  layer?: string;
  /** The frame of a series; the last one unless it is told. */
  frame?: number;
  /** Longitude and latitude of a point in the coordinates of the file; needed where these are neither nor Web Mercator. */
  toLonLat?: (x: number, y: number) => [number, number];
  /** Properties of an isovalue's feature beside `isovalue`, `index` and `frame`. */
  properties?: (isovalue: number, index: number) => Record<string, unknown>;
  limits?: Partial<Limits>;
  loadTables?: () => Promise<Uint8Array>;
}

/** What `maplibregl.addProtocol` takes. */
export type Protocol = (request: { url: string }, abort?: AbortController) => Promise<{ data: ArrayBuffer }>;

const RADIUS = 6378137, DEGREES = 180 / Math.PI;

/** How the coordinates of a file become longitude and latitude. */
function projection(crs: string | undefined, options: TileOptions): (x: number, y: number) => [number, number] {
  if (options.toLonLat) return options.toLonLat;
  if (crs === undefined || /^(EPSG:4326|OGC:CRS84)$/i.test(crs)) return (x, y) => [x, y];
  if (/^EPSG:(3857|900913)$/i.test(crs))
    return (x, y) => [(x / RADIUS) * DEGREES, (2 * Math.atan(Math.exp(y / RADIUS)) - Math.PI / 2) * DEGREES];
  throw new TypeError(`the file is in ${crs}: the option toLonLat has to say what longitude and latitude its points have`);
}

/** The curves of all isovalues of a frame, a feature each, in longitude and latitude. */
export function features(decoder: Decoder, options: TileOptions = {}): LineFeature[] {
  const { header, metadata, frames } = decoder, frame = options.frame ?? frames.length - 1;
  if (!header || header.n !== 2) throw new TypeError("tiles have curves only: the file has surfaces");
  const where = header.explicit ? [[1, 0, 0], [0, 1, 0]] : (coordinatesOf(decoder) ?? placement(metadata, 2));
  if (!where) throw new TypeError("the file does not say where its samples lie");
  const toLonLat = projection(metadata["crs"], options);
  return (frames[frame] ?? []).map(({ isovalue }, index) => {
    const feature = toGeoJSON(draw(decoder, index, frame), where, { isovalue, index, frame, ...options.properties?.(isovalue, index) });
    const { geometry } = feature;
    geometry.coordinates = geometry.coordinates.map((line) => line.map(([x, y]) => toLonLat(x!, y!)));
    return feature;
  });
}

/** Tiles of some features: a function of zoom, column and row that gives a vector tile, empty where there is nothing. */
export function tiles(list: LineFeature[], layer = "contours"): (z: number, x: number, y: number) => Uint8Array<ArrayBuffer> {
  const index = new GeoJSONVT({ type: "FeatureCollection", features: list }, { maxZoom: 24, indexMaxZoom: 4 });
  return (z, x, y) => {
    const tile = index.getTile(z, x, y);
    return tile ? Uint8Array.from(fromGeojsonVt({ [layer]: tile }, { version: 2 })) : new Uint8Array(0);
  };
}

/**
 * A handler for `maplibregl.addProtocol("iso", isoProtocol())`. Tiles of a source have addresses such as
 * `iso://https://example.org/terrain.iso/{z}/{x}/{y}`; the file is loaded once.
 */
export function isoProtocol(options: TileOptions = {}): Protocol {
  const files = new Map<string, Promise<ReturnType<typeof tiles>>>();
  const open = async (url: string): Promise<ReturnType<typeof tiles>> => {
    const answer = await fetch(url);
    if (!answer.ok || !answer.body) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
    const { limits = {}, frame, loadTables } = options;
    const each = decodeStream(answer.body, { limits, keepFrames: frame !== undefined, ...(loadTables ? { loadTables } : {}) });
    for (;;) {
      const { done, value } = await each.next();
      if (!done) continue;
      // of a file that ends too early what was decoded is shown
      if (value.error && value.error.kind !== "truncated") throw value.error;
      return tiles(features(value, options), options.layer);
    }
  };
  return async ({ url }) => {
    const found = /^[^:]+:\/\/(.+)\/(\d+)\/(\d+)\/(\d+)(?:\.\w+)?$/.exec(url);
    if (!found) throw new TypeError(`${url}: not the address of a tile, such as iso://https://example.org/a.iso/3/4/2`);
    const [, file, z, x, y] = found as unknown as [string, string, string, string, string];
    let ready = files.get(file);
    if (!ready) {
      files.set(file, (ready = open(file)));
      ready.catch(() => files.delete(file));
    }
    return { data: (await ready)(Number(z), Number(x), Number(y)).buffer };
  };
}
