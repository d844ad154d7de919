"""Contexts from the vertices around a middle in the main profile (spec clause 7.12)."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...kernel import constant, inlined, inner
from ..lattice.access import corners as corner_count
from ..lattice.access import dimension
from ..lattice.grid import cycle_of
from ..lattice.order import BLOCK, along_rows, block_of
from ..lattice.store import full, page_or_first, put, wipe
from ..lattice.tables import MOST_CORNERS, START, mesh_tables
from ..tube.state import MOST_NEAR
from .network_rows import AROUND, AROUND_SUM, AROUND_SUMS, GROUP, PATTERNS

_FAR = {2: 10, 3: 6}
"""No vertex of the lists is as far as this along an axis, in units of g."""
_REACH_2, _REACH_3 = 7, 4
"""Largest difference from a middle, along an axis."""
_ROW, _SLICE = 80, 16 * 80
"""Entries of a row and of a slice of the copied part of the board: of a block with what is around it, and more."""
assert (1 << BLOCK[3][2]) + 2 * max(_REACH_2, _REACH_3) <= _ROW and ((1 << BLOCK[3][0]) + 2 * _REACH_3) * _ROW <= _SLICE
assert ((1 << BLOCK[2][0]) + 2 * _REACH_2) * _ROW <= MOST_NEAR == ((1 << BLOCK[3][0]) + 2 * _REACH_3) * _SLICE


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


def _as_steps(n: int) -> NDArray[np.int16]:
    """Offsets as steps on the copied part of the board."""
    return (_table(n) @ {2: [_ROW, 1, 0], 3: [_SLICE, _ROW, 1]}[n]).astype(np.int16)


PLANE, SPACE = constant(partial(_table, 2)), constant(partial(_table, 3))
_PLANE_AT, _SPACE_AT = constant(partial(_as_steps, 2)), constant(partial(_as_steps, 3))


def _corners(n: int) -> NDArray[np.int16]:
    """Steps to the corners of diamonds, by their middles' coordinates modulo 4."""
    t, table, steps = mesh_tables(n), PLANE if n == 2 else SPACE, _as_steps(n)
    found = np.zeros((4**n, MOST_CORNERS), np.int16)
    for r in range(n):
        kinds = t[START["KIND"] + 64 * r :][: 4**n]
        for key in np.flatnonzero(kinds >= 0):
            kind = int(kinds[key])
            corner = t[START["CORNER"] + kind * MOST_CORNERS * 3 :][: 3 * t[START["CORNERS"] + kind]].reshape(-1, 3)
            from_middle = corner - (int(key) >> np.array([0, 2, 4]) & 3)
            same = (table[key][None] == from_middle[:, None]).all(axis=2)
            assert same.any(axis=1).all(), "a corner is among the nearest vertices"
            found[key, : len(corner)] = steps[key][same.argmax(axis=1)]
    return found


