// Compiled kernels, where they have been built.
import { existsSync, readFileSync } from "node:fs";
import { Kernels } from "../dist/kernels.js";

const file = new URL("../dist/kernels.wasm", import.meta.url);
export const kernels = existsSync(file) ? new Kernels(new WebAssembly.Module(readFileSync(file))) : undefined;
