"""``network.weighed`` for the compiler.

It would keep the sums of a loop over rows in memory; as vectors they stay in registers, which takes half of the time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from isospec.tables import HIDDEN

_LANES = 16
"""Numbers of a vector: any processor's instructions make up such vectors of their own."""
_SHORT, _INT, _LONG = ir.IntType(16), ir.IntType(32), ir.IntType(64)
_SHORTS, _INTS = ir.VectorType(_SHORT, _LANES), ir.VectorType(_INT, _LANES)


def instead_of(weighed: Callable[..., int]) -> None:
    """Kernels that call ``network.weighed`` get this."""
    overload(weighed)(lambda row, table, out: lambda row, table, out: _vectors(row, table, out))  # type: ignore[call-arg]


@intrinsic
def _vectors(_typing, row, table, out):
    return types.int64(row, table, out), _write


def _write(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
    row, table, out = (
        context.make_array(kind)(context, builder, value).data
        for kind, value in zip(signature.args, arguments, strict=True)
    )

    def vector(first: ir.Value, index: ir.Value, kind: ir.VectorType, size: int) -> ir.Value:
        return builder.load(builder.bitcast(builder.gep(first, [index]), kind.as_pointer()), align=size)

    zero = ir.Constant(_SHORTS, None)
    places = range(0, HIDDEN, _LANES)
    sums = [cgutils.alloca_once_value(builder, zero) for _ in places]
    with cgutils.for_range(builder, builder.load(row)) as rows:
        number = builder.load(builder.gep(row, [builder.add(rows.index, _LONG(1))]))
        for place, held in zip(places, sums, strict=True):
            at = builder.add(builder.mul(number, _LONG(HIDDEN)), _LONG(place))
            builder.store(builder.add(builder.load(held), vector(table, at, _SHORTS, 2)), held)
    total = ir.Constant(_INTS, None)
    for place, held in zip(places, sums, strict=True):
        value = builder.load(held)
        value = builder.select(builder.icmp_signed(">", value, zero), value, zero)
        weight = vector(out, _LONG(place), _INTS, 4)
        total = builder.add(total, builder.mul(builder.sext(value, _INTS), weight))
    # the upper half onto the lower one until a single number is left: lane by lane they would wait for one another
    left = _LANES
    while left > 1:
        left >>= 1
        low, high = (
            builder.shuffle_vector(total, total, ir.Constant(ir.VectorType(_INT, left), [*range(first, first + left)]))
            for first in (0, left)
        )
        total = builder.add(low, high)
    return builder.sext(builder.extract_element(total, _INT(0)), _LONG)
