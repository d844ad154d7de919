"""Vertices and edges that carry geometry, in the order of the leaves (spec clauses 5.6.2, 5.7.2)."""

from __future__ import annotations

import numpy as np

from ...kernel import inlined, kernel
from ...kernel.types import IntMatrix, IntVector, UInt8Vector
from ..lattice.access import dimension
from ..lattice.store import get
from ..tube.holes import on_whole_cell
from ..tube.state import State

VERTEX_ACTIVE = 8
"""Bit of a vertex's mark that is set if it is in the list; bits 0 to 2 are the grid edges that leave it upwards."""


@kernel
def active_vertices(st: State, leaves: IntMatrix, mark: UInt8Vector, full: bool, out: IntVector) -> int:
    """Vertices that geometry by values refines, in the order of the leaves (spec clause 5.6.2).

    On the full grid these are the ends of the grid edges that are crossed and, where a mask is known, that some unit
    cell without missing corners has; else all vertices of the leaves. ``leaves`` are rows of numbers of vertices.
    """
    n = dimension(st.grid.tables)
    count = 0
    for i in range(len(leaves)):
        for j in range(n + 1):
            v = leaves[i, j]
            drawn = not full
            if mark[v] & VERTEX_ACTIVE:
                continue
            if full and j > 0 and st.vertex[v, 3] != st.vertex[leaves[i, j - 1], 3]:
                drawn = _carries(st, v, leaves[i, j - 1])
            if full and j < n and not drawn and st.vertex[v, 3] != st.vertex[leaves[i, j + 1], 3]:
                drawn = _carries(st, v, leaves[i, j + 1])
            if drawn:
                mark[v] |= VERTEX_ACTIVE
                out[count] = v
                count += 1
    return count


@inlined
def _lower(st, a, b):
    """Which of two vertices comes first in the order of positions."""
    for axis in range(3):
        if st.vertex[a, axis] != st.vertex[b, axis]:
            return a if st.vertex[a, axis] < st.vertex[b, axis] else b
    return a


@inlined
def _axis(st, a, b):
    """Along which axis two ends of a grid edge differ."""
    axis = 0
    while st.vertex[a, axis] == st.vertex[b, axis]:
        axis += 1
    return axis


@inlined
def _carries(st, a, b):
    """Whether some unit cell without missing corners has the grid edge between two vertices."""
    low = _lower(st, a, b)
    x, y, z = np.int64(st.vertex[low, 0]), np.int64(st.vertex[low, 1]), np.int64(st.vertex[low, 2])
    return on_whole_cell(st, x, y, z, _axis(st, a, b))


@kernel
def grid_edges(st: State, leaves: IntMatrix, mark: UInt8Vector, out: IntMatrix) -> int:
    """Edges of the full grid that are crossed, in the order of the leaves: both ends, the lower first (5.7.2).

    Where a mask is known, those that no unit cell without missing corners has are left out.
    """
    n = dimension(st.grid.tables)
    count = 0
    for i in range(len(leaves)):
        for j in range(n):
            a, b = leaves[i, j], leaves[i, j + 1]
            if st.vertex[a, 3] == st.vertex[b, 3]:
                continue
            low = _lower(st, a, b)
            high = b if low == a else a
            axis = _axis(st, a, b)
            if not mark[low] >> axis & 1 and _carries(st, a, b):
                mark[low] |= 1 << axis
                out[count, 0] = low
                out[count, 1] = high
                count += 1
    return count


@kernel
def leaf_edges(st: State, leaves: IntMatrix, out: IntMatrix) -> int:
    """Crossed edges of all leaves, repeated as they come: both ends, the lower first (spec clause 5.7.2)."""
    n = dimension(st.grid.tables)
    count = 0
    for i in range(len(leaves)):
        for j in range(n + 1):
            for k in range(j + 1, n + 1):
                a, b = leaves[i, j], leaves[i, k]
                if st.vertex[a, 3] != st.vertex[b, 3]:
                    low = _lower(st, a, b)
                    out[count, 0] = low
                    out[count, 1] = b if low == a else a
                    count += 1
    return count


@kernel
def entries(st: State, position: IntMatrix, out: IntVector) -> None:
    """Numbers of the vertices at positions (E, 3), -1 where none is known."""
    for i in range(len(position)):
        out[i] = (get(st.known, position[i, 0], position[i, 1], position[i, 2]) >> 1) - 1
