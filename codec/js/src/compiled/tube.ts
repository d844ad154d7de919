/** The strand of an isovalue whose passes are compiled: order of the layers, what they leave behind. */
import type { Input } from "../coder.js";
import { type IsoError, Meter } from "../errors.js";
import type { Grid } from "../grid.js";
import { coordinates, places, sorted } from "../order.js";
import type { Layer } from "../program.js";
import type { Shift } from "../shift.js";
import type { Run, Strand } from "../strand.js";
import type { Missing, Pass, Tube } from "../tube.js";
import type { Coder, Coders } from "./coder.js";
import { Estimates } from "./estimates.js";
import type { Arr, Machine } from "./machine.js";
import { numbered, type Numbers, release as releaseNumbers } from "./numbers.js";
import { Reflection } from "./reflection.js";
import { softened } from "./softened.js";
import { type CounterNames, FRAME, type Lean, type State, type States } from "./state.js";
import { copied, mask, newStore, release, type Store } from "./store.js";

/** Why a kernel came back: it is done, or needs bytes, or has decoded the symbols that were granted, or room, or is at a loss. */
const DONE = 0, NEED = -1, SPENT = -2, GROW = -3, BAD = -4;
/** In the counter `error`: steps are used up; else the clause that is violated. */
const OUT_OF_STEPS = 5;
const CLAUSES: Record<number, string> = { 1: "5.3.2", 3: "5.3.3", 4: "5.5", 7: "5.4.3" };
/** Room that sorting active middles takes. */
const PLACES = 2049;
/** Symbols that are decoded before limits are asked again. */
const SLICE = 65536;
/** No limit of steps is larger. */
const MOST_STEPS = 2 ** 52;
/** Steps, sixteenths of a symbol, that listing a vertex or a simplex takes. */
const LISTED = 4;
/** Bit of a point of the mesh that stays from one adaptive layer to the next. */
const IN = 1;

/** What all strands of a file share. */
export interface Shared {
  readonly m: Machine;
  readonly meter: Meter;
  readonly input: Input;
  readonly grid: Grid;
  readonly coders: Coders;
  readonly states: States;
}

/** Models of isovalues, with what decodes them. */
export interface Coding {
  shared: boolean;
  coder: Coder;
}

/** What a strand leans on: another one, how far below it lies in steps, if they are few enough, and on which side. */
export interface Leaning {
  readonly on: CompiledStrand;
  readonly shift: Shift | undefined;
  readonly side: number;
}

type Running = "" | "base" | "continue" | "significance" | "refinement" | "values" | "offsets";

export class CompiledStrand implements Strand, Run {
  running: Running = "";
  state: State;
  readonly estimates: Estimates;
  private readonly n: number;
  private readonly reflection: Reflection;
  private readonly none: Arr;
  private leaning: Leaning | undefined;
  private marks: Store | undefined;
  private seeds: Arr;
  private births = false;
  private numbers: Numbers | undefined;
  private resting = false;
  /** Whether the bytes of the run are another strand's. */
  private borrowed = false;
  /** Level by complete layers. */
  private shown = -1;
  /** Of the run: where it begins in the input, its length, bytes that have come, symbols that may come and that were granted. */
  private start = 0;
  private length = 0;
  private come = 0;
  private granted = 0;
  private counted = 0;

  constructor(private readonly shared: Shared, readonly isovalue: number, scale: number | undefined, private readonly learned: Coding, leaning: Leaning | undefined) {
    const { m, grid, states } = shared;
    this.n = grid.n;
    this.none = m.array("int64", [0]);
    this.leaning = leaning;
    this.state = states.first(grid.n, leaning && this.leanOn(leaning.on));
    if (leaning) {
      this.counters.set("side", leaning.side);
      this.counters.set("down", leaning.shift?.down ?? 0);
      this.counters.set("up", leaning.shift?.up ?? 0);
    }
    const told = leaning && leaning.side !== FRAME ? { on: leaning.on, shift: leaning.shift } : undefined;
    this.reflection = new Reflection(m, grid, Meter.without(), isovalue, scale);
    this.estimates = new Estimates(m, grid.n, told, () => this.tube);
    this.seeds = m.array("int32", [0, 5]);
  }

  private get coder(): Coder {
    return this.learned.coder;
  }

  private get counters(): State["counters"] {
    return this.state.counters;
  }

  private count(name: CounterNames): number {
    return this.counters.get(name);
  }

