/**
 * A widget for notebooks, as anywidget takes one: draws a file while its bytes come from the kernel, which is asked for one
 * range after another, so that several views and pages that are loaded again are served alike. Files in tiles are read where
 * they are seen.
 */
import { Decoder } from "../../codec/js/src/decoder.js";
import { openTiles } from "../../codec/js/src/tiles/file.js";
import type { Answer, Drawn, Request, PlainEvent } from "../../codec/js/src/worker.js";
import { placement } from "../../codec/js/src/world.js";
import { Scene } from "./scene.js";
import { coloursOf, fit, grown, type Seen, upright } from "./upright.js";

declare const WORKER: string;

/** The model of a widget, with the kernel behind it. */
export interface Model {
  send(message: Question): void;
  on(event: "msg:custom", call: (message: Reply, buffers: DataView[]) => void): void;
  off(event: "msg:custom", call: (message: Reply, buffers: DataView[]) => void): void;
}
/** A range of the file, fewer bytes if it ends before; or the tables of the profile `main`. */
type Question = { id: number } & ({ start: number; end: number } | { tables: true });
type Reply = { id: number; error?: string };
type Bytes = Uint8Array<ArrayBuffer>;

/** Bytes that are asked for first, and at most at a time; in between twice as many each time. */
const FIRST = 4096, MOST = 2 ** 20;
/** Corners of cells after which surfaces in tiles are drawn no finer. */
const CORNERS = 2 ** 21;
/** Milliseconds that a view of tiles rests before it is read. */
const REST = 150;

/** The tables of the profile `main`, which all widgets of a page share. */
let tables: Promise<Bytes> | undefined;

