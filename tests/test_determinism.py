"""The same bytes everywhere: frozen digests, and kernels that are compiled or interpreted."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import isocodec
from brute import INTERPRETED
from isocodec.jit import drop_stale_kernels
from make_goldens import CASES, PATH, SMALL, digests


@pytest.mark.parametrize("name", SMALL if INTERPRETED else list(CASES))
def test_goldens(name):
    """Files and decoded states are those of ``goldens.json``, which only ``make_goldens.py`` writes."""
    goldens = json.loads(PATH.read_text())
    assert set(goldens) == set(CASES)
    assert digests(name) == goldens[name]


def test_interpreted_kernels_give_the_same():
    """Without numba's compiler, in another process: the same bytes and the same decoded state, n = 2 and 3."""
    assert {CASES[name][0].ndim for name in SMALL} == {2, 3}
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    script = str(PATH.with_name("make_goldens.py"))
    done = subprocess.run(
        [sys.executable, script, "--print", *SMALL], env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {name: digests(name) for name in SMALL}


@pytest.mark.parametrize("name", SMALL)
def test_nothing_is_left_behind(name):
    """The second file of a process is the first one's: no state outlives an encoder."""
    field, isovalue, options = CASES[name]
    first = isocodec.encode(field, isovalue, **options)
    isocodec.encode(field.T, isovalue + 1, signs_only=True)
    assert isocodec.encode(field, isovalue, **options) == first


def test_kernels_of_other_sources_are_dropped(tmp_path: Path):
    """Whatever the times of the files: archives and package managers set them as they like."""
    folder = tmp_path / "kernels"
    drop_stale_kernels.cache_clear()
    drop_stale_kernels(folder, "first")
    for name in ("kernel.nbi", "kernel.1.nbc", "module.pyc"):
        (folder / name).touch()
    drop_stale_kernels.cache_clear()
    drop_stale_kernels(folder, "first")
    assert len(list(folder.glob("*.nb[ic]"))) == 2
    drop_stale_kernels(folder, "second")
    assert {path.name for path in folder.iterdir()} == {"module.pyc", "sources.txt"}


def test_kernels_are_noted_to_be_of_these_sources():
    """The note says what they were compiled from wherever numba keeps them; indices that are checked are another."""
    program = "from isocodec.passes.base import base; print(getattr(base, 'stats').cache_path)"
    with tempfile.TemporaryDirectory() as folder:
        notes = []
        for checked in ("0", "1"):
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "NUMBA_BOUNDSCHECK": checked}
            environment |= {"NUMBA_DISABLE_JIT": "0", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
            done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
            notes.append((Path(done.stdout.strip()) / "sources.txt").read_text())
    assert len(notes[0]) == 64 and notes[0] != notes[1]
