// Statements and branches of the decoder that no conformance vector executes, and their share: `node test/coverage.mjs`.
// Decoding itself counts, by the package's own passes; not drawing, reading by ranges and what only users call.
import { existsSync, readFileSync } from "node:fs";
import { SourceMap } from "node:module";
import { Session } from "node:inspector/promises";
import { pathToFileURL } from "node:url";
import { build } from "esbuild";
import ts from "typescript";
import { readMesh } from "./mesh.mjs";
process.chdir(new URL("..", import.meta.url).pathname);
const ASIDE = /src\/(cubes|draw|holes|smooth|stream)\.ts|domain\/drawing|tiles\/(file|join|kept|source|web)/;
const CALLED = /^(copy|draw|filled|layers|meets|periodic|setDomains|setMain|without)$/;
const entry = 'export * from "./src/decoder.js"; export * from "./src/text.js"; export * from "./src/main/profile.js"; '
  + 'export * from "./src/tiles/file.js"; export * as domains from "./src/domain/contents.js";';
await build({ stdin: { contents: entry, resolveDir: "." }, bundle: true, format: "esm", target: "es2022", outfile: "dist/coverage.js", sourcemap: "external" });
const session = new Session(), code = readFileSync("dist/coverage.js", "utf8"), url = pathToFileURL("dist/coverage.js").href;
session.connect();
await session.post("Profiler.enable").then(() => session.post("Profiler.startPreciseCoverage", { callCount: true, detailed: true }));
const { canonicalText, coordinatesText, Decoder, domains, MainProfile, openTiles, tiledText } = await import(url);
const folder = new URL("../../../conformance/vectors/", import.meta.url), main = new MainProfile(readFileSync("../../spec/isospec/main.bin"));
for (const { name, file } of JSON.parse(readFileSync(new URL("manifest.json", folder), "utf8")).vectors) {
  const data = new Uint8Array(readFileSync(new URL(file, folder))), beside = new URL(`${name}.mesh`, folder);
  const tiled = /^(bad_)?tiled_/.test(name), mesh = existsSync(beside) ? readMesh(readFileSync(beside, "utf8")) : undefined;
  if (tiled) await openTiles(data, { main }).then(tiledText).catch(() => {});
  // once whole, with all frames for the text, and once byte by byte
  for (const keepFrames of tiled ? [] : data.length < 20000 ? [true, false] : [true]) {
    const decoder = new Decoder({ main, domains, mesh, keepFrames }), size = keepFrames ? data.length : 1;
    for (let at = 0; at < data.length; at += size) decoder.feed(data.subarray(at, at + size));
    decoder.end();
    if (keepFrames) canonicalText(decoder);
    coordinatesText(decoder);
  }
}
const { result } = await session.post("Profiler.takePreciseCoverage");
const counts = new Int32Array(code.length).fill(-1), map = new SourceMap(JSON.parse(readFileSync("dist/coverage.js.map", "utf8")));
const ranges = result.find((each) => each.url === url).functions.flatMap((each) => each.ranges);
// the innermost range of a place counts
for (const { startOffset, endOffset, count } of ranges.sort((a, b) => b.endOffset - b.startOffset - (a.endOffset - a.startOffset)))
  counts.fill(count, startOffset, endOffset);
const parsed = ts.createSourceFile("coverage.js", code, ts.ScriptTarget.ES2022, true), places = new Map();
let all = 0;
(function visit(node, missed) {
  if ((ts.isMethodDeclaration(node) || ts.isGetAccessor(node)) && CALLED.test(node.name.getText())) return;
  const { parent } = node, counted = (ts.isStatement(node) && !ts.isBlock(node) && !ts.isFunctionDeclaration(node) && !ts.isClassDeclaration(node))
    || (parent && ts.isConditionalExpression(parent) && (node === parent.whenTrue || node === parent.whenFalse))
    || (parent && ts.isBinaryExpression(parent) && node === parent.right && /^(&&|\|\||\?\?)=?$/.test(parent.operatorToken.getText()));
  const at = node.getStart(), { line, character } = parsed.getLineAndCharacterOfPosition(at), place = counted ? map.findEntry(line, character) : {};
  if (place.originalSource && !ASIDE.test(place.originalSource)) {
    all++;
    if (counts[at] <= 0) {
      const where = `${place.originalSource.replace(/^.*src\//, "")}:${place.originalLine + 1}`, text = node.getText();
      // what is within what was missed counts, but is not listed
      places.set(where, [...(places.get(where) ?? []), missed ? "" : text.replace(/\s+/g, " ").slice(0, 90)]);
    }
  }
  ts.forEachChild(node, (child) => visit(child, missed || (counted && counts[at] <= 0)));
})(parsed, false);
const lost = [...places.values()].flat().length;
for (const [where, texts] of places) if (texts.some(Boolean)) console.log(`${where}: ${texts.filter(Boolean).join(" | ")}`);
console.log(`${all - lost} of ${all} statements and branches, ${(100 * (all - lost) / all).toFixed(2)} %`);
