/** The chunks of a file of a grid: layers, masks, and what is known of the grid (3.5.4, 3.5.6, 3.5.7). */
import type { Contents } from "./chunks.js";
import { type CoordinateChunk, readCoordinates } from "./coordinates.js";
import type { Header } from "./events.js";
import { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import { type Layer, Progress, readProgram } from "./program.js";
import type { Steps } from "./reader.js";
import { Series } from "./series.js";
import type { Session } from "./session.js";
import { type Engine, type Kernels, Passes, type Run, type Strand } from "./strand.js";
import { type Missing, type Pass, Tube } from "./tube.js";

/** One isovalue of a file. */
export interface Contour {
  isovalue: number;
  lean: Contour | undefined;
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
    this.engine = kernels?.engine(s, this.grid, header.scale, main) ?? this;
    this.series = new Series<Contour>(s, {
      begin: (isovalue, lean, framed) => {
        const strand = this.engine.strand(isovalue, lean?.strand, framed);
        if (this.missing) strand.masked(this.missing, this.mask!);
        return { isovalue, lean: framed ? undefined : lean, strand, progress: new Progress(this.grid.full, lean?.progress) };
      },
      rest: ({ strand }) => strand.rest(),
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

  strand(isovalue: number, lean: Strand | undefined, framed: boolean, own?: Strand): Strand {
    const { meter, coder } = this.s;
    meter.take(65536);
    return new Passes(new Tube(this.grid, meter, coder, this.main, isovalue, this.header.scale, lean?.tube, framed, own?.tube), coder);
  }

  /** The strand of an isovalue whose next layer begins; made anew if what it leans on has begun since. */
  private ready(contour: Contour): Strand {
    const { strand, lean, isovalue } = contour;
    if (strand.begun || (!strand.resting && (!lean || strand.leans || !lean.strand.begun))) return strand;
    contour.strand = this.engine.strand(isovalue, lean?.strand, false, strand);
    if (this.missing) contour.strand.masked(this.missing, this.mask!);
    return contour.strand;
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
    else if (type === 13) yield* series.series(stop, bytes);
    else if (type === 11) yield* series.turns(stop, bytes);
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
    const [first, count] = series.turn, turn = series.contours.slice(first, first + count), programs = yield* this.programs(turn);
    for (let i = first; i < first + count; i++) series.fresh.add(i);
    let run = this.ready(turn[0]!).run(r.at, r.stop - r.at, most);
    decoding: for (const k of programs[0]!.keys()) {
      for (const [i, contour] of turn.entries()) {
        const strand = this.ready(contour), layer = programs[i]![k]!;
        run = strand.goOn(run);
        if (!(yield* this.steps(strand.begin(layer, contour.progress.bits), run))) break decoding;
        s.layer(r.offset + run.used, layer.kind, series.frames.length - 1, first + i, strand.completed());
        yield;
      }
    }
    yield* s.finish(run);
  }

  /** The program of a chunk, as it applies to each isovalue of its turn (3.5.9). */
  private *programs(turn: Contour[]): Steps<Layer[][]> {
    const { s, s: { r } } = this, start = r.at, found: Layer[][] = [];
    let end = 0;
    for (const { progress } of turn) {
      progress.begun = true;
      r.at = start;
      const program = yield* readProgram(r, progress, s.planned);
      if (found.length && (r.at !== end || program.length !== found[0]!.length)) throw r.error("3.5.9", "a program differs among the isovalues of a turn");
      end = r.at;
      s.planned += program.length;
      found.push(program);
    }
    return found;
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