function render({ model, el }: { model: Model; el: HTMLElement }): () => void {
  const dark = document.body.dataset["jpThemeLight"] === "false", canvas = document.createElement("canvas"), line = document.createElement("div");
  const slider = Object.assign(document.createElement("input"), { type: "range", min: "0", hidden: true, title: "frame" });
  canvas.style.cssText = "display:block; width:100%; height:420px; touch-action:none";
  line.style.cssText = "font-size:90%; opacity:.8";
  slider.style.width = "100%";
  el.replaceChildren(canvas, slider, line);
  const file: Seen = { n: 2, shape: [], isovalues: [], metadata: {}, kind: "grid", drawings: new Map(), box: undefined, fitted: false, raised: 1,
    world: false };
  let came = "", wrong = "", pointed: number | undefined, ended: (() => void) | undefined, gone = false;
  const describe = (): void => {
    const unit = file.metadata["unit"] ?? "";
    line.textContent = pointed === undefined ? [wrong, came].filter(Boolean).join("; ") : `${file.metadata["labels"] ? "label" : "isovalue"} ${file.isovalues[pointed]} ${unit}`;
  };
  const scene = new Scene(canvas, () => undefined, (isovalue) => {
    pointed = isovalue;
    describe();
  });
  const failed = (error: unknown): void => {
    wrong = String((error as Error).message ?? error);
    describe();
  };

  const waiting = new Map<number, [(bytes: Bytes) => void, (error: Error) => void]>();
  let asked = Math.floor(Math.random() * 2 ** 40);
  const replied = (reply: Reply, [bytes]: DataView[]): void => {
    const [resolve, reject] = waiting.get(reply.id) ?? [];
    waiting.delete(reply.id);
    if (bytes) resolve?.(new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength).slice());
    else reject?.(new Error(reply.error));
  };
  model.on("msg:custom", replied);
  const ask = (what: { start: number; end: number } | { tables: true }): Promise<Bytes> => new Promise((resolve, reject) => {
    waiting.set(++asked, [resolve, reject]);
    model.send({ id: asked, ...what });
  });

  const loadTables = (): Promise<Bytes> => {
    tables ??= ask({ tables: true });
    tables.catch(() => (tables = undefined));
    return tables;
  };

  const show = (some: readonly Drawn[]): void => {
    for (const { isovalue, drawing } of some) file.drawings.set(isovalue, drawing);
    const drawn = [...file.drawings.values()].find(({ cells }) => cells.length), all = coloursOf(file, dark);
    scene.theme(dark, (isovalue) => all[isovalue] ?? all[0]!);
    if (!file.fitted && drawn) {
      fit(scene, file, drawn.d);
      some = [...file.drawings].map(([isovalue, drawing]) => ({ isovalue, drawing }));
    }
    for (const { isovalue, drawing } of some) scene.set(isovalue, { ...drawing, points: upright(file, drawing.points, drawing.d) });
  };

  async function whole(first: Bytes): Promise<void> {
    const probe = new Decoder();
    probe.feed(first);
    const address = probe.needs === "main" ? URL.createObjectURL(new Blob([await loadTables()])) : undefined;
    const worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })), { type: "module" });
    const tell = (request: Request, transfer: Transferable[] = []): void => worker.postMessage(request, transfer);
    ended = () => worker.terminate();
    let frame: number | undefined, at = 0;
    const look = (): void => tell({ type: "show", id: 1, isovalue: undefined, frame, world: file.world });
    const happened = (event: PlainEvent): void => {
      if (event.type === "header") {
        Object.assign(file, { n: event.header.n, shape: event.header.shape, kind: event.header.explicit ? "mesh" : "grid" });
        file.isovalues.push(event.header.isovalue);
      } else if (event.type === "isovalue") file.isovalues.push(event.isovalue);
      else if (event.type === "domain" && event.kind === "surface") file.kind = "surface";
      else if (event.type === "error") failed(event.message);
      else if (event.type === "metadata" || event.type === "coordinates") {
        if (event.type === "metadata") Object.assign(file.metadata, event.metadata);
        file.world = event.type === "coordinates" || placement(file.metadata, file.n) !== undefined;
        if (file.shape.length && file.world) look();
      }
    };
    let inWorld = false;
    worker.onerror = failed;
    worker.onmessage = ({ data: answer }: MessageEvent<Answer>) => {
      if (answer.type === "failed") return failed(answer.message);
      if (answer.type === "events") return answer.events.forEach(happened);
      if (answer.type !== "drawing") return;
      requestAnimationFrame(() => tell({ type: "next", id: 1 }));
      if (answer.fresh) {
        file.drawings.clear();
        scene.clear();
      }
      if (answer.world !== inWorld || grown(file, answer.box)) file.fitted = false;
      inWorld = answer.world;
      file.box = answer.box;
      slider.hidden = answer.frames < 2;
      slider.max = String(answer.frames - 1);
      slider.value = String(answer.frame);
      show(answer.drawings);
      came = `${answer.bytes.toLocaleString()} bytes${answer.final ? "" : " so far"}, ${answer.layers} layers`;
      describe();
      Object.assign(el.dataset, { bytes: answer.bytes, final: answer.final });
    };
    slider.oninput = () => {
      frame = Number(slider.value);
      look();
    };
    const stream = new ReadableStream<Bytes>({
      async pull(control) {
        // with a byte that has come, as servers refuse ranges that begin at the end
        const end = at + Math.max(FIRST, Math.min(at, MOST)), bytes = at ? (await ask({ start: at - 1, end })).subarray(1) : first;
        at += bytes.length;
        if (bytes.length) control.enqueue(bytes);
        if (at < end || gone) control.close();
      },
    });
    const request = { type: "open" as const, id: 1, ...(address && { tables: address }) };
    try {
      tell({ ...request, stream }, [stream as unknown as Transferable]);
    } catch {
      // a browser that hands no streams over
      tell({ ...request, bytes: new Uint8Array(await new Response(stream).arrayBuffer()) });
    }
  }

  async function tiles(): Promise<void> {
    const source = Object.assign(new Blob(), { slice: (start: number, end: number) => ({ arrayBuffer: async () => (await ask({ start, end })).buffer }) });
    const read = await openTiles(source as Blob, { loadTables }), { n, shape, isovalues, metadata, stages } = read.head;
    Object.assign(file, { n, shape, isovalues, metadata, kind: "tiles", box: Float64Array.from([...shape.map(() => 0), ...shape.map((s) => s - 1)]) });
    let seen = "", timer = 0, work = new AbortController();
    fit(scene, file, n);
    if (n === 2) scene.set(0, { n, d: n, points: new Float64Array(0), cells: new Uint32Array(0) });
    const look = async (): Promise<void> => {
      const { x, y, pixel } = scene.window(), fine = n === 2 ? read.stage({ within: 2 * pixel }) : stages.length - 1;
      const box: [number, number][] = n === 2 ? [[-y[1], -y[0]], x] : shape.map((s) => [0, s - 1]), now = JSON.stringify([fine, box]);
      if (now === seen || gone) return;
      seen = now;
      work.abort();
      const { signal } = (work = new AbortController());
      const coarse = n === 2 ? [0] : stages.map((_, layer) => layer);
      for (const layer of file.drawings.size ? [fine] : new Set([...coarse, fine])) {
        const drawings = await read.windows(box, isovalues.map((_, i) => i), { layer, signal });
        show(drawings.map((drawing, isovalue) => ({ isovalue, drawing })));
        came = `${read.received.toLocaleString()} bytes in ${read.requests} ${read.requests === 1 ? "request" : "requests"}`;
        describe();
        const last = layer === fine || drawings.reduce((sum, { cells }) => sum + cells.length, 0) > CORNERS;
        Object.assign(el.dataset, { bytes: read.received, final: last });
        if (last) break;
      }
    };
    scene.viewed = () => {
      clearTimeout(timer);
      timer = window.setTimeout(() => void look().catch((error) => error.name === "AbortError" || failed(error)), REST);
    };
    ended = () => work.abort();
    scene.request();
  }

  const open = async (): Promise<void> => {
    const first = await ask({ start: 0, end: FIRST });
    if (!gone) await (first[3] === 0x54 ? tiles() : whole(first));
  };
  open().catch(failed);
  return () => {
    gone = true;
    model.off("msg:custom", replied);
    ended?.();
    // pages have few contexts, which are collected late
    canvas.getContext("webgl2")?.getExtension("WEBGL_lose_context")?.loseContext();
  };
}

export default { render };
