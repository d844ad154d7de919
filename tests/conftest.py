"""Set-up of the whole suite: where compiled kernels are kept, and how hard hypothesis tries."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest
from hypothesis import settings

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
KERNEL_HOMES = ("codec/isocodec/jit.py", "codec/isocodec/grid", "codec/isocodec/mesh", "codec/isocodec/entropy",
                "codec/isocodec/passes", "codec/isocodec/reduce", "spec/isospec")  # fmt: skip


def kernel_digest() -> str:
    """Digest of the names and bytes of all sources that end up in compiled kernels, and of how they are compiled."""
    # a kernel that was compiled without bounds checks would be loaded in a run with them
    digest = hashlib.sha256(os.environ.get("NUMBA_BOUNDSCHECK", "").encode())
    for home in (ROOT / name for name in KERNEL_HOMES):
        for path in sorted([home] if home.is_file() else home.rglob("*.py")):
            text = path.read_bytes()
            digest.update(f"{path.relative_to(ROOT).as_posix()}\0{len(text)}\0".encode() + text)
    return digest.hexdigest()[:16]


# numba's cache does not notice a change in a jitted module that another one imports: a directory for each state of
# the sources does. It lies where `pytest --cache-clear` removes it. numba reads the variable when it is imported.
os.environ["NUMBA_CACHE_DIR"] = str(ROOT / ".pytest_cache" / "d" / f"kernels-{kernel_digest()}")

settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True)
settings.register_profile("interpreted", deadline=None, derandomize=True, database=None, max_examples=3)
if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
    settings.load_profile("interpreted")
else:
    settings.load_profile("ci" if os.environ.get("CI") else "default")


# Files for the command line; imported when they are asked for, since numba reads its variable with the first import.


@pytest.fixture(scope="module")
def curve_data() -> bytes:
    from commands import HILLS
    from isocodec import encode

    return encode(HILLS, 80.5, exact=True)


@pytest.fixture(scope="module")
def surface_data() -> bytes:
    from commands import BALL
    from isocodec import encode

    return encode(BALL, 55.5, exact=True)


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
    import numpy as np

    from commands import HILLS

    path = tmp_path / "hills.npy"
    np.save(path, HILLS)
    return path
