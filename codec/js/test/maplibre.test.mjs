// Vector tiles, decoded by the library that maps use and held against the curves of the drawing.
import assert from "node:assert/strict";
import { existsSync, readFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import { createServer } from "node:http";
import { after, before, test } from "node:test";
import { VectorTile } from "@mapbox/vector-tile";
import { PbfReader } from "pbf";
import { draw } from "../dist/draw.js";
import { Decoder } from "../dist/index.js";
import { isoProtocol } from "../dist/maplibre.js";
import { lines } from "../dist/world.js";
import { withMetadata } from "./files.mjs";
import { python } from "./reference.mjs";
import { curves, scratch, tile } from "./tiled.mjs";

const folder = new URL("../../../conformance/vectors/", import.meta.url);
const vector = (name) => new Uint8Array(readFileSync(new URL(`${name}.iso`, folder)));
const loadTables = async () => new Uint8Array(readFileSync(new URL("../dist/main.bin", import.meta.url)));
/** Where samples lie: axis 0 to the south, axis 1 to the east. */
const place = (i, j) => [10 + 0.01 * j, 47 - 0.01 * i];
const PLACEMENT = "0 0.01 10 -0.01 0 47", RADIUS = 6378137;
let server, address;

before(() => {
  const files = {
    degrees: withMetadata(vector("plane_isovalues_values_above"), { placement: PLACEMENT, crs: "EPSG:4326" }),
    metres: withMetadata(vector("plane_isovalues_values_above"), { placement: "0 1000 500000 -1000 0 6000000", crs: "EPSG:3857" }),
    elsewhere: withMetadata(vector("plane_isovalues_values_above"), { placement: "0 1000 500000 -1000 0 6000000", crs: "EPSG:2056" }),
    nowhere: vector("plane_isovalues_values_above"), space: vector("space_base_9"), damaged: vector("bad_file_checksum"),
  };
  if (existsSync(python)) files.tiles = readFileSync(tile("tiles", [700, 900], ["--isovalue", "3000.5,7000", "--precision", "exact", "--tile", "64",
    "--metadata", `placement=${PLACEMENT}`, "--metadata", "crs=EPSG:4326"]));
  server = createServer((request, answer) => {
    asked++;
    const data = files[request.url.slice(1).replace(".iso", "")], [, from, to] = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? "") ?? [];
    if (!data) return answer.writeHead(404).end();
    if (!from || !request.url.includes("tiles")) return answer.end(data);
    const part = data.subarray(Number(from), Number(to) + 1);
    received += part.length;
    answer.writeHead(206, { "content-range": `bytes ${from}-${Number(from) + part.length - 1}/${data.length}` }).end(part);
  }).listen(0);
  address = `http://localhost:${server.address().port}`;
});
after(() => {
  server.close();
  rmSync(scratch, { recursive: true });
});
let asked = 0, received = 0;

/** The tile of a point, and where in it the point lies, in 4096 parts. */
function tileOf([lon, lat], z) {
  const x = (lon / 360 + 0.5) * 2 ** z, s = Math.sin((lat * Math.PI) / 180);
  const y = (0.5 - (0.25 * Math.log((1 + s) / (1 - s))) / Math.PI) * 2 ** z;
  return { x: Math.floor(x), y: Math.floor(y), at: [(x % 1) * 4096, (y % 1) * 4096] };
}

/** The distance of a point from a line of points. */
function distance([px, py], line) {
  let least = Infinity;
  for (let i = 1; i < line.length; i++) {
    const [ax, ay] = line[i - 1], [bx, by] = line[i], length = (bx - ax) ** 2 + (by - ay) ** 2;
    const t = length ? Math.min(1, Math.max(0, ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length)) : 0;
    least = Math.min(least, Math.hypot(px - ax - t * (bx - ax), py - ay - t * (by - ay)));
  }
  return least;
}

async function featuresOf(protocol, file, z, x, y) {
  const { data } = await protocol({ url: `iso://${address}/${file}.iso/${z}/${x}/${y}` });
  const layer = new VectorTile(new PbfReader(new Uint8Array(data))).layers.contours;
  return Array.from({ length: layer?.length ?? 0 }, (_, i) => layer.feature(i));
}

