// Mutated vectors, against the reference decoder's command line. ISOCODEC_MUTATED says how many; ISOCODEC_SEED which.
import assert from "node:assert/strict";
import { copyFileSync, existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { Decoder } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { canonicalText } from "../dist/text.js";
import * as domains from "../dist/domain.js";
import { crc32 } from "./files.mjs";
import { kernels } from "./kernels.mjs";
import { readMesh } from "./mesh.mjs";
import { python, reference, root } from "./reference.mjs";

const folder = join(root, "conformance/vectors");
const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));
const count = Number(process.env.ISOCODEC_MUTATED ?? 150);

/** A vector that takes long. */
const LEFT_OUT = "plane_main_mixing_limit";
/** Which vectors are mutated, by the beginnings of their names. */
const only = new RegExp(`^(${process.env.ISOCODEC_MUTATED_ONLY ?? ""})`);

let seed = Number(process.env.ISOCODEC_SEED ?? 1);
function random(below) {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return Math.floor((seed / 2 ** 32) * below);
}

function mutated(data) {
  const bytes = Array.from(data);
  for (let times = 1 + random(3); times; times--) {
    const at = random(bytes.length), what = random(6);
    if (what < 2) bytes[at] ^= 1 << random(8);
    else if (what === 2) bytes[at] = random(256);
    else if (what === 3) bytes.splice(at, 1 + random(3));
    else if (what === 4) bytes.splice(at, 0, random(256));
    else bytes.length = Math.max(1, at);
  }
  const result = Uint8Array.from(bytes);
  if (random(4) && result.length > 8) {
    const view = new DataView(result.buffer);
    view.setUint32(result.length - 4, crc32(result.subarray(0, -4)));
  }
  return result;
}

function ours(data, mesh, kernels) {
  const decoder = new Decoder({ main, domains, mesh, kernels, keepFrames: true });
  for (let at = 0; at < data.length; at += 1000) decoder.feed(data.subarray(at, at + 1000));
  decoder.end();
  const kind = decoder.error?.kind;
  // the mesh beside the file is not the one that it asks for any more
  if (kind === "mesh") return { code: "3", text: "", error: decoder.error };
  if (kind === "malformed" || kind === "limit") return { code: "refused", text: "", error: decoder.error };
  return { code: kind ? "5" : "0", text: canonicalText(decoder), error: decoder.error };
}

test("mutated files decode as the reference decodes them", { skip: existsSync(python) ? false : "no reference decoder" },
  async (t) => {
    const { vectors } = JSON.parse(readFileSync(join(folder, "manifest.json"), "utf8"));
    const small = vectors.filter((v) => v.bytes < 4000 && v.tier === undefined && v.name !== LEFT_OUT && only.test(v.name) && !/^(bad_)?tiled_/.test(v.name));
    const scratch = mkdtempSync(join(tmpdir(), "isocodec-"));
    const other = reference();
    try {
      for (let i = 0; i < count; i++) {
        const before = seed, vector = small[random(small.length)];
        const data = mutated(readFileSync(join(folder, vector.file)));
        const file = join(scratch, "mutated.iso");
        writeFileSync(file, data);
        const beside = join(folder, `${vector.name}.mesh`), own = join(scratch, "mutated.mesh");
        rmSync(own, { force: true });
        if (existsSync(beside)) copyFileSync(beside, own);
        const mesh = existsSync(beside) ? readMesh(readFileSync(beside, "utf8")) : undefined;
        const wanted = await other.ask(file), got = ours(data, mesh);
        // its kernels have to be compiled: `make kernels`
        if (!wanted && i === 0) return t.skip("the reference decoder does not run");
        assert.ok(wanted, "the reference decoder has ended");
        const name = `${vector.name}, number ${i}, seed ${before}: ${got.error?.message}`;
        if (got.code !== wanted.code || got.text !== wanted.text) {
          writeFileSync(join(tmpdir(), `differs-${before}.iso`), data);
        }
        assert.equal(got.code, wanted.code, name);
        assert.ok(got.text === wanted.text, `texts differ: ${name}`);
        if (!kernels) continue;
        const compiled = ours(data, mesh, kernels);
        assert.deepEqual([compiled.code, compiled.text], [wanted.code, wanted.text], `compiled kernels: ${name}`);
      }
    } finally {
      other.end();
      rmSync(scratch, { recursive: true });
    }
  });
