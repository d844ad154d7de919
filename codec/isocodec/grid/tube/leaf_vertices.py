"""The mixed leaf simplices at any moment, for the drawing (spec clause 9.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..lattice.access import corner, dimension, member, middle, place, vertex
from ..lattice.access import corners as corner_count
from ..lattice.grid import clamped, edge_of, phase_of, position
from ..lattice.tables import MOST_CORNERS
from .leaf_list import unpacked
from .ranks import Ranks, number_at
from .state import State, numbers_bytes, numbers_of


@inlined
def _number_at(st, numbers, x, y, z):
    """Number of the vertex at unclamped (x, y, z)."""
    return number_at(numbers, *clamped(st.grid, x, y, z))


@kernel
def vertex_numbers(
    st: State, numbers: Ranks, leaf: Int32Matrix, number: IntVector, out: IntMatrix, levels: IntVector,
) -> int:
    """Vertex numbers of the leaves of rows, as rows of ``out``, and their levels; how many.

    ``number`` is room for the corners of a diamond and its middle.
    """
    n = dimension(st.grid.tables)
    t = st.grid.tables
    rows, last = 0, np.int64(-1)
    edge, r = np.int64(0), np.int64(0)
    for i in range(len(leaf)):
        code, level = np.int64(leaf[i, 0]), np.int64(leaf[i, 4])
        b0, b1, b2 = np.int64(leaf[i, 1]), np.int64(leaf[i, 2]), np.int64(leaf[i, 3])
        if level != last:
            edge, r, last = edge_of(st.grid, level), phase_of(n, level), level  # divisions take as long as the rest
        if code >= 0:
            for j in range(n + 1):
                out[rows, j] = _number_at(st, numbers, *position(edge, b0, b1, b2, vertex(t, r, code, j)))
            levels[rows] = level
            rows += 1
            continue
        # the corners of a diamond are those of all its children
        kind, children = unpacked(code)
        corners = corner_count(t, kind)
        for j in range(corners):
            number[j] = _number_at(st, numbers, *position(edge, b0, b1, b2, corner(t, kind, j)))
        cls, d0, d1, d2, _ = member(t, kind, np.int64(0))
        w0, w1, w2 = middle(t, r, cls, b0 + d0, b1 + d1, b2 + d2)
        number[corners] = _number_at(st, numbers, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1)
        c = np.int64(0)
        while children >> c:
            if children >> c & 1:
                for j in range(n + 1):
                    out[rows, j] = number[place(t, kind, c, j)]
                levels[rows] = level + 1
                rows += 1
            c += 1
    return rows


def drawn_leaves(st: State) -> int:
    """Number of leaves at this moment."""
    return (st.counters.held or st.counters.leaves) + st.counters.mixed


def drawn_bytes(st: State) -> int:
    """Bytes that `drawn` takes."""
    return drawn_leaves(st) * (dimension(st.grid.tables) + 2) * 8 + numbers_bytes(st)


def drawn(st: State) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertex numbers of the leaves, and their levels; in the midst of a round those of `Tube.drawn_state`."""
    counters = st.counters
    room = drawn_leaves(st)
    number = np.empty(MOST_CORNERS + 1, np.int64)
    rows, levels = np.empty((room, dimension(st.grid.tables) + 1), np.int64), np.empty(room, np.int64)
    numbers = numbers_of(st)
    used = vertex_numbers(st, numbers, st.leaf[: counters.leaves], number, rows, levels)
    used += vertex_numbers(st, numbers, st.below[: counters.next], number, rows[used:], levels[used:])
    return rows[:used], levels[:used]
