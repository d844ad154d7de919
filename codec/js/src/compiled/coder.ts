/** The coder and the models of an isovalue, as kernels have them (clauses 6 and 7). */
import { STEP } from "../coder.js";
import { CLASS, CONTEXTS, Models } from "../models.js";
import { begin, KINDS, type Tables, VALUE_OPINIONS, VALUE_SETS } from "../main/tables.js";
import { PANEL_CONTEXTS, PANEL_KINDS, PANEL_LISTS, TRUST } from "../trust.js";
import type { Arr, Machine, Registers } from "./machine.js";
import { WIDTH, withSums } from "./rows.js";

export type CoderNames = "mode" | "range" | "unknown" | "pos" | "end" | "final" | "left" | "over";

/** Opinions of counts, on symbols of frames that lean on the one before (7.18). */
interface Panel {
  readonly prob: Arr;
  readonly seen: Arr;
  readonly mix: Arr;
  readonly about: Arr;
  readonly place: Arr;
  readonly said: Arr;
}

/** What the main profile has beside (7.11). */
interface Blend {
  readonly weight: Arr;
  readonly out: Arr;
  readonly mix: Arr;
  readonly squash: Arr;
  readonly stretch: Arr;
  readonly trust: Arr;
  readonly row: Arr;
  readonly trace: Arr;
  readonly panel: Panel;
}

export interface Coder {
  readonly reg: Registers<CoderNames>;
  readonly buf: Arr;
  readonly prob: Arr;
  readonly seen: Arr;
  readonly rate: Arr;
  readonly blend: Blend;
}

/** Weight that an opinion of a panel begins with, of `2**16`; rows that a symbol may list. */
const FIRST_WEIGHT = 4096, MOST_ROWS = 256;
/** Bytes of a run that there is room for at first. */
const ROOM = 4096;

/** The coders of a file. */
export class Coders {
  private readonly rate: Arr;
  private readonly shared: Pick<Blend, "weight" | "out" | "squash" | "stretch" | "trust" | "row" | "trace">;
  /** The run, which isovalues have one after the other. */
  private readonly reg: Registers<CoderNames>;
  private buf: Arr;

  /** `tables` are those of the main profile, undefined in the baseline profile. */
  constructor(private readonly m: Machine, n: number, private readonly tables: Tables | undefined) {
    this.reg = m.registers<CoderNames>("CoderRegisters");
    this.buf = m.array("uint8", [ROOM]);
    this.rate = m.numbers(STEP.subarray(0, STEP.length - 1), undefined, false);
    const none = m.array("int64", [0]);
    const small = m.array("int16", [0]);
    this.shared = { weight: m.array("int16", [0, 1]), out: m.array("int32", [0, 1]), squash: m.array("int32", [0]), stretch: small, trust: small, row: none,
      trace: m.array("int32", [0, 0]) };
    if (!tables) return;
    const sums = withSums(n, tables), out = m.array("int32", [tables.out.length / (WIDTH + 1), WIDTH + 1], false);
    const weight = m.array("int16", [sums.length / WIDTH, WIDTH], false);
    m.words(out).set(tables.out);
    new Int16Array(m.memory.buffer, weight.at, weight.size).set(sums);
    this.shared = { ...this.shared, weight, out, squash: m.small("int32", tables.squash, false),
      stretch: m.small("int16", tables.stretch, false), trust: m.small("int16", TRUST, false), row: m.array("int64", [MOST_ROWS], false) };
  }

  /** A coder with models as a file begins with them, or as another one has them (5.9.2); with a panel if `framed`, also copied if `panel`. */
  coder(from: Coder | undefined, framed: boolean, panel: boolean): Coder {
    const { m, rate, shared, reg, buf } = this, own = framed && this.tables ? this.panel(panel ? from?.blend.panel : undefined) : this.noPanel();
    if (from) {
      const { prob, seen, blend } = from;
      return { reg, buf, prob: this.wide(prob), seen: this.wide(seen), rate, blend: { ...blend, mix: m.copy(blend.mix), panel: own } };
    }
    const { tables } = this, models = new Models(undefined, tables ? CONTEXTS : CLASS);
    if (tables) begin(tables, models);
    const [prob, seen] = [models.p, models.seen].map((all) => m.numbers(all)) as [Arr, Arr];
    const mix = tables ? this.weights(tables) : m.array("int64", [0, 1]);
    const { weight, out, squash, stretch, trust, row, trace } = shared;
    return { reg, buf, prob, seen, rate, blend: { weight, out, mix, squash, stretch, trust, row, trace, panel: own } };
  }

