/** How what a file holds is seen: which way is up, from which side, in which colours; for the page and the widget. */
import type { Drawing } from "../../codec/js/src/draw.js";
import { placement } from "../../codec/js/src/world.js";
import { type Colour, colour, places } from "./colours.js";
import type { Scene } from "./scene.js";

/** What is seen of a file. */
export interface Seen {
  n: number;
  shape: number[];
  isovalues: number[];
  metadata: Record<string, string>;
  kind: "grid" | "mesh" | "surface" | "tiles";
  drawings: Map<number, Drawing>;
  /** Points that span all of it. */
  box: Float64Array | undefined;
  /** Whether all of it has been shown, in world coordinates or others. */
  fitted: boolean;
  /** How much larger heights of a surface of points are drawn. */
  raised: number;
  world: boolean;
}

/** Axes of a volume that does not say where it lies, as rows x, y, z: slices from the top, rows from the front. */
const UNPLACED = [[0, 0, -1], [0, -1, 0], [-1, 0, 0]];
/** The sides that are seen at first: of a volume its front, from above; of other surfaces the south. */
const SIDES = { volume: [Math.PI + 0.6327, -1.1467], other: [0.6, -1.0] } as const;

/** Rows x, y, z from samples of a volume to what is seen of it, with the steps of its placement. */
function standing(metadata: Seen["metadata"]): number[][] {
  const rows = placement(metadata, 3);
  if (!rows) return UNPLACED;
  const steps = [0, 1, 2].map((a) => Math.hypot(...rows.map((row) => row[a]!))), least = Math.min(...steps);
  return rows.map((row) => steps.map((step, a) => (row[a]! / step) * Math.min(step / least, 100)));
}

/** Points as they are seen, `d` numbers each: in samples axis 1 of a plane to the right and axis 0 downwards. */
export function upright(file: Seen, points: Float64Array, d: number): Float64Array {
  if (file.kind === "surface") {
    const { raised, metadata, drawings } = file, rows = drawings.get(0)?.sampled ? (placement(metadata, 2) ?? [[0, 1, 0], [-1, 0, 0]]) : [[1, 0, 0], [0, 1, 0]];
    return points.map((z, i) => {
      const row = rows[i % 3], at = i - (i % 3);
      return row ? row[0]! * points[at]! + row[1]! * points[at + 1]! + row[2]! : z * raised;
    });
  }
  if (!file.shape.length || file.world) return points;
  if (d === 2) return points.map((_, i) => (i & 1 ? -points[i - 1]! : points[i + 1]!));
  const rows = standing(file.metadata);
  return points.map((_, i) => rows[i % 3]!.reduce((sum, by, a) => sum + by * points[i - (i % 3) + a]!, 0));
}

/** How much shorter a degree of longitude is than one of latitude in the middle of a box, where coordinates are degrees. */
function shrinking({ world: inWorld, metadata: { crs, coordinate_unit: unit } }: Seen, box: Float64Array): number {
  const ys = box.filter((_, i) => i & 1);
  const middle = (Math.min(...ys) + Math.max(...ys)) / 2;
  return inWorld && (/^EPSG:(4326|4258|4269)$/.test(crs ?? "") || unit?.startsWith("degree")) && Math.abs(middle) < 85 ? Math.cos((middle * Math.PI) / 180) : 1;
}

/** By how much heights of a surface of points have to be multiplied to be seen: a number that is easily said. */
function raising(box: Float64Array): number {
  const [width, depth, height] = [0, 1, 2].map((a) => Math.abs(box[3 + a]! - box[a]!)) as [number, number, number];
  const share = height / Math.max(width, depth);
  if (!(share > 0) || (share >= 0.05 && share <= 0.6)) return 1;
  return Number((0.25 / share).toPrecision(1));
}

/** Whether a mesh or a surface of points reaches farther than before, while it arrives: heights are drawn by how far it does. */
export const grown = (file: Seen, box: Float64Array): boolean => !file.shape.length && String(box) !== String(file.box ?? box);

/** Show all of a file, whose points have `d` coordinates. */
export function fit(scene: Scene, file: Seen, d: number): void {
  file.raised = 1;
  if (file.kind === "surface") file.raised = raising(upright(file, file.box!, 3));
  const side = SIDES[file.shape.length === 3 ? "volume" : "other"];
  scene.fit(d, upright(file, file.box!, d), d === 2 ? [0, 0] : [...side], d === 2 ? shrinking(file, file.box!) : 1);
  file.fitted = true;
}

/** Colours of the isovalues that there are; one alone of a file that has no other has that of the page. */
export function coloursOf(file: Seen | undefined, dark: boolean): Colour[] {
  const { isovalues, n } = file ?? { isovalues: [], n: 2 };
  if (isovalues.length > 1) return places(isovalues).map((place) => colour(place, dark, n === 3));
  return n === 3 || file?.kind === "surface" ? [dark ? [0.62, 0.78, 0.9] : [0.5, 0.66, 0.8]] : [dark ? [0.42, 0.72, 0.94] : [0.086, 0.408, 0.659]];
}
