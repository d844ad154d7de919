// Servers that answer wrongly, too much, too late or never, when a file in tiles is opened and when a window is read.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";
import { MainProfile } from "../dist/main.js";
import { openTiles } from "../dist/tiles.js";
import { emptyTiles, entry } from "./files.mjs";

const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));
/** Bytes of a file that is taken whole. */
const WHOLE = 2 ** 24;
/** A file whose leaf directory, of runs of one tile each, reaches beyond what is read first. */
const leaf = new Uint8Array(2 ** 16);
const head = emptyTiles({ shape: [32 * 256 + 1, 32 * 256 + 1], block: 8, leaves: [], entries: [entry(leaf)] });
const DATA = Buffer.concat([head, leaf]);
const PACKED = gzipSync(Buffer.alloc(2 ** 27));
const VERSION = { etag: '"1"', "last-modified": "Sat, 28 Nov 2026 00:00:00 GMT" };

const partly = (answer, { from, to }, more = {}) =>
  answer.writeHead(206, { ...VERSION, "content-range": `bytes ${from}-${to - 1}/${DATA.length}`, ...more });
const ranged = (answer, range, more) => partly(answer, range, more).end(DATA.subarray(range.from, range.to));
function endless(answer) {
  const more = () => { while (!answer.destroyed && answer.write(Buffer.alloc(65536))); };
  answer.on("drain", more);
  more();
}

/** Answers, and what of them is found. */
const FAULTS = {
  "the whole of an endless file": [(answer) => endless(answer.writeHead(200)), /sends the whole file/],
  "the whole of a file that is long, as it says": [(answer) => answer.writeHead(200, { "content-length": 2 ** 40 }).write("x"), /sends the whole file/],
  "a range without end": [(answer, range) => endless(partly(answer, range)), /sends more than the requested bytes/],
  "a range without end that is not stated": [(answer) => endless(answer.writeHead(206)), /sends more than the requested bytes/],
  "a byte too many": [(answer, range) => partly(answer, range).end(Buffer.alloc(range.to - range.from + 1)), /sends more than the requested bytes/],
  "a byte too few": [(answer, range) => partly(answer, range).end(DATA.subarray(range.from, range.to - 1)), /ends too early/],
  "fewer bytes, as it says": [(answer, { from, to }) => ranged(answer, { from, to: to - 1 }), /sends other bytes/],
  "other bytes": [(answer, { from, to }) => ranged(answer, { from: from + 1, to }), /sends other bytes/],
  "bytes that are not stated well": [(answer, range) => ranged(answer, range, { "content-range": "bytes 5" }), /sends other bytes/],
  "a connection that breaks": [(answer, range) => {
    partly(answer, range, { "content-length": range.to - range.from }).write(DATA.subarray(range.from, range.from + 9));
    setTimeout(() => answer.destroy(), 50);
  }, /cannot be read/],
  "a packed body": [(answer, range) => partly(answer, range, { "content-encoding": "gzip" }).end(PACKED), /compresses what it sends/],
  "a packed body of the whole file": [(answer) => answer.writeHead(200, { "content-encoding": "gzip" }).end(PACKED), /compresses what it sends/],
  "no file": [(answer) => answer.writeHead(404).end("no".repeat(9999)), /404/],
  "nothing": [(answer) => answer.writeHead(204).end(), /204/],
  "being busy": [(answer) => answer.writeHead(503, { "retry-after": "0" }).end(), /503/],
  "being busy for long": [(answer) => answer.writeHead(503, { "retry-after": "1e300" }).end(), /503/],
  "no connection": [(answer) => answer.destroy(), /cannot be read/],
  "no answer": [() => undefined, /has not answered within 0.4 seconds/],
  "an answer that stops": [(answer, range) => partly(answer, range).write("x"), /has not answered within 0.4 seconds/],
  "an answer of a byte now and then": [(answer, range) => {
    partly(answer, range);
    const timer = setInterval(() => answer.write("x"), 100);
    answer.on("close", () => clearInterval(timer));
  }, /has not answered within 0.4 seconds/],
};
/** Answers of which each is right, but not beside those before. */
const CHANGES = {
  "another tag": [(answer, range) => ranged(answer, range, { etag: '"2"' }), /has changed/],
  "another time": [(answer, range) => ranged(answer, range, { "last-modified": "Sun, 29 Nov 2026 00:00:00 GMT" }), /has changed/],
  "another size": [(answer, { from, to }) => ranged(answer, { from, to }, { "content-range": `bytes ${from}-${to - 1}/${DATA.length + 9}` }), /has changed/],
  "the whole of it after parts": [(answer) => answer.writeHead(200, VERSION).end(DATA), /sends the whole file/],
};

