/** A mesh of the conformance vectors: a line `d n V T`, then coordinates and cells, a line for each vertex and cell. */
export function readMesh(text) {
  const [d, n, V, , ...rest] = text.trim().split(/\s+/).map(Number);
  return { d, n, coordinates: rest.slice(0, d * V), cells: rest.slice(d * V) };
}
