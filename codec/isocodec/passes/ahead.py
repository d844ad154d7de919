"""What the main profile sees of the mesh, and of the vertices around the one behind a gate (clauses 7.16, 7.17).

Both are lists of vertices around a place, in units that go with the mesh: the state of the mesh, or the sign, of each.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ..entropy.blend import blended, clear, mixing, see
from ..entropy.coder import code
from ..entropy.main import BASE_ROW, MESH_AROUND, MESH_KIND, MESH_NET, MESH_ROW
from ..kernel import inlined
from ..mesh.access import dimension, vertex
from ..mesh.grid import edge_of, lattice, position
from ..mesh.store import get
from .around import PLANE, SPACE, anchor
from .mesh import IN, KEPT, OUT
from .state import SCRATCH, entry

_MESH_2, _MESH_3 = MESH_ROW[2], MESH_ROW[3]
_STEPS = {
    n: np.array([d for d in product(range(-3, 4), repeat=n) if any(d) and (n == 2 or sum(map(abs, d)) <= 3)])
    for n in (2, 3)
}
"""Vertices around the one behind a gate, in units of the edges from there to the gate's vertices."""
_STEPS_2, _STEPS_3 = _STEPS[2], _STEPS[3]
_BASE_2, _BASE_3 = BASE_ROW[2], BASE_ROW[3]
ON_PATH, COARSER, FINER, OF_LEAF = np.arange(4)
"""Questions about the mesh: on the path to a component, of the simplex behind a gate, of a leaf."""


@inlined
def see_mesh(st, cd, what, history, level, x, y, z):
    """List what the main profile sees around a middle that may be in the mesh (spec clause 7.16)."""
    n = dimension(st.grid.tables)
    r = level % n
    first = _MESH_2 if n == 2 else _MESH_3
    clear(cd)
    see(cd, first + 3 * what + r)
    see(cd, first + 12 + min(n * st.grid.exponent - level, 23))
    see(cd, first + 36 + history)
    first += 44 + 4 * MESH_AROUND * r
    edge = edge_of(st.grid, level)
    w0, w1, w2 = lattice(st.grid, level, x, y, z)
    key = (w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4
    here = anchor(st, edge, w0, w1, w2)
    most = np.int64(1) << st.grid.exponent
    for i in range(MESH_AROUND):
        d = PLANE[key, i] if n == 2 else SPACE[key, i]
        p0, p1, p2 = ((w0 + d[0]) * edge) >> 1, ((w1 + d[1]) * edge) >> 1, ((w2 + d[2]) * edge) >> 1
        if min(p0, p1, p2) >= 0 and max(p0, p1, p2) <= most:
            state = get(st.mesh, p0, p1, p2)
            if state & (IN | OUT | KEPT):
                see(cd, first + 2 * i + ((state & IN) != 0))
        e = entry(st, p0, p1, p2)
        if e != 0:
            see(cd, first + 2 * (MESH_AROUND + i) + ((e & 1) == here))


@inlined
def ask(st, cd, what, history, level, x, y, z, context, bit):
    """Code whether a middle is in the mesh, in either profile; as ``code``."""
    if not mixing(cd):
        return code(cd, context, bit)
    see_mesh(st, cd, what, history, level, x, y, z)
    return blended(cd, MESH_NET, False, MESH_KIND + what, context, bit)


@inlined
def see_behind(st, cd, level, cls, b0, b1, b2, opp, guess, case, other):
    """List what the main profile sees around the vertex behind a gate (spec clause 7.17).

    ``case`` is the number of its context; what that says beside the prediction's quality has rows of its own.
    """
    n = dimension(st.grid.tables)
    r = level % n
    plane = n == 2
    first, count, cases = (_BASE_2, len(_STEPS_2), 4) if plane else (_BASE_3, len(_STEPS_3), 16)
    edge = edge_of(st.grid, level)
    frame = r * (n + 1) + opp
    clear(cd)
    see(cd, first + case % cases)
    if other >= 0:
        see(cd, first + 16 + (other == guess))
    first += 18 + 2 * count * frame
    p = st.walk[SCRATCH : SCRATCH + 12]
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
