"""Contexts from the vertices around a middle in the main profile (spec clause 7.12)."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...kernel import constant, inlined, inner
from ...kernel.flat import flat
from ..lattice.access import corners as corner_count
from ..lattice.access import dimension
from ..lattice.grid import cycle_of
from ..lattice.store import PAGES, full, page_or_first, put, wipe
from ..lattice.tables import MOST_CORNERS, START, mesh_tables
from .network_rows import AROUND, AROUND_SUM, AROUND_SUMS, GROUP, PATTERNS

_FAR = {2: 10, 3: 6}
"""No vertex of the lists is as far as this along an axis, in units of g."""
_REACH_2, _REACH_3 = 7, 4
"""Largest difference from a middle, along an axis."""


def nearest_vertices(n: int, phase: int) -> NDArray[np.int64]:
    """Vertices of the next level nearest to a middle of level phase (mod n), as differences in units of g.

    The axes along which the middle's coordinate is odd come first; along these the subdivision edge runs from
    -1 to 1. The nearest come first, those of equal distance in lexicographic order.
    """
    odd = n - phase
    d = np.indices((2 * _FAR[n] - 1,) * n).reshape(n, -1).T + 1 - _FAR[n]
    count = ((d + (np.arange(n) < odd)) % 2).sum(axis=1)
    found = d[d.any(axis=1) & ((count == 0) | (count >= odd))]
    # stable, and the differences are in lexicographic order
    return found[np.argsort((found * found).sum(axis=1), kind="stable")[: AROUND[n]]]


def _table(n: int) -> NDArray[np.int64]:
    """Offsets for all middles, by their coordinates modulo 4: from end to end the edge may run either way."""
    table = np.zeros((4**n, AROUND[n], 3), np.int64)
    nearest = [nearest_vertices(n, phase) for phase in range(n)]
    for key in range(4**n):
        w = [key >> 2 * axis & 3 for axis in range(n)]
        odd = [axis for axis in range(n) if w[axis] & 1]
        axes = odd + [axis for axis in range(n) if not w[axis] & 1]
        if odd:
            for place, axis in enumerate(axes):
                table[key, :, axis] = nearest[n - len(odd)][:, place] * (-1 if w[axis] == 3 else 1)
    assert abs(table).max() == (_REACH_2 if n == 2 else _REACH_3)
    return table


def _as_numbers(n: int) -> NDArray[np.int16]:
    """Offsets as one number: differences of x * 64 + y, or of x * 1024 + y * 32 + z."""
    return (_table(n) @ {2: [64, 1, 0], 3: [1024, 32, 1]}[n]).astype(np.int16)


PLANE, SPACE = constant(partial(_table, 2)), constant(partial(_table, 3))
_PLANE_AT, _SPACE_AT = constant(partial(_as_numbers, 2)), constant(partial(_as_numbers, 3))


def _corners(n: int) -> NDArray[np.int64]:
    """Corners of diamonds, by their middles' coordinates modulo 4: which of the vertices of the lists they are."""
    t, table = mesh_tables(n), PLANE if n == 2 else SPACE
    found = np.zeros((4**n, MOST_CORNERS), np.int64)
    for r in range(n):
        kinds = t[START["KIND"] + 64 * r :][: 4**n]
        for key in np.flatnonzero(kinds >= 0):
            kind = int(kinds[key])
            corner = t[START["CORNER"] + kind * MOST_CORNERS * 3 :][: 3 * t[START["CORNERS"] + kind]].reshape(-1, 3)
            from_middle = corner - (int(key) >> np.array([0, 2, 4]) & 3)
            same = (table[key][None] == from_middle[:, None]).all(axis=2)
            assert same.any(axis=1).all(), "a corner is among the nearest vertices"
            found[key, : len(corner)] = same.argmax(axis=1)
    return found


