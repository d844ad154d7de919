"""What the main profile sees of the vertices around a middle (spec clause 7.11)."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..entropy.blend import see
from ..entropy.main import AROUND
from ..jit import inner
from ..mesh.access import dimension
from ..mesh.store import get
from .state import EDGE, LAST, LEVEL, entry

_FAR = {2: 10, 3: 6}
"""No vertex of the lists is as far as this along an axis, in units of g."""


def nearest_vertices(n: int, phase: int) -> list[tuple[int, ...]]:
    """Vertices of the next level nearest to a middle of level phase (mod n), as differences in units of g.

    The axes along which the middle's coordinate is odd come first; along these the subdivision edge runs from
    -1 to 1. The nearest come first, those of equal distance in lexicographic order.
    """
    odd = n - phase
    found = []
    for d in product(range(1 - _FAR[n], _FAR[n]), repeat=n):
        count = sum((x + (a < odd)) % 2 for a, x in enumerate(d))
        if any(d) and (count == 0 or count >= odd):
            found.append(d)
    found.sort(key=lambda d: (sum(x * x for x in d), d))
    return found[: AROUND[n]]


def _table(n: int) -> NDArray[np.int64]:
    table = np.zeros((n, AROUND[n], 3), np.int64)
    for phase in range(n):
        table[phase, :, :n] = nearest_vertices(n, phase)
    return table


_PLANE, _SPACE = _table(2), _table(3)
_COUNT_2, _COUNT_3 = AROUND[2], AROUND[3]
_REACH = int(max(abs(_PLANE).max(), abs(_SPACE).max()))


@inner
def see_around(st, cd, first, w0, w1, w2):
    """List the known vertices around a middle as rows from ``first`` on; returns the sign that they are relative to.

    That is the sign of the end of the subdivision edge at multiples of 4 g.
    """
    n = dimension(st.tables)
    edge = st.at[EDGE]
    r = st.at[LEVEL] % n
    # the ways from the edge's first end to the other, and where each axis stands in the table
    s0 = 1 - (w0 & 2) * (w0 & 1)
    s1 = 1 - (w1 & 2) * (w1 & 1)
    s2 = 1 - (w2 & 2) * (w2 & 1)
    odd = (w0 & 1) + (w1 & 1) + (w2 & 1)
    c0 = 0 if w0 & 1 else odd
    c1 = (w0 & 1) if w1 & 1 else odd + 1 - (w0 & 1)
    c2 = (w0 & 1) + (w1 & 1) if w2 & 1 else odd + 2 - (w0 & 1) - (w1 & 1)
    a0, a1, a2 = w0 - s0 * (w0 & 1), w1 - s1 * (w1 & 1), w2 - s2 * (w2 & 1)
    here = entry(st, (a0 * edge) >> 1, (a1 * edge) >> 1, (a2 * edge) >> 1) & 1
    count = _COUNT_2 if n == 2 else _COUNT_3
    # most windows lie inside the box: nothing to clamp
    last = st.at
    low = min(w0, w1) if n == 2 else min(w0, w1, w2)
    whole = (
        low >= _REACH
        and (w0 + _REACH) * edge <= 2 * last[LAST]
        and (w1 + _REACH) * edge <= 2 * last[LAST + 1]
        and (n == 2 or (w2 + _REACH) * edge <= 2 * last[LAST + 2])
    )
    for i in range(count):
        if n == 2:
            x = (w0 + s0 * _PLANE[r, i, c0]) * edge >> 1
            y = (w1 + s1 * _PLANE[r, i, c1]) * edge >> 1
            z = w2
        else:
            x = (w0 + s0 * _SPACE[r, i, c0]) * edge >> 1
            y = (w1 + s1 * _SPACE[r, i, c1]) * edge >> 1
            z = (w2 + s2 * _SPACE[r, i, c2]) * edge >> 1
        e = get(st.known, x, y, z) if whole else entry(st, x, y, z)
        if e != 0:
            see(cd, first + 2 * i + ((e & 1) == here))
    return here
