"""View of the reduction for its kernels: the mesh's tables, the field, the vertices that are left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..grid.lattice.access import corner, dimension
from ..grid.lattice.access import kind as kind_of
from ..grid.lattice.access import members as member_count
from ..grid.lattice.diamond import existing, parent
from ..grid.lattice.grid import Grid, edge_of, position
from ..grid.lattice.store import put
from ..grid.lattice.vertex_set import Chosen, flags
from ..grid.tube.state import Counters, truth
from ..kernel import inner, record
from ..kernel.types import BoolVolume, Float32Volume, FloatVector

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


EXACT_POINTS, LINEAR_POINTS = 0, -1
"""In place of parts: points where the field crosses the edge; where it would by linear interpolation of its ends."""


@record
class Domain(NamedTuple):
    """Named like the arrays of ``tube.state.State`` where kernels are shared."""

    grid: Grid
    counters: Counters
    truth: BoolVolume  # signs, three axes
    phi: Float32Volume  # value less isovalue, three axes; its sign counts nowhere
    chosen: Chosen
    room: FloatVector  # points of a diamond's pieces
    parts: int  # a decoder knows crossings in this many parts of 2**unit samples
    unit: int


class SignedDiamond(NamedTuple):
    """A diamond of a level: its middle in units of half the edge, bits of the members and corners that exist, signs."""

    level: int
    edge: int
    kind: int
    w0: int
    w1: int
    w2: int
    whole: bool  # wholly inside the box
    members: int
    corners: int
    above: int  # corners that are


@inner
def diamond_at(dm, level, x, y, z):
    """The diamond of the middle at unclamped (x, y, z)."""
    t = dm.grid.tables
    edge = edge_of(dm.grid, level)
    w0, w1, w2 = 2 * x // edge, 2 * y // edge, 2 * z // edge
    r = level % dimension(t)
    kind = kind_of(t, r, w0, w1, w2)
    whole, members, corners = existing(dm.grid, edge, r, kind, w0, w1, w2)
    above = 0
    i = 0
    while corners >> i:
        if (corners >> i) & 1:
            u = position(edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(t, kind, np.int64(i)))
            above |= truth(dm, u[0], u[1], u[2]) << i
        i += 1
    return SignedDiamond(level, edge, kind, w0, w1, w2, whole, members, corners, above)


@inner
def corner_at(dm, diamond, i):
    """Unclamped position of a corner of a diamond."""
    offset = corner(dm.grid.tables, diamond.kind, i)
    return position(diamond.edge, diamond.w0 >> 2, diamond.w1 >> 2, diamond.w2 >> 2, offset)


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
def need_parents(dm, diamond):
    """Mark the parents of a vertex that stays."""
    if diamond.level == 0:
        return
    for m in range(member_count(dm.grid.tables, diamond.kind)):
        if (diamond.members >> m) & 1:
            p = parent_at(dm, diamond, m)
            bits = flags_of(dm, p[0], p[1], p[2])
            if not bits & NEEDED:
                set_flags(dm, p[0], p[1], p[2], bits | NEEDED)


@inner
def parent_at(dm, diamond, m):
    """Unclamped position of the middle whose bisection made member m of a diamond."""
    w0, w1, w2 = diamond.w0, diamond.w1, diamond.w2
    return parent(dm.grid.tables, diamond.level, diamond.edge, diamond.kind, m, w0, w1, w2)
