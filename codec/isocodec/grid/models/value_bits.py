"""Contexts of a value in the main profile: the values at samples nearby, as far as known (spec clause 7.15).

Whether a sample nearby is there is as good as random, and a branch that cannot be foreseen takes longer than what it
would save: everything is computed, and what is not known is overwritten.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.mixer import blended, mixing
from ...entropy.range_coder import code_below
from ...kernel import inlined, record
from ...kernel.types import IntVector
from ..lattice.access import dimension
from . import contexts as ctx
from .magnitude import CLASSES, FINE, ROUGH, bits, mean, row_of
from .network_rows import VALUE_KIND, VALUE_NET, VALUE_ROW, VALUE_SLOTS
from .value_rows import ValueRows, find_around


@record
class Nearby(NamedTuple):
    """Tables around the values of a list, and bounds from an earlier isovalue.

    Attributes
    ----------
    rows : ValueRows
        Those of the list, by which samples nearby are found; none off the full grid.
    told : (A + 1,) int64
        What is known of each value of the list (`packed`), and last the entry for all others.
    least, most : (V,) int64
        Bounds of the numbers of all vertices; without rows where none are known.
    """

    rows: ValueRows
    told: IntVector
    least: IntVector
    most: IntVector


SAME, OTHER, AXES = range(3)
"""Slots: means of the next samples on the same side of the isovalue and on the other one, then three for each axis."""
LINE, BEFORE, BEHIND = range(3)
_FIRST_2, _FIRST_3 = VALUE_ROW[2], VALUE_ROW[3]
_SLOTS_2, _SLOTS_3 = VALUE_SLOTS[2], VALUE_SLOTS[3]
_LACK_BITS = 6
UNKNOWN = (1 << _LACK_BITS) - 1
"""In place of the bits that a value lacks: nothing is known of it. As a packed number it marks such a value."""


@inlined
def packed(st, number, left, v):
    """Pack what is known of the value at a vertex: twice the middle of where it may lie, and the bits it lacks."""
    middle = (2 * number[v] + 1) << left[v]
    return (middle if st.vertex[v, 3] else -middle) << _LACK_BITS | left[v]


@inlined
def _told(told, way, j):
    """Twice the middle of where a value may lie, seen from one side; the bits it lacks. It is j-th of the list."""
    found = told[np.uint64(j)]
    return way * (found >> _LACK_BITS), found & UNKNOWN


@inlined
def _known(told, way, j):
    """Twice that middle, 0 if nothing is known of the value; whether anything is."""
    middle, lack = _told(told, way, j)
    return middle, np.int64(lack != UNKNOWN)


@inlined
def _show(row, count, first, slot, place, lack, bound, p):
    """List a candidate for twice the number, if it is known; returns how many rows there are."""
    far = place - bound
    known = FINE if lack <= p else ROUGH
    row[np.uint64(count + 1)] = first + row_of(slot, known, abs(far) << 3 >> (p + 1), far < 0)
    return count + np.int64(lack != UNKNOWN)


@inlined
def see_nearby(st, cd, nearby, number, v, p):
    """List what is known of whether bit p of the number of vertex v, the present one of the list, is 1."""
    n = dimension(st.grid.tables)
    first, slots = (_FIRST_2, _SLOTS_2) if n == 2 else (_FIRST_3, _SLOTS_3)
    told, row = nearby.told, cd.blend.row
    bound = (2 * number[v] + 1) << (p + 1)
    fine, rows = np.int64(0), np.int64(0)
    if len(nearby.rows.first) > 0:
        way = np.int64(1 if st.vertex[v, 3] else -1)
        same, other, same_count, other_count = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
        same_lack, other_lack = np.int64(0), np.int64(0)
        find_around(st, nearby.rows, st.value.row, v)
        around = nearby.rows.around
        next_to = st.scratch[: 4 * n]
        for a in range(n):
            slot = AXES + 3 * a
            x, x_lack = _told(told, way, around[np.uint64(4 * a)])
            y, y_lack = _told(told, way, around[np.uint64(4 * a + 1)])
            next_to[4 * a], next_to[4 * a + 1], next_to[4 * a + 2], next_to[4 * a + 3] = x, x_lack, y, y_lack
            for z, lack in ((x, x_lack), (y, y_lack)):
                fine += np.int64(lack <= p)
                here, there = np.int64(z > 0) & np.int64(lack != UNKNOWN), np.int64(z <= 0) & np.int64(lack != UNKNOWN)
                same, same_count, same_lack = same + here * z, same_count + here, max(same_lack, here * lack)
                other, other_count, other_lack = other + there * z, other_count + there, max(other_lack, there * lack)
            rows = _show(row, rows, first, slot + LINE, (x + y) >> 1, max(x_lack, y_lack), bound, p)
            far, lack = _told(told, way, around[np.uint64(4 * a + 2)])
            rows = _show(row, rows, first, slot + BEFORE, 2 * x - far, max(x_lack, lack), bound, p)
            far, lack = _told(told, way, around[np.uint64(4 * a + 3)])
            rows = _show(row, rows, first, slot + BEHIND, 2 * y - far, max(y_lack, lack), bound, p)
        same_lack = same_lack if same_count else np.int64(UNKNOWN)
        other_lack = other_lack if other_count else np.int64(UNKNOWN)
        rows = _show(row, rows, first, SAME, mean(same, same_count), same_lack, bound, p)
        rows = _show(row, rows, first, OTHER, mean(other, other_count), other_lack, bound, p)
        o = 4 * n
        slot = AXES + 3 * n
        for a in range(n - 1):
            for b in range(a + 1, n):
                total, count, worst = np.int64(0), np.int64(0), np.int64(0)
                for k in range(4):
                    x, y = 4 * a + (k & 2), 4 * b + 2 * (k & 1)
                    z, lack = _told(told, way, around[np.uint64(o + k)])
                    x, y = np.uint64(x), np.uint64(y)
                    lack = max(lack, next_to[x + np.uint64(1)], next_to[y + np.uint64(1)])
                    known = np.int64(lack != UNKNOWN)
                    total, count = total + known * (next_to[x] + next_to[y] - z), count + known
                    worst = max(worst, known * lack)
                worst = worst if count else np.int64(UNKNOWN)
                rows = _show(row, rows, first, slot, mean(total, count), worst, bound, p)
                o += 4
                slot += 1
    o = first + slots * 4 * CLASSES
    row[np.uint64(rows + 1)] = o + min(p, 15)
    row[np.uint64(rows + 2)] = o + 16 + min(bits(number[v]), 7)
    row[np.uint64(rows + 3)] = o + 24 + fine
    row[0] = rows + 3


@inlined
def _guessed(st, nearby, v):
    """Predict twice the number of vertex v, the present one of the list, from its neighbours; -1 if they cannot.

    The mean of what lines along axes and planes through three corners of a square predict, and of the mean of the
    neighbours on the same side of the isovalue; without any of these, of lines through two samples on one side.
    """
    n = dimension(st.grid.tables)
    way = np.int64(1 if st.vertex[v, 3] else -1)
    find_around(st, nearby.rows, st.value.row, v)
    told, around = nearby.told, nearby.rows.around
    next_to = st.scratch[: 4 * n]
    total, count, beyond, lines = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    same, some = np.int64(0), np.int64(0)
    for a in range(n):
        before, there = _known(told, way, around[np.uint64(4 * a)])
        behind, here = _known(told, way, around[np.uint64(4 * a + 1)])
        next_to[4 * a], next_to[4 * a + 1], next_to[4 * a + 2], next_to[4 * a + 3] = before, there, behind, here
        same += max(before, np.int64(0)) + max(behind, np.int64(0))
        some += np.int64(before > 0) + np.int64(behind > 0)
        far, line = _known(told, way, around[np.uint64(4 * a + 2)])
        beyond, lines = beyond + (there & line) * (2 * before - far), lines + (there & line)
        far, line = _known(told, way, around[np.uint64(4 * a + 3)])
        beyond, lines = beyond + (here & line) * (2 * behind - far), lines + (here & line)
        total += (there & here) * max((before + behind) >> 1, np.int64(0))
        count += there & here
    o = 4 * n
    for a in range(n - 1):
        for b in range(a + 1, n):
            for k in range(4):
                x, y = np.uint64(4 * a + (k & 2)), np.uint64(4 * b + 2 * (k & 1))
                far, plane = _known(told, way, around[np.uint64(o + k)])
                plane &= next_to[x + np.uint64(1)] & next_to[y + np.uint64(1)]
                total += plane * max(next_to[x] + next_to[y] - far, np.int64(0))
                count += plane
            o += 4
    if some > 0:
        total, count = total + same // some, count + 1
    if count == 0:
        total, count = max(beyond, np.int64(0)), lines
    return total // count if count > 0 else np.int64(-1)


@inlined
def implied_bit(nearby, number, v, p):
    """Bit p of the number of vertex v if it follows from what the number is at least and at most, or -1."""
    if len(nearby.least) == 0:
        return np.int64(-1)
    one = (2 * number[v] + 1) << p
    if nearby.most[v] < one:
        return np.int64(0)
    return np.int64(1 if nearby.least[v] >= one else -1)


@inlined
def code_value_bit(st, cd, nearby, number, v, p, bit):
    """Code bit p of the number of vertex v, the present one of the list; as ``code``."""
    walk = st.value
    context = ctx.VALUE + (p * 2 + np.int64(number[v] != 0)) * 3 + walk.before
    if mixing(cd):
        see_nearby(st, cd, nearby, number, v, p)
        return blended(cd, VALUE_NET, False, VALUE_KIND + min(bits(number[v]), 2), context, bit)
    below = context
    if len(nearby.rows.first) > 0:
        guess = _guessed(st, nearby, v)
        if guess >= 0:
            far = ((guess - ((2 * number[v] + 1) << (p + 1))) * 4) >> (p + 1)
            below = ctx.VALUE_NEAR + (2 * min(p, 15) + np.int64(number[v] != 0)) * 2 * ctx.NEAR
            below += ctx.near_class(far)
    return code_below(cd, below, context, bit)
