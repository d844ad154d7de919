// Every conformance vector: the state after the whole file, after each layer, and in pieces.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { existsSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { Decoder, IsoError } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { canonicalText, coordinatesText, tiledText } from "../dist/text.js";
import { openTiles } from "../dist/tiles.js";
import * as domains from "../dist/domain.js";
import { readMesh } from "./mesh.mjs";

const folder = new URL("../../../conformance/vectors/", import.meta.url);
const { vectors } = JSON.parse(readFileSync(new URL("manifest.json", folder), "utf8"));
const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));
const hash = (text) => createHash("sha256").update(text).digest("hex");

/** 4.5 million symbols of numbers with 52 bits. */
const SLOW = ["plane_main_mixing_limit"];

function status({ error }) {
  return error ? { malformed: "error", truncated: "truncated", limit: "limit", mesh: "mesh" }[error.kind] : "ok";
}

for (const { name, file, expected } of vectors.filter((v) => /^(bad_)?tiled_/.test(v.name))) {
  test(name, async () => {
    const found = { text: "" }, data = new Uint8Array(readFileSync(new URL(file, folder)));
    try {
      found.text = await tiledText(await openTiles(data, { main }));
    } catch (error) {
      found.error = error;
      assert.ok(error instanceof IsoError && error.offset <= data.length, String(error.stack));
    }
    assert.equal(status(found), expected.status);
    if (expected.state) assert.equal(hash(found.text), expected.state);
  });
}

for (const vector of vectors.filter((v) => !/^(bad_)?tiled_/.test(v.name))) {
  const slow = SLOW.includes(vector.name) && !process.env.ISOCODEC_SLOW;
  test(vector.name, { skip: slow ? "takes long" : false }, () => {
    const data = readFileSync(new URL(vector.file, folder));
    const beside = new URL(`${vector.name}.mesh`, folder);
    const options = { main, domains, mesh: existsSync(beside) ? readMesh(readFileSync(beside, "utf8")) : undefined, keepFrames: true };
    const decoder = new Decoder(options);
    const states = [];
    decoder.pauseAt = vector.layers ? 1 : Infinity;
    decoder.feed(data);
    while (decoder.layers >= decoder.pauseAt) {
      states.push(hash(canonicalText(decoder)));
      decoder.pauseAt++;
      decoder.go();
    }
    decoder.end();
    assert.equal(status(decoder), vector.expected.status);
    if (vector.expected.state) assert.equal(hash(canonicalText(decoder)), vector.expected.state);
    const coordinates = coordinatesText(decoder);
    assert.equal(coordinates && hash(coordinates), vector.expected.coordinates ?? "");
    if (!vector.layers) return;
    assert.deepEqual(states.slice(0, vector.layers.length), vector.layers.map((layer) => layer.state));
    if (data.length > 20000) return;
    const pieces = new Decoder(options);
    for (let at = 0, i = 1; at < data.length; at += i, i = (i % 7) + 1) pieces.feed(data.subarray(at, at + i));
    pieces.end();
    assert.equal(canonicalText(pieces), canonicalText(decoder));
  });
}
