// Explicit domains: drawings held against the meshes, surfaces against the empty circle, loading when a file needs it, hostile files.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { draw } from "../dist/draw.js";
import * as domains from "../dist/domain.js";
import { Decoder, decodeStream } from "../dist/index.js";
import { canonicalText } from "../dist/text.js";
import { summed, varint } from "./files.mjs";
import { readMesh } from "./mesh.mjs";

const folder = new URL("../../../conformance/vectors/", import.meta.url);
const vector = (name) => new Uint8Array(readFileSync(new URL(`${name}.iso`, folder)));

function decoded(name) {
  const mesh = readMesh(readFileSync(new URL(`${name}.mesh`, folder), "utf8")), decoder = new Decoder({ domains, mesh });
  decoder.feed(vector(name));
  decoder.end();
  assert.equal(decoder.error, undefined);
  return { decoder, mesh };
}

/** Signs by vertex as the text of the state has them. */
const signsOf = (decoder) => new Map(canonicalText(decoder).split("\n").filter((line) => line.startsWith("v"))
  .map((line) => line.split(" ").map(Number)).map(([, v, s]) => [v, s]));

for (const name of ["mesh_plane_signs", "mesh_plane_levels_offsets", "mesh_plane_values", "mesh_surface_values", "mesh_space_signs", "mesh_space_values"]) {
  test(`${name}: a piece in each cell of both signs, between its points of both`, () => {
    const { decoder, mesh: { d, n, coordinates, cells } } = decoded(name), signs = signsOf(decoder), drawing = draw(decoder);
    assert.deepEqual([drawing.n, drawing.d], [n, d]);
    let pieces = 0;
    for (let c = 0; c < cells.length; c += n + 1) {
      const up = cells.slice(c, c + n + 1).filter((v) => signs.get(v) === 1).length;
      const known = cells.slice(c, c + n + 1).every((v) => signs.has(v));
      if (known && up > 0 && up <= n) pieces += n === 3 && up === 2 ? 2 : 1;
    }
    assert.equal(drawing.cells.length / n, pieces);
    const x = (v) => coordinates.slice(d * v, d * v + d), edges = new Set();
    for (let c = 0; c < cells.length; c += n + 1)
      for (let i = 0; i <= n; i++) for (let j = 0; j < i; j++) edges.add([cells[c + i], cells[c + j]].sort((p, q) => p - q).join(" "));
    const crossed = [...edges].map((edge) => edge.split(" ").map(Number)).filter(([p, q]) => signs.get(p) + signs.get(q) === 1);
    const length = (u) => Math.hypot(...u), to = (p, q) => p.map((a, i) => a - q[i]);
    for (let i = 0; i < drawing.points.length; i += d) {
      const at = Array.from(drawing.points.subarray(i, i + d));
      assert.ok(crossed.some(([p, q]) => length(to(at, x(p))) + length(to(at, x(q))) - length(to(x(p), x(q))) < 1e-9), `${at}`);
    }
  });
}

test("higher values lie to the left in the plane, behind triangles in space", () => {
  for (const name of ["mesh_plane_values", "mesh_space_values", "mesh_plane_cut_values", "mesh_space_cut_values"]) {
    const { decoder, mesh: { d, n, coordinates } } = decoded(name), signs = signsOf(decoder), { points, cells } = draw(decoder);
    const at = (i) => Array.from(points.subarray(d * i, d * i + d)), known = [...signs].map(([v, s]) => [coordinates.slice(d * v, d * v + d), s]);
    let right = 0, all = 0;
    for (let c = 0; c < cells.length; c += n) {
      const [p, q, r] = Array.from(cells.subarray(c, c + n), at), u = q.map((x, a) => x - p[a]), w = r?.map((x, a) => x - p[a]);
      const normal = n === 2 ? [-u[1], u[0]] : [0, 1, 2].map((a) => w[(a + 1) % 3] * u[(a + 2) % 3] - w[(a + 2) % 3] * u[(a + 1) % 3]);
      // the nearest vertex, unless it lies next to the plane of the piece
      const [v, s] = known.reduce((best, each) => Math.hypot(...each[0].map((x, a) => x - p[a])) < Math.hypot(...best[0].map((x, a) => x - p[a])) ? each : best);
      const side = v.reduce((sum, x, a) => sum + (x - p[a]) * normal[a], 0);
      if (Math.abs(side) < 1e-9) continue;
      all++;
      if (side > 0 === (s === 1)) right++;
    }
    assert.ok(right > 0.8 * all, `${name}: ${right} of ${all}`);
  }
});

