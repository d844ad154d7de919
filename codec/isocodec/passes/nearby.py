"""What the main profile sees of a value: the values at samples nearby, as far as they are told (spec clause 7.15)."""

from __future__ import annotations

import numpy as np

from ..entropy.blend import clear, see
from ..entropy.main import VALUE_ROW, VALUE_SLOTS
from ..jit import inner
from ..mesh.access import dimension
from .classes import CLASSES, FINE, NONE, ROUGH, bits, mean, row_of
from .state import SCRATCH

SAME, OTHER, AXES = range(3)
"""Slots: means of the next samples on the same side of the isovalue and on the other one, then three for each axis."""
LINE, BEFORE, BEHIND = range(3)
_FIRST_2, _FIRST_3 = VALUE_ROW[2], VALUE_ROW[3]
_SLOTS_2, _SLOTS_3 = VALUE_SLOTS[2], VALUE_SLOTS[3]


@inner
def _told(st, number, left, v, u, p):
    """Twice the middle of where the value at vertex u may lie, seen from the side of vertex v; how well it is known."""
    if u < 0:
        return np.int64(0), np.int64(NONE)
    middle = (2 * number[u] + 1) << left[u]
    return middle if st.vertex[u, 3] == st.vertex[v, 3] else -middle, np.int64(FINE if left[u] <= p else ROUGH)


@inner
def _show(cd, first, slot, place, known, bound, p):
    """List a candidate for twice the number."""
    if known != NONE:
        see(cd, first + row_of(slot, known, abs(place - bound) << 3 >> (p + 1), place < bound))


@inner
def see_nearby(st, cd, near, i, number, left, v, p):
    """List what is known of whether bit p of the number of vertex v, the i-th of the list, is 1."""
    n = dimension(st.tables)
    first, slots = (_FIRST_2, _SLOTS_2) if n == 2 else (_FIRST_3, _SLOTS_3)
    clear(cd)
    bound = (2 * number[v] + 1) << (p + 1)
    fine = np.int64(0)
    if len(near) > 0:
        same, other, same_count, other_count = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
        same_known, other_known = np.int64(FINE), np.int64(FINE)
        w = st.walk[SCRATCH : SCRATCH + 4 * n]
        for a in range(n):
            slot = AXES + 3 * a
            x, x_known = _told(st, number, left, v, near[i, 4 * a], p)
            y, y_known = _told(st, number, left, v, near[i, 4 * a + 1], p)
            w[4 * a], w[4 * a + 1], w[4 * a + 2], w[4 * a + 3] = x, x_known, y, y_known
            for z, known in ((x, x_known), (y, y_known)):
                fine += known == FINE
                if known != NONE and z > 0:
                    same, same_count, same_known = same + z, same_count + 1, min(same_known, known)
                elif known != NONE:
                    other, other_count, other_known = other + z, other_count + 1, min(other_known, known)
            _show(cd, first, slot + LINE, (x + y) >> 1, min(x_known, y_known), bound, p)
            far, known = _told(st, number, left, v, near[i, 4 * a + 2], p)
            _show(cd, first, slot + BEFORE, 2 * x - far, min(x_known, known), bound, p)
            far, known = _told(st, number, left, v, near[i, 4 * a + 3], p)
            _show(cd, first, slot + BEHIND, 2 * y - far, min(y_known, known), bound, p)
        if same_count > 0:
            _show(cd, first, SAME, mean(same, same_count), same_known, bound, p)
        if other_count > 0:
            _show(cd, first, OTHER, mean(other, other_count), other_known, bound, p)
        o = 4 * n
        slot = AXES + 3 * n
        for a in range(n - 1):
            for b in range(a + 1, n):
                total, count, worst = np.int64(0), np.int64(0), np.int64(FINE)
                for k in range(4):
                    x, y = 4 * a + (k & 2), 4 * b + 2 * (k & 1)
                    z, known = _told(st, number, left, v, near[i, o + k], p)
                    known = min(known, w[x + 1], w[y + 1])
                    if known != NONE:
                        total, count, worst = total + w[x] + w[y] - z, count + 1, min(worst, known)
                if count > 0:
                    _show(cd, first, slot, mean(total, count), worst, bound, p)
                o += 4
                slot += 1
    o = first + slots * 4 * CLASSES
    see(cd, o + min(p, 15))
    see(cd, o + 16 + min(bits(number[v]), 7))
    see(cd, o + 24 + fine)
