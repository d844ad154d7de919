// Bundles the package into dist/: the library, the command line for conformance, types, the tables of the main profile.
import { execFileSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";
import { minify } from "terser";
import { internalNames } from "./mangle.mjs";

process.chdir(new URL(".", import.meta.url).pathname);
rmSync("dist", { recursive: true, force: true });
mkdirSync("dist", { recursive: true });
const common = { bundle: true, format: "esm", target: "es2022", logLevel: "error" };
const small = { ...common, outdir: "dist", minify: true, mangleProps: internalNames(), metafile: true, external: ["three", "geojson-vt", "vt-pbf"] };
// modules of one group share what they have in common; names are shortened alike in all
const groups = [
  { index: "src/index.ts", draw: "src/draw.ts", main: "src/main/profile.ts", domain: "src/domain/contents.ts", text: "src/text.ts" },
  { world: "src/world.ts", three: "src/three.ts" }, { worker: "src/worker.ts" },
  { maplibre: "src/maplibre.ts", leaflet: "src/leaflet.ts" }, { tiles: "src/tiles/file.ts" },
  { kernels: "src/kernels.ts" },
];
/** Modules that use others of the package as users do; the first files of these. */
const USERS = ["maplibre", "tiles"];
const FILES = { decoder: "index", stream: "index", errors: "index", draw: "draw", world: "world", "main/profile": "main", "tiles/file": "tiles" };
const asUsers = { name: "as users", setup: ({ onResolve }) => onResolve({ filter: /^\.\.?\/(decoder|stream|errors|draw|world|main\/profile|tiles\/file)\.js$/ },
  ({ path }) => ({ path: `./${FILES[path.replace(/^\.*\/|\.js$/g, "")]}.js`, external: true })) };
const outputs = {};
let mangleCache = {};
for (const entryPoints of groups) {
  const chunkNames = `${Object.keys(entryPoints)[0]}-[hash]`;
  const made = await build({ ...small, entryPoints, splitting: true, chunkNames, mangleCache, plugins: USERS.includes(Object.keys(entryPoints)[0]) ? [asUsers] : [] });
  mangleCache = made.mangleCache;
  Object.assign(outputs, made.metafile.outputs);
}
for (const file of Object.keys(outputs)) {
  const { code } = await minify(readFileSync(file, "utf8"), { module: true, ecma: 2022, compress: { passes: 3 } });
  writeFileSync(file, code);
}
await build({ ...common, entryPoints: { cli: "src/cli.ts" }, outdir: "dist", platform: "node",
  banner: { js: "#!/usr/bin/env node" } });
/** One file of a module and all that it needs, but for compiled kernels. */
async function whole(entry, more) {
  const { outputFiles: [made] } = await build({ ...common, minify: true, write: false, external: ["./kernels.js"], entryPoints: [entry], ...more });
  return (await minify(made.text, { module: true, ecma: 2022, compress: { passes: 3 } })).code;
}
const worker = await whole("src/worker.ts", { mangleProps: internalNames() });
const widget = await whole("../../tools/viewer/widget.ts", { define: { WORKER: JSON.stringify(worker) } });
writeFileSync("dist/widget.js", widget);
copyFileSync("../../spec/isospec/main.bin", "dist/main.bin");
/** Made by `python tools/kernels --target wasm32 --out build/wasm`, where that can be. */
const kernels = "../../build/wasm/decoder.wasm";
if (existsSync(kernels)) copyFileSync(kernels, "dist/kernels.wasm");
else console.log("kernels.wasm: left out, it has not been built");
const tsc = createRequire(import.meta.url).resolve("typescript/bin/tsc");
execFileSync(process.execPath, [tsc, "--emitDeclarationOnly", "--outDir", "dist/types"], { stdio: "inherit" });

/** What a module is loaded with at once, gzipped one by one; what it loads later is not in it. */
function sizeOf(file, seen = new Set()) {
  if (seen.has(file)) return 0;
  seen.add(file);
  const more = outputs[file].imports.filter((each) => each.kind === "import-statement" && !each.external);
  return more.reduce((sum, each) => sum + sizeOf(each.path, seen), gzipSync(readFileSync(file), { level: 9 }).length);
}
const loaded = new Set();
sizeOf("dist/index.js", loaded);
console.log(`widget.js: ${gzipSync(widget, { level: 9 }).length} bytes gzipped`);
for (const name of groups.flatMap(Object.keys)) {
  const whole = sizeOf(`dist/${name}.js`), beside = sizeOf(`dist/${name}.js`, new Set(loaded));
  console.log(`${name}.js: ${whole} bytes gzipped, ${name === "index" ? whole : beside} beside index.js`);
}
