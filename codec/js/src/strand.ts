/** What decodes the layers of an isovalue, or of a mask: the passes of this package, or compiled ones. */
import type { Coder } from "./coder.js";
import { ADAPTIVE, Base, LEAVES, UNIFORM } from "./base.js";
import type { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import { Offsets } from "./offsets.js";
import type { Layer } from "./program.js";
import { Rounds } from "./refine.js";
import type { Session } from "./session.js";
import type { Missing, Pass, Tube } from "./tube.js";
import { Values } from "./values.js";

/** A run of symbols (6.1), as far as it has been decoded. */
export interface Run {
  /** Bytes after the last symbol (8.2.3), and bytes that the coder has moved past. */
  readonly used: number;
  readonly shifts: number;
}

export interface Strand {
  /** What has been decoded so far, as it is drawn and told. */
  readonly tube: Tube;
  /** Whether a layer has begun that gives signs. */
  readonly begun: boolean;
  /** Begin a run of `length` bytes at the place `start` of the input. */
  run(start: number, length: number): Run;
  /** Go on with a run that another strand may have had. */
  goOn(run: Run): Run;
  /** Begin a layer; `bits` are those of values above and below, once they are stated. */
  begin(layer: Layer, bits: [number, number] | undefined): Pass;
  /** The layer that was begun is complete: the level of the uniform mesh. */
  completed(): number;
  /** Samples are missing, as a complete mask says; no layer has begun. */
  masked(missing: Missing, mask: Strand): void;
  /** Forget what only further layers need: none will come. */
  rest(): void;
  /** Its frame is no longer kept. */
  drop(): void;
}

/** Models and weights, of one isovalue or `shared` by several (5.9.2). */
export interface Learned {
  shared: boolean;
}

/** Begins the strands of a file. */
export interface Engine {
  /**
   * Models as a file begins with them, or a copy of those that `from` has; `framed` says whether they have a panel (7.18), and
   * `panel` whether that is copied, too.
   */
  learn(from: Learned | undefined, framed: boolean, panel: boolean): Learned;
  /** `lean` is that of the isovalue that this one leans on, if it has had a base; `framed` says whether it is one of the frame before. */
  strand(isovalue: number, lean: Strand | undefined, framed: boolean, learned: Learned): Strand;
  /** Nobody needs them any more. */
  forget(learned: Learned): void;
}

/** Compiled kernels, from `isocodec/kernels`. */
export interface Kernels {
  engine(s: Session, grid: Grid, scale: number | undefined, main: MainProfile | undefined): Engine;
}

/** The strand of a tube that this package's passes fill. */
export class Passes implements Strand {
  constructor(readonly tube: Tube, private readonly coder: Coder) {}

  get begun(): boolean {
    return this.tube.hasBase;
  }

  run(start: number, length: number): Run {
    this.coder.models = this.tube.models;
    this.coder.begin(start, length);
    return this.coder;
  }

  begin(layer: Layer, bits: [number, number] | undefined): Pass {
    const { tube } = this;
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
        return (tube.values ??= new Values(tube, ...bits!)).layer(layer.plane);
      case "offsets":
        return (tube.offsets ??= new Offsets(tube)).layer(layer.Q, layer.q);
    }
  }

  completed(): number {
    return (this.tube.shown = this.tube.uniform);
  }

  masked(missing: Missing): void {
    this.tube.mask = missing;
  }

  goOn(): Run {
    this.coder.models = this.tube.models;
    return this.coder;
  }

  rest(): void {
    this.tube.finish();
  }

  drop(): void {}
}
