"""Drawing on the full grid: points on grid edges only, as marching squares and marching cubes have them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import inner, kernel, record
from ..kernel.types import BoolVector, Int32Matrix, Int32Vector, IntMatrix, IntVector, IntVolume, UInt8Vector
from .crossing import Drawn, PatternTable, edge_points, ratios_at
from .cube import cube_table
from .leaves import Leaves


def draw_grid(leaves: Leaves, parts: bool = True) -> tuple[Drawn, NDArray[np.bool_]]:
    """Draw leaves of the finest level; which of them (M,) bool are drawn. ``parts`` asks for `Drawn.part`.

    A saddle (of a cell in 2-D, of a cell's face in 3-D) is resolved by the mesh: the two corners on its diagonal are
    connected. Points that are not on grid edges, in the middle of a few cells (n = 3), come last.

    Cells that lack some of their mixed leaves are left out: what passes through them is not known yet. Those with
    missing corners are drawn, as nothing.
    """
    grid = _Grid(leaves)
    number = grid.find(leaves.edges)
    grid.release()
    ratio, part = ratios_at(leaves, grid.edges, number, parts)
    points, cells = edge_points(leaves, grid.edges, ratio), grid.cells
    if len(grid.owner):
        first = np.flatnonzero(np.diff(grid.owner, prepend=-1))
        count = np.diff(first, append=len(grid.owner))
        centres = np.add.reduceat(points[grid.sides[:, 0]], first) / count[:, None]
        fans = np.column_stack([grid.sides, len(points) + np.repeat(np.arange(len(first)), count)])
        points, cells = np.concatenate([points, centres]), np.concatenate([cells, fans])
    return Drawn(points, cells, grid.edges, ratio, part), grid.drawn


@record
class _Cells(NamedTuple):
    """Unit cells that the contour passes through.

    Attributes
    ----------
    pattern : (C,) uint8
        Signs of their corners as bits; while cells are found, how many mixed leaves each has.
    corners : (C, 2**n) int32
        Vertices, from x0 on.
    upper : (C,) uint8
        The axes along which x0 is the upper end, as bits.
    """

    pattern: UInt8Vector
    corners: Int32Matrix
    upper: UInt8Vector


class _Grid:
    """Pieces of the contour in unit cells, by the grid edges that they meet.

    A grid edge is known by its lower end and its axis: looking that up in an array is faster than sorting.

    Attributes
    ----------
    edges : (E, 2) int64
        Vertices at their ends, the lower first.
    cells : (M, n) int64
        Segments or triangles between points on edges, by numbers of these.
    sides : (S, 2) int64
        Sides of polygons around points in the middle of cells, by numbers of points on edges.
    owner : (S,) int64
        Numbers of their cells, ascending.
    drawn : (M,) bool
        Simplices whose cells have all their mixed leaves; empty where these come in pieces.
    """

    def __init__(self, leaves: Leaves) -> None:
        n = len(leaves.shape)
        table = cube_table(n)
        self._last = np.empty(len(leaves.position), np.uint8)
        _enter_last_bits(leaves.position, self._last)
        self._cells, self.drawn = self._joined(leaves, table.mixed, n)
        if leaves.whole is not None:
            low = leaves.position[self._cells.corners[:, 0]] - (self._cells.upper[:, None] >> np.arange(n) & 1)
            self._cells.pattern[~leaves.whole(low)] = 0
        self._number = np.full((len(leaves.position), n), -1, np.int32)
        self.edges = np.empty((0, 2), np.int64)
        met, self.cells, _ = self._rows(table.cells, 0)
        met, self.sides, count = self._rows(table.fans, met)
        self.owner = np.repeat(np.arange(len(count)), count)
        self.edges.resize((met, 2), refcheck=False)

    def release(self) -> None:
        """Free what only the making of cells and `find` need."""
        del self._last, self._cells, self._number

    def _joined(self, leaves: Leaves, mixed: NDArray[np.int64], n: int) -> tuple[_Cells, NDArray[np.bool_]]:
        """The unit cells of all leaves, and for each simplex whether its cell has all its mixed leaves."""
        # both ends of a diagonal have coordinates that are all even or all odd
        parities = self._last & _PARITIES[n]
        end = (parities == 0) | (parities == _PARITIES[n])
        seat = np.cumsum(end, dtype=np.int32)
        entered = np.zeros(int(seat[-1]) << n if len(seat) else 0, np.int32)
        seat -= 1
        pattern, corners, upper = np.empty(0, np.uint8), np.empty((0, 2**n), np.int32), np.empty(0, np.uint8)
        pieces = [leaves.simplices] if leaves.pieces is None else leaves.pieces()
        cell = np.empty(0, np.int32)
        used = 0
        for simplices in pieces:
            if used + len(simplices) > len(corners):
                room = used + used // 2 + len(simplices)
                # in place: there is no moment at which both are there
                corners.resize((room, 2**n), refcheck=False)
                upper.resize(room, refcheck=False)
                pattern.resize(room, refcheck=False)
            if len(cell) < len(simplices):
                cell = np.empty(len(simplices), np.int32)
            used = _join(self._last, seat, simplices, entered, _Cells(pattern, corners, upper), cell, used)
        del entered, seat
        corners.resize((used, 2**n), refcheck=False)
        upper.resize(used, refcheck=False)
        pattern.resize(used, refcheck=False)
        cells = _Cells(pattern, corners, upper)
        _enter_patterns(leaves.above, cells, mixed)
        return cells, cells.pattern[cell] != 0 if leaves.pieces is None else np.zeros(0, np.bool_)

    def _rows(self, table: PatternTable, met: int) -> tuple[int, NDArray[np.int64], NDArray[np.uint8]]:
        """Number of edges met then; rows of a table for all cells, and how many of each."""
        pattern, corners, upper = self._cells
        count = np.diff(table.first).astype(np.uint8)[pattern]
        rows = np.empty((int(count.sum()), table.edges.shape[1]), np.int64)
        most = corners.shape[1] * (corners.shape[1].bit_length() - 1) // 2
        row = 0
        for first in range(0, len(pattern), _PIECE):
            some = slice(first, first + _PIECE)
            cells = _Cells(pattern[some], corners[some], upper[some])
            room = most * len(cells.pattern)
            if met + room > len(self.edges):
                self.edges.resize((met + met // 2 + room, 2), refcheck=False)
            end = row + int(count[some].sum())
            met = _enter_rows(table.edges, table.first, cells, self._number, self.edges, met, rows[row:end])
            row = end
        return met, rows, count

    def find(self, stated: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of edges (S, 2) of the mesh among ``edges``, or -1."""
        out = np.empty(len(stated), np.int64)
        _find(self._last, self._number, self.edges, stated, out)
        return out


@kernel
def _enter_last_bits(position: IntMatrix, last: UInt8Vector) -> None:
    """Enter the last two bits of each coordinate: they distinguish the vertices of a cell, upper from lower."""
    for i in range(len(position)):
        bits = 0
        for axis in range(position.shape[1]):
            bits |= (position[i, axis] & 3) << 2 * axis
        last[i] = bits


_LAST = np.int64(0b010101)
_PARITIES = {2: np.uint8(0b0101), 3: np.uint8(0b010101)}
"""The last bits of all coordinates."""
_PIECE = 1 << 13
"""Cells that are looked up at a time."""


@inner
def _axes(bits):
    """Every second bit."""
    return bits & 1 | bits >> 1 & 2 | bits >> 2 & 4


@inner
def _differ(a, b):
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
    last: UInt8Vector, seat: Int32Vector, simplices: IntMatrix, entered: Int32Vector, cells: _Cells,
    cell_of: Int32Vector, used: int,
) -> int:
    """Enter the simplices' vertices as corners of their cells, behind ``used`` ones; returns how many there are then.

    A cell is known by xn and the axes along which x0 is the upper end. Corners are numbered from x0 (see
    `isocodec.drawing.cube`), -1 where no mixed leaf has one. ``entered`` has each cell's number and 1, or 0, by the
    ``seat`` of its xn.
    """
    count, corners, upper = cells.pattern, cells.corners, cells.upper
    n = simplices.shape[1] - 1
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
            corners[cell, _differ(np.int64(last[simplices[i, j]]), start)] = simplices[i, j]
    return used


