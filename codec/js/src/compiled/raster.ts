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
    readonly model: Arr; readonly square: Arr;
  };
  readonly coder: Coder;
  /** Give all memory back. */
  release(): void;
}

/** Opinions that a symbol may have, and what is listed of each. */
const MOST_OPINIONS = 12, LISTED = 2;

/** Bits of the second word of what is near a sample. */
const LOW_BITS = 25;

/** `known` says whether there are known vertices already. */
export function beginRaster(m: Machine, grid: Grid, meter: Meter, leans: boolean, coder: Coder, known: boolean): RasterRun {
  check(grid, meter, leans);
  const { p, seen } = flagModels(), padded: number[] = [], model = m.array("int32", [SIGN_MODELS]);
  enterModels(m.words(model));
  for (let i = 0; i < WEIGHTS.length; i += NEAR.length)
    for (let j = 0; j < MOST_OPINIONS; j++) padded.push(WEIGHTS[i]!);
  const own = {
    walk: m.registers<"known" | "ahead">("RasterWalk"),
    pattern: m.numbers(Array.from(HIGH, (high, i) => high * 2 ** LOW_BITS + LOW[i]!), [2 * REACH + 1, 2 ** (REACH + 1)]),
    columns: m.array("uint8", [grid.last[1] + 1 + 2 * REACH]), blocks: m.array("uint8", [Math.floor(grid.last[1] / BLOCK) + 1]),
    model, square: m.array("int64", [16]),
  };
  own.walk.set("known", known ? 1 : 0);
  own.walk.set("ahead", -1);
  const [prob, counts] = [m.numbers(p), m.numbers(seen)];
  const blend = {
    ...coder.blend, mix: m.numbers(padded, [NEAR.length + 1, MOST_OPINIONS]), squash: m.small("int32", squash), stretch: m.small("int16", stretch),
    trust: m.small("int16", TRUST), row: m.array("int64", [LISTED * MOST_OPINIONS + 1]),
  };
  const release = (): void => {
    const { mix, squash, stretch, trust, row } = blend, { walk, ...arrays } = own;
    [walk.array, ...Object.values(arrays), prob, counts, mix, squash, stretch, trust, row].forEach((array) => m.release(array));
  };
  return { own, coder: { ...coder, prob, seen: counts, blend }, release };
}
