/** The chain of crossings of a curve off the full grid (7.14.4(2)). */
import type { Crossings } from "../edges.js";

/** Edges without offsets that the chain may pass on the way to one that carries them. */
const HOPS = 4;

/** The next two of the listed edges on either side of each, four numbers an edge, the nearer ones first; -1 for none. */
export function chain({ leafEdges, index, edgeLeaves }: Crossings, listed: readonly number[]): number[] {
  const told = new Int32Array(index.count).fill(-1), found: number[] = [];
  listed.forEach((id, i) => (told[id] = i));
  /** The place among the edges of leaves, two a leaf, of an edge in a leaf. */
  const place = (id: number, leaf: number): number => (leaf < 0 ? -1 : leafEdges[2 * leaf] === id ? 2 * leaf : 2 * leaf + 1);
  for (const id of listed) for (const side of [0, 1]) {
    let at = place(id, edgeLeaves[2 * id + side]!);
    for (let step = 0; step < 2; step++) {
      let next = -1, resume = -1;
      for (let hop = 0; hop < HOPS && at >= 0 && next < 0; hop++) {
        // through the leaf, and on from there unless the edge carries offsets
        const there = leafEdges[at ^ 1]!, leaf = at >> 1;
        const onward = place(there, edgeLeaves[2 * there + (edgeLeaves[2 * there] === leaf ? 1 : 0)]!);
        next = told[there]!;
        if (next >= 0) resume = onward;
        else at = onward;
      }
      found.push(next);
      at = resume;
    }
  }
  return found;
}
