// The page, its style and its script, with all that most files need, in build/viewer: index.html, viewer.css, viewer.js; and
// beside them what is loaded when a file needs it: main.js and main.bin, the main profile and its tables, of which files in the plane need the beginning only, plane.bin;
// domain.js, meshes and surfaces; kernels.js and kernels.wasm, compiled kernels, where they have been built; tiles.js, a worker
// for files in tiles. Nothing is written into the page itself: its policy forbids that.
import { copyFileSync, existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { fileURLToPath, pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

const here = fileURLToPath(new URL(".", import.meta.url)), root = `${here}../../`;
const codec = createRequire(`${root}codec/js/package.json`);
const load = (name) => import(pathToFileURL(codec.resolve(name)).href).then((module) => module.default ?? module);
const [{ build }, { minify }, { internalNames }] = [await load("esbuild"), await load("terser"), await import("../../codec/js/mangle.mjs")];
const common = { bundle: true, format: "esm", target: "es2022", minify: true, write: false, logLevel: "error" };
// names are shortened alike in all that is loaded together
let mangleCache = {};
const text = async (entry, more) => {
  const made = await build({ ...common, entryPoints: [entry], mangleCache, ...more });
  mangleCache = made.mangleCache ?? mangleCache;
  return (await minify(made.outputFiles[0].text, { module: true, ecma: 2022, compress: { passes: 3 } })).code;
};
/** Modules are imported from where the page says that they lie: a worker without a file has no place of its own. */
const MODULES = { "./main/profile.js": "main", "./domain/contents.js": "domain", "./kernels.js": "kernels" };
const beside = { name: "beside", setup: ({ onResolve }) => onResolve({ filter: /^\.\/(main\/profile|domain\/contents|kernels)\.js$/ },
  ({ path }) => ({ path: `${MODULES[path]}.js`, external: true })) };
const short = { mangleProps: internalNames() };
const inline = await text(`${root}codec/js/src/worker.ts`, { ...short, plugins: [beside] });
const worker = Object.values(MODULES).reduce((code, name) => {
  if (!code.includes(`import("${name}.js")`)) throw new Error(`the worker does not import ${name}.js`);
  return code.replaceAll(`import("${name}.js")`, `import(self.${name})`);
}, inline);
const main = await text(`${root}codec/js/src/main/profile.ts`, short);
const domain = await text(`${root}codec/js/src/domain/contents.ts`, short);
const kernels = await text(`${root}codec/js/src/kernels.ts`, short);
const tiles = await text(`${here}tiles.ts`, {});
const viewer = await text(`${here}viewer.ts`, { define: { WORKER: JSON.stringify(worker) } });
/** A module of the package, to be used here. */
const module = async (entry) => import(`data:text/javascript,${encodeURIComponent((await build({ ...common, entryPoints: [entry] })).outputFiles[0].text)}`);
const page = readFileSync(`${here}index.html`), style = readFileSync(`${here}viewer.css`);
mkdirSync(`${root}build/viewer`, { recursive: true });
writeFileSync(`${root}build/viewer/index.html`, page);
writeFileSync(`${root}build/viewer/viewer.css`, style);
writeFileSync(`${root}build/viewer/viewer.js`, viewer);
writeFileSync(`${root}build/viewer/main.js`, main);
writeFileSync(`${root}build/viewer/domain.js`, domain);
writeFileSync(`${root}build/viewer/kernels.js`, kernels);
writeFileSync(`${root}build/viewer/tiles.js`, tiles);
const tables = readFileSync(`${root}spec/isospec/main.bin`), { readTables } = await module(`${root}codec/js/src/main/tables.ts`);
writeFileSync(`${root}build/viewer/main.bin`, tables);
writeFileSync(`${root}build/viewer/plane.bin`, tables.subarray(0, readTables(tables, 2).size));
const compiled = `${root}build/wasm/decoder.wasm`;
if (existsSync(compiled)) copyFileSync(compiled, `${root}build/viewer/kernels.wasm`);
const parts = [page, style, viewer], size = parts.reduce((sum, part) => sum + gzipSync(part, { level: 9 }).length, 0);
console.log(`viewer: ${parts.reduce((sum, part) => sum + part.length, 0)} bytes, ${size} gzipped; tiles.js: ${gzipSync(tiles, { level: 9 }).length} gzipped`);
if (size > 65536) throw new Error("the page takes more than 64 KiB gzipped");
