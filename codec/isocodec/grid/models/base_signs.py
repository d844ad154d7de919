"""Signs behind gates: their prediction, contexts, and what the main profile sees (spec clauses 7.3, 7.4, 7.17)."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, clear, counted, mixing, see
from ...entropy.panel import ON
from ...entropy.range_coder import code
from ...kernel import inlined
from ...kernel.types import Integer
from ..lattice.access import dimension, neighbour, vertex
from ..lattice.grid import edge_of, phase_of, position
from ..tube.state import corner_entry, entry
from . import contexts as ctx
from .frame_before import BEHIND, SEED, Spot, see_before
from .network_rows import BASE_KIND, BASE_NET, BASE_ROW
from .parabola import MOST, nearer

_STEPS = {
    n: np.array([d for d in product(range(-3, 4), repeat=n) if any(d) and (n == 2 or sum(map(abs, d)) <= 3)])
    for n in (2, 3)
}
"""Vertices around the one behind a gate, in units of the edges from there to the gate's vertices."""
_STEPS_2, _STEPS_3 = _STEPS[2], _STEPS[3]
_BASE_2, _BASE_3 = BASE_ROW[2], BASE_ROW[3]


_CASES = 16
"""Rows of the main profile about a prediction's quality."""


class Behind(NamedTuple):
    """Prediction of the sign behind a gate.

    Attributes
    ----------
    guess : int
        The sign that is likely.
    case : int
        How good the prediction is, as the main profile sees it: curves have 16 cases, surfaces those of their contexts.
    context : int
        The one to use.
    other : int
        The sign at the earlier isovalue, or -1.
    """

    guess: Integer
    case: Integer
    context: Integer
    other: Integer


@inlined
def see_behind(st, cd, simplex, opp, guess, case, other):
    """List what the main profile sees around the vertex behind a gate (spec clause 7.17).

    What ``case`` holds beside the prediction's quality has separate rows.
    """
    n = dimension(st.grid.tables)
    level, cls, b0, b1, b2 = simplex
    r = phase_of(n, level)
    plane = n == 2
    first, count = (_BASE_2, len(_STEPS_2)) if plane else (_BASE_3, len(_STEPS_3))
    edge = edge_of(st.grid, level)
    frame = r * (n + 1) + opp
    clear(cd)
    see(cd, first + case % _CASES)
    if other >= 0:
        see(cd, first + 16 + (other == guess))
    first += 18 + 2 * count * frame
    p = st.scratch[:12]
    x, y, z = position(edge, b0, b1, b2, vertex(st.grid.tables, r, cls, opp))
    k = 0
    for j in range(n + 1):
        if j != opp:
            p[3 * k], p[3 * k + 1], p[3 * k + 2] = position(
                edge, b0, b1, b2, vertex(st.grid.tables, r, cls, np.int64(j))
            )
            p[3 * k] -= x
            p[3 * k + 1] -= y
            p[3 * k + 2] -= z
            k += 1
    for i in range(count):
        q0, q1, q2 = x, y, z
        for k in range(n):
            d = _STEPS_2[i, k] if plane else _STEPS_3[i, k]
            q0, q1, q2 = q0 + d * p[3 * k], q1 + d * p[3 * k + 1], q2 + d * p[3 * k + 2]
        e = entry(st, q0, q1, q2)
        if e != 0:
            see(cd, first + 2 * i + ((e & 1) == guess))


@inlined
def _spot(st, simplex, j):
    """Vertex j of a simplex."""
    level, cls, b0, b1, b2 = simplex
    edge = edge_of(st.grid, level)
    x, y, z = position(edge, b0, b1, b2, vertex(st.grid.tables, phase_of(dimension(st.grid.tables), level), cls, j))
    return Spot(x, y, z, edge)


