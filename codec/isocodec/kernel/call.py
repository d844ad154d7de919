"""A kernel as the rest of the package calls it, and the compiled entry that it runs."""

from __future__ import annotations

import ctypes
import functools
import operator
from collections.abc import Callable
from typing import Any

from ..errors import KernelError
from .types import BOOL, FLOAT, Signature

RESULTS = 8
"""Most numbers that a kernel returns."""
_Results = ctypes.c_int64 * RESULTS
_Fault = ctypes.c_int64 * 4
PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
"""An entry of a library: pointers to results and to the fault, the slots of all arguments; returns a status."""
FINE = (0, -2)
"""Statuses of a kernel that returned, with a value or without."""
Entry = Callable[[Any, Any, bytes], int]


class Kernel:
    """A compiled function; ``entry_of`` finds its entry, once, when it is first called.

    Arguments of types other than the annotations are an error: nothing else has been compiled, and it never runs as
    plain Python instead.
    """

    def __init__(self, function: Callable[..., Any], entry_of: Callable[[Kernel], Entry]) -> None:
        functools.update_wrapper(self, function)
        self.function = function
        self._entry_of = entry_of

    @property
    def name(self) -> str:
        """Its path in the package, as ``passes.refinement.refine``."""
        return ".".join([*self.function.__module__.split(".")[-2:], self.function.__name__])

    @functools.cached_property
    def signature(self) -> Signature:
        """Types that it takes and returns."""
        return Signature.of(self.function)

    @functools.cached_property
    def entry(self) -> Entry:
        """Function that runs when it is called."""
        return self._entry_of(self)

    @functools.cached_property
    def _packers(self) -> tuple[Callable[[Any], bytes], ...]:
        return tuple(kind.pack for _, kind in self.signature.arguments)

    def __call__(self, *arguments: Any) -> Any:
        try:
            frame = b"".join([pack(argument) for pack, argument in zip(self._packers, arguments, strict=True)])
        except (TypeError, ValueError, OverflowError):
            raise self._unfit(arguments) from None
        results, fault = _Results(), _Fault()
        status = self.entry(results, fault, frame)
        if status not in FINE:
            # only of kernels that check indices
            raise IndexError(f"kernel {self.name}: an index out of bounds, or another fault")
        return self._returned(results)

    @functools.cached_property
    def _returned(self) -> Callable[[Any], Any]:
        """Reader of the slots of results, chosen once: kernels are called often."""
        match self.signature.result:
            case None:
                return lambda results: None
            case tuple() as several:
                return lambda results: tuple(results[: len(several)])
            case kind if kind == FLOAT:
                return lambda results: ctypes.c_double.from_buffer(results).value
            case kind if kind == BOOL:
                return lambda results: bool(results[0] & 1)
        return operator.itemgetter(0)

    def _unfit(self, arguments: tuple[Any, ...]) -> KernelError:
        """Error for arguments that cannot be packed."""
        stated = self.signature.arguments
        if len(arguments) != len(stated):
            return KernelError(
                f"kernel {self.name}{self.signature} called with {len(arguments)} arguments", code="kernel-signature"
            )
        for (name, kind), argument in zip(stated, arguments, strict=True):
            try:
                kind.pack(argument)
            except (TypeError, ValueError, OverflowError) as error:
                return KernelError(f"kernel {self.name}, argument {name}: {error}", code="kernel-signature")
        return KernelError(f"kernel {self.name}: arguments of other types", code="kernel-signature")
