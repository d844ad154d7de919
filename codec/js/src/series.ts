/** Isovalues of a file, and those of the frames of a series (3.5.5, 3.5.7). */
import type { IsoError } from "./errors.js";
import type { Session } from "./session.js";
import type { Steps } from "./reader.js";

/** One isovalue of a file, of whatever domain. */
export interface Isovalue {
  readonly isovalue: number;
}

/** How the isovalues of a domain begin, and what of them goes when the next frame begins. */
export interface Beginnings<T extends Isovalue> {
  /** `framed` says whether the one that it leans on is of the frame before. */
  begin(isovalue: number, lean: T | undefined, framed: boolean): T;
  /** No further layers come of an isovalue; others may lean on it. */
  rest(contour: T): void;
  finish(contour: T): void;
  /** The contours of a frame that is no longer kept; the one after it is complete. */
  drop?(contours: readonly T[]): void;
}

export class Series<T extends Isovalue> {
  /** Isovalues by frame; of a file that is no series there is one frame. Those no longer kept are undefined. */
  readonly frames: (T[] | undefined)[] = [[]];
  /** The interval of key frames, undefined if the file is no series so far. */
  private interval: number | undefined;
  /** Isovalues of a frame. */
  private readonly isovalues: number[] = [];
  private readonly known = new Set<number>();
  /** Whether a chunk of layers has come. */
  layered = false;
  /** The isovalues that layers belong to (3.5.9): the first one and how many. */
  turn: [first: number, count: number] = [0, 1];
  private turned = false;
  /** Isovalues that have had layers since another one began, and those that get no more. */
  readonly fresh = new Set<number>();
  private readonly closed = new Set<number>();

  constructor(private readonly s: Session, private readonly beginnings: Beginnings<T>) {}

  /** Isovalues of the present frame. */
  get contours(): T[] {
    return this.frames[this.frames.length - 1]!;
  }

  /** The isovalue that layers belong to. */
  get last(): T {
    return this.contours[this.contours.length - 1]!;
  }

  private add(isovalue: number, lean: T | undefined, framed: boolean): void {
    // one without layers may get some in a turn: it begins anew then
    const before = this.contours.length - 1;
    if (before >= 0 && !this.fresh.has(before)) this.beginnings.rest(this.contours[before]!);
    for (const index of this.fresh) {
      this.closed.add(index);
      this.beginnings.rest(this.contours[index]!);
    }
    this.fresh.clear();
    this.turn = [this.contours.length, 1];
    this.contours.push(this.beginnings.begin(isovalue, lean, framed));
  }

  /** Isovalue 0 of the first frame. */
  first(isovalue: number): void {
    this.isovalues.push(isovalue);
    this.known.add(isovalue);
    this.add(isovalue, undefined, false);
  }

  /** The payload of an isovalue chunk (3.5.5). */
  *another(stop: number, bytes: number): Steps {
    const { contours, s, s: { r } } = this;
    if (this.frames.length > 1) throw r.error("3.5.7", "an isovalue behind the first frame");
    if (contours.length >= 4096) throw r.error("11.1", "a file has at most 4096 isovalues");
    const head = yield* r.byte("3.5.5"), near = head & 63, back = near < 63 ? near : yield* r.varint("3.5.5");
    if (back > contours.length) throw r.error("3.5.5", "an isovalue leans on one that has not come");
    const isovalue = yield* r.isovalue(head >> 6, "3.5.5");
    if (r.at !== stop) throw r.error("3.5.5", "bytes behind an isovalue");
    if (this.known.has(isovalue)) throw r.error("3.5.5", "an isovalue comes twice");
    const lean = back ? contours.length - back : undefined;
    this.isovalues.push(isovalue);
    this.known.add(isovalue);
    this.add(isovalue, lean === undefined ? undefined : contours[lean], false);
    s.emit({ type: "isovalue", bytes, index: contours.length - 1, isovalue, lean });
  }

  /** The payload of a turn (3.5.9). */
  *turns(stop: number, bytes: number): Steps {
    const { s, s: { r } } = this, wrong = (what: string): IsoError => r.error("3.5.9", what);
    if (this.interval !== undefined) throw wrong("a turn in a series");
    const first = yield* r.varint("3.5.9"), count = yield* r.varint("3.5.9");
    if (r.at !== stop || !count || first + count > this.contours.length) throw wrong("a turn of isovalues that have not come");
    for (const index of this.closed) if (index >= first && index < first + count) throw wrong("a turn of an isovalue that has ended");
    this.turn = [first, count];
    this.turned = true;
    s.emit({ type: "turn", bytes, first, count });
  }

  /** The payload of a chunk of series (3.5.7(1)). */
  *series(stop: number, bytes: number): Steps {
    const { s, s: { r } } = this;
    if (this.interval !== undefined) throw r.error("3.5.7", "a series begins twice");
    if (this.layered || this.turned) throw r.error("3.5.7", "a series begins behind layers");
    const interval = yield* r.varint("3.5.7");
    if (r.at !== stop) throw r.error("3.5.7", "bytes behind an interval");
    this.interval = interval;
    s.emit({ type: "series", bytes, interval });
  }

  /** The payload of a chunk of frames (3.5.7(3)); it may be a number that says on what the isovalue leans. */
  *frame(payload: number, stop: number, bytes: number): Steps {
    const { frames, isovalues, s, s: { r } } = this;
    if (this.interval === undefined) throw r.error("3.5.7", "a frame of a file that is no series");
    const back = stop > payload ? yield* r.varint("3.5.7") : undefined;
    if (r.at !== stop) throw r.error("3.5.7", "bytes behind an isovalue");
    const all = this.contours.length === isovalues.length;
    const index = all ? 0 : this.contours.length, frame = frames.length - (all ? 0 : 1);
    if (back !== undefined && back > index) throw s.r.error("3.5.7", "an isovalue leans on one that has not come");
    if (all) {
      this.contours.forEach((contour) => this.beginnings.finish(contour));
      this.fresh.clear();
      frames.push([]);
      s.planned = 0;
      s.meter.frame(!s.keepFrames);
      if (!s.keepFrames && frame > 1) {
        this.beginnings.drop?.(frames[frame - 2]!);
        frames[frame - 2] = undefined;
      }
    }
    const key = this.interval > 0 && frame % this.interval === 0, before = back === undefined && !key;
    const lean = back ? index - back : undefined;
    const isovalue = isovalues[index]!;
    this.add(isovalue, before ? frames[frame - 1]![index] : lean === undefined ? undefined : this.contours[lean], before);
    s.emit({ type: "frame", bytes, frame, index, isovalue, lean: before ? "before" : lean });
  }
}