  /** Weights of opinions, as many for each kind of symbols as value bits have. */
  private weights({ mix }: Tables): Arr {
    const wide = new Float64Array((KINDS + VALUE_SETS) * VALUE_OPINIONS);
    for (let kind = 0; kind < KINDS; kind++) wide.set(mix.subarray(4 * kind, 4 * kind + 4), VALUE_OPINIONS * kind);
    wide.set(mix.subarray(4 * KINDS), VALUE_OPINIONS * KINDS);
    return this.m.numbers(wide, [KINDS + VALUE_SETS, VALUE_OPINIONS]);
  }

  /** The models in as few bytes as they take, without the run: others may lean on them, nothing else. */
  atRest(coder: Coder): Coder {
    const { m } = this;
    return { ...coder, buf: m.array("uint8", [0]), prob: this.narrow(coder.prob, "int16"), seen: this.narrow(coder.seen, "uint8") };
  }

  private narrow(array: Arr, dtype: "int16" | "uint8"): Arr {
    const { m } = this, found = m.array(dtype, [array.size]), words = m.words(array);
    const entries = new (dtype === "int16" ? Uint16Array : Uint8Array)(m.memory.buffer, found.at, found.size);
    for (let i = 0; i < entries.length; i++) entries[i] = words[2 * i]!;
    m.release(array);
    return found;
  }

  /** A copy in eight bytes each. */
  private wide(array: Arr): Arr {
    const { m } = this;
    if (array.dtype === "int64") return m.copy(array);
    const found = m.array("int64", [array.size]), words = m.words(found);
    const entries = new (array.dtype === "int16" ? Uint16Array : Uint8Array)(m.memory.buffer, array.at, array.size);
    for (let i = 0; i < entries.length; i++) words[2 * i] = entries[i]!;
    return found;
  }

  private noPanel(): Panel {
    const { m } = this, none = m.array("int64", [0]);
    return { prob: none, seen: none, mix: m.array("int64", [0, PANEL_LISTS]), about: m.array("int64", [6]), place: none, said: none };
  }

  /** What a frame begins with that leans on one with `before`. */
  private panel(before: Panel | undefined): Panel {
    const { m } = this;
    const about = m.array("int64", [6]), [place, said] = [m.array("int64", [PANEL_LISTS]), m.array("int64", [PANEL_LISTS])];
    if (before?.prob.size) return { prob: m.copy(before.prob), seen: m.copy(before.seen), mix: m.copy(before.mix), about, place, said };
    return {
      prob: m.numbers(new Uint16Array(PANEL_CONTEXTS).fill(32768)), seen: m.array("int64", [PANEL_CONTEXTS]),
      mix: m.numbers(new Uint16Array(PANEL_KINDS * PANEL_LISTS).fill(FIRST_WEIGHT), [PANEL_KINDS, PANEL_LISTS]), about, place, said,
    };
  }

  /** Make room for `count` bytes of a run, of which `kept` are there. */
  room(coder: Coder, count: number): Coder {
    const { m, buf } = this;
    if (count > buf.size) {
      this.buf = m.wider(buf, Math.max(2 * buf.size, count));
      m.release(buf);
    }
    return coder.buf === this.buf ? coder : { ...coder, buf: this.buf };
  }

  /** Give memory back. */
  release({ prob, seen, blend: { mix, panel } }: Coder): void {
    [prob, seen, mix, ...Object.values(panel) as Arr[]].forEach((array) => this.m.release(array));
  }
}
