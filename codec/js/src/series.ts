/** Isovalues of a file, and those of the frames of a series (3.5.5, 3.5.7). */
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
  finish(contour: T): void;
}

export class Series<T extends Isovalue> {
  /** Isovalues by frame; of a file that is no series there is one frame. Those no longer kept are undefined. */
  readonly frames: (T[] | undefined)[] = [[]];
  /** The interval of key frames, undefined if the file is no series so far. */
  private interval: number | undefined;
  /** Isovalues of a frame. */
  private readonly isovalues: number[] = [];
  /** Whether a chunk of layers has come. */
  layered = false;

  constructor(private readonly s: Session, private readonly beginnings: Beginnings<T>) {}

  /** Isovalues of the present frame. */
  get contours(): T[] {
    return this.frames[this.frames.length - 1]!;
  }

  /** The isovalue that layers belong to. */
  get last(): T {
    return this.contours[this.contours.length - 1]!;
  }

  get begun(): boolean {
    return this.interval !== undefined;
  }

  private add(isovalue: number, lean: T | undefined, framed: boolean): void {
    this.contours.push(this.beginnings.begin(isovalue, lean, framed));
  }

  /** Isovalue 0 of the first frame. */
  first(isovalue: number): void {
    this.isovalues.push(isovalue);
    this.add(isovalue, undefined, false);
  }

  /** The payload of an isovalue chunk (3.5.5). */
  *another(stop: number, bytes: number): Steps {
    const { contours, s, s: { r } } = this;
    if (this.frames.length > 1) throw r.error("3.5.7", "an isovalue behind the first frame");
    if (contours.length >= 64) throw r.error("11.1", "a file has at most 64 isovalues");
    const head = yield* r.byte("3.5.5"), lean = head & 63;
    if (head >> 6 === 3) throw r.error("3.3.4", "an unknown kind of isovalue");
    if (lean > contours.length) throw r.error("3.5.5", "an isovalue leans on one that has not come");
    const isovalue = yield* r.isovalue(head >> 6, "3.5.5");
    if (r.at !== stop) throw r.error("3.5.5", "bytes behind an isovalue");
    if (contours.some((other) => other.isovalue === isovalue)) throw r.error("3.5.5", "an isovalue comes twice");
    this.isovalues.push(isovalue);
    this.add(isovalue, lean ? contours[lean - 1] : undefined, false);
    s.emit({ type: "isovalue", bytes, index: contours.length - 1, isovalue, lean: lean ? lean - 1 : undefined });
  }

  /** The payload of a chunk of frames (3.5.7). */
  *frame(payload: number, stop: number, bytes: number): Steps {
    const { s, s: { r } } = this;
    if (this.interval === undefined) {
      if (this.layered) throw r.error("3.5.7", "a series begins behind layers");
      const interval = yield* r.varint("3.5.7");
      if (r.at !== stop) throw r.error("3.5.7", "bytes behind an interval");
      this.interval = interval;
      s.emit({ type: "series", bytes, interval });
      return;
    }
    if (stop > payload + 1) throw r.error("3.5.7", "bytes behind an isovalue");
    this.next(stop > payload ? yield* r.byte("3.5.7") : undefined, bytes);
  }

  /** Begin the next isovalue of a series; `lean` is the byte that says on what it leans, if there is one. */
  next(lean: number | undefined, bytes: number): void {
    const { frames, isovalues, s } = this, all = this.contours.length === isovalues.length;
    const index = all ? 0 : this.contours.length, frame = frames.length - (all ? 0 : 1);
    if (lean !== undefined && lean > index) throw s.r.error("3.5.7", "an isovalue leans on one that has not come");
    if (all) {
      this.contours.forEach((contour) => this.beginnings.finish(contour));
      frames.push([]);
      s.planned = 0;
      s.meter.frame(!s.keepFrames);
      if (!s.keepFrames && frame > 1) frames[frame - 2] = undefined;
    }
    const key = this.interval! > 0 && frame % this.interval! === 0, before = lean === undefined && !key;
    const isovalue = isovalues[index]!;
    this.add(isovalue, before ? frames[frame - 1]![index] : lean ? this.contours[lean - 1] : undefined, before);
    s.emit({ type: "frame", bytes, frame, index, isovalue, lean: before ? "before" : lean ? lean - 1 : undefined });
  }
}
