/** Files as they come: header, chunks, events (clauses 3 and 8). */
import { Base, ADAPTIVE, LEAVES, UNIFORM } from "./base.js";
import { Coder, Input } from "./coder.js";
import { type CoordinateChunk, type Coordinates, decodeCoordinates, readCoordinates } from "./coordinates.js";
import { crc32 } from "./crc.js";
import { IsoError, type Limits, LIMITS, Meter } from "./errors.js";
import { Grid } from "./grid.js";
import { readMetadata, readPromises, type Metadata, type Promises } from "./metadata.js";
import { readTables, type Tables } from "./models.js";
import { Offsets } from "./offsets.js";
import { type Bytes, type Layer, Progress, readProgram } from "./program.js";
import { Rounds } from "./refine.js";
import { type Missing, type Pass, Tube } from "./tube.js";
import { Values } from "./values.js";

export interface Header {
  shape: number[];
  profile: "baseline" | "main";
  isovalue: number;
  /** The scale of scaled data, undefined for integer data. */
  scale: number | undefined;
}

/** What has happened, with the number of bytes of the file that it needed (8.2.2). */
export type IsoEvent =
  | { type: "header"; bytes: number; header: Header }
  | { type: "layer"; bytes: number; kind: Layer["kind"]; number: number; frame: number; isovalue: number; level: number }
  | { type: "isovalue"; bytes: number; index: number; isovalue: number; lean: number | undefined }
  | { type: "series"; bytes: number; interval: number }
  | { type: "frame"; bytes: number; frame: number; index: number; isovalue: number; lean: FrameLean }
  | { type: "metadata"; bytes: number; metadata: Metadata }
  | { type: "promises"; bytes: number; isovalue: number; promises: Promises }
  | { type: "coordinates"; bytes: number }
  | { type: "mask"; bytes: number }
  | { type: "skipped"; bytes: number; chunk: number }
  | { type: "end"; bytes: number }
  | { type: "error"; bytes: number; error: IsoError };

/** What an isovalue of a further frame leans on: that of the frame before, an earlier one of its own frame, or none. */
export type FrameLean = "before" | number | undefined;

export interface DecoderOptions {
  limits?: Partial<Limits>;
  /** The tables of the main profile, `isospec/main.bin`; without them files of that profile wait for `setTables`. */
  tables?: Uint8Array;
  /** Whether the state of all frames of a series is kept; otherwise that of the last two is. */
  keepFrames?: boolean;
}

/** One isovalue of a file. */
export interface Contour {
  tube: Tube;
  progress: Progress;
  layers: number;
}

/**
 * Decodes a file that comes in pieces. `feed` and `end` return what has happened; after an event "error" nothing more is
 * decoded, and what was decoded stays available.
 */
export class Decoder {
  header: Header | undefined;
  grid: Grid | undefined;
  /** Isovalues by frame; of a file that is no series there is one frame. Those no longer kept are undefined. */
  readonly frames: (Contour[] | undefined)[] = [[]];
  /** State of the mask from its first symbol on; `missing` says whether it is complete. */
  maskTube: Tube | undefined;
  missing: Missing | undefined;
  readonly metadata: Metadata = {};
  error: IsoError | undefined;
  done = false;
  /** Layers that are complete, of all isovalues; decoding pauses when there are `pauseAt`. */
  layers = 0;
  pauseAt = Infinity;
  needsTables = false;
  readonly meter: Meter;
  private readonly input = new Input();
  private readonly coder: Coder;
  private readonly run: Generator<void, void, void>;
  private events: IsoEvent[] = [];
  private tablesBytes: Uint8Array | undefined;
  private tables: Tables | undefined;
  private place: CoordinateChunk | undefined;
  private placed: { value: Coordinates | undefined } | undefined;
  /** Place in the input of the next byte, and the end of the payload it is in. */
  private at = 0;
  private stop = Infinity;
  private crc = 0;
  /** The interval of key frames, undefined if the file is no series so far (3.5.7). */
  private interval: number | undefined;
  /** Isovalues of a frame. */
  private readonly isovalues: number[] = [];
  /** Layers of the frame that programs have stated. */
  private planned = 0;
  private readonly keepFrames: boolean;

  constructor(options: DecoderOptions = {}) {
    this.meter = new Meter({ ...LIMITS, ...options.limits });
    this.coder = new Coder(this.input, this.meter);
    this.tablesBytes = options.tables;
    this.keepFrames = options.keepFrames ?? false;
    this.run = this.file();
  }

