/** Chunks of a file, whatever is in them (3.4, 3.5.1 to 3.5.3). */
import type { Steps } from "./reader.js";
import type { Session } from "./session.js";

/** What the chunks of a kind of domain mean. */
export interface Contents {
  /** Check whether a critical chunk may stand here; its length has been read. */
  expect(type: number): void;
  /** Decode as much of a critical chunk's payload as can be before its checksums; the reader stands at its beginning. */
  arrive(type: number): Steps;
  /** Take a critical chunk, its checksums verified; it ends at `bytes` of the file. The reader stands at its payload. */
  take(type: number, payload: number, stop: number, bytes: number): Steps;
  note: Note;
}

/** Takes an ancillary chunk, its checksums verified; false if it means nothing. */
export type Note = (type: number, payload: Uint8Array, bytes: number) => boolean;

const CRITICAL = [1, 5, 7, 9, 10, 11, 13];

export function* readChunks(s: Session, contents: Contents, note: Note): Steps {
  const { r, meter } = s;
  for (let last = false; !last; ) {
    r.begin();
    meter.bytes = r.offset;
    yield* r.need(1);
    const head = r.input.data[r.at]!, type = head & 31, critical = (head & 128) === 0;
    if (critical !== CRITICAL.includes(type)) throw r.error("3.5.2", "an unknown critical chunk");
    r.at++;
    const length = yield* r.varint("3.4.2");
    if (critical) contents.expect(type);
    const payload = r.at, stop = payload + length;
    r.stop = stop;
    if (critical) yield* contents.arrive(type);
    yield* r.need(stop - r.at);
    r.at = stop;
    last = (head & 32) !== 0;
    if (head & 64) yield* r.checksum("3.5.3", false);
    if (last) yield* r.checksum("3.4.4", true);
    const end = r.at, bytes = r.offset;
    meter.bytes = bytes;
    if (critical) {
      r.enter(payload, stop);
      yield* contents.take(type, payload, stop, bytes);
    } else if (!note(type, r.input.data.subarray(payload, stop), bytes))
      s.emit({ type: "skipped", bytes, chunk: type });
    r.at = end;
    if (last) s.emit({ type: "end", bytes });
  }
}
