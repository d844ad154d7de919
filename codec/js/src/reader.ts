/** The bytes of a file as they come, and the numbers in them (3.1, 3.2, 3.3.4). */
import { Input } from "./coder.js";
import { crc32 } from "./crc.js";
import { IsoError } from "./errors.js";

/** Something that goes on as bytes come: yields whenever those that it needs are not there. */
export type Steps<T = void> = Generator<void, T, void>;

/** Where the bytes of a payload come from; both return after their bytes are there. */
export interface Bytes {
  byte(clause: string): Steps<number>;
  varint(clause: string): Steps<number>;
  error(clause: string, what: string): IsoError;
}

export class Reader implements Bytes {
  readonly input = new Input();
  /** Place in the input of the next byte, and the end of the payload it is in. */
  at = 0;
  stop = Infinity;
  /** CRC-32 of all bytes before the present chunk. */
  private crc = 0;

  /** The number of bytes of the file before the next one. */
  get offset(): number {
    return this.input.dropped + this.at;
  }

  error(clause: string, what: string): IsoError {
    return new IsoError("malformed", clause, this.offset, what);
  }

  /** A chunk begins: what came before it is done. */
  begin(): void {
    this.crc = crc32(this.crc, this.input.data, 0, this.at);
    this.input.drop(this.at);
    this.at = 0;
    this.stop = Infinity;
  }

  /** Read on in the payload from `at` to `stop`, which is there. */
  enter(at: number, stop: number): void {
    this.at = at;
    this.stop = stop;
  }

  *need(count: number): Steps {
    while (this.input.length - this.at < count) yield;
  }

  *byte(clause: string): Steps<number> {
    if (this.at >= this.stop) throw this.error(clause, "a payload ends too early");
    yield* this.need(1);
    return this.input.data[this.at++]!;
  }

  *varint(clause: string): Steps<number> {
    return Number(yield* this.wide(clause));
  }

  /** A varint (3.2.1); one of many bytes as BigInt. */
  *wide(clause: string): Steps<number | bigint> {
    let value = 0, big = 0n;
    for (let i = 0; ; i++) {
      const byte = yield* this.byte(clause);
      if ((i === 0 && byte === 128) || (i === 8 && byte >= 128)) throw this.error(clause, "a number is not well formed");
      if (i === 7) big = BigInt(value);
      if (i >= 7) big = big * 128n + BigInt(byte & 127);
      else value = value * 128 + (byte & 127);
      if (byte < 128) return i >= 7 ? big : value;
    }
  }

  /** A signed integer (3.2.2), rounded to binary64. */
  *signed(clause: string): Steps<number> {
    const u = yield* this.wide(clause);
    if (typeof u === "bigint") return Number(u % 2n === 0n ? u / 2n : -(u + 1n) / 2n);
    return u % 2 === 0 ? u / 2 : -(u + 1) / 2;
  }

  private *fixed(count: number, clause: string): Steps<DataView> {
    const view = new DataView(new ArrayBuffer(8));
    for (let i = 0; i < count; i++) view.setUint8(i, yield* this.byte(clause));
    return view;
  }

  *binary64(clause: string): Steps<number> {
    return (yield* this.fixed(8, clause)).getFloat64(0);
  }

  /** An isovalue (3.3.4). */
  *isovalue(kind: number, clause: string): Steps<number> {
    const c = kind === 0 ? (yield* this.signed(clause)) / 2 : kind === 3 ? yield* this.decimal(clause)
      : kind === 1 ? (yield* this.fixed(4, clause)).getFloat32(0) : yield* this.binary64(clause);
    if (!Number.isFinite(c)) throw this.error("3.3.4", "an isovalue that is not finite");
    return c;
  }

  private *decimal(clause: string): Steps<number> {
    const places = yield* this.byte(clause), units = yield* this.signed(clause);
    if (places < 1 || places > 15 || Math.abs(units) >= 2 ** 53) throw this.error("3.3.4", "a decimal out of range");
    return units / Number(`1e${places}`);
  }

  /** The checksum that comes next, of the bytes of the chunk so far or, with `all`, of those of the file. */
  *checksum(clause: string, all: boolean): Steps {
    const crc = crc32(all ? this.crc : 0, this.input.data, 0, this.at);
    yield* this.need(4);
    const d = this.input.data, at = this.at;
    if (((d[at]! << 24) | (d[at + 1]! << 16) | (d[at + 2]! << 8) | d[at + 3]!) >>> 0 !== crc)
      throw this.error(clause, "a checksum is wrong");
    this.at += 4;
  }
}
