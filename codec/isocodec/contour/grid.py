"""Drawing on the full grid: points on grid edges only, as marching squares and marching cubes have them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit import inner, kernel
from .crossing import Drawn, distinct_edges, edge_points, edge_ratios
from .cube import cube_table
from .leaves import Leaves


def draw_grid(leaves: Leaves) -> Drawn:
    """Draw leaves of the full grid.

    A saddle (of a cell in 2-D, of a cell's face in 3-D) is resolved by the mesh: the two corners on its diagonal are
    connected. Points that are not on grid edges, in the middle of a few cells (n = 3), come last.

    Cells that lack some of their mixed leaves are left out: what passes through them is not known yet.
    """
    n = len(leaves.shape)
    table = cube_table(n)
    corners, pattern, mirrored = _cells(leaves)
    ends, _ = table.cells.lookup(pattern, corners, mirrored)
    sides, owner = table.fans.lookup(pattern, corners, mirrored)

    edges, number = distinct_edges(leaves, np.concatenate([ends.reshape(-1, 2), sides.reshape(-1, 2)]))
    ratio, free = edge_ratios(leaves, edges)
    points = edge_points(leaves, edges, ratio)
    cells = number[: ends.size // 2].reshape(-1, n)
    if len(owner):
        rim = number[ends.size // 2 :].reshape(-1, 2)
        first = np.flatnonzero(np.diff(owner, prepend=-1))
        count = np.diff(first, append=len(owner))
        centres = np.add.reduceat(points[rim[:, 0]], first) / count[:, None]
        fans = np.column_stack([rim, len(points) + np.repeat(np.arange(len(first)), count)])
        points, cells = np.concatenate([points, centres]), np.concatenate([cells, fans])
    return Drawn(points, cells, edges, ratio, free)


def _cells(leaves: Leaves) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Unit cells out of their simplices.

    Returns
    -------
    corners : (C, 2 ** n) int64
        Vertices, numbered from x0 (see `isocodec.contour.cube`); -1 where no mixed leaf has one.
    pattern : (C,) int64
    mirrored : (C,) bool
        Whether an odd number of axes runs downwards from x0 to xn.
    """
    n = len(leaves.shape)

    # A cell is known by xn and the directions in which x0 lies; counting into an array is faster than sorting.
    count = np.zeros(len(leaves.position) << n, np.int32)
    _count(leaves.position, leaves.simplices, count)
    keys = np.flatnonzero(count)
    number = np.empty(len(count), np.int32)
    number[keys] = np.arange(len(keys))
    corners = np.full((len(keys), 2**n), -1, np.int64)
    pattern = np.empty(len(keys), np.int64)
    # Within a cell two coordinates differ exactly if their parities do.
    parity = (leaves.position & 1) @ (1 << np.arange(n))
    _complete(leaves.position, parity, leaves.above, leaves.simplices, number, corners, pattern)

    mirrored = (keys[:, None] >> np.arange(n) & 1).sum(axis=1) % 2 == 1
    whole = count[keys] == cube_table(n).mixed[pattern]
    return corners[whole], pattern[whole], mirrored[whole]


@inner
def _cell(position, simplex):
    """The number of a simplex's cell among all that there could be."""
    n = position.shape[1]
    key = simplex[n] << n
    for axis in range(n):
        if position[simplex[0], axis] > position[simplex[n], axis]:
            key |= 1 << axis
    return key


@kernel
def _count(position, simplices, count):
    """Count the simplices of each cell."""
    for i in range(len(simplices)):
        count[_cell(position, simplices[i])] += 1


@kernel
def _complete(position, parity, above, simplices, number, corners, pattern):
    """Enter the simplices' vertices as corners of their cells, and all signs of each cell as its pattern."""
    for i in range(len(simplices)):
        cell = number[_cell(position, simplices[i])]
        for j in range(simplices.shape[1]):
            corners[cell, parity[simplices[i, j]] ^ parity[simplices[i, 0]]] = simplices[i, j]
    for cell in range(len(corners)):
        signs = np.int64(0)
        for corner in range(corners.shape[1]):
            # a corner that no mixed simplex has agrees with x0, or each of its simplices would be mixed
            v = corners[cell, corner] if corners[cell, corner] >= 0 else corners[cell, 0]
            signs |= np.int64(above[v]) << corner
        pattern[cell] = signs
