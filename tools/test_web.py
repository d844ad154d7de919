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
VIEWER = ROOT / "tools" / "viewer"
OLDEST_NODE = 20
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


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
    command = [npm, "install", "--no-audit", "--no-fund", "--no-package-lock", "--ignore-scripts", "--silent"]
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
    parser.add_argument("--viewer", action="store_true", help="build the viewer only, in build/viewer")
    options = parser.parse_args()
    strict = options.strict or options.viewer
    reason = left_out()
    if reason is not None:
        print(f"test-web: left out, {reason}")
        return 1 if strict else 0
    node = shutil.which("node") or "node"
    kernels = [str(ROOT / "tools" / "kernels"), "--target", "wasm32", "--out", str(ROOT / "build" / "wasm")]
    if subprocess.run([sys.executable, *kernels], check=False).returncode:
        print("test-web: compiled kernels are left out, they could not be built")
        if strict:
            return 1
    if options.viewer:
        return subprocess.run([node, str(VIEWER / "build.mjs")], check=False).returncode
    python = ROOT / ".venv-test" / "bin" / "python"
    environment = {**os.environ, "ISOCODEC_PYTHON": str(python)}
    pages = str(ROOT / "tests" / "house" / "test_docs.py")
    page = [[str(python), "-m", "pytest", pages, "-k", "javascript", "-m", "heavy or not heavy"]]
    tests = sorted(str(path) for folder in (PACKAGE / "test", VIEWER) for path in folder.glob("*.test.mjs"))
    for command in (
        [node, "build.mjs"],
        [node, str(PACKAGE / "node_modules" / "typescript" / "bin" / "tsc"), "-p", str(VIEWER)],
        [node, str(VIEWER / "build.mjs")],
        [node, "--test", "--test-reporter=dot", *tests],
        *(page if python.exists() else []),
    ):
        code = subprocess.run(command, cwd=PACKAGE, env=environment, check=False).returncode
        if code:
            return code
    if not any(shutil.which(name) for name in BROWSERS):
        print("test-web: the viewer's pixels are left out, no Chromium is installed")
        return 1 if strict else 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
