"""The same bytes everywhere: frozen digests, and kernels that are compiled or interpreted."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
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


def test_kernels_older_than_a_source_are_dropped(tmp_path: Path):
    """A source file from the future, as clocks and archives make them, does not drop every kernel at every start."""
    now = time.time()
    for name, age in (("old.nbi", 30), ("old.1.nbc", 30), ("new.nbc", 10), ("changed.py", 20), ("future.py", -9999)):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (now - age, now - age))
    drop_stale_kernels(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"new.nbc", "changed.py", "future.py"}
