// The page in a real browser: pixels while a throttled stream arrives, keys, isovalues, light and dark, damaged files.
import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";

const root = fileURLToPath(new URL("../../", import.meta.url));
const browserPath = process.env.CHROMIUM ?? ["chromium", "chromium-browser", "google-chrome"]
  .flatMap((name) => (process.env.PATH ?? "").split(delimiter).map((folder) => join(folder, name))).find(existsSync);
const skip = browserPath ? false : "no Chromium";
const vectors = join(root, "conformance/vectors");
let server, browser, page, address;

before(async () => {
  if (skip) return;
  server = createServer((request, answer) => {
    const name = new URL(request.url, "http://localhost").pathname.slice(1) || "index.html";
    const path = name.endsWith(".iso") ? join(vectors, name.replace("damaged-", "")) : join(root, "build/viewer", name);
    if (!existsSync(path)) return answer.writeHead(404).end();
    const data = Buffer.from(readFileSync(path));
    if (name.startsWith("damaged-")) data[data.length >> 1] ^= 255;
    answer.writeHead(200, { "content-length": data.length, "x-content-type-options": "nosniff", "content-type": name.endsWith(".html") ? "text/html" : "application/octet-stream" });
    answer.end(data);
  }).listen(0);
  address = `http://localhost:${server.address().port}/`;
  const { chromium } = createRequire(join(root, "codec/js/package.json"))("playwright-core");
  browser = await chromium.launch({ executablePath: browserPath,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"] });
  page = await browser.newPage({ viewport: { width: 640, height: 480 } });
});

after(async () => {
  await browser?.close();
  server?.close();
});

const open = (file, more = "") => page.goto(`${address}?theme=light&file=${file}${more}`, { waitUntil: "commit" });
const state = () => page.evaluate(() => ({ ...document.documentElement.dataset }));
const until = async (wanted) => {
  const there = (w) => document.documentElement.dataset.state === w;
  await page.waitForFunction(there, wanted, { timeout: 15000 }).catch(async () => {
    assert.fail(`${JSON.stringify(await state())} ${await page.textContent("#error")}`);
  });
};
const frame = () => page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));

/** How many pixels are not the background's, and a sum that tells pictures apart. */
async function pixels() {
  await frame();
  return page.evaluate(() => {
    const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2");
    const data = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    let count = 0, sum = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (Math.abs(data[i] - data[0]) + Math.abs(data[i + 1] - data[1]) + Math.abs(data[i + 2] - data[2]) < 40) continue;
      count++;
      sum = (sum * 31 + i + data[i]) % 2147483647;
    }
    return { count, sum, back: data[0] };
  });
}

for (const [name, rate] of [["plane_values_8_bit", 60], ["space_offsets_32", 80]]) {
  test(`${name} sharpens while ${rate} bytes come a second`, { skip, timeout: 60000 }, async () => {
    await open(`${name}.iso`, `&rate=${rate}`);
    await page.waitForFunction(() => Number(document.documentElement.dataset.cells) > 0, undefined, { timeout: 20000 });
    const early = await state(), first = await pixels();
    assert.equal(early.state, "open");
    assert.ok(first.count > 20, `${first.count} pixels`);
    await until("done");
    await page.waitForFunction(() => document.documentElement.dataset.final === "true");
    assert.notEqual((await pixels()).sum, first.sum);
    // how many cells an early curve has depends on when a slow machine looks
    const size = readFileSync(join(vectors, `${name}.iso`)).length;
    assert.ok(Number(early.bytes) < size, `${early.bytes} of ${size} bytes`);
    assert.equal(Number((await state()).bytes), size);
  });
}

test("a surface: turning, moving, zooming by keys and pointer", { skip, timeout: 60000 }, async () => {
  await open("space_reduced_topology_refined.iso");
  await until("done");
  await page.waitForFunction(() => document.documentElement.dataset.final === "true");
  const pictures = [await pixels()];
  assert.ok(pictures[0].count > 2000, `${pictures[0].count} pixels`);
  for (const key of ["ArrowLeft", "Shift+ArrowUp", "+"]) {
    await page.keyboard.press(key);
    pictures.push(await pixels());
  }
  await page.mouse.move(300, 240);
  await page.mouse.down();
  await page.mouse.move(360, 260);
  await page.mouse.up();
  pictures.push(await pixels());
  assert.equal(new Set(pictures.map((p) => p.sum)).size, pictures.length);
  await page.keyboard.press("0");
  assert.equal((await pixels()).sum, pictures[0].sum);
  await page.keyboard.press("t");
  assert.ok((await pixels()).back < 60);
});

test("several isovalues; the main profile fetches its tables", { skip, timeout: 60000 }, async () => {
  await open("plane_main_isovalues.iso");
  await until("done");
  await page.waitForFunction(() => document.documentElement.dataset.final === "true");
  const one = await pixels(), drawings = (await state()).drawings;
  await page.keyboard.press("]");
  await page.waitForFunction((d) => document.documentElement.dataset.drawings !== d, drawings);
  assert.notEqual((await pixels()).sum, one.sum);
});

test("a damaged file says what is wrong and keeps what it had", { skip, timeout: 60000 }, async () => {
  await open("damaged-plane_values_8_bit.iso");
  await until("malformed");
  assert.match(await page.textContent("#error"), /clause/);
});
