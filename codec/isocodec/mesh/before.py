"""Knowledge of a vertex from the frame before, and how far the present one has agreed (spec clause 10.1.5)."""

from __future__ import annotations

import numpy as np

from ..kernel import inlined, inner, kernel
from ..kernel.types import Int8Vector, IntVector
from .complex import CellArrays

UNKNOWN = -1
RINGS = 9
"""Classes of the surplus of vertices above over those below, around a vertex."""
AGREED = 4
"""Whether the last two signs were those of the frame before."""


@inner
def surplus(mesh, sign, v):
    """Class of the surplus of known corners above over those below, in the cells around a vertex."""
    more = np.int64(0)
    for k in range(mesh.first[v], mesh.first[v + 1]):
        t = mesh.star[k]
        for i in range(mesh.cell.shape[1]):
            one = sign[mesh.cell[t, i]]
            if one != UNKNOWN:
                more += 2 * one - 1
    if mesh.cell.shape[1] == 4:
        more >>= 1
    return min(max(more, -(RINGS // 2)), RINGS // 2)


@inlined
def learn_agreement(st, v, sign):
    """Record whether a sign agrees with the frame before."""
    if st.before[v] != UNKNOWN:
        st.reg.agreed = (st.reg.agreed << 1 | np.int64(st.before[v] == sign)) & (AGREED - 1)


@inlined
def sign_before(st, v, above):
    """Class of a sign by the frame before: unknown there, the same as ``above``, or the other sign."""
    if st.before[v] == UNKNOWN:
        return np.int64(0)
    return np.int64(1) if st.before[v] == above else np.int64(2)


@inner
def spread(mesh, sign, queue, end):
    """Spread signs to unknown vertices, starting from the first ``end`` vertices of a queue."""
    at = np.int64(0)
    while at < end:
        v = queue[at]
        at += 1
        for k in range(mesh.first[v], mesh.first[v + 1]):
            t = mesh.star[k]
            for i in range(mesh.cell.shape[1]):
                other = mesh.cell[t, i]
                if sign[other] == UNKNOWN:
                    sign[other] = sign[v]
                    queue[end] = other
                    end += 1


@kernel
def spread_signs(mesh: CellArrays, sign: Int8Vector, queue: IntVector) -> None:
    """Give every unknown vertex the sign of the vertices around it; ``queue`` (V,) is scratch space.

    If all vertices of mixed cells are known, as for a complete isovalue, the result does not depend on the order.
    """
    end = np.int64(0)
    for v in range(len(sign)):
        if sign[v] != UNKNOWN:
            queue[end] = v
            end += 1
    spread(mesh, sign, queue, end)
