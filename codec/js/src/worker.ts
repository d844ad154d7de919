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
 * How a file is decoded. `tables` says where `main.bin` lies, if not beside this module, `kernels` where `kernels.wasm` does:
 * without it the compiled kernels are not taken.
 */
interface Manner {
  tables?: string;
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
const LARGE = 1 << 18;

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
  private bytes = 0;
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

  /** The compiled kernels, if they are wanted and can be had. */
  private async kernels(): Promise<Kernels | undefined> {
    const { kernels } = this.request;
    if (!kernels || !(this.total! >= LARGE)) return undefined;
    return import("./kernels.js").then(({ fetchKernels }) => fetchKernels(kernels)).catch(() => undefined);
  }

  private async source(): Promise<ReadableStream<Uint8Array>> {
    const { request } = this;
    if ("stream" in request) return request.stream;
    let stream: ReadableStream<Uint8Array>;
    if ("bytes" in request) {
      this.total = request.bytes.length;
      stream = new Response(request.bytes as BlobPart & Uint8Array<ArrayBuffer>).body!;
    } else {
      const answer = await fetch(request.url);
      if (!answer.ok || !answer.body) throw new Error(`${request.url}: ${answer.status} ${answer.statusText}`);
      const length = answer.headers.get("content-length");
      if (length && !answer.headers.get("content-encoding")) this.total = Number(length);
      stream = answer.body;
    }
    return request.bytesPerSecond ? stream.pipeThrough(slower(request.bytesPerSecond)) : stream;
  }

  async run(): Promise<void> {
    const reader = (await this.source()).getReader(), kernels = await this.kernels(), decoder = (this.decoder = this.begun(kernels));
    for (;;) {
      const { done, value } = await reader.read();
      if (current !== this) return void reader.cancel();
      if (!this.bytes && value && value[3] === 0x54 && !("stream" in this.request)) {
        await reader.cancel();
        const bytes = "bytes" in this.request ? this.request.bytes : undefined;
        return scope.postMessage({ type: "tiles", id: this.id, bytes }, bytes ? [bytes.buffer] : []);
      }
      this.bytes += value?.length ?? 0;
      let events = done ? decoder.end() : decoder.feed(value);
      if (decoder.needs && !decoder.error) {
        this.send(events);
        events = await supply(decoder, () => fetchTables(this.request.tables));
      }
      this.done = done || decoder.error !== undefined;
      this.send(events);
      this.stale = true;
      this.draw();
      // let requests of the page come in between
      await new Promise((resolve) => setTimeout(resolve, 0));
      if (this.done) return;
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
    const frames = decoder.frames.length, frame = Math.min(view.frame ?? Infinity, frames - 1), { where } = this;
    const shown = JSON.stringify([view.isovalue, frame, where !== undefined]), fresh = shown !== this.shown;
    if (fresh) {
      this.shown = shown;
      this.drawn.length = 0;
      this.reach = undefined;
    }
    const drawings = this.changed(frame, where), box = boxOf(decoder, where, this.reach);
    this.ready = this.stale = false;
    scope.postMessage({
      type: "drawing", id: this.id, frame, frames, bytes: this.bytes, layers: decoder.layers, final: this.done, drawings, fresh,
      world: where !== undefined, box,
    }, [...drawings.flatMap(({ drawing: { points, cells } }) => [points.buffer, cells.buffer]), box.buffer]);
  }

  /** Drawings of the isovalues that are wanted and have changed since they were drawn; a surface of points has no isovalue. */
  private changed(frame: number, where: Where | undefined): Drawn[] {
    const { decoder, view, drawn } = this, count = Math.max(1, decoder.frames[frame]!.length), last = frame === decoder.frames.length - 1;
    const alone = view.isovalue === undefined ? undefined : Math.max(0, Math.min(view.isovalue, count - 1)), found: Drawn[] = [];
    for (let isovalue = alone ?? 0; isovalue <= (alone ?? count - 1); isovalue++) {
      // an isovalue is complete as soon as another begins
      const from = this.done || !last || isovalue < count - 1 ? Infinity : this.bytes;
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
