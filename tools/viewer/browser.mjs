// A browser with the viewer in it, for its tests and pictures: served from build/viewer, files from memory or from folders.
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readdirSync, readFileSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

export const root = fileURLToPath(new URL("../../", import.meta.url));
const python = process.env.ISOCODEC_PYTHON ?? join(root, ".venv-test/bin/python");

export const chromium = process.env.CHROMIUM ?? ["chromium", "chromium-browser", "google-chrome"]
  .flatMap((name) => (process.env.PATH ?? "").split(delimiter).map((folder) => join(folder, name))).find(existsSync);

const TYPES = { html: "text/html", css: "text/css", js: "text/javascript" };

/** The files of `samples.py` by name, made once in build/samples; none if it cannot run. */
export function samples() {
  const folder = join(root, "build/samples"), script = join(root, "tools/viewer/samples.py"), stamp = join(folder, "terrain.iso");
  try {
    mkdirSync(folder, { recursive: true });
    // the last one that it writes
    if (!existsSync(stamp) || statSync(stamp).mtimeMs < statSync(script).mtimeMs)
      execFileSync(python, [script, folder], { stdio: ["ignore", "ignore", "inherit"] });
    return Object.fromEntries(readdirSync(folder).map((name) => [name, readFileSync(join(folder, name))]));
  } catch {
    return {};
  }
}

/** A line of so many bytes a second, which all answers share, 1 kB in turn; `trip`: milliseconds until a request is answered. */
function slowLine({ rate, trip }) {
  let free = 0;
  return async (answer, bytes) => {
    await new Promise((resolve) => setTimeout(resolve, trip));
    for (let at = 0; at < bytes.length; at += 1000) {
      free = Math.max(free, performance.now()) + 1e6 / rate;
      await new Promise((resolve) => setTimeout(resolve, free - performance.now()));
      answer.write(bytes.subarray(at, at + 1000));
    }
    answer.end();
  };
}

/**
 * Opens the viewer: a page, its address, and `close`. `find(name)` gives the bytes of a file, or a function that answers the
 * request itself. On a slow `line` the page is compressed, and may be kept.
 */
export async function openViewer(find, viewport = { width: 640, height: 480 }, line = undefined) {
  const send = line ? slowLine(line) : (answer, bytes) => answer.end(bytes);
  const server = createServer((request, answer) => {
    const name = new URL(request.url, "http://localhost").pathname.slice(1) || "index.html";
    const found = name.endsWith(".iso") ? find(name) : existsSync(join(root, "build/viewer", name)) && readFileSync(join(root, "build/viewer", name));
    if (!found) return answer.writeHead(404).end();
    if (typeof found === "function") return void found(answer, request);
    const type = TYPES[name.split(".").pop()] ?? "application/octet-stream";
    const packed = line && !name.endsWith(".iso"), bytes = packed ? gzipSync(found) : found;
    answer.writeHead(200, { "content-length": bytes.length, "x-content-type-options": "nosniff", "content-type": type,
      ...(packed && { "content-encoding": "gzip", "cache-control": "max-age=3600" }) });
    void send(answer, bytes);
  }).listen(0);
  const playwright = createRequire(join(root, "codec/js/package.json"))("playwright-core");
  const browser = await playwright.chromium.launch({ executablePath: chromium,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"] });
  const page = await browser.newPage({ viewport });
  return {
    page, address: `http://localhost:${server.address().port}/`,
    async close() {
      await browser.close();
      server.closeAllConnections();
      server.close();
    },
  };
}
