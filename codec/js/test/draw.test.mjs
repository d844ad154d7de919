// Drawings: closed within the box, in whole files and in parts of them; lines, GeoJSON, three.js, streams.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { draw } from "../dist/draw.js";
import { Decoder, decodeStream } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { canonicalText } from "../dist/text.js";
import { toBufferGeometry } from "../dist/three.js";
import { coordinatesOf, lines, place, placement, toGeoJSON } from "../dist/world.js";

const folder = new URL("../../../conformance/vectors/", import.meta.url);
const tables = new Uint8Array(readFileSync(new URL("../dist/main.bin", import.meta.url))), main = new MainProfile(tables);
const vector = (name) => new Uint8Array(readFileSync(new URL(`${name}.iso`, folder)));

function decoded(data) {
  const decoder = new Decoder({ main });
  decoder.feed(data);
  return decoder;
}

/** Sides of the cells that no other cell has the other way round. */
function border({ n, cells }) {
  const sides = new Map();
  const add = (p, q) => {
    const key = n === 2 ? p : `${Math.min(p, q)} ${Math.max(p, q)}`, way = n === 2 ? q : p < q ? 1 : -1;
    sides.set(key, (sides.get(key) ?? 0) + way);
  };
  for (let c = 0; c < cells.length; c += n) {
    if (n === 2) {
      add(cells[c], 1);
      add(cells[c + 1], -1);
    } else for (let i = 0; i < 3; i++) add(cells[c + i], cells[c + ((i + 1) % 3)]);
  }
  return [...sides].filter(([, count]) => count !== 0).flatMap(([key]) => String(key).split(" ").map(Number));
}

const NAMES = [
  "plane_base_0", "plane_values_8_bit", "plane_offsets_32", "plane_steps", "plane_adapt_births", "plane_adapt_twice",
  "plane_main_offsets_between", "plane_values_interleaved", "space_base_0", "space_values_noise", "space_offsets_32",
  "space_adapt_births", "space_adapt_twice", "space_main_offsets_between", "space_cubes_even", "space_cubes_cut",
];

for (const name of NAMES) {
  test(`${name} is closed within the box`, () => {
    const data = vector(name);
    for (const part of [0.3, 0.5, 0.7, 1]) {
      const decoder = decoded(data.subarray(0, Math.round(part * data.length)));
      // during a base its curves are open
      if (!/^level \d/m.test(canonicalText(decoder))) continue;
      const drawing = draw(decoder), { n, points } = drawing, { shape } = decoder.header;
      const places = Array.from({ length: points.length / n }, (_, i) => points.subarray(n * i, n * i + n).join());
      assert.equal(new Set(places).size, places.length, `points fall together after ${part} of the file`);
      for (const i of border(drawing)) {
        const p = Array.from(points.subarray(n * i, n * i + n));
        assert.ok(p.some((x, a) => x === 0 || x === shape[a] - 1), `open at ${p} after ${part} of the file`);
      }
    }
  });
}

test("samples above a curve lie on its left, in front of a surface those below", () => {
  for (const [name, way] of [["plane_base_8", 1], ["space_base_9", 1]]) {
    const drawing = draw(decoded(vector(name))), { n, points, cells } = drawing;
    const signs = new Map(canonicalText(decoded(vector(name))).split("\n").filter((line) => line.startsWith("v"))
      .map((line) => line.split(" ")).map((words) => [words.slice(1, 1 + n).join(" "), Number(words[1 + n])]));
    let agree = 0;
    for (let c = 0; c < cells.length; c += n) {
      const p = [0, 1, 2].slice(0, n).map((i) => Array.from(points.subarray(n * cells[c + i], n * cells[c + i] + n)));
      const normal = n === 2 ? [p[1][1] - p[0][1], p[0][0] - p[1][0]] : [0, 1, 2].map((a) => {
        const [u, v] = [p[1], p[2]].map((q) => q.map((x, i) => x - p[0][i])), [b, d] = [(a + 1) % 3, (a + 2) % 3];
        return u[b] * v[d] - u[d] * v[b];
      });
      const mean = p[0].map((_, a) => p.reduce((sum, q) => sum + q[a], 0) / n), size = Math.hypot(...normal);
      const near = (by) => {
        const at = mean.map((x, a) => Math.round(x + (by * normal[a]) / size));
        return signs.get(at.join(" ")) ?? NaN;
      };
      const [ahead, behind] = [near(0.6), near(-0.6)];
      if (ahead + behind === 1) agree += ahead ? -1 : 1;
    }
    assert.ok(way * agree > 0, name);
  }
});