  /** Isovalues of the present frame. */
  get contours(): Contour[] {
    return this.frames[this.frames.length - 1]!;
  }

  /** Take the next bytes of the file. */
  feed(bytes: Uint8Array): IsoEvent[] {
    if (!this.error && !this.done && this.input.dropped + this.input.length + bytes.length > this.meter.limits.bytes)
      this.fail(new IsoError("limit", "11.2", this.meter.limits.bytes, "the file is longer than the limit"));
    if (this.error) return this.take();
    if (this.done) {
      if (bytes.length) this.fail(this.wrong("3.4.4", "there are bytes after the end"));
      return this.take();
    }
    this.input.push(bytes);
    return this.go();
  }

  /** No more bytes will come. */
  end(): IsoEvent[] {
    this.input.ended = true;
    return this.go();
  }

  /** Periodic axes of a mapped grid (3.7.4(1)). */
  get periodic(): readonly number[] {
    return this.place?.periodic ?? [];
  }

  /** Where the samples lie, if a chunk of coordinates has come that is not malformed (3.7.4). */
  get coordinates(): Coordinates | undefined {
    if (!this.place) return undefined;
    this.placed ??= { value: decodeCoordinates(this.place, this.meter.limits) };
    return this.placed.value;
  }

  /** Give the tables of the main profile to a decoder that waits for them. */
  setTables(tables: Uint8Array): IsoEvent[] {
    this.tablesBytes = tables;
    return this.go();
  }

  /** Go on after a pause. */
  go(): IsoEvent[] {
    try {
      while (!this.error && !this.done && this.layers < this.pauseAt) {
        const before = this.layers;
        if (this.run.next().done) {
          this.done = true;
          if (this.at < this.input.length) throw this.wrong("3.4.4", "there are bytes after the end");
        } else if (this.layers === before) {
          if (this.input.ended && !(this.needsTables && !this.tablesBytes)) throw this.truncated();
          break;
        }
      }
    } catch (error) {
      if (error instanceof IsoError) this.fail(error);
      else if (error instanceof RangeError) this.fail(new IsoError("limit", "11.2", this.meter.bytes, error.message));
      else throw error;
    }
    return this.take();
  }

  private take(): IsoEvent[] {
    const events = this.events;
    this.events = [];
    return events;
  }

  private fail(error: IsoError): void {
    this.error = error;
    this.events.push({ type: "error", bytes: error.offset, error });
  }

  private get offset(): number {
    return this.input.dropped + this.at;
  }

  private wrong(clause: string, what: string): IsoError {
    return new IsoError("malformed", clause, this.offset, what);
  }

  private truncated(): IsoError {
    return new IsoError("truncated", "8.3", this.input.dropped + this.input.length, "the file ends too early");
  }

  private readonly bytes: Bytes = {
    byte: (clause) => this.byte(clause),
    varint: (clause) => this.varint(clause),
    error: (clause, what) => this.wrong(clause, what),
  };

  private *need(count: number): Generator<void, void, void> {
    while (this.input.length - this.at < count) yield;
  }

  private *byte(clause: string): Generator<void, number, void> {
    if (this.at >= this.stop) throw this.wrong(clause, "a payload ends too early");
    yield* this.need(1);
    return this.input.data[this.at++]!;
  }

  private *varint(clause: string): Generator<void, number, void> {
    return Number(yield* this.wide(clause));
  }

  /** A varint (3.2.1); one of many bytes as BigInt. */
  private *wide(clause: string): Generator<void, number | bigint, void> {
    let value = 0, big = 0n;
    for (let i = 0; ; i++) {
      const byte = yield* this.byte(clause);
      if ((i === 0 && byte === 128) || (i === 8 && byte >= 128)) throw this.wrong(clause, "a number is not well formed");
      if (i === 7) big = BigInt(value);
      if (i >= 7) big = big * 128n + BigInt(byte & 127);
      else value = value * 128 + (byte & 127);
      if (byte < 128) return i >= 7 ? big : value;
    }
  }

  private *fixed(count: number, clause: string): Generator<void, DataView, void> {
    const view = new DataView(new ArrayBuffer(8));
    for (let i = 0; i < count; i++) view.setUint8(i, yield* this.byte(clause));
    return view;
  }

