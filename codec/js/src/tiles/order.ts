/** Tiles and blocks of tiles in Morton order (12.2(4)). */

/** All indices below `extent`, `extent.length` numbers each, in Morton order. */
export function morton(extent: readonly number[]): Uint32Array {
  const n = extent.length, count = extent.reduce((product, x) => product * x, 1), found = new Uint32Array(n * count);
  let at = 0;
  const visit = (origin: number[], edge: number): void => {
    if (origin.some((x, a) => x >= extent[a]!)) return;
    if (edge < 1) {
      found.set(origin, at);
      at += n;
      return;
    }
    for (let child = 0; child < 1 << n; child++) visit(origin.map((x, a) => x + ((child >> (n - 1 - a)) & 1) * edge), edge / 2);
  };
  let edge = 1;
  while (2 * edge < Math.max(...extent)) edge *= 2;
  visit(extent.map(() => 0), edge);
  return found;
}
