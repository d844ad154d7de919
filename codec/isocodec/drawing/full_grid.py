"""Drawing on the full grid: points on grid edges only, as marching squares and marching cubes have them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, kernel
from ..kernel.types import FloatMatrix, FloatVector, Int32Matrix, IntMatrix, IntVector, IntVolume, UInt8Vector
from .crossing import Drawn, PatternTable, place_on, ratios_at
from .cube import cube_table
from .leaves import Leaves
from .unit_cells import UnitCells, cells_of_leaves, cells_of_pages, differ, enter_last_bits


def draw_grid(leaves: Leaves, parts: bool = True) -> tuple[Drawn, NDArray[np.bool_]]:
    """Draw leaves of the finest level; also returns which leaves are drawn, (M,) bool. ``parts`` asks for `Drawn.part`.

    A saddle (of a cell in 2-D, of a cell's face in 3-D) is resolved by the mesh: the two corners on its diagonal are
    connected. Points that are not on grid edges, in the middle of a few cells (n = 3), come last.

    Cells that lack some of their mixed leaves are left out, since their pieces are not known yet. Cells with missing
    corners count as drawn, although they have no pieces.
    """
    grid = _Grid(leaves)
    number = grid.find(leaves.edges)
    grid.release()
    ratio, part = ratios_at(leaves, grid.edges, number, parts)
    cells, fans = grid.cells, grid.fans.whole()
    centres = np.zeros((grid.centres, len(leaves.shape)))
    if grid.centres:
        _enter_centres(leaves.vertex, grid.edges, ratio, fans, centres)
        rows = cells.room(len(fans))
        rows[: len(fans)] = fans
        rows[: len(fans), 2] += len(grid.edges)
        cells.used += len(fans)
    return Drawn(centres, cells.whole(), grid.edges, ratio, part), grid.drawn


class _Rows:
    """Rows of numbers in an array that grows in place, without a second copy at any time."""

    def __init__(self, width: int, dtype: type[np.integer], first: int = 0) -> None:
        self.array: NDArray[Any] = np.empty((first, width), dtype)
        self.used = 0

    def room(self, count: int) -> NDArray[Any]:
        """Unused rows, at least ``count``."""
        if self.used + count > len(self.array):
            self._resize(self.used + self.used // 2 + count)
        return self.array[self.used :]

    def whole(self) -> NDArray[Any]:
        """The rows used."""
        self._resize(self.used)
        return self.array

    def _resize(self, length: int) -> None:
        self.array.resize((length, self.array.shape[1]), refcheck=False)


class _Grid:
    """Pieces of the contour in unit cells, by the grid edges that they meet.

    A grid edge is identified by its lower end and its axis, which is faster to look up in an array than to sort.

    Attributes
    ----------
    edges : (E, 2) int32
        Vertices at their ends, the lower first.
    cells : rows of n int64
        Segments or triangles between points on edges, by numbers of these.
    fans : rows of 3 int32
        Sides of polygons around points in the middle of cells, by numbers of points on edges, and the number of the
        point in the middle.
    centres : int
        Points in the middle of cells.
    drawn : (M,) bool
        Simplices whose cells have all their mixed leaves; empty where cells come from the known vertices.
    """

    def __init__(self, leaves: Leaves) -> None:
        n = len(leaves.shape)
        table = cube_table(n)
        self._last = np.empty(len(leaves.vertex), np.uint8)
        enter_last_bits(leaves.vertex, n, self._last)
        self._number = np.full((len(leaves.vertex), n), -1, np.int32)
        # about as many as there are of smooth contours: to grow takes longer than to fill
        half = len(leaves.vertex) // 2
        self._met = _Rows(2, np.int32, half * n // 2)
        self.cells, self.fans = _Rows(n, np.int64, half if n == 2 else half * 5 // 2), _Rows(3, np.int32)
        self.centres = 0
        self.drawn = np.zeros(0, np.bool_)
        if leaves.known is None:
            found, self.drawn = cells_of_leaves(self._last, leaves.above, leaves.simplices, table)
            pieces = found.pieces()
        else:
            pieces = cells_of_pages(leaves.known, table, n)
        for some in pieces:
            if leaves.whole is not None:
                low = leaves.position[some.corners[:, 0]] - (some.upper[:, None] >> np.arange(n) & 1)
                some = some.some(leaves.whole(low))
            self._enter(table.cells, some, self.cells, _enter_cells)
            count = self._enter(table.fans, some, self.fans, _enter_sides)
            rows = self.fans.array[self.fans.used - int(count.sum()) : self.fans.used]
            rows[:, 2] = self.centres + np.repeat(np.cumsum(count > 0) - 1, count)
            self.centres += int(np.count_nonzero(count))
        self.edges = self._met.whole()

    def release(self) -> None:
        """Free what only the constructor and `find` need."""
        del self._last, self._number

    def _enter(
        self, table: PatternTable, cells: UnitCells, rows: _Rows, enter: Callable[..., int]
    ) -> NDArray[np.uint8]:
        """Append the rows of a table for cells, and the edges met for the first time; returns the rows of each cell."""
        count, met = table.count[cells.pattern], self._met
        total, corners = int(count.sum()), cells.corners.shape[1]
        if total:
            met.room(corners * (corners.bit_length() - 1) // 2 * len(cells.pattern))
            met.used = enter(table.edges, table.first, cells, self._number, met.array, met.used, rows.room(total))
            rows.used += total
        return count

    def find(self, stated: NDArray[np.int64]) -> NDArray[np.int64]:
        """Look up edges (S, 2) of the mesh among ``edges``; -1 for others."""
        out = np.empty(len(stated), np.int64)
        _find(self._last, self._number, self.edges, stated, out)
        return out


@inlined
def _append(table, first, cells, number, edges, met, rows):
    """Enter the rows of all cells as numbers of edges, numbering these as they are met; returns the number of edges.

    ``number`` is the edge that leaves a vertex upwards along an axis, or -1.
    """
    row = 0
    for i in range(len(cells.pattern)):
        axes = np.int64(cells.upper[i])
        mirrored = (axes ^ axes >> 1 ^ axes >> 2) & 1
        signs, corners = np.uint64(cells.pattern[i]), cells.corners[i]
        for k in range(first[signs], first[signs + np.uint64(1)]):
            for j in range(table.shape[1]):
                low, high = table[np.uint64(k), j, 0], table[np.uint64(k), j, 1]
                axis = (low ^ high) >> 1
                if (low ^ axes) >> axis & 1:
                    low, high = high, low
                a = np.uint64(corners[np.uint64(low)])
                if number[a, np.uint64(axis)] < 0:
                    number[a, np.uint64(axis)] = met
                    edges[met, 0] = a
                    edges[met, 1] = corners[np.uint64(high)]
                    met += 1
                rows[row, 1 - j if mirrored and j < 2 else j] = number[a, np.uint64(axis)]
            row += 1
    return met


@kernel
def _enter_cells(
    table: IntVolume, first: IntVector, cells: UnitCells, number: Int32Matrix, edges: Int32Matrix, met: int,
    rows: IntMatrix,
) -> int:
    """Enter segments or triangles; as `_append`."""
    return _append(table, first, cells, number, edges, met, rows)


@kernel
def _enter_sides(
    table: IntVolume, first: IntVector, cells: UnitCells, number: Int32Matrix, edges: Int32Matrix, met: int,
    rows: Int32Matrix,
) -> int:
    """Enter sides of polygons; as `_append`."""
    return _append(table, first, cells, number, edges, met, rows)


@kernel
def _enter_centres(
    vertex: Int32Matrix, edges: Int32Matrix, ratio: FloatVector, fans: Int32Matrix, centres: FloatMatrix
) -> None:
    """Enter the means (C, 3) of the corners of polygons, whose sides follow one another."""
    first = 0
    for i in range(len(fans)):
        centre, edge = fans[i, 2], fans[i, 0]
        for axis in range(3):
            centres[centre, axis] += place_on(vertex, edges, ratio, edge, axis)
        if i + 1 == len(fans) or fans[i + 1, 2] != centre:
            for axis in range(3):
                centres[centre, axis] /= i + 1 - first
            first = i + 1


@kernel
def _find(last: UInt8Vector, number: Int32Matrix, edges: Int32Matrix, stated: IntMatrix, out: IntVector) -> None:
    """Enter the numbers of edges, -1 where the mesh lacks one: edges of coarser meshes run otherwise or farther."""
    n = number.shape[1]
    for i in range(len(stated)):
        out[i] = -1
        axes = differ(np.int64(last[stated[i, 0]]), np.int64(last[stated[i, 1]]))
        for axis in range(n):
            j = number[stated[i, 0], axis]
            if axes >> axis & 1 and j >= 0 and edges[j, 1] == stated[i, 1]:
                out[i] = j
