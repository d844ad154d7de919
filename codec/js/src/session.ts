/** What all that reads a file shares. */
import { Coder } from "./coder.js";
import { Meter, type Limits } from "./errors.js";
import type { IsoEvent, LayerKind } from "./events.js";
import { Reader, type Steps } from "./reader.js";
import type { Run } from "./strand.js";

export class Session {
  readonly r = new Reader();
  readonly meter: Meter;
  readonly coder: Coder;
  events: IsoEvent[] = [];
  /** Layers that are complete, of all isovalues. */
  layers = 0;
  /** Layers of the frame that have been stated (11.1). */
  planned = 0;

  constructor(limits: Limits, readonly keepFrames: boolean) {
    this.meter = new Meter(limits);
    this.coder = new Coder(this.r.input, this.meter);
  }

  emit(event: IsoEvent): void {
    this.events.push(event);
  }

  /** A layer is complete. */
  layer(bytes: number, kind: LayerKind, frame: number, isovalue: number, level: number): void {
    this.layers++;
    this.emit({ type: "layer", bytes, kind, number: this.layers, frame, isovalue, level });
  }

  /** 6.3(2), once the payload is there. */
  *finish(run: Run): Steps {
    const { r } = this, length = r.stop - r.at;
    yield* r.need(length);
    if (run.shifts + 4 < length) throw r.error("6.3", "bytes that no symbol has needed");
  }
}
