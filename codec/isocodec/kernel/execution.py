"""Choice among the three executions in this process."""

from __future__ import annotations

import os
import warnings
from contextlib import suppress
from enum import Enum
from importlib.util import find_spec
from pathlib import Path

from ..errors import KernelError

SETTING = "ISOCODEC_KERNELS"
NOTE = Path(__file__).parent / "built" / "kernels.json"
"""Note of the library that comes with the package."""


class Execution(Enum):
    LIBRARY = "library"
    CHECKED = "checked"
    NUMBA = "numba"
    PYTHON = "python"


def content_of(path: Path) -> bytes:
    """Read a file of this package, which may lie in an archive on the path; raises `OSError`."""
    return bytes(__spec__.loader.get_data(str(path)))  # type: ignore[union-attr]


def _chosen() -> Execution:
    asked = os.environ.get(SETTING, "")
    if not asked:
        with suppress(OSError):
            if content_of(NOTE):
                return Execution.LIBRARY
        return _without_library()
    try:
        out = Execution(asked)
    except ValueError:
        names = ", ".join(each.value for each in Execution)
        raise KernelError(f"{SETTING}={asked}: choose one of {names}", code="kernels") from None
    if out is Execution.NUMBA and find_spec("numba") is None:
        raise KernelError(f"{SETTING}=numba: numba is not installed", code="kernels", remedy="pip install numba")
    return out


def _without_library() -> Execution:
    """Choose the execution on a platform without a library."""
    if find_spec("numba"):
        warnings.warn("no library of kernels for this platform: numba compiles them, in each process", stacklevel=2)
        return Execution.NUMBA
    warnings.warn(
        "no library of kernels for this platform: they run as plain Python, some hundred times slower; "
        "with numba installed they are compiled in each process", stacklevel=2,
    )
    return Execution.PYTHON


EXECUTION = _chosen()
BUILT = Path(__file__).parent / "built" / ("checked" if EXECUTION is Execution.CHECKED else "")
"""Folder of the library of a build, and of its note."""
