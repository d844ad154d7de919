"""Run the heavy tests of what has changed: packaging, zoo and others, whose sources hardly ever do.

``python tools/heavy_changed.py [COMMIT]`` compares with a commit, by default with the last merge.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = {
    "test_bench": ("tools/bench",),
    "test_docs": ("README.md", "docs/", "codec/isocodec/api/", "codec/isocodec/cli/"),
    "test_fuzz": ("conformance/isoconform/",),
    "test_kernel_builds": ("tools/kernels/",),
    "test_kernel_library": ("tools/kernels/", "codec/isocodec/kernel/"),
    "test_labelled": ("codec/isocodec/io/", "codec/isocodec/tiles/workers.py"),
    "test_packaging": ("pyproject.toml", "tools/kernels/"),
    "test_s3": ("codec/isocodec/storage/", "codec/isocodec/tiles/writing.py"),
    "test_spec_figures": ("spec/", "tools/spec_figures.py"),
    "test_terminal": ("codec/isocodec/cli/", "codec/isocodec/errors.py", "codec/isocodec/io/"),
    "test_typing": ("codec/isocodec/__init__.py", "codec/isocodec/api/"),
    "test_wasm": ("tools/kernels/", "codec/isocodec/entropy/", "codec/isocodec/grid/", "codec/isocodec/kernel/"),
    "test_zoo": ("conformance/", "spec/", "codec/isocodec/format/", "codec/isocodec/grid/", "codec/isocodec/mesh/"),
}
"""Beginnings of paths whose changes concern a module of heavy tests; its own always do."""


def output(*words: str) -> str:
    return subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def concerned(changed: list[str]) -> list[Path]:
    """Modules of heavy tests that changed files concern."""
    modules = {path.stem: path for path in (ROOT / "tests").rglob("test_*.py")}
    return [modules[name] for name, begins in SOURCES.items()
            if any(path.startswith(begins) or Path(path).stem == name for path in changed)]


def main() -> int:
    """Run them; the exit code of pytest."""
    last = output("git", "log", "--merges", "-1", "--format=%H") or "HEAD~1"
    base = sys.argv[1] if len(sys.argv) > 1 else last
    found = concerned(output("git", "diff", "--name-only", base).splitlines())
    print(f"heavy tests since {base[:12]}: {', '.join(path.stem for path in found) or 'none'}", flush=True)
    if not found:
        return 0
    words = [sys.executable, "-m", "pytest", "-m", "not apps", *map(str, found)]
    return subprocess.run(words, cwd=ROOT, env=os.environ, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
