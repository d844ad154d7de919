"""Places where an edge may be crossed, by what is known of crossings nearby (spec clauses 7.14.2 to 7.14.5).

On a grid the curve goes on, in each plane along two axes, from edge to edge of the grid's squares. What is known of the
next two crossings on either side gives candidates for this one: by lines and a cubic through them. Where leaves make up
cubes, their edges are those of a coarser grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import inlined, record
from ...kernel.types import BoolVector, Integer, IntMatrix, IntVector
from ..lattice.access import dimension
from ..tube.state import entry
from .magnitude import FINE, NONE, ROUGH, mean

UNIT = 4096
"""Positions on an edge and between edges are counted in parts of this."""
MEAN, PLANE, VERTEX, CHAIN, RECENT = 0, 1, 9, 10, 14
"""In ``State.candidates``, two numbers each, the place and how well it is known: the mean of all planes', then for each
plane four; off the full grid those of the ends' other edges, then, for curves, four along the chain of crossings; the
last different places coded."""
LINE, BEFORE, BEHIND, CUBIC = range(4)
MOST_RECENT = 4
_POINTS = 64
"""First of the crossings next to the edge, behind the candidates, three numbers each: distance from the edge, place
along it, how well it is known. Two on either side."""
_STEEP = UNIT // 8
"""Distance of crossings below which their line is not extended."""


@record
class Crossings(NamedTuple):
    """Edges that carry offsets, and what is known of where they are crossed (spec clause 5.7).

    Attributes
    ----------
    edges : (E, 2) int64
        Vertices at the lower and upper ends.
    number, parts : (E,) int64
        Parts of each, and the number of the one that holds the crossing, from the lower end; passes change them.
    length : (E,) int64
        In samples.
    rising : (E,) bool
        Whether the upper end is above.
    earlier : (E, 2) int64
        Number and parts at an earlier isovalue, 0 parts where it has none; no rows if there is no such isovalue.
    """

    edges: IntMatrix
    number: IntVector
    parts: IntVector
    length: IntVector
    rising: BoolVector
    earlier: IntMatrix


class _Square(NamedTuple):
    """An edge of the grid from (x, y, z) along axis a, of length ``edge``, in the plane of the axes a and b."""

    x: Integer
    y: Integer
    z: Integer
    a: Integer
    b: Integer
    edge: Integer


def place_of(number, parts):
    """Crossing of an edge in the middle of a part, in parts of ``UNIT``; of numbers or arrays."""
    return (2 * number + 1) * (UNIT // 2) // parts


@inlined
def _near(st, square, i, j):
    """Store entry of the vertex i edges along axis a and j along b from (x, y, z); 0 off the box."""
    a, b = square.a, square.b
    i, j = i * square.edge, j * square.edge
    x = square.x + i * (a == 0) + j * (b == 0)
    y = square.y + i * (a == 1) + j * (b == 1)
    z = square.z + i * (a == 2) + j * (b == 2)
    if min(x, y, z) < 0 or x > st.grid.last0 or y > st.grid.last1 or z > st.grid.last2:
        return np.int64(0)
    return entry(st, x, y, z)


@inlined
def _beyond(st, beside, square, e, i, j, s, t):
    """Store entry of the vertex s edges along axis a and t along b from that at (i, j), whose entry is e: one edge."""
    if len(beside.links) > 0:
        axis = square.a if s != 0 else square.b
        return np.int64(beside.links[np.uint64((e >> 1) - 1), np.uint64(2 * axis + (s + t < 0))])
    return _near(st, square, i + s, j + t)


@inlined
def _follow(st, beside, crossings, square, low, high, way, out):
    """Follow the curve from the edge of a square into the direction ``way`` of b; leaves two crossings.

    ``low`` and ``high`` are the store entries of the edge's ends.
    """
    w = st.candidates
    w[out + 2] = NONE
    w[out + 5] = NONE
    # the lower end of the edge reached, whether it runs along b, and where the curve leaves it to
    i, j, turned, step = np.int64(0), np.int64(0), False, way
    for k in range(2):
        s, t = (step, 0) if turned else (0, step)
        low_there = _beyond(st, beside, square, low, i, j, s, t)
        high_there = _beyond(st, beside, square, high, i + (not turned), j + turned, s, t)
        if low_there == 0 or high_there == 0:
            return
        at_low, at_high = (low ^ low_there) & 1, (high ^ high_there) & 1
        if at_low and at_high:
            return
        if at_low or at_high:
            if at_high:
                i, j = i + (not turned), j + turned
                low, low_there = high, high_there
            high = low_there
            if step < 0:
                i, j = i + s, j + t
                low, high = high, low
            turned = not turned
            step = 1 if at_high else -1
        else:
            i, j = i + s, j + t
            low, high = low_there, high_there
        found = np.int64(beside.grid[np.uint64((low >> 1) - 1), np.uint64(square.b if turned else square.a)])
        if found < 0:
            return
        e = np.uint64(found)
        if crossings.length[e] != square.edge:
            return
        place = beside.place[e]
        w[out + 3 * k] = way * (j * UNIT + (place if turned else 0))
        w[out + 3 * k + 1] = i * UNIT + (0 if turned else place)
        w[out + 3 * k + 2] = ROUGH if crossings.parts[e] == 1 else FINE


@inlined
def _set(w, candidate, place, known):
    w[2 * candidate] = min(max(place, -UNIT), 2 * UNIT)
    w[2 * candidate + 1] = known


@inlined
def _extended(w, at, candidate):
    """The line through the two crossings of one side, at the edge."""
    gap = w[at + 3] - w[at]
    known = min(w[at + 2], w[at + 5])
    if known != NONE and gap >= _STEEP:
        _set(w, candidate, w[at + 1] - (w[at + 4] - w[at + 1]) * w[at] // gap, known)


@inlined
def _cubic(w, c):
    """Extrapolate the cubic through four crossings from lines through two of them."""
    o = 2 * c
    known = min(w[o + 1], w[o + 3], w[o + 5])
    if known != NONE:
        _set(w, c + CUBIC, (4 * w[o] + w[o + 2] + w[o + 4]) // 6, known)


@inlined
def _crossed(st, places, edges, e, u, length, axis):
    """Coordinate of the crossing on edge e less that of vertex u, in parts of UNIT of a length."""
    a, b = np.int64(st.vertex[edges[e, 0], axis]), np.int64(st.vertex[edges[e, 1], axis])
    return ((a - st.vertex[u, axis]) * UNIT + (b - a) * places[e]) // length


@inlined
def _meet(st, beside, crossings, i, e, f, candidate):
    """Intersection of the line through the crossings on edges e and f with edge i (n = 2)."""
    if min(e, f) < 0:
        return
    places, edges, length = beside.place, crossings.edges, crossings.length[i]
    u, v = edges[i, 0], edges[i, 1]
    p0 = _crossed(st, places, edges, e, u, length, 0)
    p1 = _crossed(st, places, edges, e, u, length, 1)
    d0 = _crossed(st, places, edges, f, u, length, 0) - p0
    d1 = _crossed(st, places, edges, f, u, length, 1) - p1
    a0 = (np.int64(st.vertex[v, 0]) - st.vertex[u, 0]) * UNIT // length
    a1 = (np.int64(st.vertex[v, 1]) - st.vertex[u, 1]) * UNIT // length
    across = a0 * d1 - a1 * d0
    if 8 * abs(across) < UNIT * max(abs(d0), abs(d1)) or across == 0:
        return
    place = (p0 * d1 - p1 * d0) * UNIT // across
    rough = crossings.parts[e] == 1 or crossings.parts[f] == 1
    _set(st.candidates, candidate, place, np.int64(ROUGH if rough else FINE))


@inlined
def _span(st, u, v):
    """Along how many axes two vertices differ, and the first of these axes."""
    span, axis = np.int64(0), np.int64(0)
    lower, upper = st.vertex[np.uint64(u)], st.vertex[np.uint64(v)]
    for a in range(2, -1, -1):
        if lower[a] != upper[a]:
            span, axis = span + 1, np.int64(a)
    return span, axis


@inlined
def find_candidates(st, beside, crossings, i):
    """Leave the candidates for an edge; off the full grid, along how many axes its ends differ, else 0."""
    for c in range(RECENT):
        st.candidates[2 * c + 1] = NONE
    span, axis = _span(st, crossings.edges[i, 0], crossings.edges[i, 1])
    if len(beside.grid) > 0 and span == 1:
        _find_on_grid(st, beside, crossings, i, axis)
    if len(beside.near) == 0:
        return np.int64(0)
    _find_off_grid(st, beside, crossings, i)
    return span


@inlined
def _find_off_grid(st, beside, crossings, i):
    """Collect candidates from the ends of an edge of leaves and from the chain of crossings."""
    w, chain, near, length = st.candidates, beside.chain, beside.near, crossings.length[i]
    u, v = crossings.edges[i, 0], crossings.edges[i, 1]
    if near[u, 1] > 0 and near[v, 1] > 0:
        a, b = near[u, 0] // near[u, 1], near[v, 0] // near[v, 1]
        if a + b > 0:
            _set(w, np.int64(VERTEX), a * UNIT // (a + b), np.int64(FINE))
    elif near[u, 1] > 0:
        _set(w, np.int64(VERTEX), near[u, 0] // (near[u, 1] * length), np.int64(ROUGH))
    elif near[v, 1] > 0:
        _set(w, np.int64(VERTEX), UNIT - near[v, 0] // (near[v, 1] * length), np.int64(ROUGH))
    if len(chain) > 0:
        _meet(st, beside, crossings, i, chain[i, 0], chain[i, 2], np.int64(CHAIN + LINE))
        _meet(st, beside, crossings, i, chain[i, 0], chain[i, 1], np.int64(CHAIN + BEFORE))
        _meet(st, beside, crossings, i, chain[i, 2], chain[i, 3], np.int64(CHAIN + BEHIND))
        _cubic(w, np.int64(CHAIN))


@inlined
def count_near(beside, crossings, i, sign):
    """Add an edge's crossing to what its ends know of how far crossings are, or take it away."""
    near = beside.near
    if len(near) > 0 and crossings.parts[i] > 1:
        u, v = crossings.edges[i, 0], crossings.edges[i, 1]
        place, length = beside.place[i], crossings.length[i]
        near[u, 0] += sign * place * length
        near[v, 0] += sign * (UNIT - place) * length
        near[u, 1] += sign
        near[v, 1] += sign


