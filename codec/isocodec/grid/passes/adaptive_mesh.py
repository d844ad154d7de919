"""Adaptive meshes: what is known of them, what brings a vertex in, what follows from leaves (spec clauses 4.7, 5.8)."""

from __future__ import annotations

import numpy as np

from ...entropy.range_coder import ENCODE
from ...kernel import GROW, inlined, inner
from ..lattice.access import dimension
from ..lattice.access import kind as kind_of
from ..lattice.access import members as member_count
from ..lattice.diamond import diamond_at, existing, parent
from ..lattice.grid import edge_of, lattice, phase_of
from ..lattice.simplex import middle_at
from ..lattice.store import full, get, put
from ..lattice.vertex_set import IN, OUT, has
from ..models.mesh_questions import Question, ask
from ..tube.state import LEVEL_SYMBOL, STEP_VERTICES
from .bisection import look

BARRED = -16
"""In place of a number of ancestors: the middle cannot be in the mesh."""
ANCESTOR = 32
"""Steps that looking at an ancestor counts as: it takes about as long as so many of inference."""


@inlined
def _listed(st, first, count, x, y, z):
    for i in range(first, count):  # noqa: SIM110 - compiled
        if st.path[i, 0] == x and st.path[i, 1] == y and st.path[i, 2] == z:
            return True
    return False


@inner
def mixed(st, level, x, y, z):
    """Whether the known corners of the diamond around a middle differ in sign."""
    w0, w1, w2 = lattice(st.grid, level, x, y, z)
    r = phase_of(dimension(st.grid.tables), level)
    seen = look(st, diamond_at(st.grid, edge_of(st.grid, level), r, w0, w1, w2))
    return seen.above != 0 and seen.above != seen.known


@inner
def closure(st, level, x, y, z, free):
    """List in ``State.path`` the middle at (x, y, z) and all ancestors that the mesh lacks; their number.

    With ``free`` 0 an ancestor that would need another symbol bars the middle, and so does, with ``free`` 1, one
    that is known not to be in the mesh: ``BARRED``. Ancestors looked at count as steps (``tired``).
    """
    n = dimension(st.grid.tables)
    t = st.grid.tables
    st.path[0, 0] = x
    st.path[0, 1] = y
    st.path[0, 2] = z
    st.path[0, 3] = level
    count = np.int64(1)
    # parents lie one level up, all behind one another: only there one may be listed already
    parents = np.int64(0)
    i = 0
    while i < count:
        if i == parents:
            parents = count
        x, y, z, level = st.path[i, 0], st.path[i, 1], st.path[i, 2], st.path[i, 3]
        st.counters.work += ANCESTOR * (i > 0)
        i += 1
        if level - 1 < st.counters.uniform:
            continue
        edge = edge_of(st.grid, level)
        w0, w1, w2 = lattice(st.grid, level, x, y, z)
        kind = kind_of(t, phase_of(n, level), w0, w1, w2)
        members = existing(st.grid, edge, phase_of(n, level), kind, w0, w1, w2)[1]
        for m in range(member_count(t, kind)):
            if not (members >> m) & 1:
                continue
            p0, p1, p2 = parent(t, level, edge, kind, m, w0, w1, w2)
            state = get(st.mesh, p0, p1, p2)
            if state & IN or _listed(st, parents, count, p0, p1, p2):
                continue
            if state & OUT if free else mixed(st, level - 1, p0, p1, p2):
                return np.int64(BARRED)
            if count == len(st.path):
                return np.int64(BARRED)
            st.path[count, 0] = p0
            st.path[count, 1] = p1
            st.path[count, 2] = p2
            st.path[count, 3] = level - 1
            count += 1
    return count


@inlined
def short(st, count):
    """Whether the store of the mesh lacks room for ``count`` vertices and the rest of the step; it is asked for."""
    if full(st.mesh, count + STEP_VERTICES):
        st.counters.room = max(st.counters.room, count + STEP_VERTICES)
        return True
    return False


@inlined
def admit(st, count):
    """Mark the first vertices of ``State.path`` as in the mesh."""
    for i in range(count):
        x, y, z = st.path[i, 0], st.path[i, 1], st.path[i, 2]
        put(st.mesh, x, y, z, get(st.mesh, x, y, z) | IN)


@inlined
def told(st, level, x, y, z):
    """Whether a middle is in the mesh, as far as a base has coded that: 1, 0, or -1 for not yet."""
    if level < st.counters.uniform:
        return 1
    if level >= st.counters.finest:
        return 0
    state = get(st.mesh, x, y, z)
    if state & IN:
        return 1
    if state & OUT or st.counters.told:
        return 0
    if level - 1 < st.counters.uniform:
        return -1
    n = dimension(st.grid.tables)
    t = st.grid.tables
    edge = edge_of(st.grid, level)
    w0, w1, w2 = lattice(st.grid, level, x, y, z)
    kind = kind_of(t, phase_of(n, level), w0, w1, w2)
    members = existing(st.grid, edge, phase_of(n, level), kind, w0, w1, w2)[1]
    for m in range(member_count(t, kind)):
        if (members >> m) & 1:
            p0, p1, p2 = parent(t, level, edge, kind, m, w0, w1, w2)
            if get(st.mesh, p0, p1, p2) & OUT:
                return 0
    return -1


@inner
def tell(st, cd, what, level, x, y, z, context):
    """Learn whether a middle is in the mesh: 1 or 0, or the coder's status, or GROW.

    A vertex of the mesh brings its ancestors with it.
    """
    answer = np.int64(told(st, level, x, y, z))
    if answer >= 0:
        return answer
    count = closure(st, level, x, y, z, np.int64(1))
    if count != BARRED and short(st, count):
        return np.int64(GROW)
    want = np.int64(0)
    if cd.reg.mode == ENCODE:
        want = np.int64(has(st.chosen, x, y, z))
    bit = np.int64(0)
    if count != BARRED:
        bit = ask(st, cd, Question(what, st.base.before, level, x, y, z), context, want)
        if bit < 0:
            return bit
        st.tally[LEVEL_SYMBOL] += 1
        st.base.before = (st.base.before << 1 & 2) | bit
    if bit:
        admit(st, count)
    else:
        put(st.mesh, x, y, z, get(st.mesh, x, y, z) | OUT)
    return bit


@inlined
def exclude(st, level, cls, b0, b1, b2):
    """Mark the middle of a leaf as not in the mesh (spec clause 5.8.2)."""
    if level < st.counters.finest:
        x, y, z = middle_at(st.grid, level, cls, b0, b1, b2)
        put(st.mesh, x, y, z, get(st.mesh, x, y, z) | OUT)
