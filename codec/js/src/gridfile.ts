/** The chunks of a file of a grid: layers, masks, and what is known of the grid (3.5.4, 3.5.6, 3.5.7). */
import type { Contents } from "./chunks.js";
import { type CoordinateChunk, readCoordinates } from "./coordinates.js";
import type { Header } from "./events.js";
import { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import { Progress, readProgram } from "./program.js";
import type { Steps } from "./reader.js";
import { Series } from "./series.js";
import type { Session } from "./session.js";
import { type Engine, type Kernels, Passes, type Run, type Strand } from "./strand.js";
import { type Missing, type Pass, Tube } from "./tube.js";

/** One isovalue of a file. */
export interface Contour {
  isovalue: number;
  strand: Strand;
  progress: Progress;
}

export class GridFile implements Contents, Engine {
  readonly grid: Grid;
  readonly series: Series<Contour>;
  /** The mask from its first symbol on; `missing` says whether it is complete. */
  mask: Strand | undefined;
  missing: Missing | undefined;
  /** The coordinates of a mapped grid, as they came. */
  place: CoordinateChunk | undefined;

  private readonly engine: Engine;

  constructor(private readonly s: Session, readonly header: Header, private readonly main: MainProfile | undefined, kernels?: Kernels) {
    this.grid = new Grid(header.shape);
    this.engine = kernels?.engine(s, this.grid, header.scale !== undefined, main) ?? this;
    this.series = new Series<Contour>(s, {
      begin: (isovalue, lean, framed) => {
        const strand = this.engine.strand(isovalue, lean?.strand, framed);
        if (this.missing) strand.masked(this.missing, this.mask!);
        return { isovalue, strand, progress: new Progress(this.grid.full, lean?.progress) };
      },
      finish: ({ strand, progress }) => {
        strand.finish();
        progress.lean = undefined;
      },
    });
    this.series.first(header.isovalue);
  }

  /** Periodic axes of a mapped grid (3.7.4(1)). */
  get periodic(): readonly number[] {
    return this.place?.periodic ?? [];
  }

  strand(isovalue: number, lean: Strand | undefined, framed: boolean): Strand {
    const { meter, coder } = this.s;
    meter.take(65536);
    return new Passes(new Tube(this.grid, meter, coder, this.main, isovalue, this.header.scale !== undefined, lean?.tube, framed), coder);
  }

  expect(type: number): void {
    if (type !== 7) return;
    if (this.series.frames.length > 1) throw this.s.r.error("3.5.7", "a mask behind the first frame");
    if (this.mask) throw this.s.r.error("3.5.6", "a second mask");
  }

  *arrive(type: number): Steps {
    if (type === 7) yield* this.readMask();
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
      const mask = this.mask!, { tube } = mask;
      const missing = (this.missing = { missing: (x: number, y: number, z: number) => tube.infer(x, y, z) === 0 });
      for (const { strand, progress } of series.contours) if (!progress.begun) strand.masked(missing, mask);
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
    const { series, s, s: { r } } = this;
    if (series.begun && r.at < r.stop && series.last.progress.uniform >= 0) {
      // a base begins the next isovalue, if the present one has had one
      yield* r.need(1);
      if ([0, 4, 5, 7].includes((r.input.data[r.at]! >> 4) & 7)) series.next(undefined, r.offset + 1);
    }
    const { strand, progress } = series.last;
    progress.begun = true;
    const program = yield* readProgram(r, progress, s.planned);
    s.planned += program.length;
    const run = strand.run(r.at, r.stop - r.at, most);
    for (const layer of program) {
      if (!(yield* this.steps(strand.begin(layer, progress.bits), run))) break;
      const level = strand.completed();
      s.layer(r.offset + run.used, layer.kind, series.frames.length - 1, series.contours.length - 1, level);
      yield;
    }
    yield* s.finish(run);
  }

  private *readMask(): Steps {
    const { grid, s, s: { r, meter } } = this, before = meter.usage;
    const mask = (this.mask = this.engine.strand(0.5, undefined, false)), run = mask.run(r.at, r.stop - r.at, Infinity);
    const level = Math.min(grid.n, grid.full);
    for (let done = level; done <= grid.full; done++) {
      yield* this.steps(mask.begin(done === level ? { kind: "base", level } : { kind: "refine" }, undefined), run);
      mask.completed();
    }
    yield* s.finish(run);
    meter.setAside(before);
  }

  /** Let a pass run; false if the run is cut in it. */
  private *steps(pass: Pass, run: Run): Steps<boolean> {
    while (!pass.next().done) {
      if (run.cut) return false;
      yield;
    }
    return true;
  }
}
