/** The signs of the frame before, softened (7.18.1). */
import type { Machine } from "./machine.js";
import type { Lean } from "./state.js";
import { SHIFT, type Store } from "./store.js";

/** Rounds of smoothing, each of which reaches one sample farther. */
const ROUNDS = 3;

/** What kernels see of the frame before. */
export function softened(m: Machine, n: number, lean: Lean): Store {
  const { known } = lean, pages = m.array("int32", known.pages.shape);
  const soft = { head: m.copy(known.head), table: m.copy(known.table), pages };
  const room = m.array("int64", [(2 ** m.number(known.head, SHIFT) + 2 * ROUNDS) ** n]);
  m.call("tube_softened__soften", lean, soft, room);
  m.release(room);
  return soft;
}
