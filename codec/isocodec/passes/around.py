"""What the main profile sees of the vertices around a middle (spec clause 7.12)."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..entropy.main import AROUND
from ..jit import inner, kernel
from ..mesh.access import dimension
from ..mesh.store import full, page_or_first, put, wipe
from .state import BOARD_EDGE, BOARDED, EDGE, LAST, LEVEL, SCRATCH, SIZE, VERTICES, entry

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
    """The same for all middles, by their coordinates modulo 4: from end to end the edge may run either way."""
    table = np.zeros((4**n, AROUND[n], 3), np.int64)
    for key in range(4**n):
        w = [key >> 2 * axis & 3 for axis in range(n)]
        odd = [axis for axis in range(n) if w[axis] & 1]
        axes = odd + [axis for axis in range(n) if not w[axis] & 1]
        if odd:
            near = np.array(nearest_vertices(n, n - len(odd)))
            for place, axis in enumerate(axes):
                table[key, :, axis] = near[:, place] * (-1 if w[axis] == 3 else 1)
    return table


PLANE, SPACE = _table(2), _table(3)
# the same as one number: differences of x * 64 + y, and of x * 1024 + y * 32 + z
_PLANE_AT = PLANE[..., 0] * 64 + PLANE[..., 1]
_SPACE_AT = SPACE[..., 0] * 1024 + SPACE[..., 1] * 32 + SPACE[..., 2]
_REACH_2, _REACH_3 = int(abs(PLANE).max()), int(abs(SPACE).max())
_COUNT_2, _COUNT_3 = AROUND[2], AROUND[3]


@inner
def survey(st):
    """Enter the vertices that have become known since the last time into the board; False if it lacks room.

    The board shows the lattice of the present level in units of g: 0 where nothing is known, else 1 + the sign. Images
    of vertices outside the box are not on it.
    """
    at = st.at
    if at[BOARD_EDGE] != at[EDGE]:
        wipe(st.board)
        at[BOARD_EDGE], at[BOARDED] = at[EDGE], 0
    # of g, which is half the edge
    size = at[SIZE] - at[LEVEL] // dimension(st.tables) - 1
    odd = (np.int64(1) << size) - 1
    while at[BOARDED] < at[VERTICES]:
        if full(st.board, 1):
            return False
        x, y, z, sign = st.vertex[at[BOARDED]]
        if (x | y | z) & odd == 0:
            put(st.board, np.int64(x) >> size, np.int64(y) >> size, np.int64(z) >> size, 1 + sign)
        at[BOARDED] += 1
    return True


@kernel
def _listed(board, near, plane, row, count, first, same, w0, w1, w2):
    """Append the rows of the vertices on the board that have the entry ``same`` or another; returns how many there are.

    ``near`` is room for the numbers of the pages around. A place is counted from the corner of two by two pages, each
    coordinate in 6 (n = 2) or 5 bits, of which the highest is that of the page. Indices are unsigned: no test whether
    they count from the end.
    """
    pages = board.pages
    if plane:
        p0, p1 = (w0 - _REACH_2) >> 5, (w1 - _REACH_2) >> 5
        for i in range(4):
            near[i] = page_or_first(board, (p0 + (i >> 1)) << 5, (p1 + (i & 1)) << 5, np.int64(0))
        at = (w0 - (p0 << 5)) << 6 | (w1 - (p1 << 5))
        table = _PLANE_AT[(w0 & 3) | (w1 & 3) << 2]
        for i in range(_COUNT_2):
            s = at + table[i]
            page = near[np.uint64((s >> 10 & 2) | (s >> 5 & 1))]
            e = np.int64(pages[np.uint64(page), np.uint64((s >> 1 & 0x3E0) | (s & 31))])
            row[np.uint64(count)] = first + 2 * i + (e == same)
            count += e != 0
    else:
        p0, p1, p2 = (w0 - _REACH_3) >> 4, (w1 - _REACH_3) >> 4, (w2 - _REACH_3) >> 4
        for i in range(8):
            near[i] = page_or_first(board, (p0 + (i >> 2)) << 4, (p1 + (i >> 1 & 1)) << 4, (p2 + (i & 1)) << 4)
        at = (w0 - (p0 << 4)) << 10 | (w1 - (p1 << 4)) << 5 | (w2 - (p2 << 4))
        table = _SPACE_AT[(w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4]
        for i in range(_COUNT_3):
            s = at + table[i]
            page = near[np.uint64((s >> 12 & 4) | (s >> 8 & 2) | (s >> 4 & 1))]
            e = np.int64(pages[np.uint64(page), np.uint64((s >> 2 & 0xF00) | (s >> 1 & 0xF0) | (s & 15))])
            row[np.uint64(count)] = first + 2 * i + (e == same)
            count += e != 0
    return count


@inner
def anchor(st, edge, w0, w1, w2):
    """Sign of the end of a middle's subdivision edge that lies at multiples of 4 g, 0 if it is not known."""
    a0, a1, a2 = w0 - (1 - (w0 & 2)) * (w0 & 1), w1 - (1 - (w1 & 2)) * (w1 & 1), w2 - (1 - (w2 & 2)) * (w2 & 1)
    return entry(st, (a0 * edge) >> 1, (a1 * edge) >> 1, (a2 * edge) >> 1) & 1


@inner
def see_around(st, cd, first, w0, w1, w2):
    """List the known vertices around a middle as rows from ``first`` on; returns the sign that they are relative to.

    That is the sign of the end of the subdivision edge at multiples of 4 g. The board has been surveyed.
    """
    edge = st.at[EDGE]
    plane = dimension(st.tables) == 2
    here = anchor(st, edge, w0, w1, w2)
    row = cd.blend.row
    count = row[0] + 1
    # most windows lie inside the box: nothing to clamp
    last = st.at
    reach = _REACH_2 if plane else _REACH_3
    if (
        min(w0, w1) >= reach
        and (w0 + reach) * edge <= 2 * last[LAST]
        and (w1 + reach) * edge <= 2 * last[LAST + 1]
        and (plane or (w2 >= reach and (w2 + reach) * edge <= 2 * last[LAST + 2]))
    ):
        count = _listed(st.board, st.walk[SCRATCH:], plane, row, count, first, 1 + here, w0, w1, w2)
    else:
        key = (w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4
        for i in range(_COUNT_2 if plane else _COUNT_3):
            d = PLANE[key, i] if plane else SPACE[key, i]
            e = entry(st, ((w0 + d[0]) * edge) >> 1, ((w1 + d[1]) * edge) >> 1, ((w2 + d[2]) * edge) >> 1)
            row[count] = first + 2 * i + ((e & 1) == here)
            count += e != 0
    row[0] = count - 1
    return here
