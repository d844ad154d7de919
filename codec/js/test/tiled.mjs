// Files in tiles for tests: fields by integer arithmetic, files by the command, curves as the reference decodes them.
import { spawnSync } from "node:child_process";
import { mkdtempSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { python, root } from "./reference.mjs";

export const scratch = mkdtempSync(join(tmpdir(), "isocodec-"));

/** A file of numpy: little-endian numbers in C order. */
function npy(shape, type, values) {
  const text = `{'descr': '${type}', 'fortran_order': False, 'shape': (${shape.join(", ")}), }`;
  const head = text.padEnd(Math.ceil((text.length + 11) / 64) * 64 - 11) + "\n", bytes = Buffer.alloc(10 + head.length);
  bytes.write("\x93NUMPY\x01\x00", "latin1");
  bytes.writeUInt16LE(head.length, 8);
  bytes.write(head, 10, "latin1");
  return Buffer.concat([bytes, Buffer.from(values.buffer)]);
}

/** Hills, of integers; `missing` says where samples are. */
function hills(shape, missing) {
  const values = new (missing ? Float32Array : Int32Array)(shape.reduce((product, s) => product * s, 1));
  const at = shape.map(() => 0);
  for (let i = 0; i < values.length; i++) {
    let x = 0, y = 1;
    at.forEach((p, a) => {
      const period = 41 + 12 * a, wave = Math.abs((p * (3 + a)) % (2 * period) - period);
      x += wave * (7 + a) + ((p * p) % 13);
      y *= Math.abs((p % 60) - 30);
    });
    values[i] = missing?.(at) ? NaN : 10 * x + (y % 37);
    for (let a = shape.length - 1; a >= 0 && ++at[a] === shape[a]; a--) at[a] = 0;
  }
  return values;
}

/** Encode hills with the command `isocodec encode --tile`; returns the name of the file. */
export function tile(name, shape, options, missing) {
  const field = join(scratch, `${name}.npy`), file = join(scratch, `${name}.iso`);
  writeFileSync(field, npy(shape, missing ? "<f4" : "<i4", hills(shape, missing)));
  const { status, stderr } = spawnSync(python, ["-m", "isocodec", "encode", field, "-o", file, "--tile", "32", ...options], { cwd: root, encoding: "utf8" });
  if (status) throw new Error(stderr);
  return file;
}

/** The curves of windows, as the reference decodes them. */
export function curves(asked) {
  const script = fileURLToPath(new URL("curves.py", import.meta.url));
  const done = spawnSync(python, [script], { cwd: root, encoding: "utf8", input: asked.map((each) => JSON.stringify(each)).join("\n"), maxBuffer: 2 ** 30 });
  if (done.status) throw new Error(done.stderr);
  return done.stdout.trim().split("\n").map((line) => JSON.parse(line));
}
