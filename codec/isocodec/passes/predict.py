"""Predicted signs of a base and the contexts that they are coded in (spec clauses 7.3 and 7.4)."""

from __future__ import annotations

import numpy as np

from ..entropy import baseline as ctx
from ..kernel import inlined
from ..mesh.access import dimension, neighbour, vertex
from ..mesh.grid import edge_of, position
from .parabola import MOST, nearer
from .state import EARLY, TRAIL, corner_entry, entry
from .walk import FRESH, HISTORY


@inlined
def _balance(st, edge, x, y, z):
    """Known vertices above less those below, among the six at one cube's edge from a vertex."""
    total = 0
    for a in range(3):
        for way in (-1, 1):
            d = way * edge
            e = entry(st, x + d * (a == 0), y + d * (a == 1), z + d * (a == 2))
            if e != 0:
                total += 2 * (e & 1) - 1
    return total


@inlined
def surface_context(st, level, cls, b0, b1, b2, opp):
    """Majority sign of the neighbours, or else of the gate, and the stated case (spec clause 7.4)."""
    t = st.grid.tables
    n = dimension(t)
    r = level % n
    edge = edge_of(st.grid, level)
    above = 0
    for j in range(n + 1):
        if j != opp:
            above += corner_entry(st, edge, r, cls, b0, b1, b2, j) & 1
    gate = np.int64(1 if 2 * above > n else 0)
    x, y, z = position(edge, b0, b1, b2, vertex(t, r, cls, opp))
    total = _balance(st, edge, x, y, z)
    guess = gate if total == 0 else np.int64(total > 0)
    # the vertex behind the gate, in the simplex of equal level there
    other, far, d0, d1, d2 = neighbour(t, r, cls, opp)
    behind = corner_entry(st, edge, r, other, b0 + d0, b1 + d1, b2 + d2, far) & 1
    case = (r * 4 + opp) * 4 + min(abs(total), 3)
    return guess, ctx.BASE_SURFACE + case * 4 + 2 * (gate == guess) + (behind == guess)


@inlined
def edge_sum(st, level, cls, b0, b1, i, j):
    """Sum of the positions of the vertices i and j: twice the middle of their edge."""
    r = level % dimension(st.grid.tables)
    edge = edge_of(st.grid, level)
    p = vertex(st.grid.tables, r, cls, i)
    q = vertex(st.grid.tables, r, cls, j)
    return ((8 * b0 + p[0] + q[0]) * edge) >> 1, ((8 * b1 + p[1] + q[1]) * edge) >> 1


@inlined
def curve_context(st, level, cls, b0, b1, opp):
    """Sign that the parabola predicts, and the stated case (spec clause 7.3)."""
    i = 1 if opp == 0 else 0
    j = 3 - opp - i
    g0, g1 = edge_sum(st, level, cls, b0, b1, i, j)
    a0, a1 = edge_sum(st, level, cls, b0, b1, opp, i)
    c0, c1 = edge_sum(st, level, cls, b0, b1, opp, j)
    unit = st.grid.exponent - level // 2
    case = nearer(st.walk, TRAIL, st.walk[HISTORY], unit, g0, g1, a0, a1, c0, c1)
    # the curve leaves through the edge between the new vertex and the gate's vertex of the other sign
    through = i if case < 0 else j
    zero = np.int64(0)
    guess = 1 - (corner_entry(st, edge_of(st.grid, level), level % 2, cls, b0, b1, zero, through) & 1)
    return guess, ctx.BASE_CURVE + abs(case)


@inlined
def turn_back(st):
    """The second branch of a component starts from the first one's points in reverse (spec clause 7.3)."""
    count = min(st.walk[FRESH], MOST)
    for i in range(count):
        st.walk[TRAIL + 2 * i] = st.walk[EARLY + 2 * (count - 1 - i)]
        st.walk[TRAIL + 2 * i + 1] = st.walk[EARLY + 2 * (count - 1 - i) + 1]
    st.walk[HISTORY] = count
