// Curves on a map of the real Leaflet in Chromium, under the policy that codec/js/README.md names.
import assert from "node:assert/strict";
import { existsSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { chromium } from "playwright-core";
import { chromium as executablePath } from "../../../tools/viewer/browser.mjs";
import { draw } from "../dist/draw.js";
import { Decoder } from "../dist/index.js";
import { withMetadata } from "./files.mjs";
import { python } from "./reference.mjs";
import { curves, scratch, tile } from "./tiled.mjs";

const skip = executablePath ? false : "no Chromium", dist = fileURLToPath(new URL("../dist/", import.meta.url));
const [, POLICY] = /```text\n\s*(.*?)\n\s*```/s.exec(readFileSync(new URL("../README.md", import.meta.url), "utf8"));
const APP = `
import * as L from "leaflet/dist/leaflet-src.esm.js";
import { fetchKernels } from "./dist/kernels.js";
import { isoLayer } from "./dist/leaflet.js";
window.shown = (url, at, zoom, options) => new Promise((resolve) => {
  window.plan?.remove();
  window.plan = L.map("map", { fadeAnimation: false, zoomAnimation: false }).setView(at, zoom);
  isoLayer(L, url, { ...options, style: ({ isovalue }) => ({ color: isovalue > 100 ? "#f00" : "#00f", width: 2 }) }).on("load", resolve).addTo(window.plan);
});
window.compiled = () => fetchKernels();
window.working = () => new Promise((resolve, reject) => {
  const worker = new Worker("worker.js", { type: "module" });
  Object.assign(worker, { onmessage: resolve, onerror: reject });
  worker.postMessage({ type: "open", id: 1, url: new URL("whole.iso", location.href).href });
});
/** The painted pixels within 2 of each point, and how many there are at all. */
window.painted = (points) => {
  const canvases = [...document.querySelectorAll("canvas")].map((canvas) => [canvas.getBoundingClientRect(), canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height)]);
  const box = document.getElementById("map").getBoundingClientRect(), alpha = (x, y) => canvases.some(([{ left, top }, { data, width, height }]) => {
    const [i, j] = [Math.floor(x - left), Math.floor(y - top)];
    return i >= 0 && j >= 0 && i < width && j < height && data[4 * (width * j + i) + 3] > 60;
  });
  const missed = points.map((point) => window.plan.latLngToContainerPoint(point)).filter(({ x, y }) => x > 2 && y > 2 && x < box.width - 2 && y < box.height - 2)
    .map(({ x, y }) => [-2, -1, 0, 1, 2].some((a) => [-2, -1, 0, 1, 2].some((b) => alpha(box.left + x + a, box.top + y + b))));
  let count = 0;
  for (let y = 0; y < box.height; y++) for (let x = 0; x < box.width; x++) count += alpha(box.left + x, box.top + y);
  return { inside: missed.length, missed: missed.filter((there) => !there).length, share: count / (box.width * box.height) };
};`;
const files = {}, violations = [];
let server, browser, page, address, policy = POLICY;

before(async () => {
  if (skip) return;
  const resolveDir = fileURLToPath(new URL("../", import.meta.url));
  const { outputFiles: [app] } = await build({ stdin: { contents: APP, resolveDir }, bundle: true, format: "esm", write: false });
  const whole = Buffer.from(readFileSync(new URL("../../../conformance/vectors/plane_isovalues_values_above.iso", import.meta.url)));
  Object.assign(files, { "app.js": app.contents, "whole.iso": withMetadata(whole, { placement: "0 0.01 10 -0.01 0 47", crs: "EPSG:4326" }),
    "index.html": '<!doctype html><link rel="stylesheet" href="leaflet.css"><div id="map"></div><script type="module" src="app.js"></script>',
    "leaflet.css": readFileSync(join(resolveDir, "node_modules/leaflet/dist/leaflet.css")) + "\n#map { width: 400px; height: 300px }" });
  if (existsSync(python)) files["tiles.iso"] = readFileSync(tile("leaflet", [300, 300], ["--isovalue", "3000.5", "--precision", "exact", "--tile", "64",
    "--metadata", "placement=0 0.01 10 -0.01 0 47"]));
  server = createServer(({ url }, answer) => {
    const name = new URL(url, "http://localhost").pathname.slice(1) || "index.html", type = { html: "text/html", css: "text/css", js: "text/javascript" }[name.split(".").pop()];
    const data = files[name] ?? (existsSync(dist + name) && readFileSync(dist + name));
    if (!data) return answer.writeHead(404).end();
    answer.writeHead(200, { "content-type": type ?? "application/octet-stream", "content-security-policy": policy }).end(data);
  }).listen(0);
  address = `http://localhost:${server.address().port}/`;
  browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
  page = await browser.newPage();
  page.on("console", (message) => /Content.Security.Policy/i.test(message.text()) && violations.push(message.text()));
});

after(async () => {
  await browser?.close();
  server?.close();
  rmSync(scratch, { recursive: true });
});

test("curves are painted where they lie, of a whole file and of one in tiles; the policy allows that", { skip, timeout: 120000 }, async () => {
  await page.goto(address);
  const decoder = new Decoder();
  decoder.feed(files["whole.iso"]);
  const points = decoder.contours.flatMap((_, index) => {
    const { points: flat } = draw(decoder, index);
    return Array.from({ length: flat.length / 2 }, (_, i) => [47 - 0.01 * flat[2 * i], 10 + 0.01 * flat[2 * i + 1]]);
  });
  const cases = [["whole.iso", points, [46.9, 10.2]]];
  if (files["tiles.iso"]) {
    const [{ points: found }] = curves([{ file: join(scratch, "leaflet.iso"), window: [[0, 299], [0, 299]], options: {} }]);
    cases.push(["tiles.iso", found.map(([i, j]) => [47 - 0.01 * i, 10 + 0.01 * j]), [45.5, 11.5]]);
  }
  for (const [name, expected, middle] of cases) for (const zoom of [8, 10]) {
    await page.evaluate(([url, at, z]) => window.shown(url, at, z, {}), [name, middle, zoom]);
    const { inside, missed, share } = await page.evaluate((all) => window.painted(all), expected);
    // rings smaller than what is simplified away are not there
    assert.ok(inside > 50 && missed < 0.02 * inside && share > 0.001 && share < 0.6, `${name} ${zoom}: ${missed} of ${inside}, ${share}`);
  }
  assert.equal((await page.evaluate(() => window.working())) !== undefined, true);
  if (existsSync(`${dist}kernels.wasm`)) await page.evaluate(() => window.compiled().then(() => undefined));
  assert.deepEqual(violations, []);
});

test("without what the policy names, workers and compiled kernels are refused", { skip, timeout: 60000 }, async () => {
  policy = POLICY.replace(" 'wasm-unsafe-eval'", "").replace(/worker-src[^;]*/, "worker-src 'none'");
  assert.notEqual(policy, POLICY);
  await page.goto(address);
  await assert.rejects(page.evaluate(() => window.working().then(() => undefined)));
  assert.match(violations.join(), /worker-src/);
  if (existsSync(`${dist}kernels.wasm`)) await assert.rejects(page.evaluate(() => window.compiled().then(() => undefined)), /Content Security Policy/);
});