  /** An isovalue (3.3.4). */
  private *isovalue(kind: number, clause: string): Generator<void, number, void> {
    let c: number;
    if (kind === 0) {
      const u = yield* this.wide(clause);
      if (typeof u === "bigint") c = Number(u % 2n === 0n ? u / 2n : -(u + 1n) / 2n) / 2;
      else c = (u % 2 === 0 ? u / 2 : -(u + 1) / 2) / 2;
    } else if (kind === 1) c = (yield* this.fixed(4, clause)).getFloat32(0);
    else c = (yield* this.fixed(8, clause)).getFloat64(0);
    if (!Number.isFinite(c)) throw this.wrong("3.3.4", "an isovalue that is not finite");
    return c;
  }

  private *readHeader(): Generator<void, Header, void> {
    for (const byte of [0x89, 0x49, 0x53, 0x4f]) {
      if ((yield* this.byte("3.3.1")) !== byte) throw this.wrong("3.3.1", "not an .iso file");
    }
    yield* this.need(2);
    const version = yield* this.byte("3.3.1"), flags = yield* this.byte("3.3.2");
    if ((version & 15) > 0) throw this.wrong("3.3.1", "a later version of the format");
    if ((flags & 3) > 1) throw this.wrong("3.3.2", "an unknown profile");
    const kind = (flags >> 3) & 3, n = 2 + ((flags >> 2) & 1);
    if (kind === 3) throw this.wrong("3.3.4", "an unknown kind of isovalue");
    if (flags & 128) {
      if ((flags & 67) !== 1) throw this.wrong("3.3.2", "flags that exclude one another");
      throw new IsoError("limit", "10", this.offset, "explicit domains are beyond this decoder");
    }
    const shape: number[] = [];
    for (let a = 0; a < (flags & 64 ? 1 : n); a++) {
      const size = yield* this.varint("3.3.3");
      if (size < 1 || size > 2 ** (n === 2 ? 24 : 20)) throw this.wrong("3.3.3", "a size out of range");
      shape.push(size);
    }
    while (shape.length < n) shape.push(shape[0]!);
    const isovalue = yield* this.isovalue(kind, "3.3.4");
    let scale: number | undefined;
    if (flags & 32) {
      const e = yield* this.byte("3.3.5");
      scale = e === 128 ? (yield* this.fixed(8, "3.3.5")).getFloat64(0) : 2 ** (e < 128 ? e : e - 256);
      if (!(scale > 0 && scale < Infinity)) throw this.wrong("3.3.5", "a scale that is not positive and finite");
    }
    return { shape, profile: flags & 1 ? "main" : "baseline", isovalue, scale };
  }

  private tube(isovalue: number, lean: Tube | undefined, framed: boolean): Tube {
    this.meter.take(65536);
    const scaled = this.header!.scale !== undefined;
    return new Tube(this.grid!, this.meter, this.coder, this.tables, isovalue, scaled, lean, framed);
  }

  /** Begin an isovalue; `framed` says whether the one that it leans on is of the frame before. */
  private add(isovalue: number, lean: Contour | undefined, framed = false): void {
    const tube = this.tube(isovalue, lean?.tube, framed);
    tube.mask = this.missing;
    this.contours.push({ tube, progress: new Progress(this.grid!.full, lean?.progress), layers: 0 });
  }

