// Smoothing that files ask for (9.10): the same points as the reference draws, for each number of layers.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { draw } from "../dist/draw.js";
import { Decoder } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { python, root } from "./reference.mjs";

const main = new MainProfile(new Uint8Array(readFileSync(new URL("../dist/main.bin", import.meta.url))));

function decoded(data) {
  const decoder = new Decoder({ main });
  decoder.feed(data);
  return decoder;
}

/** The points of a drawing by those of another one of the same mesh, in which they are told apart. */
function byPlain(n, plain, points) {
  const texts = Array.from({ length: plain.length / n }, (_, v) => plain.slice(n * v, n * v + n).map((x) => (x + 1e-9).toFixed(6)).join());
  return new Map(texts.map((text, v) => [text, points.slice(n * v, n * v + n)]));
}

test("drawings are those of the reference", { skip: !existsSync(python) && "the reference is not installed" }, () => {
  const made = spawnSync(python, [fileURLToPath(new URL("smooth.py", import.meta.url))], { cwd: root, maxBuffer: 1 << 28 });
  assert.equal(made.status, 0, String(made.stderr));
  const lines = String(made.stdout).trim().split("\n").map((line) => JSON.parse(line));
  const full = lines.filter(({ parts }) => parts);
  assert.ok(full.length > 30 && lines.length > 2 * full.length);
  for (const { data, even, plain, parts } of lines) {
    const decoder = decoded(new Uint8Array(Buffer.from(data, "base64"))), { n } = decoder.header;
    const [moved, unmoved] = [true, false].map((on) => Array.from(draw(decoder, 0, 0, false, on).points));
    if (!parts) {
      // a file asks for it on the full grid
      assert.deepEqual(moved, unmoved);
      continue;
    }
    const theirs = byPlain(n, plain.flat(), even.flat()), ours = byPlain(n, unmoved, moved);
    assert.deepEqual([...ours.keys()].sort(), [...theirs.keys()].sort());
    const off = [...ours].map(([text, point]) => Math.max(...point.map((x, a) => Math.abs(x - theirs.get(text)[a]))));
    if (n === 2) assert.ok(Math.max(...off) < 1e-9);
    // which triangles are in a cube is free (9.4(3)), and with them who is whose neighbour
    assert.ok(Math.max(...off) <= 1 / parts && off.reduce((sum, x) => sum + x, 0) / off.length < 0.1 / parts);
    const still = even.flat().every((x, i) => x === plain.flat()[i]);
    assert.equal(moved.every((x, i) => x === unmoved[i]), still);
  }
});
