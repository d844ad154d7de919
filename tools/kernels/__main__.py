"""Build the kernels: ``python tools/kernels`` gives this checkout its library; ``--help`` says what else there is.

Needs nothing but Python where the library has been built before; else an environment of its own, ``.venv-build``.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
import venv
from pathlib import Path

import build
import front
from targets import TARGETS, WASM, native

ENVIRONMENT = front.ROOT / ".venv-build"


def main() -> int:
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python tools/kernels", description="Build the kernels' library.")
    parser.add_argument("--target", choices=[*TARGETS, WASM.name], help="platform, if not this one")
    parser.add_argument("--out", type=Path, help="folder for the library, if not this checkout")
    parser.add_argument("--checked", action="store_true", help="with checks of indices, for tests")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    asked = parser.parse_args()
    target = native() if asked.target is None else (TARGETS | {WASM.name: WASM})[asked.target]
    if target == WASM and not asked.out:
        parser.error(f"--target {WASM.name} needs --out: there is no library of it in a checkout")
    if target is None:
        print("kernels: there is no library for this platform; ISOCODEC_KERNELS=numba compiles them", file=sys.stderr)
        return 1
    if not build.is_kept(target, asked.checked) and build.lacking():
        return _in_environment(sys.argv[1:])
    started = time.monotonic()
    with build.library(target, asked.jobs, _progress, asked.checked) as place:
        if asked.out:
            asked.out.mkdir(parents=True, exist_ok=True)
            for path in place.iterdir():
                shutil.copy(path, asked.out)
        else:
            build.put_into_checkout(place)
    print(f"kernels: {asked.out or build.BUILT.relative_to(front.ROOT)}/{target.library}, {time.monotonic() - started:.0f} s")
    return 0


def _progress(done: int, count: int) -> None:
    end = "\n" if done == count else ""
    print(f"\rkernels: {done} of {count} compiled", end=end, file=sys.stderr, flush=True)


def _in_environment(arguments: list[str]) -> int:
    """This command, in an environment that has what a build needs."""
    python = ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(ENVIRONMENT, with_pip=True)
    print(f"kernels: fetching {', '.join(build.REQUIREMENTS)}", file=sys.stderr)
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *build.REQUIREMENTS]
    if subprocess.run(pip).returncode:
        print("kernels: cannot install what a build needs", file=sys.stderr)
        return 1
    return subprocess.run([str(python), str(Path(__file__).parent), *arguments]).returncode


if __name__ == "__main__":
    sys.exit(main())
