"""Drawing on the full grid: points on grid edges only, as marching squares and marching cubes have them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit import inner, kernel
from .crossing import Drawn, PatternTable, edge_points, ratios_at
from .cube import cube_table
from .leaves import Leaves


def draw_grid(leaves: Leaves) -> Drawn:
    """Draw leaves of the full grid.

    A saddle (of a cell in 2-D, of a cell's face in 3-D) is resolved by the mesh: the two corners on its diagonal are
    connected. Points that are not on grid edges, in the middle of a few cells (n = 3), come last.

    Cells that lack some of their mixed leaves are left out: what passes through them is not known yet.
    """
    table = cube_table(len(leaves.shape))
    grid = _Grid(leaves)
    cells, _ = grid.rows(table.cells)
    sides, owner = grid.rows(table.fans)
    edges = grid.edges
    ratio, free = ratios_at(leaves, edges, grid.find(leaves.edges))
    points = edge_points(leaves, edges, ratio)
    if len(owner):
        first = np.flatnonzero(np.diff(owner, prepend=-1))
        count = np.diff(first, append=len(owner))
        centres = np.add.reduceat(points[sides[:, 0]], first) / count[:, None]
        fans = np.column_stack([sides, len(points) + np.repeat(np.arange(len(first)), count)])
        points, cells = np.concatenate([points, centres]), np.concatenate([cells, fans])
    return Drawn(points, cells, edges, ratio, free)


class _Grid:
    """Unit cells out of their simplices, and the grid edges that the drawing has come upon.

    A grid edge is known by its lower end and its axis: looking that up in an array is faster than sorting.
    """

    def __init__(self, leaves: Leaves) -> None:
        n = len(leaves.shape)
        vertices = len(leaves.position)
        self._place = np.empty(vertices, np.uint8)
        _place_vertices(leaves.position, self._place)
        corners = np.empty((len(leaves.simplices), 2**n), np.int32)
        directions, count = np.empty(len(corners), np.uint8), np.empty(len(corners), np.uint8)
        number = np.zeros(vertices << n, np.int32)
        used = _join(self._place, leaves.simplices, number, corners, directions, count)
        self._corners, self._directions = corners[:used], directions[:used]
        self._pattern = np.empty(used, np.int64)
        _see(leaves.above, self._corners, count, cube_table(n).mixed, self._pattern)
        self._number = np.full((vertices, n), -1, np.int32)
        self._edges = np.empty((n * vertices, 2), np.int64)
        self._used = 0

    @property
    def edges(self) -> NDArray[np.int64]:
        """Ends of the edges met so far, (E, 2), the lower first."""
        return self._edges[: self._used]

    def rows(self, table: PatternTable) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows of a table for all cells, (R, k), as numbers of ``edges``, and the cell of each, ascending."""
        owner = np.repeat(np.arange(len(self._pattern)), np.diff(table.first)[self._pattern])
        out = np.empty((len(owner), table.edges.shape[1]), np.int64)
        self._used = _look_up(
            table.edges, table.first, self._pattern, self._corners, self._directions, self._number, self._edges,
            self._used, out,
        )  # fmt: skip
        return out, owner

    def find(self, stated: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of edges (S, 2) among ``edges``, or -1."""
        out = np.empty(len(stated), np.int64)
        _find(self._place, self._number, self._edges, stated, out)
        return out


@kernel
def _place_vertices(position, place):
    """The last two bits of each coordinate: they tell a cell's vertices from each other, and upper from lower ones."""
    for i in range(len(position)):
        bits = 0
        for axis in range(position.shape[1]):
            bits |= (position[i, axis] & 3) << 2 * axis
        place[i] = bits


_LAST_BITS = np.int64(0b010101)


@inner
def _axes(bits):
    """Every second bit."""
    return bits & 1 | bits >> 1 & 2 | bits >> 2 & 4


@inner
def _differ(a, b):
    """Bit i says whether two vertices of a cell, by their places, differ along axis i."""
    return _axes((a ^ b) & _LAST_BITS)


@inner
def _upper(a, b):
    """Bit i says whether the first of two vertices of a cell is the upper one along axis i."""
    carried = (a ^ b) >> 1 ^ b
    return _axes((a ^ b) & ~carried & _LAST_BITS)


@kernel
def _join(place, simplices, number, corners, directions, count):
    """Enter the simplices' vertices as corners of their cells, in the order of these; returns how many there are.

    A cell is known by xn and the directions in which x0 lies, bit i for the upper end of axis i. Corners are numbered
    from x0 (see `isocodec.contour.cube`), -1 where no mixed leaf has one.
    """
    n = simplices.shape[1] - 1
    used = 0
    for i in range(len(simplices)):
        start = np.int64(place[simplices[i, 0]])
        direction = _upper(start, np.int64(place[simplices[i, n]]))
        key = simplices[i, n] << n | direction
        cell = number[key] - 1
        if cell < 0:
            cell = used
            used += 1
            number[key] = used
            directions[cell] = direction
            count[cell] = 0
            corners[cell] = -1
        count[cell] += 1
        for j in range(n + 1):
            corners[cell, _differ(np.int64(place[simplices[i, j]]), start)] = simplices[i, j]
    return used


@kernel
def _see(above, corners, count, mixed, pattern):
    """All signs of each cell as its pattern; 0, of which nothing is drawn, for a cell that lacks mixed leaves."""
    for cell in range(len(corners)):
        signs = np.int64(0)
        for corner in range(corners.shape[1]):
            # a corner that no mixed simplex has agrees with x0, or each of its simplices would be mixed
            v = corners[cell, corner] if corners[cell, corner] >= 0 else corners[cell, 0]
            signs |= np.int64(above[v]) << corner
        pattern[cell] = signs if count[cell] == mixed[signs] else 0


@kernel
def _look_up(table, first, pattern, corners, directions, number, edges, used, out):
    """Write the rows of all cells as numbers of edges, which are given as these are met; returns how many there are."""
    row = 0
    for i in range(len(pattern)):
        direction = np.int64(directions[i])
        mirrored = (direction ^ direction >> 1 ^ direction >> 2) & 1
        for k in range(first[pattern[i]], first[pattern[i] + 1]):
            for j in range(table.shape[1]):
                low, high = table[k, j, 0], table[k, j, 1]
                axis = (low ^ high) >> 1
                if (low ^ direction) >> axis & 1:
                    low, high = high, low
                a = corners[i, low]
                if number[a, axis] < 0:
                    number[a, axis] = used
                    edges[used, 0] = a
                    edges[used, 1] = corners[i, high]
                    used += 1
                out[row, 1 - j if mirrored and j < 2 else j] = number[a, axis]
            row += 1
    return used


@kernel
def _find(place, number, edges, stated, out):
    """Numbers of edges by the arrays of `_look_up`, or -1."""
    n = number.shape[1]
    for i in range(len(stated)):
        out[i] = -1
        differ = _differ(np.int64(place[stated[i, 0]]), np.int64(place[stated[i, 1]]))
        for axis in range(n):
            j = number[stated[i, 0], axis]
            if differ >> axis & 1 and j >= 0 and edges[j, 1] == stated[i, 1]:
                out[i] = j
