// The reference decoder, and commands of the reference package.
import { spawn } from "node:child_process";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export const root = fileURLToPath(new URL("../../../", import.meta.url));
export const python = process.env.ISOCODEC_PYTHON ?? join(root, ".venv-test/bin/python");

/** The reference decoder by the batch protocol. */
export function reference() {
  const process = spawn(python, ["-m", "isoconform", "dump", "--batch"], { cwd: root, stdio: ["pipe", "pipe", "inherit"] });
  let buffer = Buffer.alloc(0), wake = () => {};
  process.stdout.on("data", (data) => {
    buffer = Buffer.concat([buffer, data]);
    wake();
  });
  let gone = false;
  process.on("exit", () => {
    gone = true;
    wake();
  });
  process.stdin.on("error", () => undefined);
  const until = async (there) => {
    while (!there() && !gone) await new Promise((resolve) => (wake = resolve));
  };
  return {
    async ask(file) {
      process.stdin.write(file + "\n");
      await until(() => buffer.includes(10));
      if (!buffer.includes(10)) return undefined;
      const end = buffer.indexOf(10), [code, length] = buffer.subarray(0, end).toString().split(" ");
      await until(() => buffer.length >= end + 1 + Number(length));
      const text = buffer.subarray(end + 1, end + 1 + Number(length)).toString();
      buffer = buffer.subarray(end + 1 + Number(length));
      return { code: code === "4" || code === "6" ? "refused" : code, text };
    },
    end: () => process.stdin.end(),
  };
}
