"""Contexts of a value in the main profile: the values at samples nearby, as far as known (spec clause 7.15).

Whether a sample nearby is there is as good as random, and a branch that cannot be foreseen takes longer than what it
would save: everything is computed, and what is not known is overwritten.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...entropy.mixer import blended, mixing
from ...entropy.range_coder import code_below
from ...kernel import inlined, kernel, record
from ...kernel.types import Int32Matrix, Int32Vector, IntMatrix, IntVector
from ..lattice.access import dimension
from ..tube.ranks import Ranks, number_at
from ..tube.state import State
from . import contexts as ctx
from .magnitude import CLASSES, FINE, ROUGH, bits, mean, row_of
from .network_rows import VALUE_KIND, VALUE_NET, VALUE_ROW, VALUE_SLOTS


@record
class Nearby(NamedTuple):
    """Tables around the values of a list, and bounds from an earlier isovalue.

    Attributes
    ----------
    near : (A, S) int32
        See `nearby_samples`; without rows off the full grid.
    told : (A + 1,) int64
        What is known of each value of the list (`packed`), and last the entry for all others.
    least, most : (V,) int64
        Bounds of the numbers of all vertices; without rows where none are known.
    """

    near: Int32Matrix
    told: IntVector
    least: IntVector
    most: IntVector


def nearby_samples(st: State, numbers: Ranks, active: NDArray[np.int64], n: int) -> NDArray[np.int32]:
    """Places in the list of the vertices near each vertex of a list, or the list's length, (A, S).

    For each axis those 1 before, 1 behind, 2 before and 2 behind, then for each two axes the four across.
    """
    unit = np.eye(3, dtype=np.int64)
    steps = [unit[axis] * far for axis in range(n) for far in (-1, 1, -2, 2)]
    for a, b in combinations(range(n), 2):
        steps += [unit[a] * i + unit[b] * j for i, j in product((-1, 1), repeat=2)]
    listed = np.full(len(st.vertex) + 1, len(active), np.int32)
    listed[active] = np.arange(len(active))
    out = np.empty((len(active), len(steps)), np.int32)
    _enter_nearby(st, numbers, active, listed, np.array(steps), out)
    return out


@kernel
def _enter_nearby(
    st: State, numbers: Ranks, active: IntVector, listed: Int32Vector, steps: IntMatrix, out: Int32Matrix
) -> None:
    """Enter the places of the vertices so many steps from each of the list.

    ``listed`` has the place of each vertex and, last, that of none.
    """
    box = st.grid
    for i in range(len(active)):
        v = active[i]
        for k in range(len(steps)):
            x, y, z = st.vertex[v, 0] + steps[k, 0], st.vertex[v, 1] + steps[k, 1], st.vertex[v, 2] + steps[k, 2]
            inside = min(x, y, z) >= 0 and x <= box.last0 and y <= box.last1 and z <= box.last2
            u = number_at(numbers, x, y, z) if inside else np.int64(-1)
            out[i, k] = listed[u]


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
def _show(row, count, first, slot, place, lack, bound, p):
    """List a candidate for twice the number, if it is known; returns how many rows there are."""
    far = place - bound
    known = FINE if lack <= p else ROUGH
    row[np.uint64(count + 1)] = first + row_of(slot, known, abs(far) << 3 >> (p + 1), far < 0)
    return count + np.int64(lack != UNKNOWN)


@inlined
def see_nearby(st, cd, nearby, i, number, v, p):
    """List what is known of whether bit p of the number of vertex v, the i-th of the list, is 1."""
    n = dimension(st.grid.tables)
    first, slots = (_FIRST_2, _SLOTS_2) if n == 2 else (_FIRST_3, _SLOTS_3)
    near, told, row = nearby.near, nearby.told, cd.blend.row
    bound = (2 * number[v] + 1) << (p + 1)
    fine, rows = np.int64(0), np.int64(0)
    if len(near) > 0:
        way = np.int64(1 if st.vertex[v, 3] else -1)
        same, other, same_count, other_count = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
        same_lack, other_lack = np.int64(0), np.int64(0)
        around = near[np.uint64(i)]
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
    told, around = nearby.told, nearby.near[np.uint64(st.value.item)]
    next_to = st.scratch[: 4 * n]
    total, count, beyond, lines = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    same, some = np.int64(0), np.int64(0)
    for a in range(n):
        for s in range(2):
            x, lack = _told(told, way, around[np.uint64(4 * a + s)])
            next_to[4 * a + 2 * s], next_to[4 * a + 2 * s + 1] = x, lack
            if lack != UNKNOWN:
                if x > 0:
                    same, some = same + x, some + 1
                far, lack = _told(told, way, around[np.uint64(4 * a + 2 + s)])
                if lack != UNKNOWN:
                    beyond, lines = beyond + 2 * x - far, lines + 1
        if max(next_to[4 * a + 1], next_to[4 * a + 3]) != UNKNOWN:
            total, count = total + max((next_to[4 * a] + next_to[4 * a + 2]) >> 1, np.int64(0)), count + 1
    o = 4 * n
    for a in range(n - 1):
        for b in range(a + 1, n):
            for k in range(4):
                x, y = 4 * a + (k & 2), 4 * b + 2 * (k & 1)
                far, lack = _told(told, way, around[np.uint64(o + k)])
                if max(lack, next_to[x + 1], next_to[y + 1]) != UNKNOWN:
                    total, count = total + max(next_to[x] + next_to[y] - far, np.int64(0)), count + 1
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
        see_nearby(st, cd, nearby, walk.item, number, v, p)
        return blended(cd, VALUE_NET, False, VALUE_KIND + min(bits(number[v]), 2), context, bit)
    below = context
    if len(nearby.near) > 0:
        guess = _guessed(st, nearby, v)
        if guess >= 0:
            far = ((guess - ((2 * number[v] + 1) << (p + 1))) * 4) >> (p + 1)
            below = ctx.VALUE_NEAR + (2 * min(p, 15) + np.int64(number[v] != 0)) * 2 * ctx.NEAR
            below += ctx.near_class(far)
    return code_below(cd, below, context, bit)
