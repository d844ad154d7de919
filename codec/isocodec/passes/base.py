"""Base at a uniform level: localisation, first signs, depth-first traversal through gates (spec clause 5.3).

Rows C2-localise, C2-uniform-base, S3-dfs. The pass is a small machine over ``State.walk``; every step codes at most
one symbol and changes nothing before the symbol is there, so that it can stop and resume at any of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..entropy import baseline as ctx
from ..entropy.coder import ENCODE, MODE, adapt, code
from ..jit import BAD, CUT, DONE, GROW, NEED, inner, kernel
from ..mesh.access import child, cube, dimension, neighbour, roots, vertex
from ..mesh.access import root as root_class
from ..mesh.store import full, get, put
from .parabola import MOST, nearer
from .seek import FOUND, FOUND_ROOT, SEEKING, seek
from .state import (
    BASE_LEVEL,
    BASE_SIGN,
    COMPONENT,
    EARLY,
    EDGE,
    ERROR,
    LEAVES,
    LOCATION,
    ORIGIN,
    PREDICTED,
    PREDICTED_RIGHT,
    STEP_VERTICES,
    TALLY,
    TRAIL,
    WALK,
    corner_entry,
    corner_truth,
    crowded,
    entry,
    exists,
    learn,
    position,
)  # fmt: skip

# Registers in State.walk, beside those of passes.seek. PATH holds one side per level.
PHASE, DEPTH, CLASS, B0, B1, B2, TIGHT, CORNER, GATES, HISTORY, FRESH, BRANCH = range(12)
LAST_ROOT = 14
PATH = 32

# Phases.
_ORIGIN, _COMPONENT, _ROOT, _LOCATE, _SIGNS, _TRAVERSE = range(6)

GATE = 6
"""A gate on the stack: class and block of the simplex behind it, the vertex opposite, the leaf it was left from."""


def registers() -> NDArray[np.int64]:
    """Registers at the start of the pass."""
    walk = np.zeros(WALK, np.int64)
    walk[LAST_ROOT] = -1
    return walk


@inner
def _stop(bit):
    return CUT if bit == -2 else NEED


@inner
def _corner_learn(st, r, cls, b0, b1, b2, j, sign):
    x, y, z = position(st.at[EDGE], b0, b1, b2, vertex(st.tables, r, cls, j))
    learn(st, x, y, z, sign)


@inner
def visited(st, mark, r, cls, b0, b1, b2):
    number, p0, p1, p2 = cube(st.tables, r, cls)
    return (get(mark, 2 * b0 + p0, 2 * b1 + p1, 2 * b2 + p2) >> number) & 1


@inner
def _visit(st, mark, r, cls, b0, b1, b2):
    """Mark a mixed simplex and append it to the tubular neighbourhood."""
    number, p0, p1, p2 = cube(st.tables, r, cls)
    x, y, z = 2 * b0 + p0, 2 * b1 + p1, 2 * b2 + p2
    put(mark, x, y, z, get(mark, x, y, z) | (np.int64(1) << number))
    i = st.at[LEAVES]
    st.leaf[i, 0] = cls
    st.leaf[i, 1] = b0
    st.leaf[i, 2] = b1
    st.leaf[i, 3] = b2
    st.at[LEAVES] = i + 1


@inner
def _push_gates(st, mark, r, cls, b0, b1, b2):
    """Push the mixed faces, in the order of the vertices opposite, that lead to an unvisited simplex."""
    n = dimension(st.tables)
    w = st.walk
    above = 0
    signs = 0
    for j in range(n + 1):
        s = corner_entry(st, st.at[EDGE], r, cls, b0, b1, b2, j) & 1
        signs |= s << j
        above += s
    for i in range(n + 1):
        rest = above - ((signs >> i) & 1)
        if rest == 0 or rest == n:
            continue
        other, opp, d0, d1, d2 = neighbour(st.tables, r, cls, i)
        c0, c1, c2 = b0 + d0, b1 + d1, b2 + d2
        if not exists(st, st.at[EDGE], r, other, c0, c1, c2) or visited(st, mark, r, other, c0, c1, c2):
            continue
        g = w[GATES] * GATE
        st.stack[g] = other
        st.stack[g + 1] = c0
        st.stack[g + 2] = c1
        st.stack[g + 3] = c2
        st.stack[g + 4] = opp
        st.stack[g + 5] = st.at[LEAVES] - 1
        w[GATES] += 1


@inner
def _tree_child(st, depth, cls, b0, b1, b2, side):
    """Class and block of a child in the forest of binary trees, and whether it exists."""
    n = dimension(st.tables)
    r = depth % n
    q, d0, d1, d2 = child(st.tables, r, cls, side)
    f = 2 if r == n - 1 else 1
    below = depth + 1
    edge = st.at[EDGE] << (st.at[BASE_LEVEL] // n - below // n)
    c0, c1, c2 = b0 * f + d0, b1 * f + d1, b2 * f + d2
    return q, c0, c1, c2, exists(st, edge, below % n, q, c0, c1, c2)


@inner
def _balance(st, x, y, z):
    """Known vertices above less those below, among the six at one cube's edge from a vertex."""
    edge = st.at[EDGE]
    total = 0
    for a in range(3):
        for way in (-1, 1):
            d = way * edge
            e = entry(st, x + d * (a == 0), y + d * (a == 1), z + d * (a == 2))
            if e != 0:
                total += 2 * (e & 1) - 1
    return total


