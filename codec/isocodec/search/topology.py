"""Check that a vertex can go without a change of topology (rows C2-topology, S3-topology).

Taking the middle w away moves it along the subdivision edge to one of the ends. If that end has the sign of w, nothing
is torn or glued. If w differs from both ends, the curve in the star must be one arc (one disc), which it is exactly if
the corners of the ring that differ from w form one stretch: none of them means that two parts are to be joined, all of
them that a component dies, several stretches that a tunnel closes. At the border of the box w may only move along the
faces of the box that it lies on, so that ends of open curves keep their order.
"""

from __future__ import annotations

import numpy as np

from ..grid.lattice.access import dimension, member
from ..grid.lattice.access import members as member_count
from ..grid.lattice.grid import clamped
from ..kernel import inner
from .reduced import corner_at


@inner
def _stretches(t, kind, differ):
    """How many members have one ring corner in ``differ`` and one not: twice the number of stretches on the ring."""
    changes = 0
    for m in range(member_count(t, kind)):
        bits = member(t, kind, m)[4] >> 2
        both = bits & (differ >> 2)
        changes += both != 0 and both != bits
    return changes


@inner
def safe(dm, diamond, sign):
    """Whether the middle of a diamond, which has the sign ``sign``, can go."""
    t = dm.grid.tables
    kind, corners = diamond.kind, diamond.corners
    differ = corners & ~diamond.above if sign else diamond.above
    if differ == 0:
        return True
    if differ == corners:
        return False
    if diamond.whole:
        if differ & 3 != 3:
            return True
        ring = corners & ~np.int64(3)
        if dimension(t) == 2:
            return differ & ring != 0 and differ & ring != ring
        return _stretches(t, kind, differ) == 2
    # at the border: along an end that lies on all faces of the box on which the middle lies
    edge = diamond.edge
    here = clamped(dm.grid, (diamond.w0 * edge) >> 1, (diamond.w1 * edge) >> 1, (diamond.w2 * edge) >> 1)
    last = dm.grid.last0, dm.grid.last1, dm.grid.last2
    for end in range(2):
        if (differ >> end) & 1 or not (corners >> end) & 1:
            continue
        x, y, z = corner_at(dm, diamond, np.int64(end))
        there = clamped(dm.grid, x, y, z)
        free = True
        for axis in range(dimension(t)):
            if (here[axis] == 0 or here[axis] == last[axis]) and there[axis] != here[axis]:
                free = False
        if free:
            return True
    return False
