// Milliseconds that files take to be decoded, the least of several runs in turn: by the package's own passes, with compiled
// kernels, by Python. `node test/speed.mjs FILE...`; ISOCODEC_RUNS says how many runs.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { Decoder } from "../dist/index.js";
import { MainProfile } from "../dist/main.js";
import { kernels } from "./kernels.mjs";
import { python } from "./reference.mjs";

const runs = Number(process.env.ISOCODEC_RUNS ?? 15);
const main = new MainProfile(readFileSync(new URL("../dist/main.bin", import.meta.url)));
const PYTHON = `
import sys, time
from isocodec import Decoder
data, times = open(sys.argv[1], "rb").read(), []
for _ in range(3):
    start = time.perf_counter()
    decoder = Decoder()
    decoder.feed(data)
    for _ in decoder:
        pass
    times.append(time.perf_counter() - start)
print(1000 * min(times))
`;

console.log("file: passes, compiled, Python; passes and compiled as parts of the speed of Python");
for (const file of process.argv.slice(2)) {
  const data = readFileSync(file), least = [Infinity, Infinity, Infinity];
  for (let run = 0; run < runs; run++) {
    [undefined, kernels].forEach((each, i) => {
      const start = performance.now(), decoder = new Decoder({ main, kernels: each });
      decoder.feed(data);
      decoder.end();
      if (decoder.error) throw decoder.error;
      least[i] = Math.min(least[i], performance.now() - start);
    });
    if (run % 5 === 0) least[2] = Math.min(least[2], Number(execFileSync(python, ["-c", PYTHON, file])));
  }
  console.log(`${file}: ${least.map((ms) => ms.toFixed(1)).join(", ")}; ${least.slice(0, 2).map((ms) => (least[2] / ms).toFixed(2)).join(", ")}`);
}
