/** Drawings for three.js. */
import { BufferAttribute, BufferGeometry } from "three";
import type { Drawing } from "./draw.js";
import { place, type Where } from "./world.js";

/**
 * A geometry of a drawing: indexed triangles with normals for a Mesh, or, of curves, pairs of points for LineSegments.
 * With a placement or coordinates its points are those of the world; `origin`, subtracted from them, keeps large coordinates
 * precise in the 32 bits that graphics have.
 */
export function toBufferGeometry(drawing: Drawing, where?: Where, origin: readonly number[] = [0, 0, 0]): BufferGeometry {
  const placed = where ? place(drawing, where) : drawing, { n, d, points, cells } = placed;
  const position = new Float32Array((3 * points.length) / d);
  for (let i = 0; i < points.length / d; i++)
    for (let a = 0; a < d; a++) position[3 * i + a] = points[d * i + a]! - origin[a]!;
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(position, 3));
  geometry.setIndex(new BufferAttribute(cells, 1));
  if (n === 3) geometry.computeVertexNormals();
  return geometry;
}