  private leanOn(on: CompiledStrand, shift?: Shift): Lean {
    const { state: { grid, counters, valueBits, known, mesh }, estimates } = on, { noLean } = this.shared.states;
    const told = shift !== undefined && estimates.hasValues, { number, left } = told ? estimates : noLean;
    return { grid, counters, valueBits, known, mesh, number, left, numbers: told ? on.numbersNow() : noLean.numbers };
  }

  /** Numbers of the vertices known now, for strands that lean on this one. */
  private numbersNow(): Numbers {
    const { state, shared: { m } } = this;
    if (this.numbers?.known === state.known && this.numbers.vertex.size === this.count("vertices")) return this.numbers;
    if (this.numbers) releaseNumbers(m, this.numbers);
    return (this.numbers = numbered(m, state));
  }

  get begun(): boolean {
    return this.count("edge") > 0;
  }

  get uniform(): number {
    return this.begun ? this.count("uniform") : -1;
  }

  private get full(): boolean {
    return this.running !== "base" && this.uniform === this.shared.grid.full;
  }

  get tube(): Tube {
    return this.reflection.of(this.state, this.estimates, this.running, this.shown);
  }

  // -- runs ------------------------------------------------------------------------------------------------------

  run(start: number, length: number): Run {
    const { reg } = this.coder;
    Object.assign(this, { start, length, come: 0, granted: 0, counted: 0 });
    reg.clear();
    reg.set("mode", 1);
    reg.set("range", 2 ** 32);
    reg.set("unknown", 32);
    return this;
  }

  goOn(run: Run): Run {
    const other = run as CompiledStrand;
    if (other === this) return this;
    const { start, length, come, granted, counted } = other;
    Object.assign(this, { start, length, come, granted, counted, borrowed: true });
    return this;
  }

  get shifts(): number {
    const { reg } = this.coder;
    return reg.get("pos") + (reg.get("unknown") >> 3) - 4;
  }

  get used(): number {
    return Math.min(this.shifts + 4, this.length);
  }

  /** Hand bytes that have come to the coder. */
  private arrive(): void {
    const { m, coders, input } = this.shared, count = Math.min(this.length, input.length - this.start);
    this.learned.coder = coders.room(this.coder, count);
    if (count > this.come) {
      m.bytes(this.coder.buf).set(input.data.subarray(this.start + this.come, this.start + count), this.come);
      this.come = count;
    }
    const { reg } = this.coder;
    reg.set("end", count);
    reg.set("final", Number(count === this.length));
  }

  /** Grant some more symbols. */
  private grant(): void {
    const { reg } = this.coder;
    reg.set("left", reg.get("left") + SLICE);
    this.granted += SLICE;
  }

  /** Count what a kernel has done to the limits. */
  private settle(work: number): void {
    const { meter, input } = this.shared, done = this.granted - this.coder.reg.get("left");
    meter.bytes = input.dropped + this.start + Math.max(0, this.shifts);
    meter.step(16 * (done - this.counted) + work);
    this.counted = done;
  }

  private wrong(clause: string, what: string): IsoError {
    const { input, meter } = this.shared;
    meter.bytes = input.dropped + this.start + Math.min(Math.max(0, this.shifts), this.come);
    return meter.wrong(clause, what);
  }

  // -- layers ----------------------------------------------------------------------------------------------------

  *begin(layer: Layer, bits: [number, number] | undefined): Pass {
    const { meter } = this.shared, listed = this.follows ? this.leaning!.on : this;
    meter.step(LISTED * (listed.count("vertices") + listed.count("held")));
    this.beginLayer(layer, bits);
    for (;;) {
      this.arrive();
      const status = this.advance();
      if (status === DONE) return;
      if (status === SPENT) this.grant();
      else yield;
    }
  }

  completed(): number {
    return (this.shown = this.uniform);
  }

  /** Whether nothing has come yet of an isovalue that leans on one of the frame before. */
  private get follows(): boolean {
    return this.leaning?.side === FRAME && !this.begun;
  }

  private beginLayer(layer: Layer, bits: [number, number] | undefined): void {
    switch (layer.kind) {
      case "base":
        return this.beginBase(layer.level, false);
      case "adaptive_base":
        return this.beginBase(layer.level, true);
      case "leaf_base":
        return this.beginAtLeaves();
      case "refine":
        this.counters.set("asks", 0);
        this.births = true;
        return this.fresh("significance");
      case "adapt":
        this.counters.set("asks", 1);
        this.counters.set("adapted", 1);
        mask(this.shared.m, this.state.mesh, IN);
        this.births = layer.births;
        return this.fresh("continue");
      case "values":
        this.estimates.beginValues(this.state, this.full, layer.plane, bits!);
        return this.fresh("values");
      case "offsets":
        this.estimates.beginOffsets(this.state, this.full, layer.Q, layer.q);
        return this.fresh("offsets");
    }
  }

