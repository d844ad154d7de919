"""Gates: faces that the curve passes, what lies behind them, and its sign (spec clauses 5.3.3, 5.3.4, 5.8.3)."""

from __future__ import annotations

import numpy as np

from ...entropy.range_coder import ENCODE, ONE, adapt
from ...kernel import inlined, inner
from ..lattice.access import child, cube, dimension, neighbour, vertex
from ..lattice.grid import cycle_of, edge_of, phase_of, position
from ..lattice.simplex import Simplex, exists, middle_at, newest, parent_of
from ..lattice.store import get, put
from ..models import contexts as ctx
from ..models.base_signs import Behind, code_behind, curve_context, edge_sum, surface_context, turn_back
from ..models.mesh_questions import COARSER, FINER
from ..models.parabola import MOST
from ..tube.inference import implied
from ..tube.state import BASE_SIGN, GATE, PREDICTED, PREDICTED_RIGHT, corner_entry, corner_truth, learn
from .adaptive_mesh import exclude, tell


@inlined
def learn_corner(st, level, cls, b0, b1, b2, j, sign):
    n = dimension(st.grid.tables)
    x, y, z = position(edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, phase_of(n, level), cls, j))
    learn(st, x, y, z, sign)


@inner
def implied_corner(st, level, cls, b0, b1, b2, j):
    """Result of ``implied`` for vertex j of a simplex."""
    x, y, z = position(
        edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, phase_of(dimension(st.grid.tables), level), cls, j)
    )
    return implied(st, x, y, z)


