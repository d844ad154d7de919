"""Set-up of the whole suite: how hard hypothesis tries, and files for the command line."""

from __future__ import annotations

import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import settings

from brute import INTERPRETED
from commands import BALL, HILLS
from isocodec import encode
from isocodec.io.readers.confined import ReadingProcess, _size_of
from isocodec.io.readers.source import InputFile

# Here alone is said how hypothesis chooses: the same examples each time where CI is set (.ci/run) or kernels are
# interpreted, others each time elsewhere.
settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True)
settings.register_profile("interpreted", deadline=None, derandomize=True, database=None, max_examples=3)
if INTERPRETED:
    settings.load_profile("interpreted")
else:
    settings.load_profile("ci" if os.environ.get("CI") else "default")


@pytest.fixture(scope="module")
def curve_data() -> bytes:
    return encode(HILLS, 80.5, precision="exact")


@pytest.fixture(scope="module")
def surface_data() -> bytes:
    return encode(BALL, 55.5, precision="exact")


@pytest.fixture
def curve(tmp_path: Path, curve_data: bytes) -> Path:
    path = tmp_path / "curve.iso"
    path.write_bytes(curve_data)
    return path


@pytest.fixture
def surface(tmp_path: Path, surface_data: bytes) -> Path:
    path = tmp_path / "surface.iso"
    path.write_bytes(surface_data)
    return path


@pytest.fixture
def hills(tmp_path: Path) -> Path:
    path = tmp_path / "hills.npy"
    np.save(path, HILLS)
    return path


@pytest.fixture(autouse=True, scope="session")
def kept_reading_processes() -> Iterator[None]:
    """Keep the processes that read files for the next test, as long as they live: to start one takes longest.

    Users have one for each file. Where a test changes directory, paths or environment, it gets one of its own.
    """
    kept: dict[str, list[tuple[object, ReadingProcess]]] = defaultdict(list)
    begin, end = ReadingProcess.__init__, ReadingProcess.__exit__

    def surroundings() -> object:
        known = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
        return sys.path[:], os.getcwd(), known

    def begun(self: ReadingProcess, library: str, extra: str, source: InputFile) -> None:
        for number, (around, one) in enumerate(kept[library]):
            if one._process.poll() is None and around == surroundings() and find_spec(library.partition(".")[0]):
                vars(self).update(vars(one), _size=_size_of(source.path), _first=one)  # it ends with the first
                del kept[library][number]
                return
        begin(self, library, extra, source)

    def ended(self: ReadingProcess, *about: object) -> None:
        if self._process.poll() is not None or self._late or self._complaints.closed:
            end(self, *about)
            return
        of_library = kept[self._library]
        of_library.append((surroundings(), self))
        if len(of_library) > 2:
            end(of_library.pop(0)[1])

    with mock.patch.object(ReadingProcess, "__init__", begun), mock.patch.object(ReadingProcess, "__exit__", ended):
        yield
    for one in (each for several in kept.values() for _, each in several):
        end(one)