  private beginBase(level: number, adaptive: boolean): void {
    const { m, grid } = this.shared, { counters } = this;
    if (this.follows && this.coder.blend.weight.size) this.state = { ...this.state, soft: softened(m, this.n, this.state.lean) };
    for (const name of ["level", "base_level", "uniform"] as const) counters.set(name, level);
    counters.set("finest", adaptive ? grid.full : level);
    counters.set("adapted", Number(adaptive));
    counters.set("edge", grid.edge(level));
    this.marks = newStore(m, this.n);
    this.running = "base";
  }

  /** Begin a base on the mesh of the isovalue that this one leans on, at its leaves (5.9.4). */
  private beginAtLeaves(): void {
    const { m } = this.shared, { on } = this.leaning!;
    release(m, this.state.mesh);
    this.state = { ...this.state, mesh: copied(m, on.state.mesh, IN) };
    this.counters.set("told", 1);
    this.counters.set("seeded", 1);
    this.seeds = this.seedsOf(on);
    this.beginBase(on.uniform, on.count("adapted") === 1);
  }

  /** Leaves as seeds: by level, by the order of their middles, of unit cells by that of their lowest corners, by their vertices. */
  private seedsOf({ n, state }: CompiledStrand): Arr {
    const { m, grid } = this.shared, count = state.counters.get("held"), rows = m.array("int32", [count, 5]), at = m.array("int64", [count, 6]);
    m.call("tube_leaf_list__one_by_one", state, rows);
    m.call("passes_refinement_places", state, rows, at);
    const words = m.words(rows), levels = Uint32Array.from({ length: count }, (_, i) => words[5 * i + 4]!);
    const found = Int32Array.from({ length: 6 * count }, (_, i) => m.number(at, i) >> (i % 6 < 3 && levels[Math.floor(i / 6)] === grid.full ? 1 : 0));
    m.release(at);
    const seeds = m.array("int32", [count, 5]), from = m.words(rows), to = m.words(seeds);
    sorted(count, [levels, ...places(n, found, 6), ...coordinates(found, 6, 3)])
      .forEach((row, i) => to.set(from.subarray(5 * row, 5 * row + 5), 5 * i));
    m.release(rows);
    return seeds;
  }

  private fresh(running: Running): void {
    const { m } = this.shared, { refinement, tree, value, digit, trail, candidates, window } = this.state;
    for (const walk of [refinement, tree, value, digit]) walk.clear();
    for (const array of [trail, candidates, window]) m.words(array).fill(0);
    this.running = running;
  }

  /** Middles of the leaves of the level become active (5.4.1). */
  private refine(): void {
    this.fresh("refinement");
    const { state, shared: { m } } = this, count = this.count("held");
    const key = m.array("int64", [2, count]), place = m.array("int64", [PLACES]);
    const found = m.call("passes_refinement_list_middles", state, key, place), active = m.array("int32", [found, 5]);
    this.counters.set("active", found);
    m.release(state.active);
    this.state = { ...state, active };
    m.call("passes_refinement_enter_middles", this.state, key, active);
    for (const array of [key, place]) m.release(array);
  }

  /** Go on with the layer begun: it is done, or bytes or symbols are lacking. */
  private advance(): number {
    const { leaning, shared: { meter, states } } = this, on = leaning?.on.counters;
    if (leaning) this.state = { ...this.state, lean: this.leanOn(leaning.on, leaning.shift) };
    for (;;) {
      const { counters } = this, { work, workPerByte } = meter.limits, before = counters.get("work"), earlier = on?.get("work") ?? 0;
      const left = Math.min(Math.max(0, 16 * (work + workPerByte * meter.bytes) - meter.steps), MOST_STEPS) + 16 * SLICE;
      counters.set("most_work", before + left);
      on?.set("most_work", earlier + left);
      const status = this.kernel(), tired = on !== undefined && on.get("work") >= on.get("most_work");
      if (status === NEED || status === SPENT) counters.set("work", counters.get("step_work"));
      counters.set("step_work", counters.get("work"));
      this.settle(counters.get("work") - before + (on ? on.get("work") - earlier : 0));
      const error = counters.get("error");
      if (tired || (status === BAD && error === OUT_OF_STEPS))
        meter.stop("work");
      if (status === GROW) {
        this.state = states.wider(this.state, this.running === "base");
        if (this.marks) this.marks = states.roomy(this.marks);
      } else if (status === BAD) throw this.wrong(CLAUSES[error]!, "what is decoded contradicts itself");
      else if (status === DONE) {
        if (this.finished()) return DONE;
      } else {
        if (status === NEED && this.coder.reg.get("over")) throw this.wrong("6.3", "a run is too short");
        return status;
      }
    }
  }

