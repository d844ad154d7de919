/** Command line for conformance: prints the decoded state, or answers the batch protocol of isoconform. */
import { existsSync, readFileSync, writeSync } from "node:fs";
import { createInterface } from "node:readline";
import { Decoder, type KnownMesh } from "./decoder.js";
import * as domains from "./domain/contents.js";
import { type ErrorKind, IsoError } from "./errors.js";
import { Kernels } from "./kernels.js";
import { MainProfile } from "./main/profile.js";
import { canonicalText, tiledText } from "./text.js";
import { openTiles } from "./tiles/file.js";

const compiled = process.env["ISOCODEC_COMPILED"];
/** The decoder's kernels, if the variable names their module. */
const kernels = compiled ? new Kernels(new WebAssembly.Module(readFileSync(compiled))) : undefined;
const tables = process.env["ISOCODEC_TABLES"] ?? new URL("./main.bin", import.meta.url);
let main: MainProfile | undefined;

/** The mesh beside a file of one that both sides have: a line `d n V T`, then vertices and cells, a line each. */
function meshOf(file: string): KnownMesh | undefined {
  const beside = file.replace(/\.iso$/, ".mesh");
  if (beside === file || !existsSync(beside)) return undefined;
  const [d, n, V, , ...rest] = readFileSync(beside, "utf8").trim().split(/\s+/).map(Number) as [number, number, number, number];
  return { d, n, coordinates: rest.slice(0, d * V), cells: rest.slice(d * V) };
}

const CODES: Record<ErrorKind, number> = { malformed: 4, limit: 6, truncated: 5, mesh: 3 };

async function dump(file: string, layers: number, bytes: number, piece: number): Promise<[number, string]> {
  main ??= new MainProfile(readFileSync(tables));
  const data = new Uint8Array(readFileSync(file)).subarray(0, bytes);
  if (data.length > 3 && data[3] === 0x54) return dumpTiles(data, main);
  const decoder = new Decoder({ main, domains, kernels, mesh: meshOf(file), keepFrames: true });
  if (layers > 0) decoder.pauseAt = layers;
  for (let at = 0; at < data.length && !decoder.error; at += piece) decoder.feed(data.subarray(at, at + piece));
  if (decoder.layers < decoder.pauseAt) decoder.end();
  const code = decoder.error ? CODES[decoder.error.kind] : 0;
  return [code, code === 0 || code === 5 ? canonicalText(decoder) : ""];
}

async function dumpTiles(data: Uint8Array, main: MainProfile): Promise<[number, string]> {
  try {
    return [0, await tiledText(await openTiles(data, { main, kernels }))];
  } catch (error) {
    if (error instanceof IsoError) return [CODES[error.kind], ""];
    throw error;
  }
}

function write(text: string): void {
  const bytes = Buffer.from(text);
  for (let at = 0; at < bytes.length; ) {
    try {
      at += writeSync(1, bytes, at);
    } catch (error) {
      if ((error as NodeJS.ErrnoException).code !== "EAGAIN") throw error;
    }
  }
}

const args = process.argv.slice(2);
if (args.includes("--batch")) {
  for await (const line of createInterface({ input: process.stdin })) {
    const [file, ...fields] = line.split("\t");
    const asked = { layers: 0, bytes: Infinity, piece: 2 ** 30 };
    let understood = true;
    for (const field of fields) {
      const [name, value] = field.split("=");
      if (name! in asked && value !== undefined) asked[name as keyof typeof asked] = Number(value);
      else understood = false;
    }
    if (!understood) write("-\n");
    else {
      const [code, text] = await dump(file!, asked.layers, asked.bytes, asked.piece);
      write(`${code} ${Buffer.byteLength(text)}\n${text}`);
    }
  }
} else {
  const option = args.indexOf("--layers");
  const layers = option < 0 ? 0 : Number(args.splice(option, 2)[1]);
  const [code, text] = await dump(args[args.length - 1]!, layers, Infinity, 2 ** 30);
  write(text);
  process.exitCode = code;
}
