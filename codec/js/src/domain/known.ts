/** Meshes that both sides have, told by a hash (10.1.2(1)). */
import type { IsoError, Meter } from "../errors.js";
import type { KnownMesh } from "../events.js";
import { Complex, neighboursOf } from "./complex.js";
import { sha256 } from "./sha256.js";

/** The nearest integer to `x * 2**-e`, ties to even. */
function position(x: number, e: number): number {
  const half = -e >> 1, y = x * 2 ** half * 2 ** (-e - half), low = Math.floor(y), over = y - low;
  return over < 0.5 ? low : over > 0.5 || low % 2 ? low + 1 : low;
}

/** The mesh of a file with so many vertices and cells, whose hash begins with `hash`. */
export function knownMesh(mesh: KnownMesh | undefined, d: number, n: number, e: number, V: number, T: number,
                          hash: Uint8Array, meter: Meter): Complex {
  const wrong = (what: string): IsoError => meter.wrong("10.1.2", what, "mesh");
  if (!mesh) throw wrong("the file needs a mesh that is not in it");
  const { coordinates, cells } = mesh;
  if (mesh.d !== d || mesh.n !== n || coordinates.length !== d * V || cells.length !== (n + 1) * T)
    throw wrong("the mesh given has other numbers than that of the file");
  meter.take(16 * (coordinates.length + cells.length));
  const positions = Float64Array.from(coordinates, (x) => position(x, e)), numbers = Int32Array.from(cells);
  if (!numbers.every((v) => v >= 0 && v < V)) throw wrong("the mesh given has cells of vertices that it does not have");
  const view = new DataView(new ArrayBuffer(8 * (4 + positions.length + numbers.length)));
  let at = 0;
  for (const list of [[d, n, V, T], positions, numbers]) {
    for (const x of list) {
      view.setUint32(at, x >>> 0, true);
      view.setInt32(at + 4, Math.floor(x / 4294967296), true);
      at += 8;
    }
  }
  const own = sha256(new Uint8Array(view.buffer));
  if (!hash.every((byte, i) => byte === own[i])) throw wrong("the mesh given is not that of the file");
  if (!positions.every((x) => Math.abs(x) < 2 ** 52)) throw meter.wrong("11.2", "positions beyond 2**52", "limit");
  return new Complex(d, n, V, T, positions, numbers, neighboursOf(n, T, numbers, meter), meter);
}
