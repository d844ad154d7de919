/**
 * Decoding in a worker. The page sends a request and gets drawings as typed arrays, transferred, never more often than it
 * takes them: it answers each drawing with `next`.
 */
import { Decoder, type Header, type IsoEvent } from "./decoder.js";
import { draw, type Drawing } from "./draw.js";
import type { Limits } from "./errors.js";
import type { Kernels } from "./kernels.js";
import { fetchTables, supply } from "./stream.js";
import { coordinatesOf, place, placement, type Where } from "./world.js";

/**
 * How a file is decoded. `tables` says where `main.bin` lies, if not beside this module; `plane` where its beginning lies that
 * files in the plane need, if that is a file of its own; `kernels` where `kernels.wasm` does: without it the compiled kernels are
 * not taken.
 */
interface Manner {
  tables?: string;
  plane?: string;
  kernels?: string;
  limits?: Partial<Limits>;
}

/** What the page sends. Streams and bytes are transferred. */
export type Request =
  | ({ type: "open"; id: number; url: string; bytesPerSecond?: number } & Manner)
  | ({ type: "open"; id: number; stream: ReadableStream<Uint8Array> } & Manner)
  | ({ type: "open"; id: number; bytes: Uint8Array; bytesPerSecond?: number } & Manner)
  | ({ type: "show"; id: number } & View)
  | { type: "next"; id: number };

/**
 * What is to be drawn: all isovalues, or one by its number; of a series the last frame there is, unless one is chosen; in world
 * coordinates, if the file has some.
 */
export interface View {
  isovalue: number | undefined;
  frame: number | undefined;
  world: boolean;
}

/** What the worker answers. */
export type Answer =
  | { type: "events"; id: number; events: PlainEvent[]; header: Header | undefined; total: number | undefined }
  | { type: "drawing"; id: number; frame: number; frames: number; bytes: number; layers: number; final: boolean;
      /** Those that have changed, by the number of their isovalue. */
      drawings: Drawn[];
      /** Whether what was drawn before goes: it was of another view. */
      fresh: boolean;
      /** Whether points are in world coordinates. */
      world: boolean;
      /** Points of the whole domain, as many numbers each as those of the drawings, that show where it lies. */
      box: Float64Array }
  /** The file is in tiles, which `isocodec/tiles` reads; its bytes, if they came with the request. */
  | { type: "tiles"; id: number; bytes: Uint8Array | undefined }
  | { type: "failed"; id: number; message: string };

/** The drawing of an isovalue. */
export interface Drawn {
  isovalue: number;
  drawing: Drawing;
}

/** Events as they can be sent: an error as its words. */
export type PlainEvent = Exclude<IsoEvent, { type: "error" }> |
  { type: "error"; bytes: number; kind: string; clause: string; message: string };

const scope = self as unknown as {
  postMessage(message: Answer, transfer?: Transferable[]): void;
  onmessage: ((event: MessageEvent<Request>) => void) | null;
};

/** Bytes of a file from which on the compiled kernels are fetched: a smaller one is decoded before they are there. */
const LARGE = 1 << 16;
/** Bytes of a large file that are decoded before it is seen whether the kernels are there; milliseconds without a turn of others. */
const PIECE = 1024, TURN = 16;
/** How many times as long as a drawing took the next one waits: most of the time is for decoding. */
const REST = 2;

class Job {
  decoder: Decoder;
  private view: View = { isovalue: undefined, frame: undefined, world: false };
  /** The view that was drawn last; of each of its isovalues how much of the file it was drawn from; where its points lie. */
  private shown = "";
  private readonly drawn: number[] = [];
  private reach: Reach | undefined;
  private ready = true;
  private stale = false;
  private done = false;
  /** When drawing may go on, and what waits for that. */
  private rested = 0;
  private waiting: ReturnType<typeof setTimeout> | undefined;
  private bytes = 0;
  /** Layers of each isovalue of the present frame. */
  private layers: number[] = [];
  private total: number | undefined;

  constructor(private readonly request: Request & { type: "open" }) {
    this.decoder = this.begun();
  }

  private begun(kernels?: Kernels): Decoder {
    // any frame of a series may be asked for
    return new Decoder({ limits: this.request.limits ?? {}, kernels, keepFrames: true });
  }

  get id(): number {
    return this.request.id;
  }

