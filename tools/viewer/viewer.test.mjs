// The page in a real browser: pixels while a throttled stream arrives, keys, isovalues, frames, coordinates, damaged files,
// windows of files in tiles.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, readFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { withMetadata } from "../../codec/js/test/files.mjs";
import { curves, scratch, tile } from "../../codec/js/test/tiled.mjs";
import { chromium, openViewer, root, samples } from "./browser.mjs";

const skip = chromium ? false : "no Chromium";
const vectors = join(root, "conformance/vectors");
const made = skip ? {} : samples(), unmade = skip || (made["terrain.iso"] ? false : "no files: the reference encoder does not run");
const PLACED = { placement: "10 0 500000 0 10 5200000", crs: "EPSG:2056" };
let viewer, page, base;
/** What the page or a worker did that its policy forbids. */
const violations = [];
/** Hills in tiles of 128 samples, and the ranges that it was asked for. */
const large = unmade ? undefined : readFileSync(tile("large", [1300, 1400], ["--isovalue", "5200.5", "--isovalue", "7000", "--precision", "exact",
  "--tile", "128", "--metadata", "placement=0 10 2500000 -20 0 1200000"]));
let ranges = [];
const solid = unmade ? undefined : readFileSync(tile("solid", [50, 60, 70], ["--isovalue", "9000.5", "--metadata", "placement=0 0 -2 7 0 3 0 8 4 0 0 9"]));
/** Lets the rest of a file through that was held back. */
let release;

function find(name) {
  if (name.startsWith("held-")) {
    const data = made[name.slice(5)], part = Math.floor(0.05 * data.length) - 1;
    return (answer) => {
      answer.writeHead(200, { "content-length": data.length });
      answer.write(data.subarray(0, part));
      release = () => answer.end(data.subarray(part));
    };
  }
  if (name === "large.iso" || name === "tiles.iso") return (answer, { headers: { range } }) => {
    const all = made[name] ?? large;
    ranges.push(range);
    const [from, last] = range ? range.slice(6).split("-").map(Number) : [0, all.length - 1], to = Math.min(last + 1, all.length);
    answer.writeHead(range ? 206 : 200, { "content-length": to - from, ...(range && { "content-range": `bytes ${from}-${to - 1}/${all.length}` }) });
    answer.end(all.subarray(from, to));
  };
  if (name === "solid.iso") return solid;
  if (made[name]) return made[name];
  const path = join(vectors, name.replace(/^(damaged|placed)-/, ""));
  if (!existsSync(path)) return undefined;
  const data = Buffer.from(readFileSync(path));
  if (name.startsWith("placed-")) return Buffer.from(withMetadata(data, PLACED));
  if (name.startsWith("damaged-")) data[data.length >> 1] ^= 255;
  return data;
}

before(async () => {
  if (skip) return;
  ({ page, address: base } = viewer = await openViewer(find));
  page.setDefaultNavigationTimeout(120000);
  page.on("console", (message) => {
    if (/Content.Security.Policy/i.test(message.text())) violations.push(message.text());
  });
});

after(async () => {
  await viewer?.close();
  rmSync(scratch, { recursive: true });
});

test("the page has a strict policy, before all that it holds for, and no script or style in it", () => {
  const text = readFileSync(join(root, "build/viewer/index.html"), "utf8");
  const [whole, policy] = /<meta http-equiv="Content-Security-Policy" content="([^"]*)">/.exec(text), before = text.slice(0, text.indexOf(whole));
  const rules = Object.fromEntries(policy.split(";").map((rule) => rule.trim().split(/ +/)).map(([name, ...sources]) => [name, sources.join(" ")]));
  assert.deepEqual(rules, {
    "default-src": "'none'", "script-src": "'self' 'wasm-unsafe-eval'", "worker-src": "'self' blob:", "style-src": "'self'",
    "connect-src": "'self' http: https:", "img-src": "data:", "base-uri": "'none'", "form-action": "'none'",
  });
  assert.doesNotMatch(before, /<(link|script|style)/);
  assert.doesNotMatch(text, /<style|<[^>]* (style|on\w+)=|javascript:/i);
  for (const [, attributes, inside] of text.matchAll(/<script([^>]*)>([^<]*)/g)) assert.ok(/ src="\w+\.js"/.test(attributes) && !inside, attributes);
  for (const file of ["viewer.js", "tiles.js", "main.js", "domain.js", "kernels.js"])
    assert.doesNotMatch(readFileSync(join(root, "build/viewer", file), "utf8"), /\beval\(|new Function\b|\.innerHTML\b|\.insertAdjacentHTML\b/, file);
});

