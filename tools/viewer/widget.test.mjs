// The widget for notebooks in a real browser, beside a kernel that is played here: what it asks for, and what it draws of it.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { chromium, openViewer, root, samples } from "./browser.mjs";

const made = chromium ? samples() : {};
const skip = !chromium ? "no Chromium" : made["terrain.iso"] ? false : "no files: the reference encoder does not run";
const python = readFileSync(join(root, "codec/isocodec/plotting/widget.py"), "utf8"), module = /_ESM = """([^]*?)"""/.exec(python)[1];
const ADDRESS = "http://notebook.example/";
let viewer, page;
/** What the page asked for, and the kernel's answer: bytes, a text for an error, or nothing yet. */
let asked = [], answer;

before(async () => {
  if (skip) return;
  viewer = await openViewer(() => undefined);
  page = viewer.page;
  const files = { "": "<!doctype html><body><div id=cell style='width:600px'></div>", "esm.js": module.replace("%s", `${ADDRESS}widget.js`),
    "lost.js": module.replace("%s", `${ADDRESS}nowhere.js`), "widget.js": readFileSync(join(root, "codec/js/dist/widget.js"), "utf8") };
  const type = (name) => (name ? "text/javascript" : "text/html");
  await page.route(`${ADDRESS}**`, (route) => {
    const name = route.request().url().slice(ADDRESS.length), body = files[name];
    return body === undefined ? route.fulfill({ status: 404 }) : route.fulfill({ body, contentType: type(name) });
  });
  await page.exposeFunction("kernel", async (message) => {
    asked.push(message);
    const given = await answer(message);
    return given instanceof Uint8Array ? { base64: Buffer.from(given).toString("base64") } : given;
  });
});
after(() => viewer?.close());

const TABLES = readFileSync(join(root, "spec/isospec/main.bin"));
const of = (file) => (message) => (message.tables ? TABLES : file.subarray(message.start, message.end));

/** A page in which a view of a model is shown. */
async function show(kernel, name = "esm.js") {
  asked = [];
  answer = kernel;
  await page.goto(ADDRESS);
  await page.evaluate(async (url) => {
    const calls = new Set(), model = {
      on: (_, call) => calls.add(call), off: (_, call) => calls.delete(call),
      send: async (message) => {
        const { base64, ...reply } = await window.kernel(message);
        // as in notebooks: a view within some other buffer
        const bytes = base64 === undefined ? [] : [new DataView(Uint8Array.from(`***${atob(base64)}`, (c) => c.charCodeAt(0)).buffer, 3)];
        for (const call of calls) call({ ...(message.id && { id: message.id }), ...reply }, bytes);
      },
    };
    window.calls = calls;
    window.end = await (await import(url)).default.render({ model, el: document.getElementById("cell") });
  }, ADDRESS + name);
}

const state = () => page.evaluate(() => ({ ...document.getElementById("cell").dataset, text: document.getElementById("cell").textContent }));
const final = () => page.waitForFunction(() => document.getElementById("cell").dataset.final === "true", undefined, { timeout: 60000 });
/** How many pixels are drawn. */
const pixels = () => page.evaluate(async () => {
  await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
  const canvas = document.querySelector("canvas"), gl = canvas.getContext("webgl2"), data = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) count += Math.abs(data[i] - data[0]) + Math.abs(data[i + 1] - data[1]) + Math.abs(data[i + 2] - data[2]) > 40;
  return count;
});

test("draws what has come before the rest does, and asks for it in order", { skip }, async () => {
  const file = made["map.iso"];
  let release;
  const held = new Promise((resolve) => (release = resolve));
  await show(async (message) => {
    if (message.start > 0) await held;
    return of(file)(message);
  });
  await page.waitForFunction(() => document.getElementById("cell").dataset.bytes, undefined, { timeout: 60000 });
  const part = await pixels();
  assert.ok(part > 200);
  assert.deepEqual([(await state()).bytes, (await state()).final], ["4096", "false"]);
  release();
  await final();
  assert.ok((await pixels()) > part);
  assert.equal((await state()).bytes, String(file.length));
  const ranges = asked.filter(({ tables }) => !tables);
  assert.deepEqual([ranges[0].start, ranges[0].end], [0, 4096]);
  ranges.slice(1).forEach(({ start, end }, i) => assert.deepEqual([start, end], [ranges[i].end - 1, 2 * ranges[i].end]));
  assert.ok(ranges.at(-1).end > file.length && asked.length === ranges.length + 1);
});

test("surfaces, series with a frame to choose, meshes, points", { skip }, async () => {
  for (const [name, frames] of [["head.iso", 1], ["waves.iso", 2], ["mesh.iso", 1], ["tin.iso", 1]]) {
    await show(of(made[name]));
    await final();
    assert.ok((await pixels()) > 200, name);
    assert.equal(await page.isVisible("input"), frames > 1, name);
  }
});

test("a file whose end a range meets, and one that is damaged", { skip }, async () => {
  const file = made["terrain.iso"].subarray(0, 4096), padded = of(file);
  await show((message) => {
    assert.ok(message.tables || message.start < file.length);
    return padded(message);
  });
  await final();
  assert.match((await state()).text, /ends|truncated/i);
  assert.ok((await pixels()) > 200);
});

test("of a file in tiles what is seen, finer where one comes near", { skip }, async () => {
  const file = made["tiles.iso"];
  await show(of(file));
  await final();
  const before = Number((await state()).bytes);
  assert.ok((await pixels()) > 200);
  await page.mouse.move(300, 210);
  await page.mouse.wheel(0, -1500);
  await page.waitForFunction((n) => Number(document.getElementById("cell").dataset.bytes) > n, before, { timeout: 60000 });
  assert.ok(asked.every(({ start, end, tables }) => tables || end - start < file.length));
});

test("errors of the kernel are shown, and a picture where the module cannot be loaded", { skip }, async () => {
  await show(() => ({ error: "the store has no such file" }));
  await page.waitForFunction(() => document.body.textContent.includes("no such file"));
  await show(({ picture }) => (picture ? { picture: "<i id=there></i>" } : { error: "?" }), "lost.js");
  await page.waitForSelector("#there", { state: "attached" });
});

test("a view that is closed asks for nothing more", { skip }, async () => {
  await show(of(made["map.iso"]));
  await final();
  await page.evaluate(() => window.end());
  assert.equal(await page.evaluate(() => window.calls.size), 0);
});
