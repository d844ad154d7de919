/** Errors of decoding (clauses 1.2(3), 8.3 and 11.2). */

/**
 * What went wrong: the file violates the specification, ends too early, or needs more than the limits allow; or the mesh
 * that was given is not the one that the file needs (10.1.2(1)).
 */
export type ErrorKind = "malformed" | "truncated" | "limit" | "mesh";

/** A file that cannot be decoded any further; what was decoded before stays available. */
export class IsoError extends Error {
  override name = "IsoError";
  constructor(
    readonly kind: ErrorKind,
    /** The clause of the specification that is violated, for example "3.4.4". */
    readonly clause: string,
    /** Byte of the file where that was found. */
    readonly offset: number,
    what: string,
  ) {
    super(`${what} (clause ${clause}, byte ${offset})`);
  }
}

/** Bounds on what a file may ask for. */
export interface Limits {
  /** Bytes of memory that the decoded state may take. */
  memory: number;
  /** Symbols, or steps that take as long; see `workPerByte`. */
  work: number;
  /** What each byte of the file adds to `work`. */
  workPerByte: number;
  /** Known vertices of all isovalues. */
  vertices: number;
  /** Bytes of the file. */
  bytes: number;
}

export const LIMITS: Readonly<Limits> = {
  memory: 2 ** 30,
  work: 2 ** 23,
  workPerByte: 512,
  vertices: 2 ** 27,
  bytes: 2 ** 31 - 2 ** 16,
};

type Usage = [memory: number, vertices: number, blocks: number];

/** Counts what has been used of the limits. Steps are sixteenths of a symbol. */
export class Meter {
  memory = 0;
  steps = 0;
  vertices = 0;
  blocks = 0;
  bytes = 0;
  constructor(readonly limits: Limits) {}

  /** More is needed than a limit allows. */
  stop(what: string): never {
    throw new IsoError("limit", "11.2", this.bytes, `the file needs more than the limit of ${what}`);
  }

  /** What is being decoded contradicts the specification, or is wrong in another way. */
  wrong(clause: string, what: string, kind: IsoError["kind"] = "malformed"): IsoError {
    return new IsoError(kind, clause, this.bytes, what);
  }

  /** One that nothing stops. */
  static without(): Meter {
    const meter = new Meter({ memory: Infinity, work: Infinity, workPerByte: 0, vertices: Infinity, bytes: Infinity });
    meter.vertices = Infinity;
    return meter;
  }

  /** Take `bytes` more memory; call before it is allocated. */
  take(bytes: number): void {
    this.memory += bytes;
    if (this.memory > this.limits.memory) this.stop("memory");
  }

  /** Count `steps` sixteenths of a symbol's work. */
  step(steps: number): void {
    this.steps += steps;
    if (this.steps > 16 * (this.limits.work + this.limits.workPerByte * this.bytes)) this.stop("work");
  }

  /** One more block of marks: next to no vertices in each are no file of an ordinary field (11.2). */
  block(): void {
    if (++this.blocks > 65536 && 4 * this.blocks > this.vertices) this.stop("blocks with few vertices");
  }

  /** What had been used when the present frame began, and what the one before it has used. */
  private began: Usage = [0, 0, 0];
  private before: Usage = [0, 0, 0];

  /** Memory, vertices and blocks that are used. */
  get usage(): Usage {
    return [this.memory, this.vertices, this.blocks];
  }

  /** What has been used since is no frame's, but stays. */
  setAside(since: Usage): void {
    this.usage.forEach((x, i) => (this.began[i]! += x - since[i]!));
  }

  /** A frame begins; with `drop` the state of the last but one goes (3.5.7(5)). */
  frame(drop: boolean): void {
    const used = this.usage.map((x, i) => x - this.began[i]!) as Usage;
    if (drop) {
      this.memory -= this.before[0];
      this.vertices -= this.before[1];
      this.blocks -= this.before[2];
    }
    this.before = used;
    this.began = this.usage;
  }

  vertex(): void {
    if (++this.vertices > this.limits.vertices) this.stop("vertices");
  }
}
