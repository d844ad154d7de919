"""Which of the three executions this process uses."""

from __future__ import annotations

import os
import warnings
from enum import Enum
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from ..errors import KernelError

SETTING = "ISOCODEC_KERNELS"
NOTE = Path(__file__).parent / "built" / "kernels.json"
"""What is noted of the library that comes with the package."""


class Execution(Enum):
    LIBRARY = "library"
    CHECKED = "checked"
    NUMBA = "numba"
    PYTHON = "python"


class Kernels(NamedTuple):
    """How kernels run in this process.

    Attributes
    ----------
    execution : str
        ``"library"``, ``"numba"`` or ``"python"``; ``"checked"`` is a library that checks indices, for tests.
    detail : str
        Of a library, its platform and which of its instructions are used.
    """

    execution: str
    detail: str

    def __str__(self) -> str:
        return f"{self.execution}, {self.detail}" if self.detail else self.execution


def _chosen() -> Execution:
    asked = os.environ.get(SETTING, "")
    if not asked:
        return Execution.LIBRARY if NOTE.is_file() else _without_library()
    try:
        out = Execution(asked)
    except ValueError:
        names = ", ".join(each.value for each in Execution)
        raise KernelError(f"{SETTING}={asked}: choose one of {names}", code="kernels") from None
    if out is Execution.NUMBA and find_spec("numba") is None:
        raise KernelError(f"{SETTING}=numba: numba is not installed", code="kernels", remedy="pip install numba")
    return out


def _without_library() -> Execution:
    """On a platform that there is no library for."""
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
"""Where a build puts the library, and what is noted of it."""


def kernels() -> Kernels:
    """How kernels run in this process: from the library, compiled by numba, or as plain Python."""
    if EXECUTION in (Execution.LIBRARY, Execution.CHECKED):
        from .library import library

        return Kernels(EXECUTION.value, library().detail)
    return Kernels(EXECUTION.value, "")
