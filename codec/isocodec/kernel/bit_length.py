"""Bits that a number has: one instruction where it is compiled, without a table that would take up cache."""

from __future__ import annotations

from typing import Any

from .execution import EXECUTION, Execution


def bit_length(x: int) -> int:
    """Bits of a number that is not negative, 0 of 0."""
    return int(x).bit_length()


if EXECUTION is Execution.NUMBA:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    def _bit_length(_typing: Any, x: Any) -> Any:
        def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            # of 0 as well: no undefined result
            zeros = builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 0))
            return builder.sub(ir.Constant(zeros.type, 64), zeros)

        return types.int64(types.int64), build

    globals()["bit_length"] = intrinsic(_bit_length)
