/**
 * Files in tiles, in a worker of their own, which the page loads when one is opened: fetches what the view needs, at the
 * resolution of the screen; in space the whole surface, at the finest layer that has not too many triangles.
 */
import type { Drawing } from "../../codec/js/src/draw.js";
import { fetchTables } from "../../codec/js/src/stream.js";
import { openTiles, type TiledFile, type TilesHead } from "../../codec/js/src/tiles/file.js";

/** What is seen of a file: an isovalue, a window of samples, how many of them a pixel is. */
export interface Look {
  isovalue: number;
  window: [number, number][];
  pixel: number;
}

/** What the page sends: a file first, then what is seen of it. */
export type TilesRequest =
  | { type: "open"; id: number; source: string | Uint8Array; tables: string }
  | ({ type: "look"; id: number } & Look);

/** What the worker answers. `final` says that a drawing is as fine as the view needs. */
export type TilesAnswer =
  | { type: "opened"; id: number; head: TilesHead }
  | { type: "drawing"; id: number; isovalue: number; drawing: Drawing; layer: number; requests: number; received: number; final: boolean }
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
let work = new AbortController();

function send(isovalue: number, layer: number, drawing: Drawing, final: boolean): void {
  const { requests, received } = file!;
  shown = true;
  scope.postMessage({ type: "drawing", id, isovalue, drawing, layer, requests, received, final }, [drawing.points.buffer, drawing.cells.buffer]);
}

/** The window as it is needed: with something around it. */
const wider = (window: Look["window"]): [number, number][] =>
  window.map(([from, to]) => [from - MARGIN * (to - from), to + MARGIN * (to - from)]);

async function curves({ isovalue, window, pixel }: Look, signal: AbortSignal): Promise<void> {
  const layer = file!.stage({ within: 2 * pixel }), box = wider(window);
  // something is shown at once
  if (!shown && layer > 0) send(isovalue, 0, await file!.window(box, { isovalue, layer: 0, signal }), false);
  send(isovalue, layer, await file!.window(box, { isovalue, layer, signal }), true);
}

async function surface({ isovalue }: Look, signal: AbortSignal): Promise<void> {
  const { stages } = file!.head;
  for (let layer = 0, final = false; !final; layer++) {
    const drawing = await file!.all({ isovalue, layer, signal }), next = stages[layer + 1];
    // cubes of half the width are crossed four times as often
    const expected = next ? (drawing.cells.length / 3) * (stages[layer]!.cube / next.cube) ** 2 : Infinity;
    final = expected > TRIANGLES;
    send(isovalue, layer, drawing, final);
  }
}

async function look(asked: Look): Promise<void> {
  work.abort();
  const { signal } = (work = new AbortController());
  await (file!.head.n === 2 ? curves : surface)(asked, signal);
}

async function open({ source, tables }: TilesRequest & { type: "open" }): Promise<void> {
  file = await openTiles(source, { loadTables: () => fetchTables(tables) });
  scope.postMessage({ type: "opened", id, head: file.head });
}

scope.onmessage = ({ data: request }) => {
  id = request.id;
  (request.type === "open" ? open(request) : look(request)).catch((error: Error & { kind?: string }) => {
    if (error.name !== "AbortError") scope.postMessage({ type: "failed", id, kind: error.kind ?? "failed", message: error.message });
  });
};
