"""Drawing on the full grid: points on grid edges only, as marching squares and marching cubes have them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel import kernel
from ..kernel.types import Int32Matrix, IntMatrix, IntVector, IntVolume, UInt8Vector
from .crossing import Drawn, PatternTable, edge_points, ratios_at
from .cube import cube_table
from .leaves import Leaves
from .unit_cells import UnitCells, cells_of_leaves, cells_of_pages, differ, enter_last_bits


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
    centres, cells = np.zeros((0, len(leaves.shape))), grid.cells
    if len(grid.owner):
        first = np.flatnonzero(np.diff(grid.owner, prepend=-1))
        count = np.diff(first, append=len(grid.owner))
        around = edge_points(leaves, grid.edges[grid.sides[:, 0]], ratio[grid.sides[:, 0]])
        centres = np.add.reduceat(around, first) / count[:, None]
        fans = np.column_stack([grid.sides, len(grid.edges) + np.repeat(np.arange(len(first)), count)])
        cells = np.concatenate([cells, fans])
    return Drawn(centres, cells, grid.edges, ratio, part), grid.drawn


class _Rows:
    """Rows of numbers, in an array that grows in place: there is no moment at which two are there."""

    def __init__(self, width: int, dtype: type[np.integer]) -> None:
        self.array: NDArray[Any] = np.empty((0, width), dtype)
        self.used = 0

    def room(self, count: int) -> NDArray[Any]:
        """Rows behind those used, at least ``count``."""
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

    A grid edge is known by its lower end and its axis: looking that up in an array is faster than sorting.

    Attributes
    ----------
    edges : (E, 2) int32
        Vertices at their ends, the lower first.
    cells : (M, n) int64
        Segments or triangles between points on edges, by numbers of these.
    sides : (S, 2) int64
        Sides of polygons around points in the middle of cells, by numbers of points on edges.
    owner : (S,) int64
        Numbers of their cells, ascending.
    drawn : (M,) bool
        Simplices whose cells have all their mixed leaves; empty where cells come from the known vertices.
    """

    def __init__(self, leaves: Leaves) -> None:
        n = len(leaves.shape)
        table = cube_table(n)
        self._last = np.empty(len(leaves.vertex), np.uint8)
        enter_last_bits(leaves.vertex, n, self._last)
        self._number = np.full((len(leaves.vertex), n), -1, np.int32)
        edges, cells, sides = _Rows(2, np.int32), _Rows(n, np.int64), _Rows(2, np.int64)
        counts = []
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
            self._enter(table.cells, some, edges, cells)
            counts.append(self._enter(table.fans, some, edges, sides))
        self.edges, self.cells, self.sides = edges.whole(), cells.whole(), sides.whole()
        sizes = np.concatenate([np.zeros(0, np.uint8), *counts])
        self.owner = np.repeat(np.arange(len(sizes)), sizes)

    def release(self) -> None:
        """Free what only the making of cells and `find` need."""
        del self._last, self._number

    def _enter(self, table: PatternTable, cells: UnitCells, edges: _Rows, rows: _Rows) -> NDArray[np.uint8]:
        """Append the rows of a table for cells, and the edges that they are the first to meet; how many rows of each.
        """
        count = table.count[cells.pattern]
        total, corners = int(count.sum()), cells.corners.shape[1]
        if total:
            edges.room(corners * (corners.bit_length() - 1) // 2 * len(cells.pattern))
            edges.used = _enter_rows(
                table.edges, table.first, cells, self._number, edges.array, edges.used, rows.room(total)
            )
            rows.used += total
        return count

    def find(self, stated: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of edges (S, 2) of the mesh among ``edges``, or -1."""
        out = np.empty(len(stated), np.int64)
        _find(self._last, self._number, self.edges, stated, out)
        return out


@kernel
def _enter_rows(
    table: IntVolume, first: IntVector, cells: UnitCells, number: Int32Matrix, edges: Int32Matrix, met: int,
    rows: IntMatrix,
) -> int:
    """Enter the rows of all cells as numbers of edges, which are given as these are met; returns how many were.

    ``number`` has that of the edge that leaves a vertex upwards along an axis, or -1.
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
