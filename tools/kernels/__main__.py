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
from shown import progress, say
from targets import TARGETS, WASM, native

ENVIRONMENT = front.ROOT / ".venv-build"


def main() -> int:
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python tools/kernels", description="Build the kernels' library.")
    parser.add_argument("--target", choices=[*TARGETS, WASM.name], help="platform, if not this one")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where to put it, if not into this checkout")
    parser.add_argument("--checked", action="store_true", help="with checks of indices: for ISOCODEC_KERNELS=checked")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    asked = parser.parse_args()
    target = (TARGETS | {WASM.name: WASM})[asked.target] if asked.target else native()
    if target is None:
        say("there is no library for this platform; with numba installed, ISOCODEC_KERNELS=numba compiles them")
        return 1
    if asked.target and target != native() and not asked.out:
        parser.error(f"a library for {asked.target} is of no use in this checkout: --out FOLDER")
    if not build.is_kept(target, asked.checked) and build.lacking():
        return _in_environment(sys.argv[1:])
    started = time.monotonic()
    with build.library(target, asked.jobs, progress, asked.checked) as place:
        if asked.out:
            shutil.copytree(place, asked.out, dirs_exist_ok=True)
        else:
            build.put_into_checkout(place, asked.checked)
    say(f"{target.library} for {target.name}, {time.monotonic() - started:.0f} s")
    return 0


def _in_environment(arguments: list[str]) -> int:
    """This command, in an environment that has what a build needs."""
    python = ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(ENVIRONMENT, with_pip=True)
    requirements = build.requirements()
    say(f"installing {', '.join(requirements)} into {ENVIRONMENT.name}")
    pip = [str(python), "-m", "pip", "install", "--quiet", "--no-compile", "--disable-pip-version-check", *requirements]
    if subprocess.run(pip).returncode:
        say("what a build needs cannot be installed, see above")
        return 1
    return subprocess.run([str(python), str(Path(__file__).parent), *arguments]).returncode


if __name__ == "__main__":
    sys.exit(main())
