/** Numbers one after the other in the bytes of a directory (3.1, 3.2, 12.3 to 12.5). */
import { crc32 } from "../crc.js";
import { IsoError } from "../errors.js";
import { Reader } from "../reader.js";

export class Cursor {
  at = 0;

  /** Reads `bytes`, which begin at the byte `offset` of the file; what is wrong with the next ones violates `clause`. */
  constructor(readonly bytes: Uint8Array, private readonly offset: number, public clause: string) {}

  error(what: string, clause = this.clause): IsoError {
    return new IsoError("malformed", clause, this.offset + this.at, what);
  }

  byte(): number {
    if (this.at >= this.bytes.length) throw this.error("a directory ends too early");
    return this.bytes[this.at++]!;
  }

  /** A varint; one beyond `2**53` is rounded. */
  varint(): number {
    let value = 0;
    for (let i = 0; ; i++) {
      const byte = this.byte();
      if ((i === 0 && byte === 128) || (i === 8 && byte >= 128)) throw this.error("a number is not well formed");
      value = value * 128 + (byte & 127);
      if (byte < 128) return value;
    }
  }

  word(): number {
    return ((this.byte() << 24) | (this.byte() << 16) | (this.byte() << 8) | this.byte()) >>> 0;
  }

  take(count: number): Uint8Array {
    if (count > this.bytes.length - this.at) throw this.error("a directory ends too early");
    return this.bytes.subarray(this.at, (this.at += count));
  }

  binary64(): number {
    const { buffer, byteOffset } = this.take(8);
    return new DataView(buffer, byteOffset).getFloat64(0);
  }

  /** An isovalue (3.3.4). */
  isovalue(kind: number): number {
    const r = new Reader();
    r.input.push(this.bytes.subarray(this.at));
    r.input.dropped = this.offset + this.at;
    r.stop = this.bytes.length - this.at;
    const { value } = r.isovalue(kind, this.clause).next();
    this.at += r.at;
    return value as number;
  }

  /** The end of what has a checksum: nothing else follows. */
  end(what: string): void {
    if (this.at < this.bytes.length) throw this.error(`there are bytes behind ${what}`);
  }
}

/** Check the CRC-32 `sum` of bytes that begin at the byte `offset` of the file. */
export function verify(bytes: Uint8Array, sum: number, offset: number, clause: string, what: string): void {
  if (crc32(0, bytes, 0, bytes.length) !== sum)
    throw new IsoError("malformed", clause, offset, `the checksum of ${what} is wrong`);
}