test("what the policy forbids is seen", { skip }, async () => {
  await page.goto(base);
  await page.evaluate(() => document.head.append(Object.assign(document.createElement("script"), { textContent: "window.ran = true" })));
  await page.evaluate(() => document.body.setAttribute("style", "color: red"));
  await frame();
  assert.equal(violations.splice(0).length, 2);
  assert.equal(await page.evaluate(() => window.ran), undefined);
});

const open = async (file, more = "", size = { width: 640, height: 480 }) => {
  await page.setViewportSize(size);
  await visit(`${base}#theme=light&file=${file}${more}`);
};
/** Load the page anew, whatever view it showed. */
const visit = async (link) => {
  await page.goto("about:blank");
  await page.goto(link, { waitUntil: "commit" });
};
const state = () => page.evaluate(() => ({ ...document.documentElement.dataset }));
const until = async (wanted) => {
  const there = (w) => document.documentElement.dataset.state === w;
  await page.waitForFunction(there, wanted, { timeout: 90000 }).catch(async () => {
    assert.fail(`${JSON.stringify(await state())} ${await page.textContent("#error")}`);
  });
};
const shown = (name, value) => page.waitForFunction(([n, v]) => document.documentElement.dataset[n] === v, [name, String(value)],
  { timeout: 90000 });
const finished = () => page.waitForFunction(() => document.documentElement.dataset.final === "true", undefined, { timeout: 120000 });
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

/** The pixels that are drawn, as places in the canvas. */
async function drawn() {
  await frame();
  return new Set(await page.evaluate(() => {
    const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2"), found = [];
    const data = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    for (let i = 0; i < data.length; i += 4) if (Math.abs(data[i] - data[0]) >= 40) found.push(i >> 2);
    return found;
  }));
}

for (const [name, rate] of [["plane_values_8_bit", 60], ["space_offsets_32", 80]]) {
  test(`${name} sharpens while ${rate} bytes come a second`, { skip, timeout: 300000 }, async () => {
    await open(`${name}.iso`, `&rate=${rate}`);
    await page.waitForFunction(() => Number(document.documentElement.dataset.cells) > 0, undefined, { timeout: 90000 });
    const early = await state(), first = await pixels();
    assert.equal(early.state, "open");
    assert.ok(first.count > 20, `${first.count} pixels`);
    await until("done");
    await finished();
    assert.notEqual((await pixels()).sum, first.sum);
    // how many cells an early curve has depends on when a slow machine looks
    const size = readFileSync(join(vectors, `${name}.iso`)).length;
    assert.ok(Number(early.bytes) < size, `${early.bytes} of ${size} bytes`);
    assert.equal(Number((await state()).bytes), size);
  });
}

