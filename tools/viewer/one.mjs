// The viewer as one file, for archives: `node tools/viewer/one.mjs OUT.html [FILE.iso]` puts build/viewer into it, and a file that it
// shows. It needs no server and can connect to none: its policy has hashes of its script and style, and allows data in the page.
import { createHash } from "node:crypto";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { basename } from "node:path";
import { fileURLToPath } from "node:url";

const [out, file] = process.argv.slice(2), folder = fileURLToPath(new URL("../../build/viewer/", import.meta.url));
const text = (name) => readFileSync(folder + name, "utf8"), style = text("viewer.css"), script = text("viewer.js");
const hash = (inline) => `'sha256-${createHash("sha256").update(inline).digest("base64")}'`;
const policy = `default-src 'none'; script-src ${hash(script)} data: 'wasm-unsafe-eval'; worker-src data:; style-src ${hash(style)}; ` +
  "connect-src data:; img-src data:; base-uri 'none'; form-action 'none'";
const parts = ["main.js", "main.bin", "domain.js", "kernels.js", "kernels.wasm", "tiles.js"].map((name) => folder + name).filter(existsSync);
const data = [...parts, ...(file ? [file] : [])].map((path) =>
  `<script type="text/plain" data-name="${basename(path).replace(/[^-\w.]/g, "_")}">${readFileSync(path, "base64")}</script>\n`);
const swaps = [
  [/(Policy" content=")[^"]*/, (_, before) => before + policy], [/<link rel="(module)?preload".*\n/g, () => ""], [/<form id="fetch"/, (form) => `${form} hidden`],
  [/<link rel="stylesheet".*/, () => `<style>${style}</style>`], [/<script.*<\/script>/, () => `${data.join("")}<script type="module">${script}</script>`],
];
const page = swaps.reduce((whole, [from, to]) => whole.replace(from, to), text("index.html"));
writeFileSync(out, page);
console.log(`${out}: ${page.length} bytes`);
