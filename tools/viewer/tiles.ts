/**
 * Files in tiles, in a worker of their own, which the page loads when one is opened: fetches what the view needs, at the
 * resolution of the screen; in space the whole surface, at the finest layer that has not too many triangles.
 */
import type { Drawing } from "../../codec/js/src/draw.js";
import { fetchTables } from "../../codec/js/src/stream.js";
import { openTiles, type TiledFile, type TilesHead } from "../../codec/js/src/tiles/file.js";
import { place, placement } from "../../codec/js/src/world.js";

/** What is seen of a file: all isovalues or one, a window, how much of it a pixel is; in samples, or in coordinates of the world. */
export interface Look {
  isovalue: number | undefined;
  window: [number, number][];
  pixel: number;
  world: boolean;
}

/** What the page sends: a file first, then what is seen of it. */
export type TilesRequest =
  | { type: "open"; id: number; source: string | Uint8Array; tables: string; plane: string }
  | ({ type: "look"; id: number } & Look);

/**
 * What the worker answers. `corners` are those of the field in the world, if the file says where it lies; `final` says that
 * a drawing is as fine as the view needs.
 */
export type TilesAnswer =
  | { type: "opened"; id: number; head: TilesHead; corners: Float64Array | undefined }
  | { type: "drawing"; id: number; isovalue: number; drawing: Drawing; world: boolean; layer: number; requests: number; received: number;
      final: boolean }
  | { type: "failed"; id: number; kind: string; message: string };

/** Triangles that a surface may have. */
const TRIANGLES = 2 ** 21;
/** How much more than the window is fetched, to each side, in widths of it. */
const MARGIN = 0.25;

const scope = self as unknown as {
  postMessage(message: TilesAnswer, transfer?: Transferable[]): void;
  onmessage: ((event: MessageEvent<TilesRequest>) => void) | null;
};

let file: TiledFile | undefined, id = 0, shown = false;
/** Rows of the placement, if there is one. */
let where: number[][] | undefined;
let work = new AbortController();

function send(isovalue: number, { world }: Look, layer: number, drawn: Drawing, final: boolean): void {
  const { requests, received } = file!, drawing = world ? place(drawn, where!) : drawn;
  shown = true;
  scope.postMessage({ type: "drawing", id, isovalue, drawing, world, layer, requests, received, final }, [drawing.points.buffer, drawing.cells.buffer]);
}

/** A window of the plane in samples, and how many of these a pixel is along the axis that has the longest steps. */
function inSamples({ window, pixel, world }: Look): { window: Look["window"]; pixel: number } {
  if (!world) return { window, pixel };
  const [[a, b, c], [d, e, f]] = where as [[number, number, number], [number, number, number]], turn = a * e - b * d;
  const [x, y] = window as [[number, number], [number, number]];
  const corners = x.flatMap((u) => y.map((v) => [(e * (u - c) - b * (v - f)) / turn, (a * (v - f) - d * (u - c)) / turn]));
  const found = [0, 1].map((axis): [number, number] => {
    const all = corners.map((corner) => corner[axis]!);
    return [Math.min(...all), Math.max(...all)];
  });
  // of steps that are nearly parallel all is taken
  const sound = found.flat().every(Number.isFinite);
  return { window: sound ? found : file!.head.shape.map((s) => [0, s - 1]), pixel: pixel / Math.max(Math.hypot(a, d), Math.hypot(b, e)) };
}

/** The window as it is needed: with something around it. */
const wider = (window: Look["window"]): [number, number][] =>
  window.map(([from, to]) => [from - MARGIN * (to - from), to + MARGIN * (to - from)]);

/** Numbers of the isovalues that are asked for. */
const wanted = ({ isovalue }: Look): number[] => (isovalue === undefined ? file!.head.isovalues.map((_, i) => i) : [isovalue]);

async function curves(asked: Look, signal: AbortSignal): Promise<void> {
  const { window, pixel } = inSamples(asked), fine = file!.stage({ within: 2 * pixel }), box = wider(window), isovalues = wanted(asked);
  // something is shown at once
  for (const layer of !shown && fine > 0 ? [0, fine] : [fine]) for (const isovalue of isovalues)
    send(isovalue, asked, layer, await file!.window(box, { isovalue, layer, signal }), layer === fine && isovalue === isovalues[isovalues.length - 1]);
}

async function surface(asked: Look, signal: AbortSignal): Promise<void> {
  const { stages } = file!.head, isovalues = wanted(asked);
  for (let layer = 0, final = false; !final; layer++) {
    const drawings: Drawing[] = [];
    for (const isovalue of isovalues) drawings.push(await file!.all({ isovalue, layer, signal }));
    const next = stages[layer + 1], triangles = drawings.reduce((sum, { cells }) => sum + cells.length / 3, 0);
    // cubes of half the width are crossed four times as often
    final = !next || triangles * (stages[layer]!.cube / next.cube) ** 2 > TRIANGLES;
    drawings.forEach((drawing, i) => send(isovalues[i]!, asked, layer, drawing, final && i === isovalues.length - 1));
  }
}

async function look(asked: Look): Promise<void> {
  work.abort();
  const { signal } = (work = new AbortController());
  await (file!.head.n === 2 ? curves : surface)(asked, signal);
}

async function open({ source, tables, plane }: TilesRequest & { type: "open" }): Promise<void> {
  file = await openTiles(source, { loadTables: () => fetchTables(file!.head.n === 2 ? plane : tables) });
  const { head } = file, { n } = head;
  where = placement(head.metadata, n);
  const points = Float64Array.from({ length: n << n }, (_, i) => ((Math.floor(i / n) >> (i % n)) & 1 ? head.shape[i % n]! - 1 : 0));
  const corners = where && place({ n, d: n, points, cells: new Uint32Array(0), full: false }, where).points;
  scope.postMessage({ type: "opened", id, head, corners });
}

scope.onmessage = ({ data: request }) => {
  id = request.id;
  (request.type === "open" ? open(request) : look(request)).catch((error: Error & { kind?: string }) => {
    if (error.name !== "AbortError") scope.postMessage({ type: "failed", id, kind: error.kind ?? "failed", message: error.message });
  });
};