  /** Decode more bytes, or the end; what the file needs is loaded. */
  private async decode(decoder: Decoder, value: Uint8Array | undefined): Promise<IsoEvent[]> {
    const { tables, plane } = this.request, events = value ? decoder.feed(value) : decoder.end();
    if (!decoder.needs || decoder.error) return events;
    if (decoder === this.decoder) this.send(events);
    return supply(decoder, () => fetchTables(decoder.header?.n === 2 ? (plane ?? tables) : tables));
  }

  private async source(): Promise<ReadableStream<Uint8Array>> {
    const { request } = this;
    if ("stream" in request) return request.stream;
    let stream: ReadableStream<Uint8Array>;
    if ("bytes" in request) {
      this.total = request.bytes.length;
      stream = new Response(request.bytes as BlobPart & Uint8Array<ArrayBuffer>).body!;
    } else {
      // what nearly all files in the plane need is on its way with the file
      if (request.plane) Promise.all([fetchTables(request.plane), import("./main/profile.js")]).catch(() => undefined);
      const answer = await fetch(request.url);
      if (!answer.ok || !answer.body) throw new Error(`${request.url}: ${answer.status} ${answer.statusText}`);
      const length = answer.headers.get("content-length");
      if (length && !answer.headers.get("content-encoding")) this.total = Number(length);
      stream = answer.body;
    }
    return request.bytesPerSecond ? stream.pipeThrough(slower(request.bytesPerSecond)) : stream;
  }

  async run(): Promise<void> {
    let stream = await this.source(), kernels: Kernels | undefined, turn = 0;
    // of a large file, what the compiled kernels decode anew when they are there: first curves do not wait for them
    const address = this.total! >= LARGE ? this.request.kernels : undefined;
    let pieces: Uint8Array[] | undefined = address ? [] : undefined;
    if (pieces) stream = stream.pipeThrough(cut());
    const reader = stream.getReader();
    for (let asked = false; ;) {
      const { done, value } = await reader.read();
      if (current !== this) return void reader.cancel();
      if (!this.bytes && value && value[3] === 0x54 && !("stream" in this.request)) {
        await reader.cancel();
        const bytes = "bytes" in this.request ? this.request.bytes : undefined;
        return scope.postMessage({ type: "tiles", id: this.id, bytes }, bytes ? [bytes.buffer] : []);
      }
      this.bytes += value?.length ?? 0;
      let { decoder } = this, events: IsoEvent[] = [], next = [value];
      if (value) pieces?.push(value);
      if (value && pieces && kernels) {
        decoder = this.begun(kernels);
        next = pieces;
        pieces = undefined;
      }
      for (const piece of next) events = await this.decode(decoder, piece);
      this.decoder = decoder;
      for (const event of events) {
        if (event.type === "frame") this.layers = [];
        if (event.type === "layer") this.layers[event.isovalue] = (this.layers[event.isovalue] ?? 0) + 1;
      }
      if (address && !asked)
        import("./kernels.js").then(({ fetchKernels }) => fetchKernels(address)).then((found) => (kernels = found), () => (pieces = undefined));
      asked = true;
      this.done = done || decoder.error !== undefined;
      this.send(events);
      this.stale = true;
      this.draw();
      if (this.done) return;
      // let requests of the page come in between
      if (performance.now() < turn) continue;
      await new Promise((resolve) => setTimeout(resolve, 0));
      turn = performance.now() + TURN;
    }
  }

  private send(events: IsoEvent[]): void {
    const plain = events.map((event): PlainEvent => event.type !== "error" ? event : {
      type: "error", bytes: event.bytes, kind: event.error.kind, clause: event.error.clause, message: event.error.message,
    });
    scope.postMessage({ type: "events", id: this.id, events: plain, header: this.decoder.header, total: this.total });
  }

  show(view: View): void {
    this.view = view;
    this.stale = true;
    this.rested = 0;
    this.draw();
  }

  next(): void {
    this.ready = true;
    this.draw();
  }

  /** Where the samples lie in the world, if that is asked for and known. */
  private get where(): Where | undefined {
    const { decoder } = this;
    if (!this.view.world || !decoder.header || decoder.header.explicit) return undefined;
    return coordinatesOf(decoder) ?? placement(decoder.metadata, decoder.header.n);
  }