  private *file(): Generator<void, void, void> {
    const header = yield* this.readHeader();
    this.header = header;
    this.grid = new Grid(header.shape);
    this.events.push({ type: "header", bytes: this.offset, header });
    if (header.profile === "main") {
      this.needsTables = true;
      while (!this.tablesBytes) yield;
      this.tables = readTables(this.tablesBytes, header.shape.length);
    }
    this.isovalues.push(header.isovalue);
    this.add(header.isovalue, undefined);
    let cut = false, layers = false, masks = 0;
    for (;;) {
      this.crc = crc32(this.crc, this.input.data, 0, this.at);
      this.input.drop(this.at);
      this.at = 0;
      this.stop = Infinity;
      this.meter.bytes = this.offset;
      yield* this.need(1);
      const head = this.input.data[this.at]!, type = head & 31, ancillary = (head & 128) !== 0;
      const critical = type === 1 || type === 2 || type === 5 || type === 7 || type === 9 || type === 10;
      if (ancillary ? critical : !critical) throw this.wrong("3.5.2", "an unknown critical chunk");
      this.at++;
      const length = yield* this.varint("3.4.2");
      if (critical && cut) throw this.wrong("3.5.4", "a critical chunk behind cut layers");
      if (type === 7 && this.frames.length > 1) throw this.wrong("3.5.7", "a mask behind the first frame");
      if (type === 7 && masks++) throw this.wrong("3.5.6", "a second mask");
      this.stop = this.at + length;
      const payload = this.at, stop = this.stop;
      if (type === 1 || type === 2) {
        let most = Infinity;
        layers = true;
        if (type === 2) {
          cut = true;
          most = yield* this.varint("3.6");
        }
        yield* this.layersOf(most);
      } else if (type === 7) yield* this.mask();
      yield* this.need(stop - this.at);
      this.at = stop;
      const last = (head & 32) !== 0;
      if (head & 64) {
        yield* this.need(4);
        this.check(crc32(0, this.input.data, 0, stop), "3.5.3");
      }
      let crc = 0;
      if (last) {
        crc = crc32(this.crc, this.input.data, 0, this.at);
        yield* this.need(4);
        this.check(crc, "3.4.4");
      }
      const end = this.at, bytes = this.offset;
      this.meter.bytes = bytes;
      if (type === 5) yield* this.another(payload, stop, bytes);
      else if (type === 9) yield* this.frame(payload, stop, bytes, layers);
      else if (type === 10) throw this.wrong("3.5.8", "a domain in a file of a grid");
      else if (type === 7) {
        const mask = this.maskTube!;
        this.missing = { missing: (x, y, z) => mask.infer(x, y, z) === 0 };
        for (const { tube, layers } of this.contours) if (!layers) tube.mask = this.missing;
        this.events.push({ type: "mask", bytes });
      } else if (ancillary) this.ancillary(type, this.input.data.subarray(payload, stop), bytes);
      this.at = end;
      if (last) {
        this.events.push({ type: "end", bytes });
        return;
      }
    }
  }

  private check(crc: number, clause: string): void {
    const d = this.input.data, at = this.at;
    if (((d[at]! << 24) | (d[at + 1]! << 16) | (d[at + 2]! << 8) | d[at + 3]!) >>> 0 !== crc)
      throw this.wrong(clause, "a checksum is wrong");
    this.at += 4;
  }

  private ancillary(type: number, payload: Uint8Array, bytes: number): void {
    if (type === 3) {
      const metadata = readMetadata(payload);
      Object.assign(this.metadata, metadata);
      this.events.push({ type: "metadata", bytes, metadata });
      return;
    }
    const place = type === 8 ? readCoordinates(payload, this.header!.shape) : undefined;
    if (place) {
      this.place = place;
      this.placed = undefined;
      this.events.push({ type: "coordinates", bytes });
      return;
    }
    const promises = type === 6 ? readPromises(payload) : undefined;
    if (promises) this.events.push({ type: "promises", bytes, isovalue: this.contours.length - 1, promises });
    else this.events.push({ type: "skipped", bytes, chunk: type });
  }

  /** The payload of an isovalue chunk (3.5.5). */
  private *another(payload: number, stop: number, bytes: number): Generator<void, void, void> {
    this.at = payload;
    this.stop = stop;
    const { contours } = this;
    if (this.frames.length > 1) throw this.wrong("3.5.7", "an isovalue behind the first frame");
    if (contours.length >= 64) throw this.wrong("11.1", "a file has at most 64 isovalues");
    const head = yield* this.byte("3.5.5"), lean = head & 63;
    if (head >> 6 === 3) throw this.wrong("3.3.4", "an unknown kind of isovalue");
    if (lean > contours.length) throw this.wrong("3.5.5", "an isovalue leans on one that has not come");
    const isovalue = yield* this.isovalue(head >> 6, "3.5.5");
    if (this.at !== stop) throw this.wrong("3.5.5", "bytes behind an isovalue");
    if (contours.some((other) => other.tube.isovalue === isovalue)) throw this.wrong("3.5.5", "an isovalue comes twice");
    this.isovalues.push(isovalue);
    this.add(isovalue, lean ? contours[lean - 1] : undefined);
    const index = contours.length - 1;
    this.events.push({ type: "isovalue", bytes, index, isovalue, lean: lean ? lean - 1 : undefined });
  }

  /** The payload of a chunk of frames (3.5.7); `late` says whether layers came before it. */
  private *frame(payload: number, stop: number, bytes: number, late: boolean): Generator<void, void, void> {
    this.at = payload;
    this.stop = stop;
    if (this.interval === undefined) {
      if (late) throw this.wrong("3.5.7", "a series begins behind layers");
      const interval = yield* this.varint("3.5.7");
      if (this.at !== stop) throw this.wrong("3.5.7", "bytes behind an interval");
      this.interval = interval;
      this.events.push({ type: "series", bytes, interval });
      return;
    }
    if (stop > payload + 1) throw this.wrong("3.5.7", "bytes behind what an isovalue leans on");
    this.next(stop > payload ? yield* this.byte("3.5.7") : undefined, bytes);
  }

