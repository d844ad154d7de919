// Files that state much and hold little: what they take of memory and time.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import * as domains from "../dist/domain.js";
import { Decoder } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { joined, varint } from "./files.mjs";
import { kernels } from "./kernels.mjs";

const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));
const LAYERS = 1, ISOVALUE = 5, FRAME = 9, DOMAIN = 10, SERIES = 13, METADATA = 0x83;
const chunk = (head, payload) => ({ head, payload });
const times = (count, make) => Array.from({ length: count }, (_, i) => make(i));
const signature = [0x89, 0x49, 0x53, 0x4f, 0x11];
/** Headers of a field of 17 x 17 samples and of meshes, isovalue 0. */
const HEADERS = { baseline: [...signature, 0x40, 17, 0], main: [...signature, 0x41, 17, 0], mesh: [...signature, 0x81, 0], space: [...signature, 0x85, 0] };
/** A domain of triangles or tetrahedra whose run is `run`. */
const coded = (d, V, T, run) => chunk(DOMAIN, [0x10, 0, ...varint(V), ...varint(T), 1, ...new Array(d).fill(0), ...times(d, () => varint(4096)).flat(), ...run]);
const TRIANGLE = coded(2, 3, 1, [0xff, 0xff, 0xff, 0xff]);

function decoded(header, chunks, options) {
  const started = process.cpuUsage(), decoder = new Decoder({ main, domains, ...options });
  const events = decoder.feed(joined({ header, chunks }));
  events.push(...decoder.end());
  const { user, system } = process.cpuUsage(started);
  assert.ok(user + system < 3e7, `${user + system} microseconds`);
  return { decoder, events };
}

const ISOVALUES = (lean) => times(4095, (i) => chunk(ISOVALUE, [lean, ...varint(2 * (i + 1))]));

for (const [profile, header] of Object.entries(HEADERS).slice(0, 2)) for (const lean of [0, 1]) for (const compiled of kernels ? [undefined, kernels] : [undefined]) {
  test(`${profile}${compiled ? ", compiled" : ""}: isovalues without layers take no memory, in frames either; lean ${lean}`, () => {
    const { decoder, events } = decoded(header, [...ISOVALUES(lean), chunk(SERIES, [0]), ...times(3 * 4096, () => chunk(FRAME, []))], { kernels: compiled });
    assert.equal(decoder.error, undefined);
    assert.equal(events.filter(({ type }) => type === "frame").length, 3 * 4096);
    assert.ok(decoder.meter.memory < 2 ** 20, `${decoder.meter.memory} bytes`);
  });
}

test("isovalues of a mesh without layers take no memory", () => {
  const few = decoded(HEADERS.mesh, [TRIANGLE]).decoder, { decoder } = decoded(HEADERS.mesh, [TRIANGLE, ...ISOVALUES(1), chunk(SERIES, [0]), ...times(3 * 4096, () => chunk(FRAME, []))]);
  // the run of random bytes may be wrong: then it is so in both
  assert.equal(decoder.error?.clause, few.error?.clause);
  assert.ok(decoder.meter.memory < 2 ** 20, `${decoder.meter.memory} bytes`);
});

test("a mesh in a file takes what its cells take, not what it states", { timeout: 120000 }, () => {
  for (const [header, d] of [[HEADERS.mesh, 2], [HEADERS.space, 3]]) for (const byte of [0, 0x55, 0xff]) {
    const { decoder } = decoded(header, [coded(d, 1e6, 4e6, new Array(20000).fill(byte)), chunk(LAYERS, [0])], { limits: { memory: 2 ** 26, work: 2 ** 21 } });
    assert.notEqual(decoder.error, undefined);
    assert.doesNotMatch(decoder.error.message, /memory/, `${d}, ${byte}`);
  }
});

test("chunks of metadata take as long as they are many", () => {
  const notes = (count) => times(count, (i) => chunk(METADATA, Buffer.from(`{"k${i}":"v"}`)));
  const { decoder, events } = decoded(HEADERS.baseline, notes(40000));
  assert.deepEqual([events.length, Object.keys(decoder.metadata).length], [40002, 40000]);
});
