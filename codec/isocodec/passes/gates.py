"""Gates: faces that the curve passes, to simplices that a component's walk has not visited yet (spec clause 5.3.3)."""

from __future__ import annotations

import numpy as np

from ..kernel import inlined, inner
from ..mesh.access import cube, dimension, neighbour
from ..mesh.grid import edge_of
from ..mesh.simplex import exists
from ..mesh.store import get, put
from .state import LEAVES, corner_entry
from .walk import GATES

GATE = 7
"""A gate on the stack: class, block and level of the simplex of equal level behind it, the vertex opposite, the leaf
it was left from."""


@inlined
def _cell(st, level, cls, b0, b1, b2):
    """Place of a simplex in the store of visited ones, a region of its own for every level, and its bit."""
    n = dimension(st.grid.tables)
    number, p0, p1, p2 = cube(st.grid.tables, level % n, cls)
    size = level // n
    return 2 * b0 + p0 + (np.int64(1) << size), 2 * b1 + p1 + ((level % n) << size), 2 * b2 + p2, number


@inlined
def visited(st, mark, level, cls, b0, b1, b2):
    """Whether a simplex is part of the tubular neighbourhood already, as a bit."""
    x, y, z, number = _cell(st, level, cls, b0, b1, b2)
    return (get(mark, x, y, z) >> number) & 1


@inlined
def visit(st, mark, level, cls, b0, b1, b2):
    """Mark a mixed simplex and append it to the tubular neighbourhood."""
    x, y, z, number = _cell(st, level, cls, b0, b1, b2)
    put(mark, x, y, z, get(mark, x, y, z) | (np.int64(1) << number))
    i = st.at[LEAVES]
    st.leaf[i, 0] = cls
    st.leaf[i, 1] = b0
    st.leaf[i, 2] = b1
    st.leaf[i, 3] = b2
    st.leaf[i, 4] = level
    st.at[LEAVES] = i + 1


@inner
def push_gates(st, mark, level, cls, b0, b1, b2):
    """Push the mixed faces, in the order of the vertices opposite, that lead to an unvisited simplex."""
    n = dimension(st.grid.tables)
    r = level % n
    edge = edge_of(st.grid, level)
    w = st.walk
    above = 0
    signs = 0
    for j in range(n + 1):
        s = corner_entry(st, edge, r, cls, b0, b1, b2, j) & 1
        signs |= s << j
        above += s
    for i in range(n + 1):
        rest = above - ((signs >> i) & 1)
        if rest == 0 or rest == n:
            continue
        other, opp, d0, d1, d2 = neighbour(st.grid.tables, r, cls, i)
        c0, c1, c2 = b0 + d0, b1 + d1, b2 + d2
        if not exists(st.grid, edge, r, other, c0, c1, c2) or visited(st, mark, level, other, c0, c1, c2):
            continue
        g = w[GATES] * GATE
        st.stack[g] = other
        st.stack[g + 1] = c0
        st.stack[g + 2] = c1
        st.stack[g + 3] = c2
        st.stack[g + 4] = opp
        st.stack[g + 5] = st.at[LEAVES] - 1
        st.stack[g + 6] = level
        w[GATES] += 1
