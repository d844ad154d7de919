"""The mixed leaf simplices at any moment, for the drawing (spec clause 9.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from ..mesh.access import dimension
from ..mesh.store import get
from .mesh import IN, KNOWN
from .seek import middle_at
from .state import (
    ASKS,
    BEFORE_ROUND,
    DONE_LEAVES,
    LEAVES,
    LEVEL,
    NEXT,
    SIZE,
    VERTICES,
    State,
    corner_entry,
    edge_of,
    entry,
)


@kernel
def vertex_numbers(st, leaf, first, count, below, rounds, out, levels):
    """Vertex numbers of leaves ``first`` to ``count``, as rows of ``out``, and their levels; returns how many.

    With ``below`` 0 those are left out that the running round, if there is one (``rounds``), has bisected already:
    their middle is known.
    """
    n = dimension(st.tables)
    rows, last = 0, np.int64(-1)
    edge, r = np.int64(0), np.int64(0)
    for i in range(first, count):
        cls = np.int64(leaf[i, 0])
        b0, b1, b2 = np.int64(leaf[i, 1]), np.int64(leaf[i, 2]), np.int64(leaf[i, 3])
        level = np.int64(leaf[i, 4])
        if not below and rounds and level == st.at[LEVEL] and level < st.at[SIZE] * n:
            x, y, z = middle_at(st, level, cls, b0, b1, b2)
            before = st.at[BEFORE_ROUND]
            if st.at[ASKS]:
                state = get(st.mesh, x, y, z)
                before = np.int64(0) if state & IN and not state & KNOWN else st.at[VERTICES]
            if entry(st, x, y, z) >> 1 > before:
                continue
        if level != last:
            edge, r, last = edge_of(st, level), level % n, level  # divisions take as long as the rest
        for j in range(n + 1):
            out[rows, j] = (corner_entry(st, edge, r, cls, b0, b1, b2, j) >> 1) - 1
        levels[rows] = level
        rows += 1
    return rows


def drawn(st: State, rounds: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertex numbers of the leaves at this moment, and their levels; ``rounds`` is 0 during a base."""
    at = st.at
    room = int(at[LEAVES]) + int(at[NEXT])
    rows, levels = np.empty((room, dimension(st.tables) + 1), np.int64), np.empty(room, np.int64)
    used = vertex_numbers(st, st.leaf, at[DONE_LEAVES], at[LEAVES], 0, rounds, rows, levels)
    used += vertex_numbers(st, st.below, 0, at[NEXT], 1, rounds, rows[used:], levels[used:])
    return rows[:used], levels[:used]
