"""Vertices and edges that carry geometry (spec clauses 5.6.2, 5.7.2).

On the full grid they follow from the known vertices alone: each is linked with the next samples along the axes.
"""

from __future__ import annotations

import numpy as np

from ...kernel import inlined, kernel
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..lattice.access import dimension
from ..lattice.store import get
from ..tube.holes import on_whole_cell
from ..tube.state import State


@kernel
def link(st: State, links: Int32Matrix) -> None:
    """Enter for each vertex the store entries of the next samples along each axis: upwards, downwards; (V, 2 n)."""
    n = dimension(st.grid.tables)
    last = (st.grid.last0, st.grid.last1, st.grid.last2)
    for v in range(len(links)):
        x, y, z = np.int64(st.vertex[v, 0]), np.int64(st.vertex[v, 1]), np.int64(st.vertex[v, 2])
        own = 2 * (v + 1) + np.int64(st.vertex[v, 3])
        for axis in range(n):
            if st.vertex[v, axis] < last[axis]:
                up = get(st.known, x + (axis == 0), y + (axis == 1), z + (axis == 2))
                if up != 0:
                    links[v, 2 * axis] = up
                    links[np.uint64((up >> 1) - 1), 2 * axis + 1] = own


@inlined
def _crosses(st, links, v, axis):
    """Whether the grid edge from a vertex upwards along an axis is crossed, and some whole unit cell has it."""
    up = np.int64(links[v, 2 * axis])
    if up == 0 or not (up ^ np.int64(st.vertex[v, 3])) & 1:
        return False
    return on_whole_cell(st, np.int64(st.vertex[v, 0]), np.int64(st.vertex[v, 1]), np.int64(st.vertex[v, 2]), axis)


@kernel
def grid_ends(st: State, links: Int32Matrix, order: IntVector, out: IntVector) -> int:
    """Vertices that geometry by values refines on the full grid, in order: the ends of edges that carry offsets."""
    n = dimension(st.grid.tables)
    count = 0
    for v in order:
        drawn = False
        for axis in range(n):
            down = np.int64(links[v, 2 * axis + 1])
            drawn = drawn or _crosses(st, links, v, axis) or (down != 0 and _crosses(st, links, (down >> 1) - 1, axis))
        if drawn:
            out[count] = v
            count += 1
    return count


@kernel
def grid_edges(st: State, links: Int32Matrix, order: IntVector, out: IntMatrix) -> int:
    """Edges of the full grid that carry offsets, by their lower ends in order: both ends, the lower first (5.7.2)."""
    n = dimension(st.grid.tables)
    count = 0
    for v in order:
        for i in range(n):
            axis = n - 1 - i
            if _crosses(st, links, v, axis):
                out[count, 0] = v
                out[count, 1] = (np.int64(links[v, 2 * axis]) >> 1) - 1
                count += 1
    return count


@inlined
def _lower(st, a, b):
    """Find which of two vertices comes first in the order of positions."""
    for axis in range(3):
        if st.vertex[a, axis] != st.vertex[b, axis]:
            return a if st.vertex[a, axis] < st.vertex[b, axis] else b
    return a


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
