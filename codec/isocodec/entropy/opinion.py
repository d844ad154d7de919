"""What a network of the main profile says of a symbol (spec clause 7.11): the sum of rows, weighed.

Much of the profile's time goes here. The compiler would keep the sums of a loop over rows in memory; as vectors they
stay in registers, which takes half of the time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from .main import HIDDEN

_LANES = 8
"""Numbers of a vector: any processor's instructions make up such vectors of their own."""
_INT, _LONG = ir.IntType(32), ir.IntType(64)
_INTS, _LONGS = ir.VectorType(_INT, _LANES), ir.VectorType(_LONG, _LANES)


def weighed(row: NDArray[np.int64], table: NDArray[np.int32], out: NDArray[np.int32]) -> int:
    """Sum of ``HIDDEN`` sums of rows, those below 0 counted as 0, each times a weight.

    Parameters
    ----------
    row : (R,) int64
        Number of rows, then which.
    table : (T, HIDDEN) int32, contiguous
    out : (HIDDEN,) int32 or longer, contiguous
    """
    sums = table[row[1 : row[0] + 1]].astype(np.int64).sum(axis=0)
    return int(np.maximum(sums, 0) @ out[:HIDDEN].astype(np.int64))


@overload(weighed)
def _compiled(row, table, out):
    return lambda row, table, out: _vectors(row, table, out)  # type: ignore[call-arg]


@intrinsic
def _vectors(_typing, row, table, out):
    return types.int64(row, table, out), _write


def _write(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
    row, table, out = (
        context.make_array(kind)(context, builder, value).data
        for kind, value in zip(signature.args, arguments, strict=True)
    )

    def vector(first: ir.Value, index: ir.Value) -> ir.Value:
        return builder.load(builder.bitcast(builder.gep(first, [index]), _INTS.as_pointer()), align=4)

    zero = ir.Constant(_INTS, None)
    places = range(0, HIDDEN, _LANES)
    sums = [cgutils.alloca_once_value(builder, zero) for _ in places]
    with cgutils.for_range(builder, builder.load(row)) as rows:
        number = builder.load(builder.gep(row, [builder.add(rows.index, _LONG(1))]))
        for place, held in zip(places, sums, strict=True):
            at = builder.add(builder.mul(number, _LONG(HIDDEN)), _LONG(place))
            builder.store(builder.add(builder.load(held), vector(table, at)), held)
    total = ir.Constant(_LONGS, None)
    for place, held in zip(places, sums, strict=True):
        value = builder.load(held)
        value = builder.select(builder.icmp_signed(">", value, zero), value, zero)
        weight = vector(out, _LONG(place))
        total = builder.add(total, builder.mul(builder.sext(value, _LONGS), builder.sext(weight, _LONGS)))
    result = _LONG(0)
    for lane in range(_LANES):
        result = builder.add(result, builder.extract_element(total, _INT(lane)))
    return result
