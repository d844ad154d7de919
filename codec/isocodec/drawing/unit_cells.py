"""Unit cells of the full grid that a contour crosses: from all known vertices, or from a list of leaves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.store import keys_of
from ..grid.tube.ranks import SIDE, Ranks, Surroundings, enter_page
from ..kernel import inlined, inner, kernel, record
from ..kernel.types import BoolVector, Int32Matrix, Int32Vector, IntMatrix, IntVector, UInt8Vector
from .cube import CubeTable

PIECE = 1 << 14
"""Cells drawn at a time."""


@record
class UnitCells(NamedTuple):
    """Unit cells that the contour passes through.

    Attributes
    ----------
    pattern : (C,) uint8
        Signs of their corners as bits, seen from x0; during the search, the number of mixed leaves.
    corners : (C, 2**n) int32
        Vertices, from x0 on (see `isocodec.drawing.cube`); -1 where none is known.
    upper : (C,) uint8
        The axes along which x0 is the upper end, as bits.
    """

    pattern: UInt8Vector
    corners: Int32Matrix
    upper: UInt8Vector

    @classmethod
    def room(cls, count: int, n: int) -> UnitCells:
        """Allocate cells to be filled in."""
        return cls(np.empty(count, np.uint8), np.empty((count, 2**n), np.int32), np.empty(count, np.uint8))

    def some(self, chosen: slice | NDArray[np.bool_]) -> UnitCells:
        """Take the cells of a slice or mask."""
        return UnitCells(self.pattern[chosen], self.corners[chosen], self.upper[chosen])

    def pieces(self) -> Iterator[UnitCells]:
        """Yield all cells, some at a time."""
        for first in range(0, len(self.pattern), PIECE):
            yield self.some(slice(first, first + PIECE))


# ---- From known vertices ---------------------------------------------------------------------------------------------


def cells_of_pages(numbers: Ranks, table: CubeTable, n: int) -> Iterator[UnitCells]:
    """Yield the cells between known vertices, some at a time, always in the same arrays.

    Cells with an unknown vertex in a mixed simplex are left out. A cell is found with the page of its highest corner.
    """
    side = SIDE[n]
    step = PIECE // side**n
    cells = UnitCells.room(step * side**n, n)
    room, keys = Surroundings.empty(n), keys_of(numbers.known)
    for first in range(0, len(keys), step):
        yield cells.some(slice(_collect(numbers, keys[first : first + step], table.needed, room, cells)))


@inlined
def _mixed(rows, plane, row):
    """Cells between a row and those after it that have known corners above and below, as bits."""
    above = rows[1, row] | rows[1, row + 1]
    below = rows[0, row] & ~rows[1, row] | rows[0, row + 1] & ~rows[1, row + 1]
    if not plane:
        above |= rows[1, row + 9] | rows[1, row + 10]
        below |= rows[0, row + 9] & ~rows[1, row + 9] | rows[0, row + 10] & ~rows[1, row + 10]
    return (above | above >> 1) & (below | below >> 1)


@inlined
def _enter_cell(local, at, upper, needed, cells, used):
    """Enter the cell with its lowest corner at a place of ``local``, if it is to be drawn; returns the new count."""
    plane = len(local) == 33 * 33
    signs = known = np.int64(0)
    corners = cells.corners[np.uint64(used)]
    for corner in range(4 if plane else 8):
        bits = corner ^ upper
        step = (bits & 1) * 33 + (bits >> 1) if plane else (bits & 1) * 81 + (bits >> 1 & 1) * 9 + (bits >> 2)
        entry = np.int64(local[np.uint64(at + step)])
        corners[corner] = (entry >> 1) - 1
        known |= np.int64(entry != 0) << corner
        signs |= (entry & 1) << corner
    # a corner that no mixed simplex has agrees with x0, or each of its simplices would be mixed
    signs |= ~known & -(signs & 1) & (15 if plane else 255)
    cells.pattern[np.uint64(used)], cells.upper[np.uint64(used)] = signs, upper
    lacking = needed[np.uint64(signs)] & ~known
    return used + (lacking == 0 and needed[np.uint64(signs)] != 0)


@kernel
def _collect(numbers: Ranks, keys: IntVector, needed: IntVector, room: Surroundings, cells: UnitCells) -> int:
    """Enter the cells of the pages with these keys; returns their number.

    ``needed`` is the set of corners of the mixed simplices of each pattern, as bits. x0 is the corner with even
    indices.
    """
    rows, local = room.rows, room.local
    plane = len(local) == 33 * 33
    length = 32 if plane else 8
    used = 0
    for number in range(len(keys)):
        enter_page(numbers, keys[number], room)
        for row in range(rows.shape[1] - (1 if plane else 10)):
            i, j = (row, 0) if plane else (row // 9, row % 9)
            if j == 8:
                continue
            mixed = _mixed(rows, plane, row)
            k = 0
            while mixed >> k and k < length:
                if mixed >> k & 1:
                    upper = ~i & 1 | (~k & 1) << 1 if plane else ~i & 1 | (~j & 1) << 1 | (~k & 1) << 2
                    used = _enter_cell(local, row * (length + 1) + k, upper, needed, cells, used)
                k += 1
    return used


# ---- From leaves -----------------------------------------------------------------------------------------------------


def cells_of_leaves(
    last: UInt8Vector, above: NDArray[np.bool_], simplices: NDArray[np.int64], table: CubeTable
) -> tuple[UnitCells, NDArray[np.bool_]]:
    """Find the cells of leaves, and for each leaf whether its cell has all its mixed leaves.

    ``last`` holds the last two bits of each coordinate of the vertices (`enter_last_bits`).
    """
    n = simplices.shape[1] - 1
    # both ends of a diagonal have coordinates that are all even or all odd
    parities = last & _PARITIES[n]
    end = (parities == 0) | (parities == _PARITIES[n])
    seat = np.cumsum(end, dtype=np.int32)
    entered = np.zeros(int(seat[-1]) << n if len(seat) else 0, np.int32)
    seat -= 1
    cells, cell = UnitCells.room(len(simplices), n), np.empty(len(simplices), np.int32)
    cells = cells.some(slice(_join(last, seat, simplices, entered, cells, cell)))
    _enter_patterns(above, cells, table.mixed)
    return cells, cells.pattern[cell] != 0


@kernel
def enter_last_bits(vertex: Int32Matrix, n: int, last: UInt8Vector) -> None:
    """Enter the last two bits of each coordinate: they distinguish the vertices of a cell, upper from lower."""
    for i in range(len(vertex)):
        bits = np.int64(0)
        for axis in range(n):
            bits |= (np.int64(vertex[i, axis]) & 3) << 2 * axis
        last[i] = bits


_LAST = np.int64(0b010101)
_PARITIES = {2: np.uint8(0b0101), 3: np.uint8(0b010101)}
"""The last bits of all coordinates."""


@inner
def _axes(bits):
    """Every second bit."""
    return bits & 1 | bits >> 1 & 2 | bits >> 2 & 4


@inner
def differ(a, b):
    """Set bit i if two vertices of a cell, by their last bits, differ along axis i."""
    return _axes((a ^ b) & _LAST)


@inner
def _upper(a, b):
    """Set bit i if the first of two vertices of a cell is the upper one along axis i.

    Of two bits, a is b + 1 if the last ones differ, and the first ones do exactly if b is odd.
    """
    carries = ~((a ^ b) >> 1 ^ b)
    return _axes((a ^ b) & carries & _LAST)


@kernel
def _join(
    last: UInt8Vector, seat: Int32Vector, simplices: IntMatrix, entered: Int32Vector, cells: UnitCells,
    cell_of: Int32Vector,
) -> int:
    """Enter the simplices' vertices as corners of their cells; returns how many cells there are.

    A cell is known by xn and the axes along which x0 is the upper end. ``entered`` has each cell's number and 1, or 0,
    by the ``seat`` of its xn.
    """
    count, corners, upper = cells.pattern, cells.corners, cells.upper
    n = simplices.shape[1] - 1
    used = 0
    for i in range(len(simplices)):
        start = np.int64(last[simplices[i, 0]])
        axes = _upper(start, np.int64(last[simplices[i, n]]))
        key = np.int64(seat[simplices[i, n]]) << n | axes
        cell = entered[key] - 1
        if cell < 0:
            cell = used
            used += 1
            entered[key] = used
            upper[cell] = axes
            count[cell] = 0
            corners[cell] = -1
        count[cell] += 1
        cell_of[i] = cell
        for j in range(n + 1):
            corners[cell, differ(np.int64(last[simplices[i, j]]), start)] = simplices[i, j]
    return used


@kernel
def _enter_patterns(above: BoolVector, cells: UnitCells, mixed: IntVector) -> None:
    """Enter the signs of each cell as its pattern, in place of the number of its mixed leaves.

    0, which draws nothing, if it lacks some of these.
    """
    pattern, corners = cells.pattern, cells.corners
    for cell in range(len(corners)):
        signs = np.int64(0)
        for corner in range(corners.shape[1]):
            # a corner that no mixed simplex has agrees with x0, or each of its simplices would be mixed
            v = corners[cell, corner] if corners[cell, corner] >= 0 else corners[cell, 0]
            signs |= np.int64(above[v]) << corner
        pattern[cell] = signs if pattern[cell] == mixed[signs] else 0