/** A server that answers so many requests as it should, others by `fault`; what it has sent of the latter. */
async function serving(fault, right = 0) {
  const seen = { count: 0, sent: 0 }, server = createServer((request, answer) => {
    const [, from, last] = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range), range = { from: Number(from), to: Math.min(Number(last) + 1, DATA.length) };
    if (seen.count++ < right) return void ranged(answer, range);
    const { socket } = answer, before = socket.bytesWritten;
    answer.on("close", () => (seen.sent += socket.bytesWritten - before));
    fault(answer, range);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { seen, url: `http://127.0.0.1:${server.address().port}/f.iso`, close: () => (server.closeAllConnections(), server.close()) };
}

const read = async (url, options) => (await openTiles(url, { main, timeout: 400, ...options })).all();

test("the file of this test takes more than one request", async () => {
  const { url, seen, close } = await serving(undefined, Infinity);
  assert.equal((await read(url)).cells.length, 0);
  assert.equal(seen.count, 2);
  close();
});

for (const [right, faults] of [[0, FAULTS], [1, { ...FAULTS, ...CHANGES }]]) for (const [name, [fault, message]] of Object.entries(faults)) {
  test(`${right ? "a window" : "opening"}: a server that sends ${name}`, async () => {
    const { url, seen, close } = await serving(fault, right), before = process.memoryUsage().rss, begun = Date.now();
    await assert.rejects(read(url), message);
    assert.ok(Date.now() - begun < 5000, `${Date.now() - begun} ms`);
    await new Promise((resolve) => setTimeout(resolve, 50));
    // what a connection holds beside what is read is not much
    assert.ok(seen.sent < WHOLE + 2 ** 24, `${seen.sent} bytes`);
    const grown = process.memoryUsage().rss - before;
    assert.ok(grown < 2 ** 27, `${grown} bytes of memory`);
    close();
  });
}

test("a short file comes whole from a server without ranges", async () => {
  const { url, seen, close } = await serving((answer) => answer.writeHead(200).end(DATA));
  assert.equal((await read(url)).cells.length, 0);
  assert.equal(seen.count, 1);
  await assert.rejects(read(url, { limits: { bytes: 1000 } }), { kind: "limit" });
  close();
});

test("a signal aborts requests", async () => {
  for (const right of [0, 1]) {
    const { url, close } = await serving(() => undefined, right), signal = AbortSignal.timeout(100), begun = Date.now();
    const reading = right ? openTiles(url, { main }).then((file) => file.all({ signal })) : openTiles(url, { main, signal });
    await assert.rejects(reading, { name: "TimeoutError" });
    assert.ok(Date.now() - begun < 3000);
    close();
  }
});

test("ranges take at most 8 requests and twice their bytes, unless they are far apart", async () => {
  const entry = fileURLToPath(new URL("../src/tiles/source.ts", import.meta.url));
  const { outputFiles: [{ text }] } = await build({ entryPoints: [entry], bundle: true, format: "esm", write: false });
  const { Pieces } = await import(`data:text/javascript;base64,${Buffer.from(text).toString("base64")}`);
  const data = new Blob([new Uint8Array(2 ** 23)]), random = (below) => Math.floor(Math.random() * below), counts = [];
  for (let i = 0; i < 500; i++) {
    const pieces = new Pieces(data, Infinity, 8000), large = 2 ** random(18), far = 2 ** random(20), ranges = [];
    for (let at = 0; ranges.length < 1 + random(60);) {
      const size = 1 + random(large);
      at += random(2) ? random(far) : 0;
      if (at + size > data.size) break;
      ranges.push({ at, size });
      at += size;
    }
    const found = await pieces.read(ranges), needed = ranges.reduce((sum, { size }) => sum + size, 0), { requests, received } = pieces;
    assert.deepEqual(found.map(({ length }) => length), ranges.map(({ size }) => size));
    if (requests < 8) assert.ok(received <= 2 * needed, `${received} of ${needed} bytes in ${requests} requests`);
    assert.ok(received <= 2 * needed + 2 ** 20, `${received} of ${needed} bytes in ${requests} requests`);
    counts.push(requests);
  }
  assert.ok(counts.filter((count) => count <= 8).length > 400, `${counts}`);
});
