/** Compiled kernels: files of grids are decoded several times as fast with them. They are loaded when they are wanted. */
import type { Grid } from "./grid.js";
import type { MainProfile } from "./main/profile.js";
import type { Session } from "./session.js";
import { shiftOf } from "./shift.js";
import type { Engine, Strand } from "./strand.js";
import { Coders } from "./compiled/coder.js";
import { Kernels as Module, Machine } from "./compiled/machine.js";
import { FRAME, States } from "./compiled/state.js";
import { CompiledStrand, type Leaning, type Shared } from "./compiled/tube.js";

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
    const shared: Shared = { m, meter, input, grid, coders: new Coders(m, grid.n, main?.of(grid.n)), states: new States(m, meter, grid), finished: [] };
    let before: CompiledStrand[] = [];
    return {
      strand: (isovalue, lean, framed, own) => {
        if (shared.finished.length) {
          // another frame begins: the last one stays, the one before goes unless it is wanted
          if (!s.keepFrames) before.forEach((each) => each.drop());
          [before, shared.finished] = [shared.finished, []];
        }
        return strand(shared, scale, isovalue, lean as CompiledStrand | undefined, framed, own as CompiledStrand | undefined);
      },
    };
  }
}

function strand(shared: Shared, scale: number | undefined, isovalue: number, lean: CompiledStrand | undefined, framed: boolean,
                own: CompiledStrand | undefined): Strand {
  let leaning: Leaning | undefined;
  if (lean?.begun) {
    const shift = framed ? undefined : shiftOf(isovalue, lean.isovalue, scale);
    leaning = { on: lean, shift, side: framed ? FRAME : isovalue > lean.isovalue ? 1 : -1 };
  }
  // the models of an isovalue without layers are those of the ones that lean on it, too (5.9.2)
  const same = own ?? (lean && !framed && !lean.begun ? lean : undefined);
  return new CompiledStrand(shared, isovalue, scale, same ?? lean, framed, leaning, same !== undefined);
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