CORNER_2, CORNER_3 = constant(partial(_corners, 2)), constant(partial(_corners, 3))
_COUNT_2, _COUNT_3 = AROUND[2], AROUND[3]
_FIRST_2, _FIRST_3 = AROUND_SUM[2], AROUND_SUM[3]
_SUMS_2, _SUMS_3 = AROUND_SUMS[2], AROUND_SUMS[3]
# patterns of a group, by the sign that entries of the board are relative to: 2 is the same one
_PATTERN = np.arange(PATTERNS)
_SWAPPED = sum((3 - _PATTERN // 3**i % 3) % 3 * 3**i for i in range(GROUP))
_MIRROR = np.array([_SWAPPED, _PATTERN])
_PAGES = 2
_MARGIN = 32
"""Margin of the board, in units of g: whole pages, and more than windows reach."""


@inlined
def _images(x, last, size, reach):
    """First and last place along an axis, in units of g, of a vertex and its images; none if the last comes first.

    A vertex on the border of the box is the image of all places beyond (clause 4.6); windows reach so far.
    """
    first = -reach if x == 0 else (x + (np.int64(1) << size) - 1) >> size
    return first, (x >> size) + (reach + 2 if x == last else 0)


@inner
def survey(st):
    """Enter the vertices that have become known since the last time into the board; False if it lacks room.

    The board shows the lattice of the present level in units of g, ``_MARGIN`` beyond the box: 0 where nothing is
    known, else 1 + the sign.
    """
    counters = st.counters
    if counters.boarded == counters.vertices and counters.board_edge == counters.edge:
        return True
    if counters.board_edge != counters.edge:
        wipe(st.board)
        st.window[0] = 0
        counters.board_edge, counters.boarded = counters.edge, 0
    plane = dimension(st.grid.tables) == 2
    reach = _REACH_2 if plane else _REACH_3
    # of g, which is half the edge
    size = st.grid.exponent - cycle_of(dimension(st.grid.tables), counters.level) - 1
    while counters.boarded < counters.vertices:
        # a vertex and its images reach over two pages along each axis
        if full(st.board, 8):
            return False
        x, y, z, sign = st.vertex[counters.boarded]
        counters.boarded += 1
        if 0 < x < st.grid.last0 and 0 < y < st.grid.last1 and (plane or 0 < z < st.grid.last2):
            # it has no images; those of finer levels are not on this lattice
            if (x | y | z) & (np.int64(1) << size) - 1 == 0:
                deep = np.int64(0) if plane else _MARGIN + (z >> size)
                put(st.board, _MARGIN + (x >> size), _MARGIN + (y >> size), deep, 1 + sign)
            continue
        x0, x1 = _images(np.int64(x), st.grid.last0, size, reach)
        y0, y1 = _images(np.int64(y), st.grid.last1, size, reach)
        z0, z1 = _images(np.int64(z), st.grid.last2, size, reach)
        if plane:
            z0 = z1 = np.int64(0)
        for i in range(x0, x1 + 1):
            for j in range(y0, y1 + 1):
                for k in range(z0, z1 + 1):
                    put(st.board, _MARGIN + i, _MARGIN + j, k if plane else _MARGIN + k, 1 + sign)
    return True


@inlined
def _as_differences(near, count):
    """Replace numbers of pages by what exclusive or makes them of: vectors compute them faster than they look them up.

    The number of page i is that of all places whose bits are bits of i.
    """
    bit = 1
    while bit < count:
        for i in range(count):
            if i & bit:
                near[i] ^= near[i ^ bit]
        bit *= 2


@inlined
def _short(number):
    """A number in 32 bits: a vector has twice as many of them. So many places the board may have."""
    return np.int32(number)


@inlined
def _places_2(near, table, at, out):
    """Places on the board of so many vertices, given from the corner of two by two pages, a coordinate in 6 bits."""
    n0, n1, n2, n3 = _short(near[0]), _short(near[1]), _short(near[2]), _short(near[3])
    at = _short(at)
    for i in range(len(table)):
        s = _short(at + table[i])
        y, x = _short(-_short(s >> 5 & 1)), _short(-_short(s >> 11 & 1))
        page = _short(n0 ^ (y & n1) ^ (x & n2) ^ (x & y & n3))
        out[i] = _short(page << 10) | _short(s >> 1 & 0x3E0) | _short(s & 31)


@inlined
def _places_3(near, table, at, out):
    """Places for n = 3, a coordinate in 5 bits."""
    n0, n1, n2, n3 = _short(near[0]), _short(near[1]), _short(near[2]), _short(near[3])
    n4, n5, n6, n7 = _short(near[4]), _short(near[5]), _short(near[6]), _short(near[7])
    at = _short(at)
    for i in range(len(table)):
        s = _short(at + table[i])
        z, y, x = _short(-_short(s >> 4 & 1)), _short(-_short(s >> 9 & 1)), _short(-_short(s >> 14 & 1))
        page = _short(n0 ^ (z & (n1 ^ (y & n3))) ^ (y & n2) ^ (x & (n4 ^ (z & (n5 ^ (y & n7))) ^ (y & n6))))
        out[i] = _short(page << 12) | _short(s >> 2 & 0xF00) | _short(s >> 1 & 0xF0) | _short(s & 15)


@inlined
def _listed(cells, row, count, first, mirror, places):
    """Append the rows of the vertices on the board, a group at a time; returns how many rows there are.

    Indices are unsigned: no test whether they count from the end.
    """
    for i in range(0, len(places), GROUP):
        a, b = cells[np.uint64(places[np.uint64(i)])], cells[np.uint64(places[np.uint64(i + 1)])]
        c, d = cells[np.uint64(places[np.uint64(i + 2)])], cells[np.uint64(places[np.uint64(i + 3)])]
        row[np.uint64(count)] = first + mirror[np.uint64(a + 3 * b + 9 * c + 27 * d)]
        first += PATTERNS
        count += 1
    return count


@inlined
def _window(st, q0, q1, q2):
    """Find the pages of the board at a corner: two along each axis, the last axis first, as differences.

    Middles that follow one another are near one another: mostly the pages are those of the middle before.
    """
    board, window = st.board, st.window
    corner = (q0 << 40 | q1 << 20 | q2) + 1
    if window[0] == corner and window[1] == board.head[PAGES]:
        return
    window[0], window[1] = corner, board.head[PAGES]
    near = window[_PAGES : _PAGES + 8]
    plane = dimension(st.grid.tables) == 2
    edge = 5 if plane else 4
    for i in range(4 if plane else 8):
        a, b, c = (i >> 1, i & 1, 0) if plane else (i >> 2, i >> 1 & 1, i & 1)
        near[i] = page_or_first(board, (q0 + a) << edge, (q1 + b) << edge, (q2 + c) << edge)
    _as_differences(near, 4 if plane else 8)


@inlined
def _key(w0, w1, w2):
    """A middle's coordinates modulo 4, as one number."""
    return (w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4


@inlined
def look_around(st, w0, w1, w2):
    """Find the places on the board of the vertices around a middle. The board has been surveyed."""
    near = st.window[_PAGES : _PAGES + 8]
    p0, p1, p2 = w0 + _MARGIN, w1 + _MARGIN, w2 + _MARGIN
    if dimension(st.grid.tables) == 2:
        q0, q1 = (p0 - _REACH_2) >> 5, (p1 - _REACH_2) >> 5
        _window(st, q0, q1, np.int64(0))
        _places_2(near, _PLANE_AT[np.uint64(_key(w0, w1, w2))], (p0 - (q0 << 5)) << 6 | (p1 - (q1 << 5)), st.place)
    else:
        q0, q1, q2 = (p0 - _REACH_3) >> 4, (p1 - _REACH_3) >> 4, (p2 - _REACH_3) >> 4
        _window(st, q0, q1, q2)
        at = (p0 - (q0 << 4)) << 10 | (p1 - (q1 << 4)) << 5 | (p2 - (q2 << 4))
        _places_3(near, _SPACE_AT[np.uint64(_key(w0, w1, w2))], at, st.place)


@inlined
def corners_around(st, diamond, corners):
    """Bits of the corners that are known, and of the known ones above; `look_around` has found them.

    ``corners`` are bits of those that exist.
    """
    key = np.uint64(_key(diamond.w0, diamond.w1, diamond.w2))
    cells = flat(st.board.pages)
    known = above = np.int64(0)
    plane = dimension(st.grid.tables) == 2
    for i in range(corner_count(st.grid.tables, diamond.kind)):
        at = CORNER_2[key, np.uint64(i)] if plane else CORNER_3[key, np.uint64(i)]
        cell = np.int64(cells[np.uint64(st.place[np.uint64(at)])])
        known |= np.int64(cell != 0) << i
        above |= (cell >> 1) << i
    return known & corners, above & corners


@inlined
def see_around(st, cd, r, here):
    """List the known vertices around a middle, as `look_around` has found them, as rows.

    They are relative to the sign ``here``, that of the end of the subdivision edge at multiples of 4 g.
    """
    row = cd.blend.row
    plane = dimension(st.grid.tables) == 2
    first = _FIRST_2 + r * _SUMS_2 if plane else _FIRST_3 + r * _SUMS_3
    places = st.place[:_COUNT_2] if plane else st.place[:_COUNT_3]
    row[0] = _listed(flat(st.board.pages), row, row[0] + 1, first, _MIRROR[np.uint64(here)], places) - 1
