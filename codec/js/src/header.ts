/** The header of a file (3.3). */
import type { Header } from "./events.js";
import type { Reader, Steps } from "./reader.js";

export function* readHeader(r: Reader): Steps<Header> {
  for (const byte of [0x89, 0x49, 0x53, 0x4f]) {
    if ((yield* r.byte("3.3.1")) !== byte) throw r.error("3.3.1", "not a file of isocontours: the signature is missing");
  }
  yield* r.need(2);
  const version = yield* r.byte("3.3.1"), flags = yield* r.byte("3.3.2");
  if ((version & 15) !== 1) throw r.error("3.3.1", "another version of the format");
  if ((flags & 3) > 1) throw r.error("3.3.2", "an unknown profile");
  const kind = (flags >> 3) & 3, n = 2 + ((flags >> 2) & 1), explicit = (flags & 128) !== 0;
  if (explicit && (flags & 67) !== 1) throw r.error("3.3.2", "flags that exclude one another");
  const shape: number[] = [];
  for (let a = 0; !explicit && a < (flags & 64 ? 1 : n); a++) {
    const size = yield* r.varint("3.3.3");
    if (size < 1 || size > 2 ** (n === 2 ? 24 : 20)) throw r.error("3.3.3", "a size out of range");
    shape.push(size);
  }
  while (!explicit && shape.length < n) shape.push(shape[0]!);
  const isovalue = yield* r.isovalue(kind, "3.3.4");
  let scale: number | undefined;
  if (flags & 32) {
    const e = yield* r.byte("3.3.5");
    scale = e === 128 ? yield* r.binary64("3.3.5") : 2 ** (e < 128 ? e : e - 256);
    if (!(scale > 0 && scale < Infinity)) throw r.error("3.3.5", "a scale that is not positive and finite");
  }
  return { n, shape, explicit, profile: flags & 1 ? "main" : "baseline", isovalue, scale };
}
