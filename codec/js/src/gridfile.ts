/** The chunks of a file of a grid: layers, masks, and what is known of the grid (3.5.4, 3.5.6, 3.5.7). */
import type { Contents } from "./chunks.js";
import { type CoordinateChunk, readCoordinates } from "./coordinates.js";
import type { Header } from "./events.js";
import { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import { Models, type Weighed } from "./models.js";
import { type Layer, Progress, readProgram } from "./program.js";
import type { Steps } from "./reader.js";
import { Series } from "./series.js";
import type { Session } from "./session.js";
import { type Engine, type Kernels, type Learned, Passes, type Strand } from "./strand.js";
import { type Missing, Tube } from "./tube.js";

/** One isovalue of a file. */
export interface Contour {
  isovalue: number;
  /** What it leans on; until its frame has ended. */
  lean: Contour | undefined;
  /** Whether that is of the frame before. */
  framed: boolean;
  family: Family;
  /** What decodes its layers, from the first one on: a file may have thousands of isovalues without any. */
  strand: Strand | undefined;
  progress: Progress;
}

/**
 * The models of an isovalue, and of those that began to lean on it before it had a layer (5.9.2). They are made for the first
 * layer of one of these.
 */
interface Family {
  learned: Learned | undefined;
  /** Models that they begin as a copy of. */
  from: Learned | undefined;
  framed: boolean;
  /** Whether the panel is copied, too. */
  panel: boolean;
  shared: boolean;
}

/** The models of an isovalue that leans on another one, or on none. */
function familyOf(lean: Contour | undefined, framed: boolean): Family {
  if (!lean) return { learned: undefined, from: undefined, framed, panel: false, shared: false };
  const { family, family: { learned, from, panel } } = lean;
  if (framed || lean.strand) return { learned: undefined, from: learned ?? from, framed, panel: framed && family.framed && (panel || learned !== undefined), shared: false };
  family.shared = true;
  if (learned) learned.shared = true;
  return family;
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
      begin: (isovalue, lean, framed) => ({
        isovalue, lean, framed, family: familyOf(lean, framed), strand: undefined, progress: new Progress(this.grid.full, lean?.progress),
      }),
      rest: ({ strand }) => strand?.rest(),
      finish: (contour) => {
        contour.strand?.rest();
        contour.lean = contour.progress.lean = undefined;
      },
      drop: (contours) => this.drop(contours),
    });
    this.series.first(header.isovalue);
  }

  /** Periodic axes of a mapped grid (3.7.4(1)). */
  get periodic(): readonly number[] {
    return this.place?.periodic ?? [];
  }

  learn(from: Learned | undefined, framed: boolean, panel: boolean): Learned {
    const { main, grid } = this, other = from as Weighed | undefined;
    this.s.meter.take(main ? 1 << 17 : 1 << 16);
    return main ? main.learn(grid.n, other, framed, panel) : { shared: false, models: new Models(other?.models) } as Weighed;
  }

  strand(isovalue: number, lean: Strand | undefined, framed: boolean, learned: Learned): Strand {
    const { meter, coder } = this.s;
    return new Passes(new Tube(this.grid, meter, coder, this.main, isovalue, this.header.scale, learned as Weighed, lean?.tube, framed), coder);
  }

  forget(): void {}

  /** The strand of an isovalue whose next layer begins. */
  private ready(contour: Contour): Strand {
    return (contour.strand ??= this.started(contour));
  }

  private started({ isovalue, lean, framed, family }: Contour): Strand {
    const learned = (family.learned ??= this.engine.learn(family.from, family.framed, family.panel)), on = lean?.strand;
    learned.shared = family.shared;
    family.from = undefined;
    const strand = this.engine.strand(isovalue, on?.begun ? on : undefined, framed, learned);
    if (this.missing) strand.masked(this.missing, this.mask!);
    return strand;
  }

  /** Isovalues get their first layer that have models which others have changed: those that begin with a copy of them get it now. */
  private part(turn: readonly Contour[]): void {
    for (const { strand, family: { learned } } of turn) {
      if (strand || !learned) continue;
      let copy: Learned | undefined;
      for (const { family } of this.series.contours)
        if (family.from === learned) family.from = copy ??= this.engine.learn(learned, false, false);
    }
  }

  /** Models of frames that are no longer kept, which others will begin with a copy of. */
  private readonly held = new Set<Learned>();

  /** Let go of a frame, but of models that isovalues of the one after it begin with. */
  private drop(contours: readonly Contour[]): void {
    const { engine, held, series } = this, wanted = new Set(series.frames[series.frames.length - 2]!.map(({ family }) => family.from));
    for (const { strand, family: { learned } } of contours) {
      strand?.drop();
      if (learned) held.add(learned);
    }
    for (const learned of held) {
      if (wanted.has(learned)) continue;
      engine.forget(learned);
      held.delete(learned);
    }
  }

  expect(type: number): void {
    if (type !== 7) return;
    if (this.series.frames.length > 1) throw this.s.r.error("3.5.7", "a mask behind the first frame");
    if (this.mask) throw this.s.r.error("3.5.6", "a second mask");
  }

  *arrive(type: number): Steps {
    if (type === 7) yield* this.readMask();
    if (type !== 1) return;
    this.series.layered = true;
    yield* this.layers();
  }

  *take(type: number, payload: number, stop: number, bytes: number): Steps {
    const { series, s } = this;
    if (type === 5) yield* series.another(stop, bytes);
    else if (type === 9) yield* series.frame(payload, stop, bytes);
    else if (type === 13) yield* series.series(stop, bytes);
    else if (type === 11) yield* series.turns(stop, bytes);
    else if (type === 10) throw s.r.error("3.5.8", "a domain in a file of a grid");
    else if (type === 7) {
      const { tube } = this.mask!;
      this.missing = { missing: (x: number, y: number, z: number) => tube.infer(x, y, z) === 0 };
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

  private *layers(): Steps {
    const { series, s, s: { r } } = this;
    const [first, count] = series.turn, turn = series.contours.slice(first, first + count), programs = yield* this.programs(turn);
    for (let i = first; i < first + count; i++) series.fresh.add(i);
    this.part(turn);
    let run = this.ready(turn[0]!).run(r.at, r.stop - r.at);
    for (const k of programs[0]!.keys()) {
      for (const [i, contour] of turn.entries()) {
        const strand = this.ready(contour), layer = programs[i]![k]!;
        run = strand.goOn(run);
        yield* strand.begin(layer, contour.progress.bits);
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
    const mask = (this.mask = this.engine.strand(0.5, undefined, false, this.engine.learn(undefined, false, false))), run = mask.run(r.at, r.stop - r.at);
    const level = Math.min(grid.n, grid.full);
    for (let done = level; done <= grid.full; done++) {
      yield* mask.begin(done === level ? { kind: "base", level } : { kind: "refine" }, undefined);
      mask.completed();
    }
    yield* s.finish(run);
    meter.setAside(before);
  }
}
