"""The mixed leaf simplices at any moment, for the drawing (spec clause 9.1)."""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..mesh.access import dimension, middle
from .state import BEFORE_ROUND, EDGE, LEVEL, SIZE, corner_entry, entry


@kernel
def vertex_numbers(st, leaf, first, count, below, out):
    """Vertex numbers of leaves ``first`` to ``count``, as rows of ``out``; returns how many.

    With ``below`` 0 the leaves are of the present level, and those already bisected by the running round are
    left out: their middle is known. With ``below`` 1 they are of the next level.
    """
    n = dimension(st.tables)
    level = st.at[LEVEL] + below
    r = level % n
    edge = st.at[EDGE]
    if below and r == 0:
        edge >>= 1
    rows = 0
    for i in range(first, count):
        cls = np.int64(leaf[i, 0])
        b0, b1, b2 = np.int64(leaf[i, 1]), np.int64(leaf[i, 2]), np.int64(leaf[i, 3])
        if not below and st.at[LEVEL] < st.at[SIZE] * n:
            w0, w1, w2 = middle(st.tables, r, cls, b0, b1, b2)
            if entry(st, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1) >> 1 > st.at[BEFORE_ROUND]:
                continue
        for j in range(n + 1):
            out[rows, j] = (corner_entry(st, edge, r, cls, b0, b1, b2, j) >> 1) - 1
        rows += 1
    return rows