_CORNER_2, _CORNER_3 = constant(partial(_corners, 2)), constant(partial(_corners, 3))
_BLOCK_2, _SHORT_3 = BLOCK[2][0], BLOCK[3][0]
_FIRST_2, _FIRST_3 = AROUND_SUM[2], AROUND_SUM[3]
_SUMS_2, _SUMS_3 = AROUND_SUMS[2], AROUND_SUMS[3]
# patterns of a group, by the sign that entries of the board are relative to: 2 is the same one
_PATTERN = np.arange(PATTERNS)
_SWAPPED = sum((3 - _PATTERN // 3**i % 3) % 3 * 3**i for i in range(GROUP))
_MIRROR = np.array([_SWAPPED, _PATTERN])
_ORIGIN, _LOW, _HIGH, _COPIED = 0, 3, 6, 9
"""Places in ``State.window``: where the copied part of the board begins, the least and the greatest coordinates of the
middles that it is for, whether there is one."""
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
        st.window[_COPIED] = 0
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
                _enter(st, x >> size, y >> size, z >> size, 1 + sign)
            continue
        x0, x1 = _images(np.int64(x), st.grid.last0, size, reach)
        y0, y1 = _images(np.int64(y), st.grid.last1, size, reach)
        z0, z1 = _images(np.int64(z), st.grid.last2, size, reach)
        if plane:
            z0 = z1 = np.int64(0)
        for i in range(x0, x1 + 1):
            for j in range(y0, y1 + 1):
                for k in range(z0, z1 + 1):
                    _enter(st, i, j, k, 1 + sign)
    return True


@inlined
def _enter(st, x, y, z, entry):
    """Enter a vertex, in units of g, into the board, and into the copied part of it."""
    plane = dimension(st.grid.tables) == 2
    put(st.board, _MARGIN + x, _MARGIN + y, np.int64(0) if plane else _MARGIN + z, entry)
    window, reach = st.window, _REACH_2 if plane else _REACH_3
    x, y, z = along_rows(plane, x, y, z)
    deep = 0 if plane else reach
    if (
        window[_COPIED] and window[_LOW] - reach <= x <= window[_HIGH] + reach
        and window[_LOW + 1] - deep <= y <= window[_HIGH + 1] + deep
        and window[_LOW + 2] - reach <= z <= window[_HIGH + 2] + reach
    ):
        st.near[np.uint64(_near_at(plane, window, x, y, z))] = entry


@inlined
def _near_at(plane, window, x, y, z):
    """Place on the copied part of the board."""
    at = (x - window[_ORIGIN]) * (_ROW if plane else _SLICE)
    return at + (y - window[_ORIGIN + 1]) * _ROW + z - window[_ORIGIN + 2]


@inner
def _copy_near(st, m0, m1, m2):
    """Copy what the board has around a middle, and around those that follow it in its block."""
    plane = dimension(st.grid.tables) == 2
    window, counters = st.window, st.counters
    b0, b1, b2 = block_of(plane, m0, m1, m2)
    low0, low1, low2, high0, high1, high2 = m0, m1, m2, m0, m1, m2
    for i in range(counters.coded, counters.active):
        row = st.active[np.uint64(i)]
        x, y, z = along_rows(plane, np.int64(row[0]), np.int64(row[1]), np.int64(row[2]))
        c0, c1, c2 = block_of(plane, x, y, z)
        if c0 != b0 or c1 != b1 or c2 != b2:
            break
        low0, low1, low2 = min(low0, x), min(low1, y), min(low2, z)
        high0, high1, high2 = max(high0, x), max(high1, y), max(high2, z)
    reach, short = (_REACH_2, _BLOCK_2) if plane else (_REACH_3, _SHORT_3)
    deep = 0 if plane else reach
    window[_ORIGIN], window[_ORIGIN + 1] = (b0 << short) - reach, (b1 << short) - deep
    window[_ORIGIN + 2], window[_COPIED] = (b2 << _BLOCK_2) - reach, 1
    window[_LOW], window[_LOW + 1], window[_LOW + 2] = low0, low1, low2
    window[_HIGH], window[_HIGH + 1], window[_HIGH + 2] = high0, high1, high2
    edge = np.int64(5 if plane else 4)
    first1, end1 = (np.int64(0), np.int64(1)) if plane else (low1 - reach + _MARGIN, high1 + reach + 1 + _MARGIN)
    first0, end0 = low0 - reach + _MARGIN, high0 + reach + 1 + _MARGIN
    first2, end2 = low2 - reach + _MARGIN, high2 + reach + 1 + _MARGIN
    for i in range(first0 >> edge, (end0 - 1 >> edge) + 1):
        for j in range(first1 >> edge, (end1 - 1 >> edge) + 1):
            for k in range(first2 >> edge, (end2 - 1 >> edge) + 1):
                x, y, z = max(first0, i << edge), max(first1, j << edge), max(first2, k << edge)
                last0, last1 = min(end0, i + 1 << edge), min(end1, j + 1 << edge)
                _copy_page(st, plane, x, last0, y, last1, z, min(end2, k + 1 << edge))


@inlined
def _copy_page(st, plane, x0, x1, y0, y1, z0, z1):
    """Copy a part of a page of the board."""
    deep = np.int64(0) if plane else _MARGIN
    page = page_or_first(st.board, x0, z0, np.int64(0)) if plane else page_or_first(st.board, x0, y0, z0)
    cells, near, edge = st.board.pages[np.uint64(page)], st.near, 5 if plane else 4
    inside = (1 << edge) - 1
    for x in range(x0, x1):
        for y in range(y0, y1):
            row = (x & inside) if plane else (x & inside) << edge | y & inside
            at = row << edge | z0 & inside
            to = _near_at(plane, st.window, x - _MARGIN, y - deep, z0 - _MARGIN)
            for i in range(z1 - z0):
                near[np.uint64(to + i)] = cells[np.uint64(at + i)]


@inlined
def _key(w0, w1, w2):
    """A middle's coordinates modulo 4, as one number."""
    return (w0 & 3) | (w1 & 3) << 2 | (w2 & 3) << 4


@inlined
def look_around(st, w0, w1, w2):
    """Find the place of a middle on the copied part of the board, with what is around it; the board is surveyed."""
    plane = dimension(st.grid.tables) == 2
    window = st.window
    x, y, z = along_rows(plane, w0, w1, w2)
    if not (
        window[_COPIED] and window[_LOW] <= x <= window[_HIGH] and window[_LOW + 1] <= y <= window[_HIGH + 1]
        and window[_LOW + 2] <= z <= window[_HIGH + 2]
    ):
        _copy_near(st, x, y, z)
    return _near_at(plane, window, x, y, z)


@inlined
def corners_around(st, diamond, corners):
    """Bits of the corners that are known, and of the known ones above.

    ``corners`` are bits of those that exist.
    """
    plane = dimension(st.grid.tables) == 2
    here = look_around(st, diamond.w0, diamond.w1, diamond.w2)
    key = np.uint64(_key(diamond.w0, diamond.w1, diamond.w2))
    known = above = np.int64(0)
    for i in range(corner_count(st.grid.tables, diamond.kind)):
        step = _CORNER_2[key, np.uint64(i)] if plane else _CORNER_3[key, np.uint64(i)]
        cell = np.int64(st.near[np.uint64(here + step)])
        known |= np.int64(cell != 0) << i
        above |= (cell >> 1) << i
    return known & corners, above & corners


@inlined
def _listed(near, here, steps, row, count, first, mirror):
    """Append the rows of the vertices around a place, a group at a time; returns how many rows there are.

    Indices are unsigned: no test whether they count from the end.
    """
    for i in range(0, len(steps), GROUP):
        a, b = near[np.uint64(here + steps[np.uint64(i)])], near[np.uint64(here + steps[np.uint64(i + 1)])]
        c, d = near[np.uint64(here + steps[np.uint64(i + 2)])], near[np.uint64(here + steps[np.uint64(i + 3)])]
        row[np.uint64(count)] = first + mirror[np.uint64(a + 3 * b + 9 * c + 27 * d)]
        first += PATTERNS
        count += 1
    return count


@inlined
def see_around(st, cd, diamond, here):
    """List the known vertices around a middle as rows.

    They are relative to the sign ``here``, that of the end of the subdivision edge at multiples of 4 g.
    """
    row, mirror = cd.blend.row, _MIRROR[np.uint64(here)]
    at = look_around(st, diamond.w0, diamond.w1, diamond.w2)
    key, r = np.uint64(_key(diamond.w0, diamond.w1, diamond.w2)), diamond.phase
    if dimension(st.grid.tables) == 2:
        row[0] = _listed(st.near, at, _PLANE_AT[key], row, row[0] + 1, _FIRST_2 + r * _SUMS_2, mirror) - 1
    else:
        row[0] = _listed(st.near, at, _SPACE_AT[key], row, row[0] + 1, _FIRST_3 + r * _SUMS_3, mirror) - 1
