/** The file of a tile, put together from its segments (12.6(2)). */
import { crc32 } from "../crc.js";
import type { Opened } from "./head.js";
import type { TilesHead } from "./types.js";

function varint(x: number): number[] {
  const bytes = [x % 128];
  while ((x = Math.floor(x / 128))) bytes.unshift(128 + (x % 128));
  return bytes;
}

function scaleBytes(scale: number): number[] {
  const exponent = Math.round(Math.log2(scale)), view = new DataView(new ArrayBuffer(8));
  if (2 ** exponent === scale && Math.abs(exponent) < 128) return [exponent & 255];
  view.setFloat64(0, scale);
  return [128, ...new Uint8Array(view.buffer)];
}

/** A critical chunk without a checksum of its own. */
function chunk(type: number, payload: number[]): Uint8Array {
  return new Uint8Array([type, ...varint(payload.length), ...payload]);
}

/**
 * The file of a tile of `widths` samples at isovalues of a group: `segments` are those of its stages, in each those of all
 * these isovalues.
 */
export function assemble({ head, coded }: Opened, isovalues: readonly number[], widths: readonly number[], mask: Uint8Array | undefined,
                         segments: readonly Uint8Array[]): Uint8Array {
  const count = isovalues.length, further = isovalues.slice(1).map((i) => chunk(5, [coded[i]!.kind << 6 | 1, ...coded[i]!.bytes]));
  const layers = segments.flatMap((segment, i) => (count > 1 ? [chunk(11, [...varint(i % count), 1]), segment] : [segment]));
  return enclose(head, coded[isovalues[0]!]!, widths, [...(mask ? [mask] : []), ...further, ...layers]);
}

/** Chunks between a header and a last one. */
function enclose(head: TilesHead, { kind, bytes }: Opened["coded"][number], widths: readonly number[], segments: readonly Uint8Array[]): Uint8Array {
  const equal = widths.every((w) => w === widths[0]);
  const flags = Number(equal) << 6 | Number(head.scale !== undefined) << 5 | kind << 3 | (head.n - 2) << 2 | Number(head.profile === "main");
  const start = [
    0x89, 0x49, 0x53, 0x4f, 0x11, flags, ...(equal ? widths.slice(0, 1) : widths).flatMap(varint), ...bytes,
    ...(head.scale === undefined ? [] : scaleBytes(head.scale)),
  ];
  const end = start.length + segments.reduce((sum, each) => sum + each.length, 0), file = new Uint8Array(end + 6);
  file.set(start);
  let at = start.length;
  for (const segment of segments) {
    file.set(segment, at);
    at += segment.length;
  }
  file.set([0xa3, 0], end);
  new DataView(file.buffer).setUint32(end + 2, crc32(0, file, 0, end + 2));
  return file;
}
