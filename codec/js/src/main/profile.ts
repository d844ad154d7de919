/** The main profile (7.10 to 7.18), which is loaded when a file needs it. */
import type { Tube } from "../tube.js";
import { Mixing } from "./mixing.js";
import { CONTEXTS, Models, type Weighed } from "../models.js";
import { PANEL_CONTEXTS, PANEL_KINDS, PANEL_LISTS } from "../trust.js";
import { begin, readTables, type Tables } from "./tables.js";

export class MainProfile {
  private readonly tables: (Tables | undefined)[] = [];

  /** `bytes` is the file `main.bin`. */
  constructor(private readonly bytes: Uint8Array) {}

  /** The tables for a number of axes. */
  of(n: number): Tables {
    return (this.tables[n] ??= readTables(this.bytes, n));
  }

  /** Models and weights as they begin, or copied from others; with a panel if `framed`, also copied if `panel`. */
  learn(n: number, from: Weighed | undefined, framed: boolean, panel: boolean): Weighed {
    const models = new Models(from?.models, CONTEXTS + (framed ? PANEL_CONTEXTS : 0), panel ? undefined : CONTEXTS), tables = this.of(n), first = PANEL_LISTS * PANEL_KINDS;
    if (!from) begin(tables, models);
    const weights = framed ? ((panel ? from?.panel?.slice() : undefined) ?? new Float64Array(first).fill(4096)) : undefined;
    return { shared: false, models, mix: (from?.mix ?? tables.mix).slice(), panel: weights };
  }

  /** What an isovalue has beside its contexts; `framed` says whether it leans on one of the frame before. */
  begin(t: Tube, framed: boolean, learned: Weighed): Mixing {
    return new Mixing(t, this.of(t.n), learned, framed);
  }
}
