/** What compiled kernels of raster layers work on (5.12). */
import { squash, stretch } from "../domain/logistic.js";
import type { Meter } from "../errors.js";
import type { Grid } from "../grid.js";
import { BLOCK, check, enterModels, flagModels, HIGH, LOW, NEAR, REACH, SIGN_MODELS, WEIGHTS } from "../raster.js";
import { TRUST } from "../trust.js";
import type { Coder } from "./coder.js";
import type { Arr, Machine, Registers } from "./machine.js";

/** A raster layer that goes on: its progress, and a coder with models of its own. */
export interface RasterRun {
  readonly own: {
    readonly walk: Registers<"known" | "ahead">; readonly pattern: Arr; readonly columns: Arr; readonly blocks: Arr;
    readonly model: Arr; readonly square: Arr; readonly mix: Arr; readonly lane: Arr;
  };
  readonly coder: Coder;
  /** Give all memory back. */
  release(): void;
}

/** Contexts that the kernels work on at a time, and groups of what is listed of each. */
const LANES = 8, LISTED = 4;

/** Bits of the second word of what is near a sample. */
const LOW_BITS = 25;

/** `known` says whether there are known vertices already. */
export function beginRaster(m: Machine, grid: Grid, meter: Meter, leans: boolean, coder: Coder, known: boolean): RasterRun {
  check(grid, meter, leans);
  const { p, seen } = flagModels(), model = m.array("int32", [SIGN_MODELS]);
  enterModels(m.words(model));
  const mix = m.array("int32", [NEAR.length + 1, LANES]), weights = m.words(mix);
  for (let i = 0; i < WEIGHTS.length; i++) weights[Math.floor(i / NEAR.length) * LANES + i % NEAR.length] = WEIGHTS[i]!;
  const own = {
    walk: m.registers<"known" | "ahead">("RasterWalk"),
    pattern: m.numbers(Array.from(HIGH, (high, i) => high * 2 ** LOW_BITS + LOW[i]!), [2 * REACH + 1, 2 ** (REACH + 1)]),
    columns: m.array("uint8", [grid.last[1] + 1 + 2 * REACH]), blocks: m.array("uint8", [Math.floor(grid.last[1] / BLOCK) + 1]),
    model, square: m.array("int64", [16]), mix, lane: m.array("int32", [LISTED * LANES]),
  };
  own.walk.set("known", known ? 1 : 0);
  own.walk.set("ahead", -1);
  const [prob, counts] = [m.numbers(p), m.numbers(seen)];
  const blend = {
    ...coder.blend, squash: m.small("int32", squash), stretch: m.small("int16", stretch), trust: m.small("int16", TRUST),
  };
  const release = (): void => {
    const { squash, stretch, trust } = blend, { walk, ...arrays } = own;
    [walk.array, ...Object.values(arrays), prob, counts, squash, stretch, trust].forEach((array) => m.release(array));
  };
  return { own, coder: { ...coder, prob, seen: counts, blend }, release };
}