for (const [file, toLonLat] of [
  ["degrees", place],
  ["metres", (i, j) => {
    const [x, y] = [500000 + 1000 * j, 6000000 - 1000 * i];
    return [((x / RADIUS) * 180) / Math.PI, ((2 * Math.atan(Math.exp(y / RADIUS)) - Math.PI / 2) * 180) / Math.PI];
  }],
]) {
  test(`tiles of a file in ${file} have its curves, of each isovalue`, async () => {
    const decoder = new Decoder(), protocol = isoProtocol();
    decoder.feed(vector("plane_isovalues_values_above"));
    asked = 0;
    assert.ok(decoder.contours.length > 1);
    for (const [index, { isovalue }] of decoder.contours.entries()) {
      const drawing = draw(decoder, index);
      const curves = lines(drawing).map((line) => line.map((i) => toLonLat(drawing.points[2 * i], drawing.points[2 * i + 1])));
      assert.ok(curves.length);
      for (const z of [6, 9, 12]) {
        // rings smaller than what is simplified away are not there
        const part = 360 / 2 ** z / 4096, large = (line) => line.some((p) => Math.hypot(p[0] - line[0][0], p[1] - line[0][1]) > 4 * part);
        for (const point of curves.filter(large).flat().filter((_, i) => i % 5 === 0)) {
          const { x, y, at } = tileOf(point, z), found = await featuresOf(protocol, file, z, x, y);
          const own = found.filter((feature) => feature.properties.index === index);
          assert.ok(own.length, `${z}/${x}/${y}`);
          for (const feature of own) assert.equal(feature.properties.isovalue, isovalue);
          const near = Math.min(...own.flatMap((feature) => feature.loadGeometry()).map((line) => distance(at, line.map((p) => [p.x, p.y]))));
          // three parts of 4096 are simplified away, rounding takes one
          assert.ok(near < 5, `${near} parts from the curve at zoom ${z}`);
        }
      }
    }
    assert.equal(asked, 1, "the file is loaded once");
  });
}

test("of a file in tiles ranges are read, as fine as the zoom shows; its curves are those of the reference", { skip: existsSync(python) ? false : "no Python" }, async () => {
  const protocol = isoProtocol({ loadTables }), size = readFileSync(join(scratch, "tiles.iso")).length;
  const counts = (found) => found.map((feature) => [feature.properties.isovalue, feature.loadGeometry().flat().length]);
  const { x: x6, y: y6 } = tileOf(place(350, 450), 6), coarse = counts(await featuresOf(protocol, "tiles", 6, x6, y6));
  assert.deepEqual(coarse.map(([isovalue]) => isovalue), [3000.5, 7000]);
  const overview = received;
  assert.ok(overview < size / 2, `${overview} of ${size} bytes`);
  for (const [isovalue, value] of [3000.5, 7000].entries()) {
    const [{ points }] = curves([{ file: join(scratch, "tiles.iso"), window: [[200, 500], [250, 650]], options: { isovalue } }]);
    assert.ok(points.length > 200);
    for (const [i, j] of points.filter((_, k) => k % Math.ceil(points.length / 25) === 0)) {
      const { x, y, at } = tileOf(place(i, j), 10), own = (await featuresOf(protocol, "tiles", 10, x, y)).filter(({ properties }) => properties.isovalue === value);
      const near = Math.min(...own.flatMap((feature) => feature.loadGeometry()).map((line) => distance(at, line.map((p) => [p.x, p.y]))));
      assert.ok(near < 5, `${near} parts from the curve of ${value}`);
    }
  }
  assert.ok(received > overview && received < size, `${received} of ${size} bytes`);
  // far away nothing is read
  const before = received;
  assert.equal((await protocol({ url: `iso://${address}/tiles.iso/9/0/0` })).data.byteLength, 0);
  assert.equal(received, before);
  // a projection that has no inverse in closed form
  const bent = isoProtocol({ loadTables, toLonLat: (x, y) => [x + 0.2 * Math.sin(y), y + 0.1 * Math.sin(x)] }), [lon, lat] = place(330, 430);
  const { x, y } = tileOf([lon + 0.2 * Math.sin(lat), lat + 0.1 * Math.sin(lon)], 10);
  assert.ok((await featuresOf(bent, "tiles", 10, x, y)).length);
});

test("where there is no curve a tile is empty", async () => {
  const { data } = await isoProtocol()({ url: `iso://${address}/degrees.iso/9/0/0` });
  assert.equal(data.byteLength, 0);
});

test("other coordinates are told by a function, properties by another", async () => {
  const toLonLat = (x, y) => [(x - 500000) / 1000, (y - 6000000) / 1000];
  const protocol = isoProtocol({ toLonLat, properties: (isovalue) => ({ label: `${isovalue} m` }) });
  const [feature] = await featuresOf(protocol, "elsewhere", 0, 0, 0);
  assert.match(feature.properties.label, / m$/);
});

test("what cannot be shown on a map says so, and is asked for again", async () => {
  const protocol = isoProtocol(), ask = (url) => protocol({ url });
  await assert.rejects(ask(`iso://${address}/elsewhere.iso/0/0/0`), /EPSG:2056.*toLonLat/);
  await assert.rejects(ask(`iso://${address}/nowhere.iso/0/0/0`), /where its samples lie/);
  await assert.rejects(ask(`iso://${address}/space.iso/0/0/0`), /curves only/);
  await assert.rejects(ask(`iso://${address}/damaged.iso/0/0/0`), /checksum/);
  await assert.rejects(ask(`iso://${address}/missing.iso/0/0/0`), /404/);
  await assert.rejects(ask(`iso://${address}/missing.iso`), /address of a tile/);
  asked = 0;
  await assert.rejects(ask(`iso://${address}/missing.iso/0/0/0`), /404/);
  assert.equal(asked, 1);
});
