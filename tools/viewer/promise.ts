/** Promises of a file in words, as `isocodec info` prints them. */
import type { Promises } from "../../codec/js/src/metadata.js";

const cells = (distance: string): string => `${distance} cell${distance === "1" ? "" : "s"}`;

/** The layers of an isovalue: whether the last one has values that say all of it, and those that keep a distance. */
export interface Stated {
  promises: Promises | undefined;
  layers: number;
}

/** What the note `promise` states of a file on a mesh, in tiles, or of points; undefined if nothing. */
function noted(note: string, kind: string, metadata: Record<string, string>): string | undefined {
  const known: Record<string, string> = { exact: "all values exactly", signs: "all signs" };
  if (kind === "tiles" && known[note]) return known[note];
  if (kind === "tiles" && note.startsWith("step=")) return `values to within ${Number(note.slice(5)) / 2}`;
  const [distances, at] = note.split(" at ") as [string, string | undefined];
  const parts = distances.split(",").filter((each) => each !== "exact"), last = parts.at(-1);
  if (!last || !/^[\d.eE+-]+ ?\D*$/.test(last)) return undefined;
  const unit = /[a-zA-Z]$/.test(last), far = unit ? last : cells(last);
  if (kind === "surface" && at) return `contours of ${at.split(" ").join(", ")} within ${far}`;
  if (kind === "tiles") return `within ${far}`;
  const named = metadata[kind === "surface" ? "unit" : "coordinate_unit"] ?? (kind === "surface" ? "" : "in the unit of its points");
  const all = kind === "surface" ? `values within ${last}` : `within ${parts.join(", ")}`;
  return `${unit ? all : `${all} ${named}`.trimEnd()}${note.endsWith(",exact") ? ", then all values exactly" : ""}`;
}

/**
 * The precision that a file states it will have when it is complete: of the isovalues that have come, one of which may be
 * shown alone.
 */
export function promiseOf(kind: "grid" | "mesh" | "surface" | "tiles", metadata: Record<string, string>, stated: readonly Stated[]): string | undefined {
  const note = metadata["promise"] ?? "";
  if (kind !== "grid" && note) return noted(note, kind, metadata);
  const parts = note.split(",").filter((each) => each && each !== "exact");
  const texts = new Set(stated.map(({ promises }) => promises?.distances.map(({ distance }, i) => {
    const asked = parts[i];
    return asked && /[a-zA-Z]$/.test(asked) ? `${asked} (${cells(String(distance))})` : cells(asked ?? String(distance));
  }).join(", ") ?? ""));
  const distances = texts.size > 1 ? "distances that differ between isovalues" : texts.values().next().value;
  const topology = stated.length > 0 && stated.every(({ promises }) => promises?.topology);
  // of a mesh they count units that are not known here
  return [kind === "grid" && distances && (texts.size > 1 ? distances : `within ${distances}`), topology && "topology"].filter(Boolean).join(", ") || undefined;
}
