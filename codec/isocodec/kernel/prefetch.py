"""Entries of large arrays, on their way into the cache before they are needed."""

from __future__ import annotations

from typing import Any

from .execution import EXECUTION, Execution


def prefetch(array: Any, i: int) -> None:
    """Begin to load entry ``i`` of an array, which is read or changed soon; nothing waits for it."""


if EXECUTION is Execution.NUMBA:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    _CACHED, _DATA = 3, 1
    """Into the nearest cache; data, not instructions."""

    def _prefetch(_typing: Any, array: Any, i: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            first = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            place = builder.bitcast(builder.gep(first, [arguments[1]]), ir.IntType(8).as_pointer())
            kinds = [place.type, *[ir.IntType(32)] * 3]
            name = "llvm.prefetch.p0i8"
            function = builder.module.globals.get(name) or ir.Function(
                builder.module, ir.FunctionType(ir.VoidType(), kinds), name
            )
            builder.call(function, [place, *(ir.Constant(ir.IntType(32), x) for x in (0, _CACHED, _DATA))])
            return context.get_dummy_value()

        return types.none(array, types.int64), build

    globals()["prefetch"] = intrinsic(_prefetch)