@inner
def _surface_context(st, r, cls, b0, b1, b2, opp):
    """Majority sign of the neighbours, or else of the gate, and the stated case (spec clause 7.4)."""
    t = st.tables
    n = dimension(t)
    edge = st.at[EDGE]
    above = 0
    for j in range(n + 1):
        if j != opp:
            above += corner_entry(st, edge, r, cls, b0, b1, b2, j) & 1
    gate = np.int64(1 if 2 * above > n else 0)
    x, y, z = position(edge, b0, b1, b2, vertex(t, r, cls, opp))
    total = _balance(st, x, y, z)
    guess = gate if total == 0 else np.int64(total > 0)
    # the vertex behind the gate, in the simplex that it was left from
    other, far, d0, d1, d2 = neighbour(t, r, cls, opp)
    behind = corner_entry(st, edge, r, other, b0 + d0, b1 + d1, b2 + d2, far) & 1
    case = (r * 4 + opp) * 4 + min(abs(total), 3)
    return guess, ctx.BASE_SURFACE + case * 4 + 2 * (gate == guess) + (behind == guess)


@inner
def _sum(st, r, cls, b0, b1, i, j):
    """Sum of the vertices i and j (twice the middle of their edge) in units of g."""
    p = vertex(st.tables, r, cls, i)
    q = vertex(st.tables, r, cls, j)
    return 8 * b0 + p[0] + q[0], 8 * b1 + p[1] + q[1]


@inner
def _curve_context(st, r, cls, b0, b1, opp):
    """Sign that the parabola predicts, and the stated case (spec clause 7.3)."""
    i = 1 if opp == 0 else 0
    j = 3 - opp - i
    g0, g1 = _sum(st, r, cls, b0, b1, i, j)
    a0, a1 = _sum(st, r, cls, b0, b1, opp, i)
    c0, c1 = _sum(st, r, cls, b0, b1, opp, j)
    case = nearer(st.walk, TRAIL, st.walk[HISTORY], g0, g1, a0, a1, c0, c1)
    # the curve leaves through the edge between the new vertex and the gate's vertex of the other sign
    through = i if case < 0 else j
    guess = 1 - (corner_entry(st, st.at[EDGE], r, cls, b0, b1, np.int64(0), through) & 1)
    return guess, ctx.BASE_CURVE + abs(case)


@inner
def _turn_back(st):
    """The second branch of a component starts from the first one's points in reverse (spec clause 7.3)."""
    count = min(st.walk[FRESH], MOST)
    for i in range(count):
        st.walk[TRAIL + 2 * i] = st.walk[EARLY + 2 * (count - 1 - i)]
        st.walk[TRAIL + 2 * i + 1] = st.walk[EARLY + 2 * (count - 1 - i) + 1]
    st.walk[HISTORY] = count


