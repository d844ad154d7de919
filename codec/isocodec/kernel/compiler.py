"""Kernels compiled by numba: in this process, or as LLVM code that becomes part of a library.

Nothing here is needed at run time where there is a library.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import Any

from numba import njit, types
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import typeof_impl

from ..errors import KernelError
from .call import PROTOTYPE, Entry, Kernel
from .records import type_of
from .types import Number, Signature

CHECKED = os.environ.get("NUMBA_BOUNDSCHECK", "0") not in ("", "0")
"""Whether indices are checked: for tests."""

# Kernels allocate nothing, so that their arrays need no reference counts: these atomics cost ten times the work itself.
_OPTIONS: dict[str, Any] = {
    "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": True, "_nrt": False,
}


class Inner:
    """A function that kernels call. Called from Python it runs uncompiled."""

    def __init__(self, function: Callable[..., Any], **options: bool) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self.dispatcher = njit(**(_OPTIONS | options))(function)

    def __call__(self, *arguments: Any) -> Any:
        return self._function(*arguments)


class CompiledKernel(Kernel):
    """A kernel that numba has compiled, or will; kernels may call it, too."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function, entry)
        self.dispatcher = njit(**_OPTIONS)(function)


@typeof_impl.register(Inner)
@typeof_impl.register(CompiledKernel)
def _called_by_a_kernel(function: Inner | CompiledKernel, _context: Any) -> types.Type:
    return types.Dispatcher(function.dispatcher)


def compiled(kernel: CompiledKernel) -> Any:
    """Compile by numba a function of one argument, the address of a kernel's argument slots: it calls the kernel."""
    signature = kernel.signature
    taken = ", ".join(f"arguments.{name}" for name, _ in signature.arguments)
    scope: dict[str, Any] = {"kernel": kernel}
    exec(f"def unpacked(arguments):\n    return kernel({taken})", scope)
    unpacked = njit(**_OPTIONS)(scope["unpacked"])
    frame = type_of(signature.frame)
    with global_compiler_lock:
        unpacked.compile((frame,))
        result: Any = unpacked.overloads[(frame,)]
        _check_result(kernel, signature, result.signature.return_type)
        result.library._ensure_finalized()
    return result


def entry(kernel: Kernel) -> Entry:
    """A kernel compiled for this process."""
    assert isinstance(kernel, CompiledKernel)
    result = compiled(kernel)
    made = PROTOTYPE(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))
    made.compiled = result  # type: ignore[attr-defined]  # or its code would go
    return made


def _check_result(kernel: Kernel, signature: Signature, found: types.Type) -> None:
    """Check that the type returned is the one annotated."""
    match signature.result:
        case None:
            stated: types.Type = types.none
        case Number() as number:
            stated = type_of(number)
        case tuple() as several:
            stated = types.UniTuple(type_of(several[0]), len(several))
    if stated != found:
        raise KernelError(f"kernel {kernel.name} returns {found}, but is annotated with {stated}", code="kernel-result")