test("curves, GeoJSON and placements", () => {
  const drawing = draw(decoded(vector("plane_values_8_bit"))), found = lines(drawing);
  assert.equal(found.reduce((sum, line) => sum + line.length - 1, 0), drawing.cells.length / 2);
  const feature = toGeoJSON(drawing, undefined, { level: 1 }), [x, y] = feature.geometry.coordinates[0][0];
  assert.deepEqual([y, x], Array.from(drawing.points.subarray(2 * lines(place(drawing, [[0, 1, 0], [1, 0, 0]]))[0][0]).subarray(0, 2)));
  assert.equal(feature.properties.level, 1);
  const rows = placement({ placement: "2 0 10 0 -3 20" }, 2);
  assert.deepEqual(rows, [[2, 0, 10], [0, -3, 20]]);
  assert.equal(place(drawing, rows).points[0], 10 + 2 * drawing.points[0]);
  const tilted = placement({ placement: "1 0 10 0 0.6 20 0 0.8 30" }, 2), inSpace = place(drawing, tilted);
  assert.deepEqual(tilted, [[1, 0, 10], [0, 0.6, 20], [0, 0.8, 30]]);
  assert.equal(inSpace.d, 3);
  assert.deepEqual(Array.from(inSpace.points.subarray(3, 6)), [
    10 + drawing.points[2], 20 + 0.6 * drawing.points[3], 30 + 0.8 * drawing.points[3],
  ]);
  assert.equal(toGeoJSON(drawing, tilted).geometry.coordinates[0][0].length, 3);
  assert.equal(placement({ placement: "1 2 0 2 4 0 3 6 0" }, 2), undefined);
  for (const text of ["1 2 3", "1 0 0 0 0 0", "1 0 0 0 01 0", "1 0 0 0 1e-31 0", "1 2 0 2 4 0"])
    assert.equal(placement({ placement: text }, 2), undefined, text);
});

test("mapped grids: places by coordinates, as the reference decoder finds them", () => {
  for (const [name, at, to] of [
    ["plane_mapped_axes", [16, 7.5], [3760.5, 1128]], ["plane_mapped_nodes", [15.5, 7], [2208.6875, 2063.875]],
    ["plane_mapped_wraps", [15.5, 7], [553, 79]],
  ]) {
    const decoder = decoded(vector(name)), drawing = draw(decoder), { points } = drawing;
    const placed = place(drawing, coordinatesOf(decoder));
    let i = 0;
    while (points[2 * i] !== at[0] || points[2 * i + 1] !== at[1]) i++;
    assert.deepEqual(Array.from(placed.points.subarray(2 * i, 2 * i + 2)), to, name);
    assert.ok(toGeoJSON(drawing, coordinatesOf(decoder)).geometry.coordinates.length);
  }
});

test("a curve goes on where a periodic axis closes", () => {
  // across a strip of 4 x 2 unit cells: axis 0 closes, as an annulus or in a coordinate that wraps
  const nodes = [5, 3, 1], run = (f) => Float64Array.from({ length: 15 }, (_, i) => f(Math.floor(i / 3), i % 3));
  const coordinate = (period, values) => ({ axes: [0, 1], origin: 0, unit: 1, period, nodes, values });
  const drawing = {
    n: 2, d: 2, full: true, points: Float64Array.of(0, 1.5, 1, 1.5, 2, 1.5, 3, 1.5, 4, 1.5),
    cells: Uint32Array.of(2, 3, 3, 4, 0, 1, 1, 2), seam: Uint32Array.of(4, 0),
  };
  const x = [1, 0, -1, 0, 1], y = [0, 1, 0, -1, 0];
  const ring = { periodic: [0], coordinates: [
    coordinate(0, run((i, j) => (j + 1) * x[i])), coordinate(0, run((i, j) => (j + 1) * y[i])),
  ] };
  const closed = place(drawing, ring), [line] = lines(closed);
  assert.equal(lines(closed).length, 1);
  assert.deepEqual([line.length, line[0]], [5, line.at(-1)]);
  const wraps = { periodic: [0], coordinates: [coordinate(40, run((i) => 10 * i)), coordinate(0, run((_, j) => j))] };
  const { coordinates } = toGeoJSON({ ...drawing, cells: drawing.cells.slice(2) }, wraps).geometry;
  assert.deepEqual(coordinates, [[[30, 1.5], [40, 1.5], [50, 1.5], [60, 1.5]]]);
});

test("a series keeps two frames, or all", () => {
  const data = vector("plane_frames_main_values"), last = decoded(data), all = new Decoder({ main, keepFrames: true });
  all.feed(data);
  all.end();
  const count = all.frames.length;
  assert.ok(count > 2 && all.frames.every(Boolean));
  assert.deepEqual(last.frames.map(Boolean), last.frames.map((_, t) => t >= count - 2));
  assert.ok(last.meter.memory < all.meter.memory && last.meter.vertices < all.meter.vertices);
  for (const t of [count - 2, count - 1]) assert.deepEqual(draw(last, 0, t), draw(all, 0, t));
  assert.equal(draw(last, 0, 0).cells.length, 0);
  assert.throws(() => canonicalText(last), /keepFrames/);
});

test("three.js takes a surface and curves", () => {
  const surface = draw(decoded(vector("space_values_noise"))), geometry = toBufferGeometry(surface);
  assert.equal(geometry.getAttribute("position").count, surface.points.length / 3);
  assert.equal(geometry.getIndex().count, surface.cells.length);
  assert.equal(geometry.getAttribute("normal").count, surface.points.length / 3);
  const curves = draw(decoded(vector("plane_values_8_bit")));
  assert.equal(toBufferGeometry(curves).getAttribute("position").count, curves.points.length / 2);
});

test("a stream whose tables are fetched when they are needed", async () => {
  let asked = 0;
  const loadTables = async () => {
    asked++;
    return tables;
  };
  for (const [name, times] of [["plane_base_0", 0], ["plane_main_offsets", 1]]) {
    asked = 0;
    const data = vector(name);
    const stream = new ReadableStream({
      start(controller) {
        for (let at = 0; at < data.length; at += 10) controller.enqueue(data.slice(at, at + 10));
        controller.close();
      },
    });
    let last;
    for await (const { events } of decodeStream(stream, { loadTables })) last = events.at(-1) ?? last;
    assert.equal(last.type, "end");
    assert.equal(asked, times);
  }
});