@inlined
def _find_on_grid(st, beside, crossings, i, a):
    """Candidates of all planes and their mean for an edge along axis a."""
    u, v = crossings.edges[i, 0], crossings.edges[i, 1]
    w = st.candidates
    lower, upper = st.vertex[np.uint64(u)], st.vertex[np.uint64(v)]
    x, y, z = np.int64(lower[0]), np.int64(lower[1]), np.int64(lower[2])
    low, high = 2 * (u + 1) + lower[3], 2 * (v + 1) + upper[3]
    n = dimension(st.grid.tables)
    total, count, worst = np.int64(0), np.int64(0), np.int64(FINE)
    for plane in range(n - 1):
        b = a + 1 + plane if a + 1 + plane < n else a + 1 + plane - n
        one, two = np.int64(_POINTS), np.int64(_POINTS + 6)
        square = _Square(x, y, z, a, b, crossings.length[i])
        _follow(st, beside, crossings, square, low, high, np.int64(1), one)
        _follow(st, beside, crossings, square, low, high, np.int64(-1), two)
        c = PLANE + 4 * plane
        _extended(w, one, c + BEFORE)
        _extended(w, two, c + BEHIND)
        known = min(w[one + 2], w[two + 2])
        span = w[one] + w[two]
        if known != NONE and span > 0:
            _set(w, c + LINE, (w[one + 1] * w[two] + w[two + 1] * w[one]) // span, known)
        _cubic(w, c)
        o = 2 * c
        line, before, behind = w[o + 1], w[o + 3], w[o + 5]
        # the best that the plane has
        if w[o + 7] != NONE:
            total, count, worst = total + w[o + 6], count + 1, min(worst, w[o + 7])
        elif line != NONE:
            total, count, worst = total + w[o], count + 1, min(worst, line)
        elif before != NONE:
            total, count, worst = total + w[o + 2], count + 1, min(worst, before)
        elif behind != NONE:
            total, count, worst = total + w[o + 4], count + 1, min(worst, behind)
    if count > 0:
        _set(w, MEAN, mean(total, count), worst)


@inlined
def remember(st, place, rising):
    """Make the crossing just coded a candidate for the next ones: it comes first in the list of recent places."""
    w = st.candidates
    place = place if rising else UNIT - place
    o = 2 * RECENT
    i = 0
    while i + 1 < MOST_RECENT and w[o + 2 * i + 1] != NONE and w[o + 2 * i] != place:
        i += 1
    while i > 0:
        w[o + 2 * i] = w[o + 2 * i - 2]
        w[o + 2 * i + 1] = w[o + 2 * i - 1]
        i -= 1
    w[o] = place
    w[o + 1] = FINE
