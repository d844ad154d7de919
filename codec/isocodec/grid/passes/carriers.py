"""Vertices and edges that carry geometry (spec clauses 5.6.2, 5.7.2).

On the full grid they follow from the known vertices alone: each is linked with the next samples along the axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..lattice.access import dimension
from ..lattice.store import keys_of
from ..tube.holes import on_whole_cell
from ..tube.ranks import Ranks, Surroundings, enter_page
from ..tube.state import State


def linked(st: State, numbers: Ranks) -> NDArray[np.int32]:
    """For each vertex the next samples along each axis, upwards and downwards: (V, 2 n) int32.

    An entry is ``2 * (number + 1) + sign``, or 0 where none is known.
    """
    n = int(dimension(st.grid.tables))
    links = np.zeros((int(st.counters.vertices), 2 * n), np.int32)
    _link(numbers, keys_of(st.known), Surroundings.empty(n), links)
    return links


@kernel
def _link(numbers: Ranks, keys: IntVector, room: Surroundings, links: Int32Matrix) -> None:
    """Enter the links of all vertices, page by page."""
    local, rows = room.local, room.rows
    n = links.shape[1] >> 1
    side = len(local) // rows.shape[1]
    for number in range(len(keys)):
        enter_page(numbers, keys[number], room)
        # what lies before the page is another one's
        for row in range(1 if n == 2 else side + 1, rows.shape[1]):
            if n == 3 and row % side == 0:
                continue
            there, k = rows[0, row] >> 1, 1
            while there:
                if there & 1:
                    at = row * side + k
                    entry = np.int64(local[np.uint64(at)])
                    v, step = np.uint64((entry >> 1) - 1), 1
                    for i in range(n):
                        axis = n - 1 - i
                        before = np.int64(local[np.uint64(at - step)])
                        if before != 0:
                            links[v, 2 * axis + 1] = before
                            links[np.uint64((before >> 1) - 1), 2 * axis] = entry
                        step *= side
                there >>= 1
                k += 1


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
