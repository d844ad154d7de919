/** The curves of files on maps of Leaflet, drawn on canvas. */
import { type CurveOptions, open, type Tile, type Tiles } from "./curves.js";

export interface LayerOptions extends CurveOptions {
  /** Colour and width in pixels of a line, by the properties of its feature; by default black lines of one pixel. */
  style?: (properties: Record<string, unknown>) => { color?: string; width?: number };
  /** Options of `L.GridLayer`. */
  [option: string]: unknown;
}

/** What is used of Leaflet. */
export interface Leaflet<Layer> {
  GridLayer: { extend(members: object): new (options?: object) => Layer };
}

interface Grid {
  getTileSize(): { x: number; y: number };
}

function paint(canvas: HTMLCanvasElement, tile: Tile, style: LayerOptions["style"], ratio: number): void {
  const pen = canvas.getContext("2d")!, [across, down] = [canvas.width / 4096, canvas.height / 4096];
  for (const { tags, geometry } of tile?.features ?? []) {
    const { color = "#000", width = 1 } = style?.(tags as Record<string, unknown>) ?? {};
    pen.strokeStyle = color;
    pen.lineWidth = width * ratio;
    pen.beginPath();
    for (const line of geometry as [number, number][][])
      line.forEach(([x, y], i) => (i ? pen.lineTo(x * across, y * down) : pen.moveTo(x * across, y * down)));
    pen.stroke();
  }
}

/** A layer, as `isoLayer(L, "terrain.iso").addTo(map)`. A whole file is loaded once; of a file in tiles what is seen is read. */
export function isoLayer<Layer>(L: Leaflet<Layer>, url: string, options: LayerOptions = {}): Layer {
  let ready: Promise<Tiles> | undefined;
  const Curves = L.GridLayer.extend({
    createTile(this: Grid, { x, y, z }: { x: number; y: number; z: number }, done: (error: unknown, canvas: HTMLCanvasElement) => void) {
      const canvas = document.createElement("canvas"), size = this.getTileSize(), ratio = devicePixelRatio;
      Object.assign(canvas, { width: size.x * ratio, height: size.y * ratio });
      ready ??= open(url, options);
      ready.catch(() => (ready = undefined));
      ready.then((tiles) => tiles(z, x, y)).then((tile) => {
        paint(canvas, tile, options.style, ratio);
        done(undefined, canvas);
      }).catch((error: unknown) => done(error, canvas));
      return canvas;
    },
  });
  return new Curves(options);
}