@inlined
def code_seed(st, cd, simplex, j, other, before, bit):
    """Code the sign of vertex j of a seed, which is ``other`` at the earlier isovalue, or -1 (clause 7.9); as ``code``.

    ``before`` holds the signs that the simplex has so far.
    """
    context = ctx.SEED + (max(other, 0) * 4 + before) * 2 + st.base.before
    see_before(st, cd, _spot(st, simplex, j), np.int64(1), SEED, other)
    if cd.blend.panel.about[ON]:
        return counted(cd, context, bit)
    return code(cd, context, bit)


@inlined
def code_behind(st, cd, simplex, opp, behind, bit):
    """Code whether the sign of the vertex behind a gate, number ``opp`` of the simplex there, is as predicted.

    As ``code``.
    """
    if not mixing(cd):
        return code(cd, behind.context, bit)
    phase = phase_of(dimension(st.grid.tables), simplex.level)
    see_behind(st, cd, simplex, opp, behind.guess, behind.case, behind.other)
    see_before(st, cd, _spot(st, simplex, opp), behind.guess, BEHIND + phase, behind.other)
    return blended(cd, BASE_NET, False, BASE_KIND + phase + 3 * (behind.other >= 0), behind.context, bit)


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
    r = phase_of(n, level)
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
    r = phase_of(dimension(st.grid.tables), level)
    edge = edge_of(st.grid, level)
    p = vertex(st.grid.tables, r, cls, i)
    q = vertex(st.grid.tables, r, cls, j)
    return ((8 * b0 + p[0] + q[0]) * edge) >> 1, ((8 * b1 + p[1] + q[1]) * edge) >> 1


@inlined
def _seen(st, x, y, sign):
    """Whether the vertex at unclamped (x, y) is not known (0), has that sign (1), or the other one (2)."""
    e = entry(st, x, y, np.int64(0))
    if e == 0:
        return 0
    return 1 if e & 1 == sign else 2


@inlined
def curve_context(st, level, cls, b0, b1, opp):
    """Sign that the stiff parabola predicts, its context, and what the main profile sees of it (spec clause 7.3)."""
    i = 1 if opp == 0 else 0
    j = 3 - opp - i
    g = edge_sum(st, level, cls, b0, b1, i, j)
    a = edge_sum(st, level, cls, b0, b1, opp, i)
    b = edge_sum(st, level, cls, b0, b1, opp, j)
    unit = st.grid.exponent - level // 2
    case, agree = nearer(st.trail, st.base.points, unit, g, a, b)
    # the curve leaves through the edge between the new vertex and the gate's vertex of the other sign
    through, end = (i, j) if case < 0 else (j, i)
    zero = np.int64(0)
    edge = edge_of(st.grid, level)
    guess = 1 - (corner_entry(st, edge, level % 2, cls, b0, b1, zero, through) & 1)
    # known vertices that the curve has to leave on their sides, seen from the gate's vertex that has the sign guessed
    e0, e1, _ = position(edge, b0, b1, zero, vertex(st.grid.tables, level % 2, cls, end))
    t0, t1, _ = position(edge, b0, b1, zero, vertex(st.grid.tables, level % 2, cls, through))
    v0, v1, _ = position(edge, b0, b1, zero, vertex(st.grid.tables, level % 2, cls, opp))
    across = _seen(st, e0 + t0 - v0, e1 + t1 - v1, guess) == 1
    beyond = _seen(st, 2 * e0 - t0, 2 * e1 - t1, guess)
    back = _seen(st, 2 * e0 - v0, 2 * e1 - v1, guess) == 1
    context = (((2 * abs(case) + agree) * 2 + across) * 3 + beyond) * 2 + back
    return guess, ctx.BASE_CURVE + context, 4 * abs(case) + st.base.history


@inlined
def turn_back(st):
    """The second branch of a component starts from the first one's points in reverse (spec clause 7.3)."""
    count = min(st.base.early_points, MOST)
    for i in range(count):
        st.trail[2 * i] = st.early[2 * (count - 1 - i)]
        st.trail[2 * i + 1] = st.early[2 * (count - 1 - i) + 1]
    st.base.points = count