for (const kind of ["plane", "surface", "space"]) {
  test(`a cut of a ${kind} draws in each layer between known vertices of both signs, and grows`, () => {
    const name = `mesh_${kind}_cut_layers`, mesh = readMesh(readFileSync(new URL(`${name}.mesh`, folder), "utf8")), { d, coordinates } = mesh;
    const decoder = new Decoder({ domains, mesh }), data = vector(name), counts = [];
    const length = (u) => Math.hypot(...u), to = (p, q) => p.map((a, i) => a - q[i]), x = (v) => coordinates.slice(d * v, d * v + d);
    for (let at = 0; at < data.length; at += 3) {
      if (!decoder.feed(data.subarray(at, at + 3)).some((event) => event.type === "layer")) continue;
      const signs = [...signsOf(decoder)], { points, cells } = draw(decoder);
      counts.push(cells.length);
      for (let i = 0; i < points.length; i += d) {
        const p = Array.from(points.subarray(i, i + d));
        assert.ok(signs.some(([u, s]) => s && signs.some(([v, r]) => !r && length(to(p, x(u))) + length(to(p, x(v))) - length(to(x(u), x(v))) < 1e-9)));
      }
    }
    assert.equal(counts.length, 4);
    assert.ok(counts[0] > 0 && counts[0] <= counts[1] && counts[1] < counts[2] && counts[2] === counts[3], `${counts}`);
  });
}

test("triangles of a surface cover the hull, and no circle holds another point", () => {
  for (const name of ["tin_terrain", "tin_scattered", "tin_grid"]) {
    const decoder = new Decoder({ domains });
    decoder.feed(vector(name));
    const { points, cells } = draw(decoder), count = points.length / 3, x = (i) => points[3 * i], y = (i) => points[3 * i + 1];
    const area = (a, b, c) => (x(b) - x(a)) * (y(c) - y(a)) - (y(b) - y(a)) * (x(c) - x(a));
    let sum = 0;
    for (let t = 0; t < cells.length; t += 3) {
      const [a, b, c] = cells.subarray(t, t + 3);
      assert.ok(area(a, b, c) > 0);
      sum += area(a, b, c);
      for (let p = 0; p < count; p++) {
        const [A, B, C] = [a, b, c].map((i) => [x(i) - x(p), y(i) - y(p)]), square = ([u, v]) => u * u + v * v;
        const turn = ([u, v], [s, w]) => u * w - v * s;
        assert.ok(square(A) * turn(B, C) + square(B) * turn(C, A) + square(C) * turn(A, B) <= 1e-6 * square(A) ** 2, name);
      }
    }
    // the hull by gift wrapping
    let low = 0, at, hull = 0;
    for (let p = 1; p < count; p++) if (x(p) < x(low) || (x(p) === x(low) && y(p) < y(low))) low = p;
    at = low;
    do {
      let next = at === 0 ? 1 : 0;
      for (let p = 0; p < count; p++) if (p !== at && area(at, next, p) < 0) next = p;
      hull += x(at) * y(next) - x(next) * y(at);
      at = next;
    } while (at !== low);
    assert.ok(Math.abs(hull - sum) <= 1e-9 * sum, `${name}: ${sum} of ${hull}`);
  }
});

