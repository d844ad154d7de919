"""Ranks of the known vertices by position: what geometry and drawings look up, made when they begin.

The state itself keeps two bits a vertex: vertices are numbered as they become known, and rounds need no number. Here
they are ranked page by page; a vertex's rank leads to its number.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel, record
from ...kernel.types import Int32Matrix, Int32Vector, IntMatrix, IntVector
from ..lattice.store import PAGES, SHIFT, Flags, key_page, page_with, pages_around
from ..lattice.tables import PAGE_SHIFT

_GROUP = 16
"""Entries of a page, one after the other, of which the first one's rank is kept."""


@record
class Ranks(NamedTuple):
    """Ranks of the vertices known at a moment.

    Attributes
    ----------
    known : Store of uint8
        That of the state.
    first : (P, entries / 16) int32
        Known vertices in all pages and entries before each group of 16.
    vertex : (V,) int32
        The vertices' numbers, page by page.
    """

    known: Flags
    first: Int32Matrix
    vertex: Int32Vector


def numbered(known: Flags, vertex: NDArray[np.int32]) -> Ranks:
    """Number the vertices of a store, which are those of rows (V, 4) of position and sign."""
    used, entries = int(known.head[PAGES]), known.pages.shape[1]
    numbers = Ranks(known, np.empty((used, entries // _GROUP), np.int32), np.empty(len(vertex), np.int32))
    _enter_numbers(numbers, vertex)
    return numbers


def bytes_to_number(known: Flags, vertices: int) -> int:
    """Bytes that `numbered` takes beside the store."""
    return 4 * (vertices + int(known.head[PAGES]) * known.pages.shape[1] // _GROUP)


@inlined
def _rank(numbers, page, cell):
    """Number of known vertices before an entry of a page, in all pages."""
    group = cell & -_GROUP
    rank = np.int64(numbers.first[np.uint64(page), np.uint64(cell // _GROUP)])
    entries = numbers.known.pages[np.uint64(page)]
    for i in range(group, cell):
        rank += np.int64(entries[np.uint64(i)] != 0)
    return rank


@kernel
def _enter_numbers(numbers: Ranks, vertex: Int32Matrix) -> None:
    rank = np.int64(0)
    for page in range(len(numbers.first)):
        entries = numbers.known.pages[page]
        for group in range(numbers.first.shape[1]):
            numbers.first[page, group] = rank
            for i in range(group * _GROUP, (group + 1) * _GROUP):
                rank += np.int64(entries[np.uint64(i)] != 0)
    for v in range(len(numbers.vertex)):
        page, cell = page_with(numbers.known, np.int64(vertex[v, 0]), np.int64(vertex[v, 1]), np.int64(vertex[v, 2]), 0)
        numbers.vertex[_rank(numbers, page, cell)] = v


@inlined
def number_at(numbers, x, y, z):
    """Number of the vertex at a position, -1 if none is known there."""
    page, cell = page_with(numbers.known, x, y, z, 0)
    if page < 0 or numbers.known.pages[np.uint64(page), np.uint64(cell)] == 0:
        return np.int64(-1)
    return np.int64(numbers.vertex[np.uint64(_rank(numbers, page, cell))])


@kernel
def enter_numbers_at(numbers: Ranks, position: IntMatrix, out: IntVector) -> None:
    """Enter the numbers of the vertices at positions (E, 3), -1 where none is known."""
    for i in range(len(position)):
        out[i] = number_at(numbers, position[i, 0], position[i, 1], position[i, 2])


# ---- Pages with what lies before them --------------------------------------------------------------------------------

SIDE = {n: 1 << shift for n, shift in PAGE_SHIFT.items()}
"""Entries of a page along each axis."""


@record
class Surroundings(NamedTuple):
    """A page and the last vertices before it along each axis.

    Attributes
    ----------
    near : (11,) int64
        The pages there, as ``pages_around`` enters them.
    local : ((side + 1)**n,) int32
        The vertices: 2 (number + 1) + sign, or 0.
    rows : (2, (side + 1)**(n - 1)) int64
        Which vertices of each row are known, and which of them lie above, as bits.
    """

    near: IntVector
    local: Int32Vector
    rows: IntMatrix

    @classmethod
    def empty(cls, n: int) -> Surroundings:
        """Those of no page."""
        side = SIDE[n] + 1
        return cls(np.empty(11, np.int64), np.empty(side**n, np.int32), np.empty((2, side ** (n - 1)), np.int64))


@inlined
def enter_page(numbers, key, room):
    """Enter the surroundings of the page with a key."""
    head, near, local = numbers.known.head, room.near, room.local
    plane = len(local) == 33 * 33
    length, own = (32, 2) if plane else (8, 1)
    x, y, z = key_page(key)
    pages_around(numbers.known, x << head[SHIFT], y << head[SHIFT + 1], z << head[SHIFT + 2], 1, 1 - plane, near)
    local[:] = 0
    for row in range(room.rows.shape[1]):
        i, j = (row, 0) if plane else (row // 9, row % 9)
        pair = np.int64(i > 0) << 2 | np.int64(j > 0) << 1
        cell = (i - 1 & 31) << 5 if plane else (i - 1 & 7) << 6 | (j - 1 & 7) << 3
        at = row * (length + 1)
        e = _entry(numbers, near[pair], cell + length - 1)
        local[np.uint64(at)] = e
        there, above = np.int64(e != 0), e & 1
        page = near[pair | own]
        if page >= 0:
            entries = numbers.known.pages[np.uint64(page)]
            rank = _rank(numbers, page, cell)
            for k in range(length):
                e = np.int64(entries[np.uint64(cell + k)])
                if e != 0:
                    local[np.uint64(at + 1 + k)] = 2 * (numbers.vertex[np.uint64(rank)] + 1) + (e & 1)
                    rank += 1
                there |= (e >> 1) << 1 + k
                above |= (e & 1) << 1 + k
        room.rows[0, np.uint64(row)], room.rows[1, np.uint64(row)] = there, above


@inlined
def _entry(numbers, page, cell):
    """The vertex of an entry of a page, as in ``Surroundings.local``; 0 for a missing page."""
    if page < 0:
        return np.int64(0)
    e = np.int64(numbers.known.pages[np.uint64(page), np.uint64(cell)])
    if e == 0:
        return e
    return 2 * (np.int64(numbers.vertex[np.uint64(_rank(numbers, page, cell))]) + 1) + (e & 1)
