"""The cache of compiled kernels: what is cut off, emptied or damaged there is made again, and nothing is said of it."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from brute import INTERPRETED
from isocodec.kept import is_whole

pytestmark = pytest.mark.skipif(INTERPRETED, reason="nothing is compiled")

ENTRIES = """
from isocodec.mesh.store import get, grown, new_store, put, wipe
store = grown(new_store(2), 1)
put(store, 3, 4, 0, 5)
print(get(store, 3, 4, 0), get(store, 4, 3, 0))
wipe(store)
print(sum(kernel.stats.cache_misses.total() for kernel in (get, put, wipe)))
"""
"""Three small kernels are compiled or loaded; their results, and how many were compiled."""


def began(cache: Path) -> subprocess.Popen[str]:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", ENTRIES], env=environment, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip


def compiled_by_a_process(cache: Path) -> int:
    """How many kernels a process compiled, which has right results and nothing to say."""
    process = began(cache)
    out, said = process.communicate(timeout=120)
    assert (process.returncode, said) == (0, "")
    results, _, count = out.partition("\n")
    assert results == "5 0"
    return int(count)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, bytes]:
    """The files of a cache that a first process made, by their names in it."""
    cache = tmp_path_factory.mktemp("kept")
    assert compiled_by_a_process(cache) == 3
    assert compiled_by_a_process(cache) == 0
    return {path.relative_to(cache): path.read_bytes() for path in cache.rglob("*") if path.is_file()}


def changed_byte(data: bytes) -> bytes:
    place = len(data) // 3
    return data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "emptied": lambda data: b"",
    "cut off": lambda data: data[: len(data) // 2],
    "noise": lambda data: random.Random(1).randbytes(len(data)),
    "a bit changed": changed_byte,
}


def enter(cache: Path, kept: dict[Path, bytes], suffix: str, damage: Callable[[bytes], bytes]) -> None:
    """Fill a cache with the files of another, those of one kind damaged."""
    for name, data in kept.items():
        (cache / name).parent.mkdir(exist_ok=True)
        (cache / name).write_bytes(damage(data) if name.name.endswith(suffix) else data)


@pytest.mark.parametrize("suffix", [".nbi", ".nbc", "sources.txt"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_made_again(tmp_path: Path, kept: dict[Path, bytes], damage: str, suffix: str) -> None:
    """All of a kind at once: indices, machine code, or the note of the sources, without which all is made anew."""
    enter(tmp_path, kept, suffix, DAMAGES[damage])
    assert compiled_by_a_process(tmp_path) == 3
    found = {path.relative_to(tmp_path): path for path in tmp_path.rglob("*") if path.is_file()}
    assert {name for name in found if name.suffix == ".nbi"} == {name for name in kept if name.suffix == ".nbi"}
    for name, path in found.items():
        assert path.read_bytes() == kept[name] if name.suffix == ".txt" else is_whole(path)


def test_one_damaged_kernel_costs_no_other(tmp_path: Path, kept: dict[Path, bytes]) -> None:
    (name,) = (name.name for name in kept if "store.put" in name.name and name.suffix == ".nbc")
    enter(tmp_path, kept, name, DAMAGES["emptied"])
    assert compiled_by_a_process(tmp_path) == 1
    assert compiled_by_a_process(tmp_path) == 0


def test_a_cache_that_cannot_be_written_costs_time_only(tmp_path: Path, kept: dict[Path, bytes]) -> None:
    """Directories in the place of the indices: nothing can be renamed over them."""
    enter(tmp_path, kept, "", lambda data: data)
    for path in tmp_path.rglob("*.nbi"):
        path.unlink()
        path.mkdir()
    assert compiled_by_a_process(tmp_path) == 3
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.parametrize("trials", [3, pytest.param(200, marks=pytest.mark.heavy)])
def test_killed_at_any_moment(tmp_path: Path, trials: int) -> None:
    """What a killed process leaves is whole or is not there, and the next one works."""
    for trial in range(trials):
        cache = tmp_path / str(trial)
        process = began(cache)
        # until it begins to write, on any machine, and a random while from then on
        while process.poll() is None and not list(cache.rglob("*.nb[ic]*")):
            time.sleep(0.002)
        time.sleep(random.uniform(0, 0.4))
        process.send_signal(signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
        process.communicate(timeout=120)
        assert all(map(is_whole, cache.rglob("*.nb[ic]")))
        assert compiled_by_a_process(cache) <= 3
        assert all(map(is_whole, cache.rglob("*.nb[ic]")))


def test_processes_at_once(tmp_path: Path) -> None:
    """They write the same files."""
    processes = [began(tmp_path) for _ in range(2)]
    for process in processes:
        assert process.communicate(timeout=120)[1] == "" and process.returncode == 0
    assert compiled_by_a_process(tmp_path) == 0
