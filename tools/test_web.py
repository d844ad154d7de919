"""Tests of what runs in browsers: builds the npm package and runs its tests; says what is left out and why.

Node 20 or later is needed, and what the package is built with, which npm fetches once. Where either cannot be had the
tests are left out and the exit code is 0, unless ``--strict`` is given.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "codec" / "js"
OLDEST_NODE = 20


def left_out() -> str | None:
    """Why the tests cannot run, None if they can."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        return "node and npm are not installed"
    version = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout.strip()
    number = version.lstrip("v").split(".")[0]
    if not number.isdigit() or int(number) < OLDEST_NODE:
        return f"node {version or 'without a version'} is older than {OLDEST_NODE}"
    stamp = PACKAGE / "node_modules" / ".installed"
    if stamp.exists() and stamp.stat().st_mtime >= (PACKAGE / "package.json").stat().st_mtime:
        return None
    command = [npm, "install", "--no-audit", "--no-fund", "--no-package-lock", "--silent"]
    try:
        done = subprocess.run(command, cwd=PACKAGE, timeout=300, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        done = False
    if not done:
        return "npm could not install what the package is built with"
    stamp.touch()
    return None


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--strict", action="store_true", help="fail where something is missing")
    strict = parser.parse_args().strict
    reason = left_out()
    if reason is not None:
        print(f"test-web: left out, {reason}")
        return 1 if strict else 0
    node = shutil.which("node") or "node"
    environment = {**os.environ, "ISOCODEC_PYTHON": str(ROOT / ".venv-test" / "bin" / "python")}
    tests = sorted(str(path) for path in (PACKAGE / "test").glob("*.test.mjs"))
    for command in ([node, "build.mjs"], [node, "--test", "--test-reporter=dot", *tests]):
        code = subprocess.run(command, cwd=PACKAGE, env=environment, check=False).returncode
        if code:
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
