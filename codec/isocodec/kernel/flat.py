"""All entries of an array as a vector, without a copy."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from .execution import EXECUTION, Execution


def flat(array: NDArray[Any]) -> NDArray[Any]:
    """The entries of a contiguous array in their order."""
    return array.reshape(-1)


if EXECUTION is Execution.NUMBA:
    # numba's own reshape calls a function of its run-time library
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    def _flat(_typing: Any, array: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            given = context.make_array(signature.args[0])(context, builder, arguments[0])
            made = context.make_array(signature.return_type)(context, builder)
            for name in ("meminfo", "parent", "nitems", "itemsize", "data"):
                setattr(made, name, getattr(given, name))
            made.shape = cgutils.pack_array(builder, [given.nitems])
            made.strides = cgutils.pack_array(builder, [given.itemsize])
            return made._getvalue()

        return types.Array(array.dtype, 1, "C")(array), build

    globals()["flat"] = intrinsic(_flat)