@inner
def traverse(st, cd, mark):
    """Find what lies behind the gate on top of the stack (spec clauses 5.3.4, 5.8.3)."""
    n = dimension(st.grid.tables)
    walk = st.base
    encoding = cd.reg.mode == ENCODE
    adaptive = st.counters.uniform != st.counters.finest
    g = (walk.gates - 1) * GATE
    level, cls, b0, b1, b2 = st.stack[g + 6], st.stack[g], st.stack[g + 1], st.stack[g + 2], st.stack[g + 3]
    opp, left_from = st.stack[g + 4], st.stack[g + 5]
    if adaptive:
        status = behind(st, cd, level, cls, b0, b1, b2, opp)
        if status < 0:
            return status
        level, cls, opp = walk.behind_level, walk.behind_cls, walk.behind_opposite
        b0, b1, b2 = walk.behind_b0, walk.behind_b1, walk.behind_b2
    if visited(st, mark, level, cls, b0, b1, b2):
        walk.gates -= 1
        return np.int64(0)
    r = phase_of(n, level)
    edge = edge_of(st.grid, level)
    if adaptive:
        if not exists(st.grid, edge, r, cls, b0, b1, b2):
            walk.gates -= 1
            return np.int64(0)
        if st.counters.told == 0:
            exclude(st, level, cls, b0, b1, b2)
    e = corner_entry(st, edge, r, cls, b0, b1, b2, opp)
    if n == 2:
        if left_from == walk.branch and left_from != st.counters.leaves - 1:
            turn_back(st)
            walk.branch = -1
        guess, context, case = curve_context(st, level, cls, b0, b1, opp)
    else:
        guess, context = surface_context(st, level, cls, b0, b1, b2, opp)
        case = context - ctx.BASE_SURFACE
    if e == 0:
        sign, other = implied_corner(st, level, cls, b0, b1, b2, opp)
        if sign < 0:
            if other >= 0:
                bank = (ctx.SURFACE if n == 3 else ctx.CURVE) * (1 + (other == guess))
                context += bank
            right_guess = np.int64(0)
            if encoding:
                right_guess = np.int64(corner_truth(st, edge, r, cls, b0, b1, b2, opp) == guess)
            # what the context has seen decides which of both signs is the prediction
            likely = np.int64(cd.prob[np.uint64(context)] >= ONE // 2)
            expected = Behind(guess, case, context, other)
            bit = code_behind(st, cd, Simplex(level, cls, b0, b1, b2), opp, expected, right_guess)
            if bit < 0:
                return bit
            st.tally[BASE_SIGN] += 1
            st.tally[PREDICTED] += 1
            st.tally[PREDICTED_RIGHT] += bit == likely
            walk.history = (walk.history & 1) << 1 | bit
            sign = guess if bit else 1 - guess
        learn_corner(st, level, cls, b0, b1, b2, opp, sign)
    else:
        adapt(cd, context, np.int64((e & 1) == guess))
    if n == 2:
        i = 1 if opp == 0 else 0
        g0, g1 = edge_sum(st, level, cls, b0, b1, i, 3 - opp - i)
        slot = walk.points % MOST
        st.trail[2 * slot] = g0
        st.trail[2 * slot + 1] = g1
        walk.points += 1
        if walk.early_points < MOST and walk.branch >= 0:
            st.early[2 * walk.early_points] = g0
            st.early[2 * walk.early_points + 1] = g1
            walk.early_points += 1
    walk.gates -= 1
    visit(st, mark, level, cls, b0, b1, b2)
    push_gates(st, mark, level, cls, b0, b1, b2)
    return np.int64(0)


_EQUAL = np.int64(-1)


@inlined
def _question(n, level, opp):
    """Question about the level behind a gate (design of the alphabets, spec clause 5.8.3)."""
    if opp == newest(n, phase_of(n, level)):
        return COARSER
    if opp == 0 or opp == n - phase_of(n, level):
        return FINER
    return _EQUAL


@inner
def behind(st, cd, level, cls, b0, b1, b2, opp):
    """Find the leaf behind a gate, leaving it in the registers: 0, or what ``tell`` or ``settle`` return."""
    n = dimension(st.grid.tables)
    r = phase_of(n, level)
    walk = st.base
    question = _question(n, level, opp)
    if question == FINER or (question == COARSER and level > 0):
        coarser = np.int64(question == COARSER)
        x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
        if coarser:
            x, y, z = position(edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, r, cls, opp))
        bit = tell(st, cd, question, level - coarser, x, y, z, ctx.LEVEL + (r * 2 + coarser) * 4 + walk.before)
        if bit < 0:
            return bit
        if coarser and bit == 0:
            cls, b0, b1, b2, side = parent_of(st.grid, level, cls, b0, b1, b2)
            level -= 1
            opp = np.int64(0) if side else n - phase_of(n, level)
        elif bit == 1 and not coarser:
            side = 1 if opp == 0 else 0
            q, d0, d1, d2 = child(st.grid.tables, r, cls, side)
            f = 2 if r == n - 1 else 1
            cls, b0, b1, b2 = q, b0 * f + d0, b1 * f + d1, b2 * f + d2
            level += 1
            opp = newest(n, phase_of(n, level))
    walk.behind_level = level
    walk.behind_cls = cls
    walk.behind_b0 = b0
    walk.behind_b1 = b1
    walk.behind_b2 = b2
    walk.behind_opposite = opp
    return np.int64(0)


@inlined
def _cell(st, level, cls, b0, b1, b2):
    """Place of a simplex in the store of visited ones, which has a region for every level, and its bit."""
    n = dimension(st.grid.tables)
    number, p0, p1, p2 = cube(st.grid.tables, phase_of(n, level), cls)
    size = cycle_of(n, level)
    return 2 * b0 + p0 + (np.int64(1) << size), 2 * b1 + p1 + (phase_of(n, level) << size), 2 * b2 + p2, number


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
    i = st.counters.leaves
    st.leaf[i, 0] = cls
    st.leaf[i, 1] = b0
    st.leaf[i, 2] = b1
    st.leaf[i, 3] = b2
    st.leaf[i, 4] = level
    st.counters.leaves = i + 1


@inner
def push_gates(st, mark, level, cls, b0, b1, b2):
    """Push the mixed faces, in the order of the vertices opposite, that lead to an unvisited simplex."""
    n = dimension(st.grid.tables)
    r = phase_of(n, level)
    edge = edge_of(st.grid, level)
    walk = st.base
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
        g = walk.gates * GATE
        st.stack[g] = other
        st.stack[g + 1] = c0
        st.stack[g + 2] = c1
        st.stack[g + 3] = c2
        st.stack[g + 4] = opp
        st.stack[g + 5] = st.counters.leaves - 1
        st.stack[g + 6] = level
        walk.gates += 1
