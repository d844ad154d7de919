// Runs kernels of a WebAssembly module, named as the one argument, for runner.py, which talks to it over pipes.
//
// Every message is its length (four bytes, as all numbers: little endian) and so many bytes. The first one goes out:
// the names of the module's entries and the address from where on its memory is free, as JSON. A request is
//   length of a name, the name of the entry; the addresses of results, fault and slots; where memory may end;
//   number of regions to be written, for each its address, its size and its bytes;
//   number of regions that the kernel may write, for each its address and its size.
// An answer is the status, the 64 bytes of results, and for each region that has changed address, size and bytes; or,
// if the kernel failed, the status FAILED and why.

import { readFileSync, readSync, writeSync } from "node:fs";

const PAGE = 65536;
const RESULTS = 64;
const FAILED = -1;

const module = new WebAssembly.Module(readFileSync(process.argv[2]));
const { memory, __heap_base, ...entries } = new WebAssembly.Instance(module).exports;
let live = Buffer.from(memory.buffer);
let known = Buffer.from(live); // what the other side knows of the memory

function received(size) {
  const out = Buffer.allocUnsafe(size);
  for (let place = 0; place < size; ) {
    const count = readSync(0, out, place, size - place, null);
    if (count === 0) process.exit(0);
    place += count;
  }
  return out;
}

function send(parts) {
  const content = Buffer.concat(parts);
  const whole = Buffer.concat([numbers(content.length), content]);
  for (let place = 0; place < whole.length; ) place += writeSync(1, whole, place);
}

function numbers(...values) {
  const out = Buffer.alloc(4 * values.length);
  values.forEach((value, i) => out.writeInt32LE(value | 0, 4 * i));
  return out;
}

function grow(end) {
  if (end <= live.length) return;
  memory.grow(Math.ceil(Math.max(end - live.length, live.length) / PAGE));
  live = Buffer.from(memory.buffer);
  const before = known;
  known = Buffer.alloc(live.length);
  before.copy(known);
}

function answer(request) {
  let at = 0;
  const number = () => request.readUInt32LE((at += 4) - 4);
  const bytes = (size) => request.subarray(at, (at += size));

  const name = bytes(number()).toString();
  const [results, fault, slots] = [number(), number(), number()];
  grow(number());
  for (let left = number(); left > 0; left--) {
    const [address, size] = [number(), number()];
    const content = bytes(size);
    content.copy(live, address);
    content.copy(known, address);
  }
  const status = entries[name](results, fault, slots);
  const parts = [numbers(status), Buffer.from(live.subarray(results, results + RESULTS))];
  for (let left = number(); left > 0; left--) {
    const [address, size] = [number(), number()];
    const found = live.subarray(address, address + size);
    if (found.compare(known, address, address + size) === 0) continue;
    found.copy(known, address);
    parts.push(numbers(address, size), found);
  }
  return parts;
}

send([Buffer.from(JSON.stringify({ entries: Object.keys(entries), free: __heap_base.value }))]);
for (;;) {
  const request = received(received(4).readUInt32LE());
  let parts;
  try {
    parts = answer(request);
  } catch (error) {
    parts = [numbers(FAILED), Buffer.from(String(error))];
  }
  send(parts);
}