  private kernel(): number {
    const { state, coder, none, shared: { m } } = this;
    switch (this.running) {
      case "base":
        return m.call("passes_base_base", state, coder, this.marks!, none, this.seeds);
      case "continue":
        return m.call("passes_refinement_go_on", state, coder, 0);
      case "significance":
        return m.call("passes_new_components_significance", state, coder, none);
      case "refinement":
        return m.call("passes_refinement_refine", state, coder);
      case "values":
        return this.estimates.codeValues(state, coder);
      case "offsets":
        return this.estimates.codeOffsets(state, coder);
      case "":
        throw new Error("no layer has begun");
    }
  }

  /** End of a pass; false if the layer has another one. */
  private finished(): boolean {
    const { counters, shared: { m, grid } } = this, at = (name: CounterNames): number => counters.get(name);
    switch (this.running) {
      case "base":
        release(m, this.marks!);
        m.release(this.seeds);
        this.marks = undefined;
        this.seeds = m.array("int32", [0, 5]);
        counters.set("told", 0);
        counters.set("seeded", 0);
        counters.set("held", at("leaves"));
        this.endMesh();
        break;
      case "continue":
        if (this.state.refinement.get("more")) {
          if (this.births) this.fresh("significance");
          else this.refine();
          return false;
        }
        this.endAdaptive();
        break;
      case "significance":
        this.refine();
        return false;
      case "refinement":
        this.takeList();
        this.setLevel(at("level") + 1);
        if (!at("asks")) {
          counters.set("uniform", at("level"));
          this.endMesh();
        } else if (at("level") < grid.full) {
          this.fresh("continue");
          return false;
        } else this.endAdaptive();
    }
    this.running = "";
    return true;
  }

  /** The simplices that a layer has made replace those that were there. */
  private takeList(): void {
    const { counters, state: { leaf, below, active }, shared: { m } } = this;
    m.release(active);
    this.state = { ...this.state, leaf: below, below: leaf, active: m.array("int32", [0, 5]) };
    counters.set("leaves", counters.get("next"));
    counters.set("held", counters.get("mixed"));
    for (const name of ["next", "mixed", "done_leaves", "active", "coded", "bisected"] as const) counters.set(name, 0);
  }

  private setLevel(level: number): void {
    this.counters.set("level", level);
    this.counters.set("edge", this.shared.grid.edge(level));
  }

  private endAdaptive(): void {
    this.counters.set("asks", 0);
    this.setLevel(this.uniform);
    this.endMesh();
  }

  private endMesh(): void {
    this.counters.set("meshes", this.count("meshes") + 1);
  }

  // -- what others have ------------------------------------------------------------------------------------------

  masked(_: Missing, other: Strand): void {
    const { m } = this.shared, { state: { grid, known, mesh, counters } } = other as CompiledStrand;
    const own = m.registers<CounterNames>("Counters");
    own.set("base_level", counters.get("base_level"));
    own.set("most_work", 2 ** 62);
    this.state = { ...this.state, hole: { ...this.shared.states.noLean, grid, known, mesh, counters: own } };
    this.counters.set("masked", 1);
  }

  rest(): void {
    if (this.resting) return;
    this.resting = true;
    this.estimates.rest();
    this.estimates.part();
    this.state = this.shared.states.atRest(this.state);
    // models that others have, too, stay as they are
    if (!this.learned.shared && !this.borrowed && this.begun) this.learned.coder = this.shared.coders.atRest(this.coder);
    this.leaning = undefined;
  }

  /** Give all memory back, but that of the models: the frame is no longer kept. */
  drop(): void {
    if (this.numbers) releaseNumbers(this.shared.m, this.numbers);
    this.estimates.release();
    this.shared.states.release(this.state);
  }
}
