"""Places where an edge may be crossed, by what is known of crossings nearby (spec clauses 7.14.2 to 7.14.5).

On a grid the curve goes on, in each plane along two axes, from edge to edge of the grid's squares. What is known of the
next two crossings on either side gives candidates for this one: by lines and a cubic through them. Where leaves make up
cubes, their edges are those of a coarser grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, record
from ...kernel.types import BoolVector, Integer, IntMatrix, IntVector
from ..lattice.access import dimension
from .magnitude import FINE, NONE, ROUGH, by_few, mean

UNIT = 4096
"""Positions on an edge and between edges are counted in parts of this."""
MEAN, PLANE, VERTEX, CHAIN, RECENT = 0, 1, 9, 10, 14
"""In ``State.candidates``, two numbers each, the place and how well it is known: the mean of all planes', then for each
plane four; off the full grid those of the ends' other edges, then, for curves, four along the chain of crossings; the
last different places coded."""
LINE, BEFORE, BEHIND, CUBIC = range(4)
MOST_RECENT = 4
SEEN, TURNS, NEXT = range(3)
"""Columns of ``Beside.around``; those from ``NEXT`` on are for the planes, upwards and downwards in each."""
SPAN_SHIFT = 8
"""In the column ``TURNS``, the first bit of along how many axes the ends differ."""
_STEEP = UNIT // 8
"""Distance of crossings below which their line is not extended."""


def _second_crossings() -> NDArray[np.int64]:
    """Make ``_SECOND``: places of the second crossing on a side, by how the curve turns."""
    out = np.zeros((2, 3, 3, 4), np.int64)
    for down, first, second in np.ndindex(out.shape[:3]):
        ahead = UNIT if first == 0 else 0
        # along the edge: where the square begins that the curve leaves by its second crossing
        beside = (0, -UNIT, UNIT)[first]
        if (first == 0) == (second == 0):
            # on an edge of the same direction
            far = 2 * UNIT if first == 0 else UNIT * ((second == 1) == down)
            out[down, first, second] = far, 0, beside, -1
        else:
            along = beside + (UNIT * (first == 2) if second == 0 else UNIT * (second - 1))
            out[down, first, second] = ahead, -1, along, 0
    return out.reshape(18, 4)


_SECOND = _second_crossings()
"""For each way, 0 upwards and 1 downwards, each turn at the first square and each at the second, four numbers: distance
from the edge and place along it, each with a mask for what the place of the second crossing adds."""


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


class _Side(NamedTuple):
    """The next two crossings on one side of an edge: distance from it, place along it, and how well that is known."""

    first: Integer
    first_place: Integer
    first_known: Integer
    second: Integer
    second_place: Integer
    second_known: Integer


def place_of(number, parts):
    """Crossing of an edge in the middle of a part, in parts of ``UNIT``; of numbers or arrays."""
    return (2 * number + 1) * (UNIT // 2) // parts


def seen_of(number, parts):
    """Twice the place where an edge is crossed, and 1 more if a digit of it is coded: what ``Beside.around`` keeps."""
    return 2 * place_of(number, parts) + (parts > 1)


@inlined
def enter_place(around, i, number, parts):
    """Enter where edge i is crossed, of which a digit is coded; returns the place."""
    place = by_few((2 * number + 1) * (UNIT // 2), parts)
    around[i, SEEN] = 2 * place + 1
    return place


@inlined
def _side(around, e, plane, other, down):
    """Follow the curve from edge e upwards or downwards in one of its planes: over two squares.

    Edges that run along the plane's other axis count the same plane as their number ``other``.
    """
    at = np.uint64(e)
    side = 2 * plane + down
    f = np.int64(around[at, np.uint64(NEXT + side)])
    if f < 0:
        return _Side(np.int64(0), np.int64(0), np.int64(NONE), np.int64(0), np.int64(0), np.int64(NONE))
    turn = (np.int64(around[at, np.uint64(TURNS)]) >> 2 * side) & 3
    at = np.uint64(f)
    seen = np.int64(around[at, np.uint64(SEEN)])
    place, known = seen >> 1, ROUGH + (seen & 1)
    ahead = UNIT - place if down else place
    first = UNIT if turn == 0 else ahead
    first_place = place if turn == 0 else (turn - 1) * UNIT
    # it leaves the second square upwards or downwards, seen from there
    side = side if turn == 0 else 2 * other + (turn == 1)
    g = np.int64(around[at, np.uint64(NEXT + side)])
    if g < 0:
        return _Side(first, first_place, known, np.int64(0), np.int64(0), np.int64(NONE))
    case = np.uint64(9 * down + 3 * turn + ((np.int64(around[at, np.uint64(TURNS)]) >> 2 * side) & 3))
    seen = np.int64(around[np.uint64(g), np.uint64(SEEN)])
    place = seen >> 1
    ahead = UNIT - place if down else place
    second = _SECOND[case, 0] + (_SECOND[case, 1] & ahead)
    second_place = _SECOND[case, 2] + (_SECOND[case, 3] & place)
    return _Side(first, first_place, known, second, second_place, ROUGH + (seen & 1))


@inlined
def _set(w, candidate, place, known):
    w[2 * candidate] = min(max(place, -UNIT), 2 * UNIT)
    w[2 * candidate + 1] = known


@inlined
def _extended(w, side, candidate):
    """The line through the two crossings of one side, at the edge."""
    gap = side.second - side.first
    known = min(side.first_known, side.second_known)
    if known != NONE and gap >= _STEEP:
        place = side.first_place - (side.second_place - side.first_place) * side.first // gap
        _set(w, candidate, place, known)


@inlined
def _cubic(w, c):
    """Extrapolate the cubic through four crossings from lines through two of them."""
    o = 2 * c
    known = min(w[o + 1], w[o + 3], w[o + 5])
    if known != NONE:
        _set(w, c + CUBIC, (4 * w[o] + w[o + 2] + w[o + 4]) // 6, known)


@inlined
def _crossed(st, beside, edges, e, u, length, axis):
    """Coordinate of the crossing on edge e less that of vertex u, in parts of UNIT of a length."""
    a, b = np.int64(st.vertex[edges[e, 0], axis]), np.int64(st.vertex[edges[e, 1], axis])
    place = np.int64(beside.around[e, SEEN]) >> 1
    return ((a - st.vertex[u, axis]) * UNIT + (b - a) * place) // length


@inlined
def _meet(st, beside, crossings, i, e, f, candidate):
    """Intersection of the line through the crossings on edges e and f with edge i (n = 2)."""
    if min(e, f) < 0:
        return
    edges, length = crossings.edges, crossings.length[i]
    u, v = edges[i, 0], edges[i, 1]
    p0 = _crossed(st, beside, edges, e, u, length, 0)
    p1 = _crossed(st, beside, edges, e, u, length, 1)
    d0 = _crossed(st, beside, edges, f, u, length, 0) - p0
    d1 = _crossed(st, beside, edges, f, u, length, 1) - p1
    a0 = (np.int64(st.vertex[v, 0]) - st.vertex[u, 0]) * UNIT // length
    a1 = (np.int64(st.vertex[v, 1]) - st.vertex[u, 1]) * UNIT // length
    across = a0 * d1 - a1 * d0
    if 8 * abs(across) < UNIT * max(abs(d0), abs(d1)) or across == 0:
        return
    place = (p0 * d1 - p1 * d0) * UNIT // across
    rough = crossings.parts[e] == 1 or crossings.parts[f] == 1
    _set(st.candidates, candidate, place, np.int64(ROUGH if rough else FINE))


@inlined
def find_candidates(st, beside, crossings, i):
    """Leave the candidates for an edge; off the full grid, along how many axes its ends differ, else 0."""
    w = st.candidates
    for c in range(RECENT):
        w[2 * c + 1] = NONE
    _find_on_grid(st, beside.around, i)
    span = np.int64(beside.around[i, TURNS]) >> SPAN_SHIFT
    if span > 0:
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
        place, length = np.int64(beside.around[i, SEEN]) >> 1, crossings.length[i]
        near[u, 0] += sign * place * length
        near[v, 0] += sign * (UNIT - place) * length
        near[u, 1] += sign
        near[v, 1] += sign


@inlined
def _find_on_grid(st, around, i):
    """Candidates of all planes and their mean."""
    w = st.candidates
    planes = dimension(st.grid.tables) - 1
    total, count, worst = np.int64(0), np.int64(0), np.int64(FINE)
    for plane in range(planes):
        one = _side(around, i, plane, planes - 1 - plane, np.int64(0))
        two = _side(around, i, plane, planes - 1 - plane, np.int64(1))
        c = PLANE + 4 * plane
        _extended(w, one, c + BEFORE)
        _extended(w, two, c + BEHIND)
        known = min(one.first_known, two.first_known)
        span = one.first + two.first
        if known != NONE and span > 0:
            _set(w, c + LINE, (one.first_place * two.first + two.first_place * one.first) // span, known)
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