test("a surface is there in part while it comes", () => {
  const data = vector("tin_layers"), decoder = new Decoder({ domains }), counts = [];
  for (const byte of data) {
    decoder.feed(Uint8Array.of(byte));
    counts.push(draw(decoder).points.length / 3);
  }
  assert.ok(counts.every((count, i) => i === 0 || count >= counts[i - 1]));
  assert.ok(new Set(counts).size > 10, "points come one by one");
});

test("a stream loads what reads explicit domains", async () => {
  for (const name of ["mesh_plane_coded", "tin_terrain"]) {
    let last;
    for await (const { decoder, events } of decodeStream(new Response(vector(name)).body)) {
      last = events.at(-1) ?? last;
      if (last.type === "end") assert.ok(draw(decoder).cells.length > 0);
    }
    assert.equal(last.type, "end");
  }
});

test("points next to the contour alone have the contour of all points, ties included", () => {
  const [few, all] = ["needed", "all"].map((name) => {
    const decoder = new Decoder({ domains });
    decoder.feed(vector(`mesh_plane_delaunay_${name}_ties`));
    decoder.end();
    assert.equal(decoder.error, undefined);
    return { points: canonicalText(decoder).split("\n").filter((line) => line.startsWith("p ")).length, drawing: draw(decoder) };
  });
  assert.ok(few.drawing.cells.length > 20 && few.points < all.points);
  assert.deepEqual(few.drawing.points, all.drawing.points);
  assert.deepEqual(few.drawing.cells, all.drawing.cells);
});

test("a mesh that is not the file's is an error of the caller", () => {
  const decoder = new Decoder({ domains });
  decoder.feed(vector("mesh_plane_signs"));
  assert.equal(decoder.error.kind, "mesh");
});

/** A file of chunks, each a head and a payload. */
function fileOf(flags, chunks) {
  const bytes = [0x89, 0x49, 0x53, 0x4f, 0x11, flags, 0];
  chunks.forEach(([type, payload], i) => {
    bytes.push(type | (i === chunks.length - 1 ? 32 : 0), ...varint(payload.length));
    for (const byte of payload) bytes.push(byte);
  });
  return summed(bytes);
}

test("runs of random bytes end", { timeout: 120000 }, () => {
  let seed = 1;
  const random = (count) => Array.from({ length: count }, () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) >>> 24);
  const extent = [...varint(2 ** 24), ...varint(2 ** 24)], origin = [0, 0];
  for (const [flags, payload] of [
    [0x81, [0x10, 0, ...varint(200000), ...varint(400000), 1, ...origin, ...extent, ...random(5000)]],
    [0x81, [0x10, 0, ...varint(5), ...varint(200000), 1, ...origin, ...extent, ...random(3000)]],
    [0x85, [0x10, 0, ...varint(60000), ...varint(300000), 1, ...origin, 0, ...extent, ...varint(2 ** 24), ...random(2000)]],
    [0x81, [0x30, 0, ...varint(500000), ...varint(900000), 1, ...origin, ...extent, ...random(5000)]],
    [0x81, [0x20, ...varint(2 ** 28), ...varint(2 ** 28), 0, 2, 0, 100, 1, ...varint(2 ** 28), ...random(20000)]],
    [0x81, [0x20, ...varint(2 ** 28), ...varint(2 ** 28), 0, 2, 0, 100, 1, ...varint(2 ** 28), ...new Array(20000).fill(0)]],
    [0x81, [0x20, ...varint(2 ** 28), ...varint(2 ** 28), 0, 2, 0, 100, 1, ...varint(2 ** 28), ...new Array(20000).fill(255)]],
  ]) {
    const started = process.cpuUsage(), decoder = new Decoder({ domains });
    decoder.feed(fileOf(flags, [[10, payload], [1, [0, ...random(100)]]]));
    decoder.end();
    assert.notEqual(decoder.error, undefined);
    // of this process, whatever else the machine does: limits stop it after some
    const seconds = process.cpuUsage(started).user / 1e6;
    assert.ok(seconds < 60, `${seconds} seconds: ${decoder.error.message}`);
    if (process.env.ISOCODEC_VERBOSE) console.log(seconds, decoder.error.message);
  }
});
