/** The canonical text of a decoded state (annex B). */
import type { Coordinates } from "./coordinates.js";
import type { Decoder } from "./decoder.js";
import { IsoError } from "./errors.js";
import { coordinatesOf } from "./nodes.js";
import { SIGN } from "./store.js";
import type { Place } from "./tiles/directory.js";
import type { TiledFile } from "./tiles/file.js";
import type { Tube } from "./tube.js";

function sorted(data: Int32Array, length: number, width: number): number[] {
  const order = Array.from({ length: length / width }, (_, i) => i * width);
  return order.sort((p, q) => {
    for (let i = 0; i < width; i++) if (data[p + i] !== data[q + i]) return data[p + i]! - data[q + i]!;
    return 0;
  });
}

function vertices(t: Tube, lines: string[]): void {
  const { data, length } = t.known, { n, store, values } = t;
  for (const i of sorted(data, length, 3)) {
    const x = data[i]!, y = data[i + 1]!, z = data[i + 2]!, flags = store.get(x, y, z);
    let line = n === 2 ? `v ${x} ${y}` : `v ${x} ${y} ${z}`;
    line += flags & SIGN ? " 1" : " 0";
    const id = values ? values.id(x, y, z) : -1;
    lines.push(id < 0 ? line : `${line} ${values!.missing[id]!} ${values!.number[id]!}`);
  }
}

/** The lines of an isovalue, which has no tube before its first layer. */
function tube(t: Tube | undefined, lines: string[]): void {
  if (!t) return void lines.push("level -1");
  const { n } = t;
  lines.push(`level ${t.shown}`);
  const { data, length } = t.explicit;
  for (const i of sorted(data, length, 3)) {
    const p = Array.from(data.subarray(i, i + 3));
    if (t.grid.levelOf(p[0]!, p[1]!, p[2]!) >= t.uniform) lines.push(`m ${p.slice(0, n).join(" ")}`);
  }
  vertices(t, lines);
  const offsets = t.offsets;
  if (!offsets) return;
  const { edges, parts, number } = offsets, e = edges.ends;
  for (const o of sorted(e, 6 * edges.count, 6)) {
    const id = o / 6;
    if (parts[id]! <= 1) continue;
    const low = Array.from(e.subarray(o, o + n)), high = Array.from(e.subarray(o + 3, o + 3 + n));
    lines.push(`e ${[...low, ...high, parts[id]!, number[id]!].join(" ")}`);
  }
}

/** The text of all that has been decoded; nothing before the header is there. */
export function canonicalText(decoder: Decoder): string {
  const { grid, domain } = decoder;
  const lines = grid ? [`shape ${grid.header.shape.join(" ")}`] : (domain?.head() ?? []);
  if (!lines.length) return "";
  decoder.frames.forEach((contours, frame) => {
    if (!contours) throw new Error(`frame ${frame} has not been kept: decode with keepFrames`);
    if (frame) lines.push(`frame ${frame}`);
    contours.forEach((_, i) => {
      if (i) lines.push(`isovalue ${i}`);
      if (grid) tube(grid.series.frames[frame]![i]!.strand?.tube, lines);
      else domain!.lines(frame, i, lines);
    });
  });
  const mask = grid?.mask?.tube;
  if (mask) {
    lines.push("mask", `level ${mask.shown}`);
    vertices(mask, lines);
  }
  return lines.join("\n") + "\n";
}

/** The lines of B.1(9). */
function coordinateLines({ periodic, coordinates }: Coordinates): string[] {
  const lines = ["coordinates", ["periodic", ...periodic].join(" ")], n = coordinates.length;
  const hex = (x: number): string => {
    const view = new DataView(new ArrayBuffer(8));
    view.setFloat64(0, x);
    return view.getBigUint64(0).toString(16).padStart(16, "0");
  };
  coordinates.forEach(({ origin, unit, period, nodes, values }, r) => {
    lines.push(`c ${r} ${period} ${hex(origin)} ${hex(unit)}`);
    let at = 0;
    for (let x = 0; x < nodes[0]; x++) for (let y = 0; y < nodes[1]; y++) for (let z = 0; z < nodes[2]; z++)
      lines.push(`n ${[x, y, z].slice(0, n).join(" ")} ${values[at++]!}`);
  });
  return lines;
}

/** The lines that a reader of coordinates may print behind that text (B.1(9)); nothing without coordinates. */
export function coordinatesText(decoder: Decoder): string {
  const coordinates = coordinatesOf(decoder);
  return coordinates ? coordinateLines(coordinates).join("\n") + "\n" : "";
}

/** Tiles of a file whose text is made; one of more tiles is refused (B.4). */
const MOST_TILES = 65536;

/** The text of a file in tiles (B.4), all of which is decoded. Throws what is wrong with it. */
export async function tiledText(file: TiledFile): Promise<string> {
  const { directory, head: { shape, tiles, isovalues, together, stages } } = file, lines = [`tiles ${shape.join(" ")}`], last = stages.length - 1;
  await directory.whole();
  if (tiles.reduce((product, m) => product * m, 1) > MOST_TILES) throw new IsoError("limit", "11.2", 0, "a text of so many tiles");
  const blocks = await directory.blocks(undefined);
  for (let i = 0; i < isovalues.length; i += together) {
    lines.push(`isovalue ${i}`);
    const places = blocks.flatMap(([block, channels]) => directory.coded(block, channels, directory.group(i), undefined)).sort(before);
    const groups = await directory.fetch(places.flatMap((place) => directory.segments(place, i, last)));
    for (const place of places) {
      const text = canonicalText(await file.decode(directory.file(place, i, last, groups))), state = text.split("mask\n", 1)[0]!;
      if (/^v /m.test(state)) lines.push(`tile ${place.index.join(" ")}`, text.trimEnd());
    }
  }
  return lines.join("\n") + "\n";
}

/** The lexicographic order of indices. */
function before({ index: p }: Place, { index: q }: Place): number {
  const a = p.findIndex((x, i) => x !== q[i]);
  return p[a]! - q[a]!;
}
