"""Execution of kernels in this process."""

from __future__ import annotations

from typing import NamedTuple

from .execution import EXECUTION, Execution


class Kernels(NamedTuple):
    """Execution of kernels in this process.

    Attributes
    ----------
    execution : str
        ``"library"``, ``"numba"`` or ``"python"``; ``"checked"`` is a library that checks indices, for tests.
    detail : str
        For a library, its platform and which of its instructions are used.
    """

    execution: str
    detail: str

    def __str__(self) -> str:
        return f"{self.execution}, {self.detail}" if self.detail else self.execution


def kernels() -> Kernels:
    """Find how kernels run in this process: from the library, compiled by numba, or as plain Python."""
    if EXECUTION in (Execution.LIBRARY, Execution.CHECKED):
        from .library import library

        return Kernels(EXECUTION.value, library().detail)
    return Kernels(EXECUTION.value, "")


def untested() -> bool:
    """Whether kernels are those of a library that could not be run where it was built."""
    if EXECUTION not in (Execution.LIBRARY, Execution.CHECKED):
        return False
    from .library import note

    return not note().ran
