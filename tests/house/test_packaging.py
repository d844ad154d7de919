"""What is handed out: a source archive with all that belongs to it, and the wheel that it builds, somewhere else."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import venv
from pathlib import Path

import pytest

from home import ROOT

pytest.importorskip("build")
pytestmark = pytest.mark.heavy

TESTS = ("test_exact.py", "test_isovalues.py", "test_files.py")
"""Tests that need no other library than those below."""
ROUND_TRIP = """
import sys, numpy, isocodec
assert "site-packages" in isocodec.__file__, isocodec.__file__
field = numpy.hypot(*numpy.mgrid[:64, :64])
contour = isocodec.decode(isocodec.encode(field, 20.5, precision=0.005))
assert abs(numpy.hypot(*contour.points.T) - 20.5).max() < 0.02
print(isocodec.kernels())
"""


def run(*command: object, cwd: Path, **environment: str) -> str:
    # nothing of the checkout may be found
    kept = {name: text for name, text in os.environ.items() if name != "PYTHONPATH" and not name.startswith("ISOCODEC")}
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, cwd=cwd, env=kept | environment, timeout=3600
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The archive, and the wheel that was built of what is in it."""
    out = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", out, ROOT, cwd=out)
    (archive,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return archive, wheel


def test_the_archive_holds_what_is_kept(built: tuple[Path, Path]) -> None:
    """All files of the repository, and nothing else."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout")
    kept = {*run("git", "ls-files", "--cached", "--others", "--exclude-standard", cwd=ROOT).splitlines()}
    with tarfile.open(built[0]) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert held - kept == {"PKG-INFO"} and kept <= held


def test_the_wheel_works_elsewhere(built: tuple[Path, Path], tmp_path: Path) -> None:
    """In an environment of its own, from an empty folder: a round trip, commands, vectors, and tests of the archive."""
    venv.create(tmp_path / "venv", with_pip=True)
    there = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    empty = tmp_path / "empty"
    empty.mkdir()
    run(there / "python", "-m", "pip", "install", "-q", built[1], cwd=empty)
    assert run(there / "python", "-c", ROUND_TRIP, cwd=empty).startswith("library")
    assert run(there / "isocodec", "--version", cwd=empty).startswith("isocodec 0.")
    assert ", 0 failed" in run(there / "isoconform", "run", cwd=empty)
    run(there / "python", "-m", "pip", "install", "-q", "pytest", "hypothesis", "scikit-image", cwd=empty)
    with tarfile.open(built[0]) as archive:
        archive.extractall(tmp_path, [m for m in archive if "/tests/" in m.name], filter="data")
    (source,) = tmp_path.glob("isocodec-*")
    tests = [source / "tests" / "stream" / name for name in TESTS]
    said = run(there / "python", "-m", "pytest", "-q", "-m", "not heavy", *tests, cwd=empty)
    assert " passed" in said and " failed" not in said