  /** Begin the next isovalue of a series; `lean` is the byte that says on what it leans, if there is one. */
  private next(lean: number | undefined, bytes: number): void {
    const { frames, isovalues } = this, all = this.contours.length === isovalues.length;
    const index = all ? 0 : this.contours.length, t = frames.length - (all ? 0 : 1);
    if (lean !== undefined && lean > index) throw this.wrong("3.5.7", "an isovalue leans on one that has not come");
    if (all) {
      for (const { tube, progress } of this.contours) {
        tube.finish();
        progress.lean = undefined;
      }
      frames.push([]);
      this.planned = 0;
      this.meter.frame(!this.keepFrames);
      if (!this.keepFrames && t > 1) frames[t - 2] = undefined;
    }
    const key = this.interval! > 0 && t % this.interval! === 0;
    const before = lean === undefined && !key;
    this.add(isovalues[index]!, before ? frames[t - 1]![index] : lean ? this.contours[lean - 1] : undefined, before);
    this.events.push({
      type: "frame", bytes, frame: t, index, isovalue: isovalues[index]!, lean: before ? "before" : lean ? lean - 1 : undefined,
    });
  }

  private *layersOf(most: number): Generator<void, void, void> {
    if (this.interval !== undefined && this.at < this.stop && this.contours[this.contours.length - 1]!.progress.uniform >= 0) {
      // a base begins the next isovalue, if the present one has had one
      yield* this.need(1);
      if ([0, 4, 5, 7].includes((this.input.data[this.at]! >> 4) & 7)) this.next(undefined, this.offset + 1);
    }
    const contour = this.contours[this.contours.length - 1]!, { tube } = contour;
    contour.layers++;
    const program = yield* readProgram(this.bytes, contour.progress, this.planned);
    this.planned += program.length;
    this.coder.models = tube.models;
    this.coder.begin(this.at, this.stop - this.at, most);
    for (const layer of program) {
      if (!(yield* this.steps(begin(contour, layer)))) break;
      tube.shown = tube.uniform;
      this.layers++;
      contour.layers++;
      this.events.push({
        type: "layer", bytes: this.offset + this.coder.used, kind: layer.kind, number: this.layers,
        frame: this.frames.length - 1, isovalue: this.contours.length - 1, level: tube.uniform,
      });
      yield;
    }
    yield* this.finish();
  }

  private *mask(): Generator<void, void, void> {
    const before = this.meter.usage, tube = (this.maskTube = this.tube(0.5, undefined, false)), level = Math.min(this.grid!.n, this.grid!.full);
    this.coder.models = tube.models;
    this.coder.begin(this.at, this.stop - this.at, Infinity);
    yield* this.steps(new Base(tube, UNIFORM, level).decode());
    tube.shown = tube.uniform;
    const rounds = new Rounds(tube);
    while (tube.uniform < this.grid!.full) {
      yield* this.steps(rounds.uniform());
      tube.shown = tube.uniform;
    }
    yield* this.finish();
    this.meter.setAside(before);
  }

  /** Let a pass run; false if the run is cut in it. */
  private *steps(pass: Pass): Generator<void, boolean, void> {
    while (!pass.next().done) {
      if (this.coder.cut) return false;
      yield;
    }
    return true;
  }

  /** 6.3(2), once the payload is there. */
  private *finish(): Generator<void, void, void> {
    const length = this.stop - this.at;
    yield* this.need(length);
    if (this.coder.shifts + 4 < length) throw this.wrong("6.3", "bytes that no symbol has needed");
  }
}

function begin({ tube, progress }: Contour, layer: Layer): Pass {
  switch (layer.kind) {
    case "base":
      return new Base(tube, UNIFORM, layer.level).decode();
    case "adaptive_base":
      return new Base(tube, ADAPTIVE, layer.level).decode();
    case "leaf_base":
      return new Base(tube, LEAVES, 0).decode();
    case "refine":
      return (tube.rounds ??= new Rounds(tube)).uniform();
    case "adapt":
      return (tube.rounds ??= new Rounds(tube)).adapt(layer.births);
    case "values":
      tube.offsets = undefined;
      return (tube.values ??= new Values(tube, ...progress.bits!)).layer(layer.plane);
    case "offsets":
      return (tube.offsets ??= new Offsets(tube)).layer(layer.Q, layer.q);
  }
}
