/** The main profile (7.10 to 7.18), which is loaded when a file needs it. */
import type { Tube } from "../tube.js";
import { Mixing } from "./mixing.js";
import { PANEL_CONTEXTS } from "../trust.js";
import { readTables, type Tables } from "./tables.js";

export class MainProfile {
  readonly panelContexts = PANEL_CONTEXTS;
  private readonly tables: (Tables | undefined)[] = [];

  /** `bytes` is the file `main.bin`. */
  constructor(private readonly bytes: Uint8Array) {}

  /** The tables for a number of axes. */
  of(n: number): Tables {
    return (this.tables[n] ??= readTables(this.bytes, n));
  }

  /** What an isovalue has beside its contexts; `framed` says whether `lean` is of the frame before. */
  begin(t: Tube, lean: Tube | undefined, framed: boolean, shared: Mixing | undefined): Mixing {
    return new Mixing(t, this.of(t.n), lean?.main, framed, shared);
  }
}
