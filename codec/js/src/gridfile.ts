/** The chunks of a file of a grid: layers, masks, and what is known of the grid (3.5.4, 3.5.6, 3.5.7). */
import { ADAPTIVE, Base, LEAVES, UNIFORM } from "./base.js";
import type { Contents } from "./chunks.js";
import { type CoordinateChunk, readCoordinates } from "./coordinates.js";
import type { Header } from "./events.js";
import { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import { Offsets } from "./offsets.js";
import { type Layer, Progress, readProgram } from "./program.js";
import type { Steps } from "./reader.js";
import { Rounds } from "./refine.js";
import { Series } from "./series.js";
import type { Session } from "./session.js";
import { type Missing, type Pass, Tube } from "./tube.js";
import { Values } from "./values.js";

/** One isovalue of a file. */
export interface Contour {
  isovalue: number;
  tube: Tube;
  progress: Progress;
}

export class GridFile implements Contents {
  readonly grid: Grid;
  readonly series: Series<Contour>;
  /** State of the mask from its first symbol on; `missing` says whether it is complete. */
  maskTube: Tube | undefined;
  missing: Missing | undefined;
  /** The coordinates of a mapped grid, as they came. */
  place: CoordinateChunk | undefined;

  constructor(private readonly s: Session, readonly header: Header, private readonly main: MainProfile | undefined) {
    this.grid = new Grid(header.shape);
    this.series = new Series<Contour>(s, {
      begin: (isovalue, lean, framed) => {
        const tube = this.tube(isovalue, lean?.tube, framed);
        tube.mask = this.missing;
        return { isovalue, tube, progress: new Progress(this.grid.full, lean?.progress) };
      },
      finish: ({ tube, progress }) => {
        tube.finish();
        progress.lean = undefined;
      },
    });
    this.series.first(header.isovalue);
  }

  /** Periodic axes of a mapped grid (3.7.4(1)). */
  get periodic(): readonly number[] {
    return this.place?.periodic ?? [];
  }

  private tube(isovalue: number, lean: Tube | undefined, framed: boolean): Tube {
    const { meter, coder } = this.s;
    meter.take(65536);
    return new Tube(this.grid, meter, coder, this.main, isovalue, this.header.scale !== undefined, lean, framed);
  }

  expect(type: number): void {
    if (type !== 7) return;
    if (this.series.frames.length > 1) throw this.s.r.error("3.5.7", "a mask behind the first frame");
    if (this.maskTube) throw this.s.r.error("3.5.6", "a second mask");
  }

  *arrive(type: number): Steps {
    if (type === 7) yield* this.mask();
    if (type > 2) return;
    this.series.layered = true;
    yield* this.layers(type === 2 ? yield* this.s.r.varint("3.6") : Infinity);
  }

  *take(type: number, payload: number, stop: number, bytes: number): Steps {
    const { series, s } = this;
    if (type === 5) yield* series.another(stop, bytes);
    else if (type === 9) yield* series.frame(payload, stop, bytes);
    else if (type === 10) throw s.r.error("3.5.8", "a domain in a file of a grid");
    else if (type === 7) {
      const mask = this.maskTube!;
      this.missing = { missing: (x, y, z) => mask.infer(x, y, z) === 0 };
      for (const { tube, progress } of series.contours) if (!progress.begun) tube.mask = this.missing;
      s.emit({ type: "mask", bytes });
    }
  }

  note(type: number, payload: Uint8Array, bytes: number): boolean {
    const place = type === 8 ? readCoordinates(payload, this.header.shape) : undefined;
    if (!place) return false;
    this.place = place;
    this.s.emit({ type: "coordinates", bytes });
    return true;
  }

  private *layers(most: number): Steps {
    const { series, s, s: { r, coder } } = this;
    if (series.begun && r.at < r.stop && series.last.progress.uniform >= 0) {
      // a base begins the next isovalue, if the present one has had one
      yield* r.need(1);
      if ([0, 4, 5, 7].includes((r.input.data[r.at]! >> 4) & 7)) series.next(undefined, r.offset + 1);
    }
    const contour = series.last, { tube, progress } = contour;
    progress.begun = true;
    const program = yield* readProgram(r, progress, s.planned);
    s.planned += program.length;
    coder.models = tube.models;
    coder.begin(r.at, r.stop - r.at, most);
    for (const layer of program) {
      if (!(yield* this.steps(begin(contour, layer)))) break;
      tube.shown = tube.uniform;
      s.layer(r.offset + coder.used, layer.kind, series.frames.length - 1, series.contours.length - 1, tube.uniform);
      yield;
    }
    yield* s.finish();
  }

  private *mask(): Steps {
    const { grid, s, s: { r, meter, coder } } = this, before = meter.usage;
    const tube = (this.maskTube = this.tube(0.5, undefined, false));
    coder.models = tube.models;
    coder.begin(r.at, r.stop - r.at, Infinity);
    yield* this.steps(new Base(tube, UNIFORM, Math.min(grid.n, grid.full)).decode());
    tube.shown = tube.uniform;
    const rounds = new Rounds(tube);
    while (tube.uniform < grid.full) {
      yield* this.steps(rounds.uniform());
      tube.shown = tube.uniform;
    }
    yield* s.finish();
    meter.setAside(before);
  }

  /** Let a pass run; false if the run is cut in it. */
  private *steps(pass: Pass): Steps<boolean> {
    while (!pass.next().done) {
      if (this.s.coder.cut) return false;
      yield;
    }
    return true;
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
