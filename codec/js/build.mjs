// Bundles the package into dist/: the library, the command line for conformance, types, the tables of the main profile.
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";

process.chdir(new URL(".", import.meta.url).pathname);
rmSync("dist", { recursive: true, force: true });
mkdirSync("dist", { recursive: true });
const common = { bundle: true, format: "esm", target: "es2022", minify: true, logLevel: "error" };
await build({ ...common, entryPoints: { index: "src/index.ts", worker: "src/worker.ts", three: "src/three.ts",
  domain: "src/domain/contents.ts" }, splitting: true, chunkNames: "chunk-[hash]", outdir: "dist", external: ["three"] });
await build({ ...common, entryPoints: { cli: "src/cli.ts" }, outdir: "dist", platform: "node", minify: false,
  banner: { js: "#!/usr/bin/env node" } });
copyFileSync("../../spec/isospec/main.bin", "dist/main.bin");
const tsc = createRequire(import.meta.url).resolve("typescript/bin/tsc");
execFileSync(process.execPath, [tsc, "--emitDeclarationOnly", "--outDir", "dist/types"], { stdio: "inherit" });
for (const name of ["index.js", "domain.js", "worker.js", "three.js"]) {
  const bytes = readFileSync(`dist/${name}`);
  console.log(`${name}: ${bytes.length} bytes, ${gzipSync(bytes, { level: 9 }).length} gzipped`);
}