@kernel
def base(st, cd, mark, pyramid, levels):
    """Run the pass until it is done or must stop."""
    n = dimension(st.tables)
    w = st.walk
    encoding = cd.reg[MODE] == ENCODE
    depth_all = st.at[BASE_LEVEL]
    r = depth_all % n
    while True:
        if crowded(st) or full(mark, STEP_VERTICES) or (w[GATES] + n + 1) * GATE > len(st.stack):
            return GROW
        phase = w[PHASE]

        if phase == _ORIGIN:
            bit = code(cd, ctx.ORIGIN, np.int64(encoding and st.truth[0, 0, 0]))
            if bit < 0:
                return _stop(bit)
            st.at[TALLY + ORIGIN] += 1
            zero = np.int64(0)
            learn(st, zero, zero, zero, bit)
            w[PHASE] = _COMPONENT

        elif phase == _COMPONENT:
            more = np.int64(0)
            if encoding:
                if w[SEEKING] != 2:
                    if (roots(st.tables) + depth_all + 4) * GATE > len(st.stack):
                        return GROW
                    more = np.int64(seek(st, mark, pyramid, levels))
                    w[SEEKING] = 2
                    w[TIGHT] = more
                more = w[TIGHT]
            bit = code(cd, ctx.COMPONENT, more)
            if bit < 0:
                return _stop(bit)
            st.at[TALLY + COMPONENT] += 1
            w[SEEKING] = 1
            if bit == 0:
                return DONE
            w[PHASE] = _ROOT
            w[CORNER] = max(w[LAST_ROOT], 0)
            w[TIGHT] = 1

        elif phase == _ROOT:
            # one symbol for each root from the last component's on: is it here?
            root = w[CORNER]
            bit = np.int64(1)
            if root < roots(st.tables) - 1:
                here = np.int64(encoding and w[FOUND_ROOT] == root)
                bit = code(cd, ctx.ROOT, here)
                if bit < 0:
                    return _stop(bit)
                st.at[TALLY + LOCATION] += 1
            if bit:
                if root != w[LAST_ROOT]:
                    w[TIGHT] = 0
                w[LAST_ROOT] = root
                w[CLASS] = root_class(st.tables, root)
                w[B0] = 0
                w[B1] = 0
                w[B2] = 0
                w[DEPTH] = 0
                w[PHASE] = _LOCATE
            else:
                w[CORNER] += 1

        elif phase == _LOCATE:
            depth = w[DEPTH]
            if depth == depth_all:
                cls, b0, b1, b2 = w[CLASS], w[B0], w[B1], w[B2]
                if not exists(st, st.at[EDGE], r, cls, b0, b1, b2) or visited(st, mark, r, cls, b0, b1, b2):
                    st.at[ERROR] = 1
                    return BAD
                w[CORNER] = 0
                w[PHASE] = _SIGNS
                continue
            side = np.int64(0)
            k0, l0, l1, l2, left = _tree_child(st, depth, w[CLASS], w[B0], w[B1], w[B2], side + 0)
            k1, r0, r1, r2, right = _tree_child(st, depth, w[CLASS], w[B0], w[B1], w[B2], side + 1)
            # ascending order: along the last path nothing is left of it
            bit = np.int64(1)
            if not right:
                bit = np.int64(0)
            elif left and not (w[TIGHT] and w[PATH + depth]):
                bit = code(cd, ctx.PATH + w[TIGHT], w[FOUND + depth] if encoding else 0)
                if bit < 0:
                    return _stop(bit)
                st.at[TALLY + LOCATION] += 1
            if w[TIGHT] and bit != w[PATH + depth]:
                w[TIGHT] = 0
            w[PATH + depth] = bit
            w[CLASS] = k1 if bit else k0
            w[B0] = r0 if bit else l0
            w[B1] = r1 if bit else l1
            w[B2] = r2 if bit else l2
            w[DEPTH] = depth + 1

        elif phase == _SIGNS:
            j = w[CORNER]
            cls, b0, b1, b2 = w[CLASS], w[B0], w[B1], w[B2]
            if j <= n:
                if corner_entry(st, st.at[EDGE], r, cls, b0, b1, b2, j) == 0:
                    before = 0
                    unknown = 0
                    for i in range(n + 1):
                        e = corner_entry(st, st.at[EDGE], r, cls, b0, b1, b2, i)
                        if e == 0:
                            unknown += 1
                        else:
                            before |= 1 << (e & 1)
                    if unknown == 1 and before != 3:
                        _corner_learn(st, r, cls, b0, b1, b2, j, 2 - before)
                    else:
                        bit = np.int64(0)
                        if encoding:
                            bit = corner_truth(st, st.at[EDGE], r, cls, b0, b1, b2, j)
                        bit = code(cd, ctx.FIRST + 4 * (j > 0) + before, bit)
                        if bit < 0:
                            return _stop(bit)
                        st.at[TALLY + BASE_SIGN] += 1
                        _corner_learn(st, r, cls, b0, b1, b2, j, bit)
                w[CORNER] = j + 1
                continue
            signs = 0
            for i in range(n + 1):
                signs |= 1 << (corner_entry(st, st.at[EDGE], r, cls, b0, b1, b2, i) & 1)
            if signs != 3:
                st.at[ERROR] = 3
                return BAD
            _visit(st, mark, r, cls, b0, b1, b2)
            _push_gates(st, mark, r, cls, b0, b1, b2)
            w[HISTORY] = 0
            w[FRESH] = 0
            w[BRANCH] = st.at[LEAVES] - 1
            w[PHASE] = _TRAVERSE

        else:
            if w[GATES] == 0:
                w[PHASE] = _COMPONENT
                continue
            g = (w[GATES] - 1) * GATE
            cls, b0, b1, b2 = st.stack[g], st.stack[g + 1], st.stack[g + 2], st.stack[g + 3]
            opp, left_from = st.stack[g + 4], st.stack[g + 5]
            if visited(st, mark, r, cls, b0, b1, b2):
                w[GATES] -= 1
                continue
            e = corner_entry(st, st.at[EDGE], r, cls, b0, b1, b2, opp)
            if n == 2:
                if left_from == w[BRANCH] and left_from != st.at[LEAVES] - 1:
                    _turn_back(st)
                    w[BRANCH] = -1
                guess, context = _curve_context(st, r, cls, b0, b1, opp)
            else:
                guess, context = _surface_context(st, r, cls, b0, b1, b2, opp)
            if e == 0:
                right_guess = np.int64(0)
                if encoding:
                    right_guess = np.int64(corner_truth(st, st.at[EDGE], r, cls, b0, b1, b2, opp) == guess)
                bit = code(cd, context, right_guess)
                if bit < 0:
                    return _stop(bit)
                st.at[TALLY + BASE_SIGN] += 1
                st.at[TALLY + PREDICTED] += 1
                st.at[TALLY + PREDICTED_RIGHT] += bit
                _corner_learn(st, r, cls, b0, b1, b2, opp, guess if bit else 1 - guess)
            else:
                adapt(cd, context, np.int64((e & 1) == guess))
            if n == 2:
                i = 1 if opp == 0 else 0
                g0, g1 = _sum(st, r, cls, b0, b1, i, 3 - opp - i)
                slot = w[HISTORY] % MOST
                w[TRAIL + 2 * slot] = g0
                w[TRAIL + 2 * slot + 1] = g1
                w[HISTORY] += 1
                if w[FRESH] < MOST and w[BRANCH] >= 0:
                    w[EARLY + 2 * w[FRESH]] = g0
                    w[EARLY + 2 * w[FRESH] + 1] = g1
                    w[FRESH] += 1
            w[GATES] -= 1
            _visit(st, mark, r, cls, b0, b1, b2)
            _push_gates(st, mark, r, cls, b0, b1, b2)
