"""Which of the three executions this process uses."""

from __future__ import annotations

import os
from enum import Enum
from importlib.util import find_spec
from typing import NamedTuple

from ..errors import KernelError

SETTING = "ISOCODEC_KERNELS"


class Execution(Enum):
    LIBRARY = "library"
    NUMBA = "numba"
    PYTHON = "python"


class Kernels(NamedTuple):
    """How kernels run in this process.

    Attributes
    ----------
    execution : str
        ``"library"``, ``"numba"`` or ``"python"``.
    detail : str
        Of a library, its platform and which of its instructions are used.
    """

    execution: str
    detail: str


def _chosen() -> Execution:
    asked = os.environ.get(SETTING, "") or Execution.LIBRARY.value
    try:
        out = Execution(asked)
    except ValueError:
        names = ", ".join(each.value for each in Execution)
        raise KernelError(f"{SETTING}={asked}: choose one of {names}", code="kernels") from None
    if out is Execution.NUMBA and find_spec("numba") is None:
        raise KernelError(f"{SETTING}=numba: numba is not installed", code="kernels", remedy="pip install numba")
    return out


EXECUTION = _chosen()


def kernels() -> Kernels:
    """How kernels run in this process: from the library, compiled by numba, or as plain Python."""
    if EXECUTION is Execution.LIBRARY:
        from .library import library

        return Kernels(EXECUTION.value, library().detail)
    return Kernels(EXECUTION.value, "")
