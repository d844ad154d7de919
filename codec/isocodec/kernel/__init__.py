"""Kernels: the functions that are compiled, and the three ways in which they run.

A kernel is plain Python of numbers and arrays, with type annotations. The same source runs

- as a library, compiled ahead of time for the platform: what users install (``library``);
- compiled by numba in the process that runs: for developers (``compiler``);
- as plain Python: the reference.

``ISOCODEC_KERNELS`` chooses among ``library``, ``numba`` and ``python``.
"""

from __future__ import annotations

from .declare import inlined, inner, kernel
from .execution import EXECUTION, Execution
from .running import kernels, untested
from .status import BAD, CUT, DONE, GROW, NEED
from .types import record

__all__ = [
    "BAD", "CUT", "DONE", "EXECUTION", "GROW", "NEED", "Execution", "inlined", "inner", "kernel", "kernels", "record",
    "untested",
]
