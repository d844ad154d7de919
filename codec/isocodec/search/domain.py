"""What the kernels of the reduction see: the mesh's tables, the field, the vertices that are left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inner, record
from ..kernel.types import BoolVolume, Float32Volume, FloatVector
from ..mesh.access import corner
from ..mesh.access import members as member_count
from ..mesh.diamond import parent
from ..mesh.grid import Grid, edge_of, position
from ..mesh.store import put
from ..mesh.vertex_set import Chosen, flags
from ..tube.state import Counters, truth

NEEDED, OPEN, FAILED = 2, 4, 8
"""Bits of a lattice point, beside GONE: a child is left; it may go if the curve stays near enough; it does not."""
ROOM = 512
"""Values in ``Domain.room``."""


def number_of(n, x, y, z):
    """The place of a middle as one number: 21 bits an axis, 26 where there are but two."""
    return x << 42 | y << 21 | z if n == 3 else x << 26 | y


def place_of(n, number):
    """The reverse of ``number_of``."""
    if n == 3:
        return number >> 42, number >> 21 & 0x1FFFFF, number & 0x1FFFFF
    return number >> 26, number & 0x3FFFFFF, number & 0


@record
class Domain(NamedTuple):
    """Named like the arrays of ``tube.state.State`` where kernels are shared."""

    grid: Grid
    counters: Counters
    truth: BoolVolume  # signs, three axes
    phi: Float32Volume  # value less isovalue, three axes; its sign counts nowhere
    chosen: Chosen
    room: FloatVector  # points of a diamond's pieces


@inner
def flags_of(dm, x, y, z):
    """Bits of the lattice point at unclamped (x, y, z)."""
    return flags(dm.chosen, x, y, z)


@inner
def set_flags(dm, x, y, z, bits):
    s0, s1, s2 = dm.truth.shape
    if x < s0 and y < s1 and z < s2:
        dm.chosen.inside[x, y, z] = bits
    else:
        put(dm.chosen.outside, x, y, z, bits)


@inner
def signs_of(dm, edge, kind, corners, w0, w1, w2):
    """Bits of the corners that are above."""
    above = np.int64(0)
    i = 0
    while corners >> i:
        if (corners >> i) & 1:
            x, y, z = position(edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(dm.grid.tables, kind, np.int64(i)))
            above |= truth(dm, x, y, z) << i
        i += 1
    return above


@inner
def need_parents(dm, level, kind, members, w0, w1, w2):
    """Mark the parents of a vertex that stays."""
    t = dm.grid.tables
    edge = edge_of(dm.grid, level)
    if level == 0:
        return
    for m in range(member_count(t, kind)):
        if (members >> m) & 1:
            p = parent(t, level, edge, kind, m, w0, w1, w2)
            bits = flags_of(dm, p[0], p[1], p[2])
            if not bits & NEEDED:
                set_flags(dm, p[0], p[1], p[2], bits | NEEDED)
