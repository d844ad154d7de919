"""Questions about the mesh: what the main profile sees around a middle (spec clause 7.16)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, clear, mixing, see
from ...entropy.range_coder import code
from ...kernel import inlined
from ...kernel.types import Integer
from ..lattice.access import dimension
from ..lattice.grid import edge_of, lattice, phase_of
from ..lattice.store import get
from ..lattice.vertex_set import IN, KEPT, OUT
from ..tube.state import entry
from .neighbourhood import PLANE, SPACE
from .network_rows import MESH_AROUND, MESH_KIND, MESH_NET, MESH_ROW

_MESH_2, _MESH_3 = MESH_ROW[2], MESH_ROW[3]
ON_PATH, COARSER, FINER, OF_LEAF = np.arange(4)
"""Questions about the mesh: on the path to a component, of the simplex behind a gate, of a leaf."""


class Question(NamedTuple):
    """Whether a middle is in the mesh.

    Attributes
    ----------
    what : int
        One of the four sorts of questions.
    history : int
        The last answers, as bits, or how many nearby are in the mesh (``nearby``).
    level, x, y, z : int
        Of the middle; its position is unclamped.
    """

    what: Integer
    history: Integer
    level: Integer
    x: Integer
    y: Integer
    z: Integer


@inlined
def nearby(st, diamond):
    """Count of the middles nearest before one those in the mesh less those kept, plus 4, limited (clause 7.9(2))."""
    n = dimension(st.grid.tables)
    total = np.int64(4)
    for i in range(n * (n - 1) if diamond.phase else n):
        d0, d1, d2 = np.int64(0), np.int64(0), np.int64(0)
        if diamond.phase == 0:
            d0, d1, d2 = -2 * np.int64(i == 0), -2 * np.int64(i == 1), -2 * np.int64(i == 2)
        else:
            # back along the first of two axes, to either side along the second
            pair, way = i >> 1, np.int64(2 * (i & 1) - 1)
            d0 = np.int64(-1 if pair < 2 else 0)
            d1 = way if pair == 0 else np.int64(0 if pair == 1 else -1)
            d2 = np.int64(0) if pair == 0 else way
        v0, v1, v2 = diamond.w0 + d0, diamond.w1 + d1, diamond.w2 + d2
        if min(v0, v1, v2) < 0 or (v0 & 1) + (v1 & 1) + (v2 & 1) != n - diamond.phase:
            continue
        edge = diamond.edge
        state = get(st.mesh, (v0 * edge) >> 1, (v1 * edge) >> 1, (v2 * edge) >> 1)
        total += np.int64(state & IN != 0) - np.int64(state & KEPT != 0)
    return min(max(total, 0), 7)


@inlined
def _anchor(st, edge, w0, w1, w2):
    """Sign of the end of a middle's subdivision edge that lies at multiples of 4 g, 0 if it is not known."""
    a0, a1, a2 = w0 - (1 - (w0 & 2)) * (w0 & 1), w1 - (1 - (w1 & 2)) * (w1 & 1), w2 - (1 - (w2 & 2)) * (w2 & 1)
    return entry(st, (a0 * edge) >> 1, (a1 * edge) >> 1, (a2 * edge) >> 1) & 1


@inlined
def see_mesh(st, cd, question):
    """List what the main profile sees around a middle that may be in the mesh (spec clause 7.16)."""
    n = dimension(st.grid.tables)
    level = question.level
    r = phase_of(n, level)
    first = _MESH_2 if n == 2 else _MESH_3
    clear(cd)
    see(cd, first + 3 * question.what + r)
    see(cd, first + 12 + min(n * st.grid.exponent - level, 23))
    see(cd, first + 36 + question.history)
    first += 44 + 4 * MESH_AROUND * r
    edge = edge_of(st.grid, level)
    w0, w1, w2 = lattice(st.grid, level, question.x, question.y, question.z)
    key = (w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4
    here = _anchor(st, edge, w0, w1, w2)
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
def ask(st, cd, question, context, bit):
    """Code whether a middle is in the mesh, in either profile; as ``code``."""
    if not mixing(cd):
        return code(cd, context, bit)
    see_mesh(st, cd, question)
    return blended(cd, MESH_NET, False, MESH_KIND + question.what, context, bit)
