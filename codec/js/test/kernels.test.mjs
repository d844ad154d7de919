// Compiled kernels: every vector of a grid, after each layer and in pieces; what is drawn is what the package's own passes draw.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { existsSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { draw } from "../dist/draw.js";
import { Decoder } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { canonicalText, tiledText } from "../dist/text.js";
import { openTiles } from "../dist/tiles.js";
import { kernels } from "./kernels.mjs";

const folder = new URL("../../../conformance/vectors/", import.meta.url);
const { vectors } = JSON.parse(readFileSync(new URL("manifest.json", folder), "utf8"));
const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));
const hash = (text) => createHash("sha256").update(text).digest("hex");
const skip = kernels ? false : "they have not been built";
const domain = ({ name }) => /^(bad_)?(mesh|tin)_|^bad_(known|coded|delaunay|mesh_series|surface)_chunk_/.test(name) || existsSync(new URL(`${name}.mesh`, folder));
const inTiles = ({ name }) => /^(bad_)?tiled_|^bad_tiles_/.test(name);

function status({ error }) {
  return error ? { malformed: "error", truncated: "truncated", limit: "limit" }[error.kind] : "ok";
}

/** The drawings of all isovalues: their cells by the points of these, in which nothing but the numbers of points may differ. */
function drawn(decoder) {
  return decoder.contours.map((_, i) => {
    const { d, points, cells } = draw(decoder, i);
    return Array.from(cells, (c) => points.subarray(d * c, d * c + d).join()).join(" ");
  });
}

/** States after each layer, and drawings. */
function followed(data, paused, options) {
  const decoder = new Decoder({ main, keepFrames: true, ...options }), states = [], drawings = [];
  decoder.pauseAt = paused ? 1 : Infinity;
  decoder.feed(data);
  while (decoder.layers >= decoder.pauseAt) {
    states.push(hash(canonicalText(decoder)));
    drawings.push(drawn(decoder));
    decoder.pauseAt++;
    decoder.go();
  }
  decoder.end();
  drawings.push(drawn(decoder));
  return { decoder, states, drawings };
}

for (const vector of vectors.filter((v) => !domain(v) && !inTiles(v))) {
  test(vector.name, { skip }, () => {
    const data = readFileSync(new URL(vector.file, folder)), paused = Boolean(vector.layers);
    const { decoder, states, drawings } = followed(data, paused, { kernels });
    // beyond all tiers of conformance a decoder may also go on: the run is too short
    assert.ok([vector.expected.status, ...(vector.tier === 2 ? ["error"] : [])].includes(status(decoder)), status(decoder));
    if (vector.expected.state) assert.equal(hash(canonicalText(decoder)), vector.expected.state);
    if (!paused) return;
    assert.deepEqual(states.slice(0, vector.layers.length), vector.layers.map((layer) => layer.state));
    if (data.length > 20000) return;
    assert.deepEqual(drawings, followed(data, paused, {}).drawings);
    const pieces = new Decoder({ main, kernels, keepFrames: true }), own = new Decoder({ main, keepFrames: true });
    for (let at = 0, i = 1; at < data.length; at += i, i = (i % 7) + 1) {
      for (const each of [pieces, own]) each.feed(data.subarray(at, at + i));
      // in the middle of layers, too
      if (at % 16 === 0) assert.deepEqual(drawn(pieces), drawn(own));
    }
    pieces.end();
    assert.equal(canonicalText(pieces), canonicalText(decoder));
  });
}

test("files in tiles", { skip }, async () => {
  for (const { name, file, expected } of vectors.filter((v) => inTiles(v) && v.expected.status === "ok"))
    assert.equal(hash(await tiledText(await openTiles(new Uint8Array(readFileSync(new URL(file, folder))), { main, kernels }))), expected.state, name);
});

test("frames that are not kept give their memory back", { skip }, () => {
  const { file } = vectors.find((v) => v.name === "plane_frames_main_values"), data = readFileSync(new URL(file, folder));
  const [kept, dropped] = [true, false].map((keepFrames) => {
    const decoder = new Decoder({ main, kernels, keepFrames });
    decoder.feed(data);
    return decoder.meter.memory;
  });
  assert.ok(dropped < kept, `${dropped} of ${kept}`);
});

test("what is no module of kernels is refused", { skip }, async () => {
  const { Kernels } = await import("../dist/kernels.js");
  assert.throws(() => new Kernels(new WebAssembly.Module(Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0))), /not a module of isocodec's kernels/);
});
