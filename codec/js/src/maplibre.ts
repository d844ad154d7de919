/** Vector tiles of the curves of files, for maps of MapLibre. */
import { fromGeojsonVt } from "vt-pbf";
import { type CurveOptions, open, type Tiles } from "./curves.js";

export interface TileOptions extends CurveOptions {
  /** Name of the layer of the tiles; by default "contours". */
  layer?: string;
}

/** What `maplibregl.addProtocol` takes. */
export type Protocol = (request: { url: string }, abort?: AbortController) => Promise<{ data: ArrayBuffer }>;

/**
 * A handler for `maplibregl.addProtocol("iso", isoProtocol())`. Tiles of a source have addresses such as
 * `iso://https://example.org/terrain.iso/{z}/{x}/{y}`. A whole file is loaded once; of a file in tiles what is seen is read.
 */
export function isoProtocol(options: TileOptions = {}): Protocol {
  const files = new Map<string, Promise<Tiles>>();
  return async ({ url }, abort) => {
    const found = /^[^:]+:\/\/(.+)\/(\d+)\/(\d+)\/(\d+)(?:\.\w+)?$/.exec(url);
    if (!found) throw new TypeError(`${url}: not the address of a tile, such as iso://https://example.org/a.iso/3/4/2`);
    const [, file, z, x, y] = found as unknown as [string, string, string, string, string];
    let ready = files.get(file);
    if (!ready) {
      files.set(file, (ready = open(file, options)));
      ready.catch(() => files.delete(file));
    }
    const tile = await (await ready)(Number(z), Number(x), Number(y), abort?.signal);
    return { data: tile ? Uint8Array.from(fromGeojsonVt({ [options.layer ?? "contours"]: tile }, { version: 2 })).buffer : new ArrayBuffer(0) };
  };
}
