"""Contexts of a value: the values at samples nearby, as far as known (spec clauses 7.7, 7.15).

Whether a sample nearby is there is as good as random, and a branch that cannot be foreseen takes longer than what it
would save: everything is computed, and what is not known is 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...entropy.guesses import clear_opinions, decided, hear, say
from ...entropy.mixer import mixing
from ...entropy.range_coder import code, code_below
from ...kernel import inlined, record
from ...kernel.types import IntVector
from ..lattice.access import dimension
from . import contexts as ctx
from .magnitude import bits, mean
from .network_rows import AROUND_VALUE, VALUE_LIST, VALUE_LISTS, VALUE_MIX, VALUE_MIXES
from .value_rows import ValueRows, find_around


@record
class Nearby(NamedTuple):
    """Tables around the values of a list, and bounds from an earlier isovalue.

    Attributes
    ----------
    rows : ValueRows
        Those of the list, by which samples nearby are found; none off the full grid.
    told : (A + 1,) int64
        What is known of each value of the list (`doubled`), and last 0 for all others.
    least, most : (V,) int64
        Bounds of the numbers of all vertices; without rows where none are known.
    """

    rows: ValueRows
    told: IntVector
    least: IntVector
    most: IntVector


@inlined
def doubled(st, number, left, v):
    """Twice the middle of where the value at a vertex may lie, negative below the isovalue; never 0."""
    middle = (2 * number[v] + 1) << left[v]
    return middle if st.vertex[v, 3] else -middle


@inlined
def _look_around(st, nearby, v):
    """Enter the values near vertex v, the present one of the list, as seen from its side; 0 where none is known."""
    way = np.int64(1 if st.vertex[v, 3] else -1)
    around, near = nearby.rows.around, st.scratch
    find_around(st, nearby.rows, st.value.row, v)
    for i in range(len(around)):
        near[np.uint64(i)] = way * nearby.told[np.uint64(around[np.uint64(i)])]


@inlined
def _along(near, a):
    """Values near on an axis: before and behind, one and then two samples away."""
    i = np.uint64(4 * a)
    return near[i], near[i + np.uint64(1)], near[i + np.uint64(2)], near[i + np.uint64(3)]


@inlined
def _across(near, a, b, k, first):
    """Values near on a plane: one step along either axis, the k-th along both; whether all three are known."""
    x, y, z = near[np.uint64(4 * a + (k >> 1))], near[np.uint64(4 * b + (k & 1))], near[np.uint64(first + k)]
    return x, y, z, np.int64(x != 0) & np.int64(y != 0) & np.int64(z != 0)


@inlined
def _leaning(place, there, cut, p):
    """Logit by how far a candidate lies beyond the cut, and its class from 1 on; 0 and 0 if it is not there."""
    half = np.int64(1) << (p + 1)
    logit = (min(max(place - cut, -half), half - 1) << 8) >> (p + 1)
    return there * logit, there * (1 + ((logit + 256) * 7 >> 9))


@inlined
def _hear_around(st, cd, cut, p):
    """List opinions of the values nearby on whether a number lies beyond a cut; half of the rest has p + 1 bits."""
    n, near = dimension(st.grid.tables), st.scratch
    same, sames, other, others = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    for a in range(n):
        for z in (near[np.uint64(4 * a)], near[np.uint64(4 * a + 1)]):
            same, sames = same + max(z, np.int64(0)), sames + np.int64(z > 0)
            other, others = other + min(z, np.int64(0)), others + np.int64(z < 0)
    logit, alike = _leaning(mean(same, sames), np.int64(sames > 0), cut, p)
    say(cd, logit)
    say(cd, _leaning(mean(other, others), np.int64(others > 0), cut, p)[0])
    lines, beyond, planes, of_planes = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    first = AROUND_VALUE
    for a in range(n):
        x, y, x_far, y_far = _along(near, a)
        line, between = _leaning((x + y) >> 1, np.int64(x != 0) & np.int64(y != 0), cut, p)
        back, before = _leaning(2 * x - x_far, np.int64(x != 0) & np.int64(x_far != 0), cut, p)
        on, behind = _leaning(2 * y - y_far, np.int64(y != 0) & np.int64(y_far != 0), cut, p)
        lines, beyond = lines + line, beyond + back + on
        hear(cd, first + (between << 9 | before << 6 | behind << 3 | alike))
        first += VALUE_LIST
    o = 4 * n
    for a in range(n - 1):
        for b in range(a + 1, n):
            total, count = np.int64(0), np.int64(0)
            for k in range(4):
                x, y, z, there = _across(near, a, b, k, o)
                total, count = total + there * (x + y - z), count + there
            across, plane = _leaning(mean(total, count), np.int64(count > 0), cut, p)
            planes, of_planes = planes + across, of_planes << 3 | plane
            o += 4
    hear(cd, AROUND_VALUE + (VALUE_LISTS - 1) * VALUE_LIST + (of_planes << 3 | alike))
    say(cd, lines)
    say(cd, beyond)
    say(cd, planes)


@inlined
def _guessed(st):
    """Predict twice a number from the values nearby; -1 if they cannot.

    The mean of what lines along axes and planes through three corners of a square predict, and of the mean of the
    neighbours on the same side of the isovalue; without any of these, of lines through two samples on one side.
    """
    n, near = dimension(st.grid.tables), st.scratch
    total, count, beyond, lines = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    same, some = np.int64(0), np.int64(0)
    for a in range(n):
        x, y, x_far, y_far = _along(near, a)
        same += max(x, np.int64(0)) + max(y, np.int64(0))
        some += np.int64(x > 0) + np.int64(y > 0)
        for z, far in ((x, x_far), (y, y_far)):
            line = np.int64(z != 0) & np.int64(far != 0)
            beyond, lines = beyond + line * (2 * z - far), lines + line
        both = np.int64(x != 0) & np.int64(y != 0)
        total, count = total + both * max((x + y) >> 1, np.int64(0)), count + both
    o = 4 * n
    for a in range(n - 1):
        for b in range(a + 1, n):
            for k in range(4):
                x, y, z, there = _across(near, a, b, k, o)
                total, count = total + there * max(x + y - z, np.int64(0)), count + there
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
    if len(nearby.rows.first) == 0:
        return code(cd, context, bit)
    _look_around(st, nearby, v)
    cut = (2 * number[v] + 1) << (p + 1)
    if mixing(cd):
        clear_opinions(cd)
        hear(cd, context)
        _hear_around(st, cd, cut, p)
        return decided(cd, VALUE_MIX + min(bits(number[v]), VALUE_MIXES - 1), bit)
    guess = _guessed(st)
    if guess < 0:
        return code(cd, context, bit)
    near = ctx.VALUE_NEAR + (2 * min(p, 15) + np.int64(number[v] != 0)) * 2 * ctx.NEAR
    return code_below(cd, near + ctx.near_class(((guess - cut) * 4) >> (p + 1)), context, bit)
