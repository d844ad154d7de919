"""The encoder's search for new components: all added vertices that differ from every corner of their diamond (5.5).

Most of the domain is skipped in blocks that the curve does not pass.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.access import corner, dimension
from ..grid.lattice.access import corners as corner_count
from ..grid.lattice.access import kind as kind_of
from ..grid.lattice.diamond import existing
from ..grid.lattice.grid import clamped, position
from ..grid.lattice.slots import cubes, middle_of, slots
from ..grid.lattice.store import get
from ..grid.lattice.vertex_set import IN, has
from ..grid.passes.new_components import SLOT_BITS
from ..grid.tube.state import State, entry, truth
from ..kernel import inner, kernel
from ..kernel.types import BoolVolume, IntVector, UInt8Volume

BLOCK = 3
"""Log2 of the edge of the blocks in which the encoder looks for changes of sign."""


@kernel
def busy_blocks(truth: BoolVolume, same: UInt8Volume, busy: BoolVolume) -> None:
    """Find blocks of samples that the curve may pass, their neighbours counted in.

    ``same`` is room for one flag a block: 1 all below, 2 all above, 3 both.
    """
    for x in range(truth.shape[0]):
        for y in range(truth.shape[1]):
            for z in range(truth.shape[2]):
                same[x >> BLOCK, y >> BLOCK, z >> BLOCK] |= 1 + truth[x, y, z]
    for x in range(same.shape[0]):
        for y in range(same.shape[1]):
            for z in range(same.shape[2]):
                seen = 0
                for i in range(max(x - 1, 0), min(x + 2, same.shape[0])):
                    for j in range(max(y - 1, 0), min(y + 2, same.shape[1])):
                        for k in range(max(z - 1, 0), min(z + 2, same.shape[2])):
                            seen |= same[i, j, k]
                busy[x, y, z] = seen == 3


def busy_of(signs: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Blocks of a field, its signs on three axes, that the curve passes, with their neighbours."""
    blocks = tuple(((s - 1) >> BLOCK) + 1 for s in signs.shape)
    busy = np.zeros(blocks, np.bool_)
    busy_blocks(signs, np.zeros(blocks, np.uint8), busy)
    return busy


@inner
def _idle(st, busy, x, y, z):
    """Whether the block of a cube, and with it the diamonds of its middles, lies off the curve."""
    edge = st.counters.edge
    if edge > 1 << BLOCK:
        return False
    x, y, z = clamped(st.grid, x * edge, y * edge, z * edge)
    return not busy[x >> BLOCK, y >> BLOCK, z >> BLOCK]


@inner
def _ends(w, edge, last):
    """One coordinate of a middle and of both ends of its subdivision edge, on the box.

    Where the middle's coordinate is odd the ends lie g off, one of them at a multiple of 4 g.
    """
    m = (w * edge) >> 1
    if not w & 1:
        m = min(m, last)
        return np.uint64(m), np.uint64(m), np.uint64(m)
    d = edge >> 1 if w & 2 else -(edge >> 1)
    return np.uint64(min(m, last)), np.uint64(min(m + d, last)), np.uint64(min(m - d, last))


@inner
def _corner_sign(st, kind, i, w0, w1, w2):
    x, y, z = position(st.counters.edge, w0 >> 2, w1 >> 2, w2 >> 2, corner(st.grid.tables, kind, i))
    return truth(st, x, y, z)


@inner
def _alone(st, r, w0, w1, w2):
    """Whether a middle differs from all corners of its diamond."""
    t = st.grid.tables
    edge = st.counters.edge
    kind = kind_of(t, r, w0, w1, w2)
    x, y, z = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
    if (st.counters.asks and not has(st.chosen, x, y, z)) or entry(st, x, y, z) != 0 or get(st.mesh, x, y, z) & IN:
        return False
    s = truth(st, (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1)
    corners = existing(st.grid, edge, r, kind, w0, w1, w2)[2]
    for i in range(corner_count(t, kind)):
        if (corners >> i) & 1 and s == _corner_sign(st, kind, i, w0, w1, w2):
            return False
    return corners != 0


@kernel
def find(st: State, busy: BoolVolume, found: IntVector) -> int:
    """All new components of the round, as Morton numbers of their cubes followed by the slot (unsorted).

    Fills ``found`` as far as it goes and returns their number.
    """
    n = dimension(st.grid.tables)
    r = st.counters.level % n
    edge = st.counters.edge
    field = st.truth
    last0, last1, last2 = st.grid.last0, st.grid.last1, st.grid.last2
    c0, c1, c2 = cubes(st.grid, st.counters.level)
    # the cubes of one block at a time
    run = max((1 << BLOCK) // edge, 1)
    zero = np.int64(0)
    count = 0
    for x0 in range(0, c0, run):
        for y0 in range(0, c1, run):
            for z0 in range(0, c2, run):
                if _idle(st, busy, x0, y0, z0):
                    continue
                for slot in range(slots(n, r)):
                    v0, v1, v2 = middle_of(n, r, zero, zero, zero, slot)
                    for x in range(x0, min(x0 + run, c0)):
                        w0 = v0 + 2 * x
                        m0, p0, q0 = _ends(w0, edge, last0)
                        for y in range(y0, min(y0 + run, c1)):
                            w1 = v1 + 2 * y
                            m1, p1, q1 = _ends(w1, edge, last1)
                            for z in range(z0, min(z0 + run, c2)):
                                w2 = v2 + 2 * z
                                m2, p2, q2 = _ends(w2, edge, last2)
                                # most middles agree with an end of their edge; that is found out without the tables
                                s = field[m0, m1, m2]
                                if s == field[p0, p1, p2] or s == field[q0, q1, q2]:
                                    continue
                                if _alone(st, r, w0, w1, w2):
                                    if count < len(found):
                                        found[count] = _morton(n, x, y, z) << SLOT_BITS | slot
                                    count += 1
    return count


@inner
def _morton(n, x, y, z):
    number = np.int64(0)
    for i in range(25):
        if n == 2:
            number |= ((x >> i & 1) << 1 | (y >> i & 1)) << 2 * i
        else:
            number |= ((x >> i & 1) << 2 | (y >> i & 1) << 1 | (z >> i & 1)) << 3 * i
        if (x | y | z) >> i == 0:
            break
    return number
