"""The decorators of compiled functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .call import Kernel
from .execution import EXECUTION, Execution


def kernel(function: Callable[..., Any]) -> Any:
    """Decorator of every function that is compiled and called from Python; its annotations are its one signature."""
    match EXECUTION:
        case Execution.LIBRARY | Execution.CHECKED:
            from .library import entry

            return Kernel(function, entry)
        case Execution.NUMBA:
            from .compiler import CompiledKernel

            return CompiledKernel(function)
    return function


def inner(function: Callable[..., Any]) -> Any:
    """Decorator of functions that only kernels call. From Python they run uncompiled.

    They are compiled anew for each literal number that they are called with. Constants that are handed on to large
    functions are therefore of numpy's types.
    """
    if EXECUTION is Execution.NUMBA:
        from . import compiler

        return compiler.Inner(function)
    return function


def inlined(function: Callable[..., Any]) -> Any:
    """Decorator of small functions in the innermost loops, put where they are called."""
    if EXECUTION is Execution.NUMBA:
        from . import compiler

        return compiler.Inner(function, forceinline=True)
    return function