test("a surface: turning, moving, zooming by keys and pointer", { skip, timeout: 300000 }, async () => {
  await open("space_reduced_topology_refined.iso");
  await until("done");
  await finished();
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

test("several isovalues; the main profile fetches its tables", { skip, timeout: 300000 }, async () => {
  await open("plane_main_isovalues.iso");
  await until("done");
  await finished();
  const all = await pixels(), { drawings, cells } = await state();
  await page.keyboard.press("]");
  await page.waitForFunction((d) => document.documentElement.dataset.drawings !== d, drawings);
  assert.notEqual((await pixels()).sum, all.sum);
  assert.ok(Number((await state()).cells) < Number(cells));
  await page.keyboard.press("a");
  await shown("cells", cells);
  assert.equal((await pixels()).sum, all.sum);
});

/** Colours of the legend by isovalue, and how many pixels of the canvas have just that colour. */
async function counted() {
  await frame();
  return page.evaluate(() => {
    const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2"), data = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    const counts = new Map();
    for (let i = 0; i < data.length; i += 4) {
      const key = `rgb(${data[i]}, ${data[i + 1]}, ${data[i + 2]})`;
      counts.set(key, (counts.get(key) ?? 0) + 1);
    }
    return [...document.querySelectorAll("#isovalues button")].map((row) => {
      const colour = getComputedStyle(row.querySelector("i")).backgroundColor;
      return { isovalue: Number(row.title.split(/[ :]/)[0]), colour, count: counts.get(colour) ?? 0 };
    });
  });
}

/** The file of a name, or one of `samples.py`, is open and all of it shown. */
async function opened(name, more, size) {
  await open(name, more, size);
  await until("done");
  await finished();
}

for (const [name, more, isovalues] of [["map", "", 42], ["tiles", "", 42], ["waves", "", 5], ["waves", "&frame=2", 5], ["mesh", "", 6]])
  for (const dark of [false, true])
    test(`${name}${more} on ${dark ? "black" : "white"}: the colour of every isovalue is there, and one alone by choice`, { skip: unmade, timeout: 300000 }, async () => {
      // so large that the smallest summits of a map are seen
      await opened(`${name}.iso`, more, { width: 1000, height: 900 });
      if (dark) await page.keyboard.press("t");
      const all = await counted();
      assert.equal(all.length, isovalues);
      assert.equal(new Set(all.map(({ colour }) => colour)).size, isovalues);
      assert.deepEqual(all.map(({ isovalue }) => isovalue), all.map(({ isovalue }) => isovalue).sort((p, q) => q - p));
      for (const { isovalue, count } of all) assert.ok(count > 0, `${isovalue}: ${count} pixels`);
      const { drawings } = await state(), chosen = all[isovalues >> 1];
      await page.click(`#isovalues button:nth-child(${(isovalues >> 1) + 1})`);
      await page.waitForFunction((d) => document.documentElement.dataset.drawings !== d, drawings);
      await until("done");
      const alone = await counted();
      assert.deepEqual(alone.filter(({ count }) => count > 0).map(({ isovalue }) => isovalue), [chosen.isovalue]);
      await page.click(`#isovalues button:nth-child(${(isovalues >> 1) + 1})`);
      await page.waitForFunction((n) => [...document.querySelectorAll("#isovalues .other")].length === n, 0);
      await until("done");
      await page.waitForFunction((c) => Number(document.documentElement.dataset.cells) > c, Number((await state()).cells) - 1);
    });

test("pointing at a curve names its value, in every place where its colour is", { skip: unmade, timeout: 300000 }, async () => {
  await opened("waves.iso");
  const all = await counted(), named = new Map();
  for (const { colour, isovalue } of all) {
    const places = await page.evaluate((wanted) => {
      const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2"), data = new Uint8Array(4 * canvas.width * canvas.height), found = [];
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
      for (let i = 0; i < data.length; i += 4) if (`rgb(${data[i]}, ${data[i + 1]}, ${data[i + 2]})` === wanted)
        found.push([(i >> 2) % canvas.width, canvas.height - 1 - Math.floor((i >> 2) / canvas.width)]);
      return found;
    }, colour);
    const free = places.filter(([x, y]) => x < 500 && y > 100 && y < 420), [x, y] = free[free.length >> 1];
    await page.mouse.move(x, y);
    named.set(isovalue, [Number((await state()).pointed), await page.textContent("#value")]);
    assert.equal(await page.locator("#isovalues .marked").getAttribute("title"), `${isovalue}: show it alone, or all again`);
    await page.mouse.move(5, 300);
  }
  for (const [isovalue, [pointed, text]] of named) assert.deepEqual([pointed, text], [isovalue, String(isovalue)]);
  assert.equal((await state()).pointed, undefined);
});

const address = () => page.evaluate(() => Object.fromEntries(new URLSearchParams(location.hash.slice(1))));

test("the address holds the view: file, isovalue, frame, place, zoom", { skip: unmade, timeout: 300000 }, async () => {
  await opened("waves.iso");
  await page.keyboard.press(",");
  await shown("frame", 6);
  await page.keyboard.press("]");
  for (const key of ["+", "+", "ArrowLeft", "Shift+ArrowLeft"]) await page.keyboard.press(key);
  await page.waitForFunction(() => new URLSearchParams(location.hash.slice(1)).get("zoom") === "1.5625" && location.hash.includes("turn"));
  await page.mouse.move(5, 300);
  const kept = await address(), link = page.url(), picture = await pixels();
  assert.deepEqual([kept.file, kept.isovalue, kept.frame, kept.theme], ["waves.iso", "-150", "6", "light"]);
  assert.equal(kept.at.split(",").length, 2);
  await visit(link);
  await until("done");
  await finished();
  assert.deepEqual(await pixels(), picture);
  assert.equal(await page.inputValue("#isovalue"), "0");
  await page.waitForTimeout(400);
  assert.deepEqual(await address(), kept);
  // another address, given to the page that is open
  await page.goto(link.replace("frame=6", "frame=2"));
  await shown("frame", 2);
  await until("done");
  assert.notDeepEqual(await pixels(), picture);
  await opened("head.iso");
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("Shift+ArrowUp");
  await page.waitForFunction(() => location.hash.includes("turn") && !location.hash.includes("at=-100.8,-100.8,-69&"));
  const solid = await pixels();
  await visit(page.url());
  await until("done");
  await finished();
  // turns are rounded
  assert.ok(Math.abs((await pixels()).count / solid.count - 1) < 1e-3);
});

test("a head stands upright, is seen from its front and has the steps of its data", { skip: unmade, timeout: 300000 }, async () => {
  await opened("head.iso", "&isovalue=500.5");
  const { turn } = await page.evaluate(() => Object.fromEntries(new URLSearchParams(location.hash.slice(1))));
  const world = await pixels();
  await page.keyboard.press("w");
  await page.waitForFunction(() => !document.getElementById("world").checked);
  await page.waitForTimeout(500);
  const samples = await pixels();
  assert.ok(Math.abs(samples.count / world.count - 1) < 0.01, `${samples.count} ${world.count}`);
  assert.equal(turn, undefined);
  await page.waitForFunction(() => location.hash.includes("turn=3.7743"));
});

test("the promise is what the file states", { skip: unmade, timeout: 300000 }, async () => {
  for (const [name, text] of [["map.iso", "within 0.1 cells"], ["tiles.iso", "all values exactly"], ["tin.iso", "none"], ["head.iso", "within 0.2 cells"]]) {
    await opened(name);
    assert.equal(await page.textContent("#promise"), text, name);
  }
});

test("surfaces are shaded by normals of their vertices: shades of a sphere vary from pixel to pixel by little", { skip: unmade, timeout: 300000 }, async () => {
  await opened("handles.iso");
  const shades = await page.evaluate(() => {
    const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2"), data = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return new Set(Array.from({ length: data.length / 4 }, (_, i) => data[4 * i])).size;
  });
  assert.ok(shades > 60, `${shades} shades`);
});

test("a damaged file says what is wrong and keeps what it had", { skip, timeout: 300000 }, async () => {
  await open("damaged-plane_values_8_bit.iso");
  await until("malformed");
  assert.match(await page.textContent("#error"), /clause/);
});

test("any frame of a series, by keys and by the slider", { skip: unmade, timeout: 300000 }, async () => {
  await open("waves.iso");
  await until("done");
  await finished();
  const last = Number(await page.getAttribute("#frame", "max")), pictures = [];
  assert.equal(last, 7);
  assert.ok(await page.isVisible("#frame"));
  await shown("frame", last);
  const times = ["5 s", "6 s", "7 s", "7.25 s"];
  for (const t of [last, last - 1, last - 2]) {
    await shown("frame", t);
    assert.equal(await page.textContent("#shown"), `${t}: ${times[t - 4]}`);
    pictures.push((await pixels()).sum);
    await page.keyboard.press(",");
  }
  await page.evaluate(() => {
    const slider = document.getElementById("frame");
    slider.value = "0";
    slider.dispatchEvent(new Event("input"));
  });
  await shown("frame", 0);
  pictures.push((await pixels()).sum);
  assert.equal(new Set(pictures).size, pictures.length);
  await page.evaluate(() => document.activeElement.blur());
  for (let t = 1; t <= last; t++) {
    await page.keyboard.press(".");
    await shown("frame", t);
  }
  assert.equal((await pixels()).sum, pictures[0]);
});

test("world coordinates at first: of a placement, and of a mapped grid; samples by choice", { skip, timeout: 300000 }, async () => {
  for (const [name, low, high] of [["placed-plane_values_8_bit", 490000, 510000], ["plane_mapped_nodes", 1500, 3000]]) {
    await open(`${name}.iso`);
    await until("done");
    await finished();
    const placed = await pixels(), drawings = (await state()).drawings;
    assert.ok(placed.count > 50);
    await page.mouse.move(320, 240);
    const [, x] = /x (-?[\d.]+)/.exec(await page.textContent("#where"));
    assert.ok(Number(x) > low && Number(x) < high, `${name}: ${x}`);
    await page.keyboard.press("w");
    await page.waitForFunction((d) => document.documentElement.dataset.drawings !== d, drawings);
    await page.mouse.move(322, 240);
    const [, column] = /x (-?[\d.]+)/.exec(await page.textContent("#where"));
    assert.ok(Number(column) > 0 && Number(column) < 100, `${name}: ${column}`);
    await open(`${name}.iso`, "&world=0");
    await until("done");
    await finished();
    assert.ok(!(await page.isChecked("#world")));
  }
});

test("the first curve is there before 5 % of a file of 1 MB", { skip: unmade, timeout: 300000 }, async (t) => {
  const size = made["terrain.iso"].length;
  assert.ok(size > 1e6, `${size} bytes`);
  await open("held-terrain.iso");
  await page.waitForFunction(() => Number(document.documentElement.dataset.cells) > 0, undefined, { timeout: 120000 });
  const early = await state();
  assert.equal(early.state, "open");
  assert.ok(Number(early.bytes) < 0.05 * size);
  assert.ok((await pixels()).count > 100);
  t.diagnostic(`${early.cells} segments after ${early.bytes} of ${size} bytes`);
  release();
});

test("isovalues that come level by level are drawn again as they are refined, to the end", { skip: unmade, timeout: 300000 }, async () => {
  await opened("map.iso");
  const { cells } = await state(), whole = await pixels();
  await open("held-map.iso");
  await shown("curves", 42);
  assert.ok(Number((await state()).cells) < Number(cells) / 2);
  release();
  await finished();
  assert.equal((await state()).cells, cells);
  assert.deepEqual(await pixels(), whole);
});

test("the viewer as one file shows the file in it, without a server, by its own policy", { skip: unmade, timeout: 300000 }, async () => {
  const asked = [], note = (request) => asked.push(request.url());
  for (const [name, count] of [["map.iso", 42], ["tiles.iso", 42], ["mesh.iso", 6]]) {
    await opened(name);
    const { cells } = await state(), path = join(scratch, "one.html");
    execFileSync(process.execPath, [join(root, "tools/viewer/one.mjs"), path, join(root, "build/samples", name)], { stdio: "ignore" });
    page.on("request", note);
    await visit(`${pathToFileURL(path)}#theme=light`);
    await until("done");
    await finished();
    page.off("request", note);
    assert.deepEqual([(await state()).cells, await page.locator("#isovalues button").count()], [cells, count], name);
    await page.keyboard.press("]");
    await page.waitForFunction((n) => location.hash.includes(`file=${n}&isovalue=`), name);
    await page.evaluate(() => document.body.setAttribute("style", "color: red"));
    await frame();
    assert.equal(violations.splice(0).length, 1);
  }
  assert.deepEqual(asked.filter((url) => !/^(file|data):/.test(url)), []);
});

test("compiled kernels draw what the page's own passes draw", {
  skip: unmade || (existsSync(join(root, "build/viewer/kernels.wasm")) ? false : "they have not been built"), timeout: 60000,
}, async () => {
  const fetched = [], pictures = [];
  const note = (request) => fetched.push(new URL(request.url()).pathname.slice(1));
  page.on("request", note);
  for (const more of ["", "&kernels=off"]) {
    fetched.length = 0;
    await open("hills.iso", more);
    await page.waitForFunction(() => document.documentElement.dataset.final === "true", undefined, { timeout: 90000 });
    pictures.push([await pixels(), (await state()).cells]);
    assert.deepEqual(fetched.filter((name) => name.startsWith("kernels.")).sort(), more ? [] : ["kernels.js", "kernels.wasm"]);
  }
  page.off("request", note);
  assert.ok(pictures[0][0].count > 1000);
  assert.deepEqual(pictures[0], pictures[1]);
});

test("a surface of 300,000 triangles turns", { skip: unmade, timeout: 300000 }, async (t) => {
  await open("gyroid.iso");
  await page.waitForFunction(() => document.documentElement.dataset.final === "true", undefined, { timeout: 120000 });
  const cells = Number((await state()).cells);
  assert.ok(cells > 3e5, `${cells} triangles`);
  const times = [];
  for (let i = 0; i < 10; i++) {
    times.push(await page.evaluate(() => new Promise((resolve) => {
      const started = performance.now(), gl = document.getElementById("view").getContext("webgl2");
      dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
      requestAnimationFrame(() => {
        // one pixel is read, so that the frame is drawn
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        resolve(performance.now() - started);
      });
    })));
  }
  times.sort((p, q) => p - q);
  t.diagnostic(`${cells} triangles: ${times[5].toFixed(0)} ms a frame, drawn by the processor`);
  assert.ok((await pixels()).count > 2000);
});

test("a surface of points and the curves of a mesh in the file", { skip, timeout: 300000 }, async () => {
  for (const name of ["tin_terrain", "mesh_plane_coded", "mesh_surface_coded"]) {
    await open(`${name}.iso`);
    await until("done");
    await finished();
    assert.ok((await pixels()).count > 20, name);
  }
});

test("a file in tiles: coarse at first, then what is seen, at the resolution of the screen", { skip: unmade, timeout: 300000 }, async (t) => {
  ranges = [];
  await open("large.iso", "&world=0");
  await page.waitForFunction(() => Number(document.documentElement.dataset.cells) > 0, undefined, { timeout: 90000 });
  const early = await state();
  assert.equal(early.layer, "0");
  assert.ok(Number(early.requests) <= 3, `${early.requests} requests`);
  await until("done");
  const overview = await state(), whole = await pixels();
  assert.ok(whole.count > 500, `${whole.count} pixels`);
  assert.ok(Number(overview.layer) < 3 && Number(overview.bytes) < large.length / 2, `layer ${overview.layer}, ${overview.bytes} bytes`);
  for (let i = 0; i < 12; i++) await page.keyboard.press("+");
  await shown("layer", 3);
  await until("done");
  const near = await state(), zoomed = await pixels();
  assert.notEqual(zoomed.sum, whole.sum);
  assert.ok(Number(near.requests) > Number(overview.requests) && Number(near.bytes) < large.length, `${near.bytes} of ${large.length} bytes`);
  for (let i = 0; i < 12; i++) await page.keyboard.press("ArrowLeft");
  await page.waitForFunction((r) => Number(document.documentElement.dataset.requests) > r, Number(near.requests));
  await until("done");
  const moved = await state();
  assert.ok((await pixels()).count > 50);
  await page.keyboard.press("]");
  await page.waitForFunction((d) => Number(document.documentElement.dataset.drawings) > d, Number(moved.drawings));
  // the page looks at the beginning once, without a range
  assert.deepEqual(ranges.filter((range) => !range).length, 1);
  assert.equal(ranges.length - 1, Number((await state()).requests));
  t.diagnostic(`${large.length} bytes: overview ${overview.requests} requests and ${overview.bytes} bytes, window ${near.requests} and ${near.bytes}`);
});

test("world coordinates of a file in tiles: a field whose rows are twice as far apart", { skip: unmade, timeout: 300000 }, async () => {
  // the page as wide as in the test before, so that a pixel is as many samples
  await open("large.iso", "&world=0");
  await until("done");
  const before = await state();
  assert.ok(await page.isEnabled("#world"));
  await page.keyboard.press("w");
  await page.waitForFunction((d) => Number(document.documentElement.dataset.drawings) > d, Number(before.drawings));
  await until("done");
  const overview = await state();
  assert.ok((await pixels()).count > 500);
  assert.ok(Number(overview.layer) < 3 && Number(overview.bytes) < large.length / 2, `layer ${overview.layer}`);
  const at = async (x, y) => {
    await page.mouse.move(x, y);
    return /x (-?[\d.]+) +y (-?[\d.]+)/.exec(await page.textContent("#where")).slice(1).map(Number);
  };
  const [x, y] = await at(320, 240);
  assert.ok(Math.abs(x - 2506995) < 100 && Math.abs(y - 1187010) < 100, `${x} ${y}`);
  for (let i = 0; i < 14; i++) await page.keyboard.press("+");
  await shown("layer", 3);
  await until("done");
  const near = await state(), world = await drawn();
  assert.ok(world.size > 200 && Number(near.bytes) < large.length / 2, `${world.size} pixels, ${near.bytes} bytes`);
  // the reference's curve in what is seen is drawn where its points lie in the world
  const p = await at(100, 100), q = await at(540, 380), steps = [(q[0] - p[0]) / 440, (q[1] - p[1]) / 280];
  const rows = [p[1], q[1]].map((each) => (1200000 - each) / 20), columns = [p[0], q[0]].map((each) => (each - 2500000) / 10);
  const [{ points }] = curves([{ file: join(scratch, "large.iso"), window: [rows, columns], options: {} }]);
  let inside = 0;
  for (const [i, j] of points) {
    const column = Math.floor(100 + (2500000 + 10 * j - p[0]) / steps[0]), row = Math.floor(100 + (1200000 - 20 * i - p[1]) / steps[1]);
    if (column < 100 || column > 540 || row < 100 || row > 380) continue;
    assert.ok([-1, 0, 1].some((a) => [-1, 0, 1].some((b) => world.has((479 - row + a) * 640 + column + b))), `${i} ${j}`);
    inside++;
  }
  assert.ok(inside > 50, `${inside} points`);
  await page.keyboard.press("w");
  await page.waitForFunction((d) => Number(document.documentElement.dataset.drawings) > d, Number(near.drawings));
  await until("done");
  assert.equal((await state()).layer, before.layer);
  assert.ok((await at(320, 240)).every((z, a) => Math.abs(z - [699.5, -649.5][a]) < 8));
});

test("a surface in tiles in world coordinates, and a file that has none", { skip: unmade, timeout: 300000 }, async () => {
  await open("solid.iso", "&world=0");
  await until("done");
  const samples = await pixels(), { drawings, cells } = await state();
  await page.keyboard.press("w");
  await page.waitForFunction((d) => Number(document.documentElement.dataset.drawings) > d, Number(drawings));
  await until("done");
  const world = await pixels();
  // axes of different length, another way round: seen from the same side, with the steps of the data in both
  assert.ok(world.count > 500 && Math.abs(world.count / samples.count - 1) < 0.1, `${world.count} ${samples.count}`);
  assert.equal((await state()).cells, cells);
  await open("tiled_space_exact.iso");
  await until("done");
  assert.ok(!(await page.isEnabled("#world")));
});

test("surfaces in tiles, files that are opened, damaged ones", { skip, timeout: 300000 }, async () => {
  await open("tiled_space_exact.iso");
  await until("done");
  assert.equal((await state()).layer, "3");
  assert.ok((await pixels()).count > 100);
  await page.setInputFiles("#file", join(vectors, "tiled_plane_main.iso"));
  await until("done");
  await page.waitForFunction(() => document.getElementById("size").textContent.startsWith("70"));
  await until("done");
  assert.ok((await pixels()).count > 100);
  await open("damaged-tiled_plane_exact.iso");
  await until("malformed");
  assert.match(await page.textContent("#error"), /clause 12/);
});

test("nothing that the page has done so far is against its policy", { skip }, () => assert.deepEqual(violations, []));
