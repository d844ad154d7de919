/** Compiled kernels: files of grids are decoded several times as fast with them. They are loaded when they are wanted. */
import type { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import type { Session } from "./session.js";
import { shiftOf } from "./shift.js";
import type { Engine } from "./strand.js";
import { Coders } from "./compiled/coder.js";
import { Kernels as Module, Machine } from "./compiled/machine.js";
import { FRAME, States } from "./compiled/state.js";
import { type Coding, CompiledStrand, type Shared } from "./compiled/tube.js";

/** Compiled kernels, for as many decoders as want them. */
export class Kernels {
  private readonly module: Module;

  /** `module` is that of `kernels.wasm`. */
  constructor(module: WebAssembly.Module) {
    this.module = new Module(module);
  }

  /** What begins the strands of a file. */
  engine(s: Session, grid: Grid, scale: number | undefined, main: MainProfile | undefined): Engine {
    const { meter, r: { input } } = s, m = new Machine(this.module, meter);
    const coders = new Coders(m, grid.n, main?.of(grid.n)), shared: Shared = { m, meter, input, grid, coders, states: new States(m, meter, grid) };
    return {
      learn: (from, framed, panel): Coding => ({ shared: false, coder: coders.coder((from as Coding | undefined)?.coder, framed, panel) }),
      strand: (isovalue, lean, framed, learned) => {
        const on = lean as CompiledStrand | undefined, shift = on && !framed ? shiftOf(isovalue, on.isovalue, scale) : undefined;
        const leaning = on && { on, shift, side: framed ? FRAME : isovalue > on.isovalue ? 1 : -1 };
        return new CompiledStrand(shared, isovalue, scale, learned as Coding, leaning);
      },
      forget: (learned) => coders.release((learned as Coding).coder),
    };
  }
}

let fetched: Promise<Kernels> | undefined;

/** The kernels, from beside this module; they are fetched and compiled once. */
export function fetchKernels(url: string | URL = new URL("./kernels.wasm", import.meta.url)): Promise<Kernels> {
  fetched ??= fetch(url).then(async (answer) => {
    if (!answer.ok) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
    return new Kernels(await WebAssembly.compile(await answer.arrayBuffer()));
  });
  fetched.catch(() => (fetched = undefined));
  return fetched;
}