  private draw(): void {
    const { decoder, view } = this;
    if (!this.ready || !this.stale || !(decoder.contours.length || decoder.domain)) return;
    const began = performance.now();
    if (began < this.rested && !this.done) {
      this.waiting ??= setTimeout(() => {
        this.waiting = undefined;
        this.draw();
      }, this.rested - began);
      return;
    }
    const frames = decoder.frames.length, frame = Math.min(view.frame ?? Infinity, frames - 1), { where } = this;
    const shown = JSON.stringify([view.isovalue, frame, where !== undefined]), fresh = shown !== this.shown;
    if (fresh) {
      this.shown = shown;
      this.drawn.length = 0;
      this.reach = undefined;
    }
    const drawings = this.changed(frame, where), box = boxOf(decoder, where, this.reach);
    this.ready = this.stale = false;
    this.rested = began + (1 + REST) * (performance.now() - began);
    scope.postMessage({
      type: "drawing", id: this.id, frame, frames, bytes: this.bytes, layers: decoder.layers, final: this.done, drawings, fresh,
      world: where !== undefined, box,
    }, [...drawings.flatMap(({ drawing: { points, cells } }) => [points.buffer, cells.buffer]), box.buffer]);
  }

  /** Drawings of the isovalues that are wanted and have changed since they were drawn; a surface of points has no isovalue. */
  private changed(frame: number, where: Where | undefined): Drawn[] {
    const { decoder, view, drawn } = this, count = Math.max(1, decoder.frames[frame]!.length), last = frame === decoder.frames.length - 1;
    const alone = view.isovalue === undefined ? undefined : Math.max(0, Math.min(view.isovalue, count - 1)), found: Drawn[] = [];
    const [first, size] = (decoder.grid ?? decoder.domain)!.series.turn;
    for (let isovalue = alone ?? 0; isovalue <= (alone ?? count - 1); isovalue++) {
      // only isovalues in turn change (3.5.9), which others may have been since the last drawing
      const from = last && isovalue >= first && isovalue < first + size ? this.bytes : last ? -(this.layers[isovalue] ?? 0) : Infinity;
      if (drawn[isovalue] === from) continue;
      drawn[isovalue] = from;
      const flat = draw(decoder, isovalue, frame), drawing = where ? place(flat, where) : flat;
      if (decoder.header!.explicit) this.reach = reached(this.reach, drawing);
      found.push({ isovalue, drawing });
    }
    return found;
  }
}

/** Least and largest coordinates of points. */
type Reach = [low: number[], high: number[]];

function reached(reach: Reach | undefined, { d, points }: Drawing): Reach | undefined {
  if (!points.length) return reach;
  const [low, high] = reach ?? [Array.from<number>({ length: d }).fill(Infinity), Array.from<number>({ length: d }).fill(-Infinity)];
  points.forEach((x, i) => {
    low[i % d] = Math.min(low[i % d]!, x);
    high[i % d] = Math.max(high[i % d]!, x);
  });
  return [low, high];
}

/** Points of the grid, at its corners and some between; of an explicit domain the ends of what is drawn. */
function boxOf({ header }: Decoder, where: Where | undefined, reach: Reach | undefined): Float64Array<ArrayBuffer> {
  const { n, shape } = header!, steps = where ? 8 : 1, points: number[] = [];
  if (header!.explicit) return Float64Array.from(reach?.flat() ?? []);
  for (let i = 0; i < (steps + 1) ** n; i++)
    for (let a = 0, rest = i; a < n; a++, rest = Math.floor(rest / (steps + 1)))
      points.push(((shape[a]! - 1) * (rest % (steps + 1))) / steps);
  const box: Drawing = { n, d: n, points: Float64Array.from(points), cells: new Uint32Array(0), full: false };
  return Float64Array.from((where ? place(box, where) : box).points);
}

/** Cuts what comes into pieces. */
function cut(): TransformStream<Uint8Array, Uint8Array> {
  return new TransformStream({
    transform(bytes, controller) {
      for (let at = 0; at < bytes.length; at += PIECE) controller.enqueue(bytes.subarray(at, at + PIECE));
    },
  });
}

/** Lets so many bytes through in a second, a twentieth at a time. */
function slower(bytesPerSecond: number): TransformStream<Uint8Array, Uint8Array> {
  const piece = Math.max(1, Math.round(bytesPerSecond / 20));
  return new TransformStream({
    async transform(bytes, controller) {
      for (let at = 0; at < bytes.length; at += piece) {
        controller.enqueue(bytes.slice(at, at + piece));
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
    },
  });
}

let current: Job | undefined;

scope.onmessage = ({ data: request }) => {
  if (request.type === "open") {
    const job = (current = new Job(request));
    job.run().catch((error: unknown) => {
      if (current === job) scope.postMessage({ type: "failed", id: job.id, message: String(error) });
    });
  } else if (current?.id === request.id) {
    if (request.type === "next") current.next();
    else current.show(request);
  }
};
