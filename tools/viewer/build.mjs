// One page with everything in it but the tables of the main profile: build/viewer/index.html and main.bin.
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { fileURLToPath, pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

const here = fileURLToPath(new URL(".", import.meta.url)), root = `${here}../../`;
const esbuild = createRequire(`${root}codec/js/package.json`).resolve("esbuild");
const { build } = await import(pathToFileURL(esbuild).href).then((module) => module.default ?? module);
const common = { bundle: true, format: "esm", target: "es2022", minify: true, write: false, logLevel: "error" };
const text = async (entry, define) =>
  (await build({ ...common, entryPoints: [entry], define })).outputFiles[0].text.trim();
const worker = await text(`${root}codec/js/src/worker.ts`, {});
const viewer = await text(`${here}viewer.ts`, { WORKER: JSON.stringify(worker) });
const page = readFileSync(`${here}index.html`, "utf8").replace("/*viewer*/", () => viewer.replaceAll("</script", "<\\/script"));
mkdirSync(`${root}build/viewer`, { recursive: true });
writeFileSync(`${root}build/viewer/index.html`, page);
copyFileSync(`${root}spec/isospec/main.bin`, `${root}build/viewer/main.bin`);
const size = gzipSync(page, { level: 9 }).length;
console.log(`viewer: ${page.length} bytes, ${size} gzipped`);
if (size > 64000) throw new Error("the page takes more than 64 kB gzipped");
