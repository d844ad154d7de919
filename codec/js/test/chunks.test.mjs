// Chunks of each type in files of each kind: which may stand where, whatever is in them (3.5, 10.1.1, 10.9.1).
import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { test } from "node:test";
import * as domains from "../dist/domain.js";
import { Decoder } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { canonicalText } from "../dist/text.js";
import { chunksOf, joined, repair, tiledParts } from "./files.mjs";
import { openTiles } from "../dist/tiles.js";
import { readMesh } from "./mesh.mjs";

const folder = new URL("../../../conformance/vectors/", import.meta.url);
const vector = (name) => new Uint8Array(readFileSync(new URL(`${name}.iso`, folder)));
const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));

const LAYERS = 1, ISOVALUE = 5, MASK = 7, FRAME = 9, DOMAIN = 10, TURN = 11, SERIES = 13;
const CRITICAL = [LAYERS, ISOVALUE, MASK, FRAME, DOMAIN, TURN, SERIES];
/** A file of each kind. */
const FILES = {
  grid: "plane_isovalues_signs", turns: "plane_turns_masked", series: "plane_frames_main_signs", "series of a masked field": "plane_frames_missing",
  known: "mesh_plane_signs", coded: "mesh_plane_coded", delaunay: "mesh_plane_delaunay_all_ties", "series of a mesh": "mesh_plane_frames_signs", surface: "tin_scattered",
};
const PAYLOADS = [[], [0, 1]];

/** The clause that forbids a chunk behind others, if one does. */
function forbidden(explicit, surface, before, { head }) {
  const type = head & 31, had = (...types) => before.some((chunk) => !(chunk.head & 128) && types.includes(chunk.head & 31));
  if (!(head & 128) !== CRITICAL.includes(type)) return "3.5.2";
  if (head & 128) return undefined;
  if (explicit && type === MASK) return "10.1.1";
  if (explicit && had(DOMAIN) === (type === DOMAIN)) return "3.5.8";
  if (surface && type !== DOMAIN) return "10.9.1";
  if (type === DOMAIN) return explicit ? undefined : "3.5.8";
  if (type === TURN) return explicit || had(SERIES) ? "3.5.9" : undefined;
  if ([ISOVALUE, MASK].includes(type) && had(FRAME)) return "3.5.7";
  if (type === MASK && had(MASK)) return "3.5.6";
  if (type === FRAME && !had(SERIES)) return "3.5.7";
  return type === SERIES && had(SERIES, LAYERS, TURN) ? "3.5.7" : undefined;
}

function decoded(data, mesh) {
  const decoder = new Decoder({ main, domains, mesh, keepFrames: true });
  decoder.feed(data);
  decoder.end();
  return decoder;
}

for (const [kind, name] of Object.entries(FILES)) {
  test(`chunks of each type at each place of a file: ${kind}`, () => {
    const { header, chunks } = chunksOf(vector(name)), beside = new URL(`${name}.mesh`, folder), explicit = (header[5] & 128) !== 0;
    const mesh = existsSync(beside) ? readMesh(readFileSync(beside, "utf8")) : undefined, whole = decoded(vector(name), mesh);
    assert.equal(whole.error, undefined);
    const last = chunks.at(-1).payload, text = canonicalText(whole);
    // behind the first chunk of each type, and at the end
    const places = [0, ...[...chunks.keys()].filter((i) => chunks.findIndex((c) => c.head === chunks[i].head) === i).map((i) => i + 1), chunks.length];
    for (const at of new Set(places)) for (let head = 0; head < 256; head++) for (const payload of [...PAYLOADS, last]) {
      if (head & 96) continue;
      const before = chunks.slice(0, at), chunk = { head, payload }, about = `type ${head & 31}, ${head & 128 ? "ancillary" : "critical"}, at ${at}: ${payload.slice(0, 8)}`;
      const clause = forbidden(explicit, kind === "surface", before, chunk);
      if (!clause && !(head & 128)) continue;
      const found = decoded(joined({ header, chunks: [...before, chunk, ...chunks.slice(at)] }), mesh);
      assert.equal(found.error?.clause, clause, about);
      if (!clause) assert.equal(canonicalText(found), text, about);
    }
  });
}

test("chunks of each type in a tile", async () => {
  const data = vector("tiled_plane_signs"), { parts } = tiledParts(data), part = parts.at(-1), head = data[part.at];
  assert.equal(head, LAYERS);
  for (let type = 0; type < 256; type++) {
    const bytes = data.slice();
    if (type & 96) continue;
    bytes[part.at] = type;
    repair(bytes, part);
    const found = await openTiles(bytes, { main }).then((tiles) => tiles.all()).catch((error) => error);
    const clause = forbidden(false, false, [], { head: type });
    if (clause) assert.equal(found.clause, clause, `type ${type}`);
  }
});
