"""The mixed leaf simplices at any moment, for the drawing (spec clause 9.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..lattice.access import corner, dimension, member, middle, place
from ..lattice.access import corners as corner_count
from ..lattice.grid import edge_of, position
from ..lattice.simplex import middle_at
from ..lattice.store import get
from ..lattice.tables import MOST_CORNERS
from ..lattice.vertex_set import IN, KNOWN
from .leaf_list import child_at, unpacked
from .state import (
    State,
    corner_entry,
    entry,
)


@inlined
def _bisected(st, level, cls, b0, b1, b2):
    """Whether the running round has bisected a leaf: its middle is known."""
    if level != st.counters.level or level >= st.grid.exponent * dimension(st.grid.tables):
        return False
    x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
    before = st.counters.before_round
    if st.counters.asks:
        state = get(st.mesh, x, y, z)
        before = np.int64(0) if state & IN and not state & KNOWN else st.counters.vertices
    return entry(st, x, y, z) >> 1 > before


@kernel
def vertex_numbers(
    st: State, leaf: Int32Matrix, first: int, count: int, round_runs: int, number: IntVector, out: IntMatrix,
    levels: IntVector,
) -> int:
    """Vertex numbers of the leaves of rows ``first`` to ``count``, as rows of ``out``, and their levels; how many.

    With ``round_runs`` those are left out that the running round has bisected already. ``number`` is room for the
    corners of a diamond and its middle.
    """
    n = dimension(st.grid.tables)
    t = st.grid.tables
    rows, last = 0, np.int64(-1)
    edge, r = np.int64(0), np.int64(0)
    for i in range(first, count):
        code, level = np.int64(leaf[i, 0]), np.int64(leaf[i, 4])
        b0, b1, b2 = np.int64(leaf[i, 1]), np.int64(leaf[i, 2]), np.int64(leaf[i, 3])
        if level != last:
            edge, r, last = edge_of(st.grid, level), level % n, level  # divisions take as long as the rest
        if code >= 0:
            if not (round_runs and _bisected(st, level, code, b0, b1, b2)):
                for j in range(n + 1):
                    out[rows, j] = (corner_entry(st, edge, r, code, b0, b1, b2, j) >> 1) - 1
                levels[rows] = level
                rows += 1
            continue
        # the corners of a diamond are those of all its children
        kind, children, _ = unpacked(code)
        corners = corner_count(t, kind)
        for j in range(corners):
            x, y, z = position(edge, b0, b1, b2, corner(t, kind, j))
            number[j] = (entry(st, x, y, z) >> 1) - 1
        cls, d0, d1, d2, _ = member(t, kind, np.int64(0))
        w0, w1, w2 = middle(t, r, cls, b0 + d0, b1 + d1, b2 + d2)
        number[corners] = (entry(st, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1) >> 1) - 1
        c = st.counters.child if round_runs and i == first else np.int64(0)
        while children >> c:
            if children >> c & 1:
                cls, d0, d1, d2 = child_at(t, kind, c, b0, b1, b2)
                if not (round_runs and _bisected(st, level + 1, cls, d0, d1, d2)):
                    for j in range(n + 1):
                        out[rows, j] = number[place(t, kind, c, j)]
                    levels[rows] = level + 1
                    rows += 1
            c += 1
    return rows


def drawn_leaves(st: State, rounds: bool) -> int:
    """Largest number of leaves at this moment; ``rounds`` is false during a base."""
    return (st.counters.held if rounds else st.counters.leaves) + st.counters.mixed


def drawn_bytes(st: State, rounds: int) -> int:
    """Bytes that `drawn` takes."""
    return drawn_leaves(st, bool(rounds)) * (dimension(st.grid.tables) + 2) * 8


def drawn(st: State, rounds: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertex numbers of the leaves at this moment, and their levels; ``rounds`` is 0 during a base."""
    counters = st.counters
    room = drawn_leaves(st, bool(rounds))
    number = np.empty(MOST_CORNERS + 1, np.int64)
    rows, levels = np.empty((room, dimension(st.grid.tables) + 1), np.int64), np.empty(room, np.int64)
    used = vertex_numbers(st, st.leaf, counters.done_leaves, counters.leaves, rounds, number, rows, levels)
    used += vertex_numbers(st, st.below, 0, counters.next, 0, number, rows[used:], levels[used:])
    return rows[:used], levels[:used]
