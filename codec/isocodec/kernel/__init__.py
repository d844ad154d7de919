"""Kernels: the functions that are compiled, and the three ways in which they run.

A kernel is plain Python of numbers and arrays, with type annotations. The same source runs

- as a library, compiled ahead of time for the platform: what users install (``library``);
- compiled by numba in the process that runs: for developers (``compiler``);
- as plain Python: the reference.

``ISOCODEC_KERNELS`` chooses among ``library``, ``numba`` and ``python``.

The decorators are imported when they are asked for: how kernels run is known without numpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .execution import EXECUTION, Execution
from .running import kernels, untested
from .status import BAD, DONE, GROW, NEED, SPENT

if TYPE_CHECKING:
    from .constants import constant
    from .declare import inlined, inner, kernel
    from .types import record

__all__ = [
    "BAD",
    "DONE",
    "EXECUTION",
    "GROW",
    "NEED",
    "SPENT",
    "Execution",
    "constant",
    "inlined",
    "inner",
    "kernel",
    "kernels",
    "record",
    "untested",
]

if not TYPE_CHECKING:  # or type checkers would take any name for one that is there

    def __getattr__(name: str) -> Any:
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from .constants import constant
        from .declare import inlined, inner, kernel
        from .types import record

        globals().update(constant=constant, inlined=inlined, inner=inner, kernel=kernel, record=record)
        return globals()[name]