@kernel
def _enter_patterns(above: BoolVector, cells: _Cells, mixed: IntVector) -> None:
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


@kernel
def _enter_rows(
    table: IntVolume, first: IntVector, cells: _Cells, number: Int32Matrix, edges: IntMatrix, met: int,
    rows: IntMatrix,
) -> int:
    """Enter the rows of all cells as numbers of edges, which are given as these are met; returns how many were.

    ``number`` has that of the edge that leaves a vertex upwards along an axis, or -1.
    """
    pattern, corners = cells.pattern, cells.corners
    row = 0
    for i in range(len(pattern)):
        axes = np.int64(cells.upper[i])
        mirrored = (axes ^ axes >> 1 ^ axes >> 2) & 1
        signs = np.int64(pattern[i])
        for k in range(first[signs], first[signs + 1]):
            for j in range(table.shape[1]):
                low, high = table[k, j, 0], table[k, j, 1]
                axis = (low ^ high) >> 1
                if (low ^ axes) >> axis & 1:
                    low, high = high, low
                a = corners[i, low]
                if number[a, axis] < 0:
                    number[a, axis] = met
                    edges[met, 0] = a
                    edges[met, 1] = corners[i, high]
                    met += 1
                rows[row, 1 - j if mirrored and j < 2 else j] = number[a, axis]
            row += 1
    return met


@kernel
def _find(last: UInt8Vector, number: Int32Matrix, edges: IntMatrix, stated: IntMatrix, out: IntVector) -> None:
    """Enter the numbers of edges, -1 where the mesh lacks one: edges of coarser meshes run otherwise or farther."""
    n = number.shape[1]
    for i in range(len(stated)):
        out[i] = -1
        axes = _differ(np.int64(last[stated[i, 0]]), np.int64(last[stated[i, 1]]))
        for axis in range(n):
            j = number[stated[i, 0], axis]
            if axes >> axis & 1 and j >= 0 and edges[j, 1] == stated[i, 1]:
                out[i] = j
