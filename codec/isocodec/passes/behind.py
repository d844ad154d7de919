"""What lies behind a gate on an adaptive mesh: questions about levels, and what leaves say (spec clause 5.8)."""

from __future__ import annotations

import numpy as np

from ..entropy import baseline as ctx
from ..entropy.coder import ENCODE, MODE
from ..kernel import GROW, inlined, inner
from ..mesh.access import child, dimension, vertex
from ..mesh.chosen import has
from ..mesh.grid import edge_of, position
from ..mesh.simplex import middle_at, newest, parent_of
from ..mesh.store import get, put
from .ahead import COARSER, FINER, ask
from .mesh import BARRED, IN, OUT, admit, closure, short, told
from .state import FINEST, LEVEL_SYMBOL, TALLY, UNIFORM
from .walk import BEFORE, RESOLVED

_EQUAL = np.int64(-1)


@inlined
def _question(n, level, opp):
    """What there is to ask about the level behind a gate (design of the alphabets, spec clause 5.8.3)."""
    if opp == newest(n, level % n):
        return COARSER
    if opp == 0 or opp == n - level % n:
        return FINER
    return _EQUAL


@inner
def tell(st, cd, what, level, x, y, z, context):
    """Learn whether a middle is in the mesh: 1 or 0, or what the coder says, or GROW.

    A vertex of the mesh brings its ancestors with it.
    """
    answer = np.int64(told(st, level, x, y, z))
    if answer >= 0:
        return answer
    count = closure(st, level, x, y, z, np.int64(1))
    if count != BARRED and short(st, count):
        return np.int64(GROW)
    want = np.int64(0)
    if cd.reg[MODE] == ENCODE:
        want = np.int64(has(st.chosen, x, y, z))
    bit = np.int64(0)
    if count != BARRED:
        bit = ask(st, cd, what, st.walk[BEFORE], level, x, y, z, context, want)
        if bit < 0:
            return bit
        st.at[TALLY + LEVEL_SYMBOL] += 1
        st.walk[BEFORE] = (st.walk[BEFORE] << 1 & 2) | bit
    if bit:
        admit(st, count)
    else:
        put(st.mesh, x, y, z, get(st.mesh, x, y, z) | OUT)
    return bit


@inner
def settle(st, level, cls, b0, b1, b2):
    """Mark what a leaf says of the mesh: its newest vertex is in it, its middle is not. 0, GROW or BARRED."""
    n = dimension(st.grid.tables)
    x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
    if level < st.at[FINEST]:
        state = get(st.mesh, x, y, z)
        if state & IN:
            return np.int64(BARRED)
        put(st.mesh, x, y, z, state | OUT)
    if level - 1 < st.at[UNIFORM]:
        return np.int64(0)
    x, y, z = position(
        edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, level % n, cls, newest(n, level % n))
    )
    state = get(st.mesh, x, y, z)
    if state & IN:
        return np.int64(0)
    if state & OUT:
        return np.int64(BARRED)
    count = closure(st, level - 1, x, y, z, np.int64(1))
    if count == BARRED:
        return count
    if short(st, count):
        return np.int64(GROW)
    admit(st, count)
    return np.int64(0)


@inner
def resolve(st, cd, level, cls, b0, b1, b2, opp):
    """Find the leaf behind a gate, leaving it in the registers: 0, or what ``tell`` or ``settle`` say."""
    n = dimension(st.grid.tables)
    r = level % n
    w = st.walk
    question = _question(n, level, opp)
    if question == FINER or (question == COARSER and level > 0):
        coarser = np.int64(question == COARSER)
        x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
        if coarser:
            x, y, z = position(edge_of(st.grid, level), b0, b1, b2, vertex(st.grid.tables, r, cls, opp))
        bit = tell(st, cd, question, level - coarser, x, y, z, ctx.LEVEL + (r * 2 + coarser) * 4 + w[BEFORE])
        if bit < 0:
            return bit
        if coarser and bit == 0:
            cls, b0, b1, b2, side = parent_of(st.grid, level, cls, b0, b1, b2)
            level -= 1
            opp = np.int64(0) if side else n - level % n
        elif bit == 1 and not coarser:
            side = 1 if opp == 0 else 0
            q, d0, d1, d2 = child(st.grid.tables, r, cls, side)
            f = 2 if r == n - 1 else 1
            cls, b0, b1, b2 = q, b0 * f + d0, b1 * f + d1, b2 * f + d2
            level += 1
            opp = newest(n, level % n)
    w[RESOLVED] = level
    w[RESOLVED + 1] = cls
    w[RESOLVED + 2] = b0
    w[RESOLVED + 3] = b1
    w[RESOLVED + 4] = b2
    w[RESOLVED + 5] = opp
    return np.int64(0)
