"""Set-up of the whole suite: how hard hypothesis tries, and files for the command line."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from brute import INTERPRETED
from commands import BALL, HILLS
from isocodec import encode

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
