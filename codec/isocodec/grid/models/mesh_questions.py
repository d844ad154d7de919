"""Questions about the mesh: what the main profile sees around a middle (spec clause 7.16)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, clear, mixing, see
from ...entropy.range_coder import code
from ...kernel import inlined
from ...kernel.types import Integer
from ..lattice.access import dimension
from ..lattice.grid import edge_of, lattice
from ..lattice.store import get
from ..lattice.vertex_set import IN, KEPT, OUT
from ..tube.state import entry
from .neighbourhood import PLANE, SPACE, anchor
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
        The last answers, as bits.
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
def see_mesh(st, cd, question):
    """List what the main profile sees around a middle that may be in the mesh (spec clause 7.16)."""
    n = dimension(st.grid.tables)
    level = question.level
    r = level % n
    first = _MESH_2 if n == 2 else _MESH_3
    clear(cd)
    see(cd, first + 3 * question.what + r)
    see(cd, first + 12 + min(n * st.grid.exponent - level, 23))
    see(cd, first + 36 + question.history)
    first += 44 + 4 * MESH_AROUND * r
    edge = edge_of(st.grid, level)
    w0, w1, w2 = lattice(st.grid, level, question.x, question.y, question.z)
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
def ask(st, cd, question, context, bit):
    """Code whether a middle is in the mesh, in either profile; as ``code``."""
    if not mixing(cd):
        return code(cd, context, bit)
    see_mesh(st, cd, question)
    return blended(cd, MESH_NET, False, MESH_KIND + question.what, context, bit)
