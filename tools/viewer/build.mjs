// One page with everything in it but the tables of the main profile: build/viewer/index.html and main.bin.
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { fileURLToPath, pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

const here = fileURLToPath(new URL(".", import.meta.url)), root = `${here}../../`;
const codec = createRequire(`${root}codec/js/package.json`);
const load = (name) => import(pathToFileURL(codec.resolve(name)).href).then((module) => module.default ?? module);
const [{ build }, { minify }, { internalNames }] = [await load("esbuild"), await load("terser"), await import("../../codec/js/mangle.mjs")];
const common = { bundle: true, format: "esm", target: "es2022", minify: true, write: false, logLevel: "error" };
const text = async (entry, more) => {
  const { outputFiles: [{ text: bundle }] } = await build({ ...common, entryPoints: [entry], ...more });
  return (await minify(bundle, { module: true, ecma: 2022, compress: { passes: 3 } })).code;
};
const worker = await text(`${root}codec/js/src/worker.ts`, { mangleProps: internalNames() });
const viewer = await text(`${here}viewer.ts`, { define: { WORKER: JSON.stringify(worker) } });
const page = readFileSync(`${here}index.html`, "utf8").replace("/*viewer*/", () => viewer.replaceAll("</script", "<\\/script"));
mkdirSync(`${root}build/viewer`, { recursive: true });
writeFileSync(`${root}build/viewer/index.html`, page);
copyFileSync(`${root}spec/isospec/main.bin`, `${root}build/viewer/main.bin`);
const size = gzipSync(page, { level: 9 }).length;
console.log(`viewer: ${page.length} bytes, ${size} gzipped`);
if (size > 60000) throw new Error("the page takes more than 60 kB gzipped");
