"""Drawing on the full grid: points on grid edges only, as marching squares and marching cubes have them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .crossing import distinct_edges, edge_points, edge_ratios
from .cube import cube_table
from .leaves import Leaves


def draw_grid(leaves: Leaves) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (P, n) float64 and cells (M, n) int64 of leaves of the full grid.

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
    points = edge_points(leaves, edges, edge_ratios(leaves, edges))
    cells = number[: ends.size // 2].reshape(-1, n)
    if not len(owner):
        return points, cells

    rim = number[ends.size // 2 :].reshape(-1, 2)
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    count = np.diff(first, append=len(owner))
    centres = np.add.reduceat(points[rim[:, 0]], first) / count[:, None]
    fans = np.column_stack([rim, len(points) + np.repeat(np.arange(len(first)), count)])
    return np.concatenate([points, centres]), np.concatenate([cells, fans])


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
    axes = np.arange(n)
    first, last = leaves.simplices[:, 0], leaves.simplices[:, -1]

    # A cell is known by xn and the directions in which x0 lies; counting into an array is faster than sorting.
    key = last << n
    for axis, coordinate in enumerate(leaves.position.T):
        key |= (coordinate[first] > coordinate[last]).astype(np.int64) << axis
    count = np.bincount(key, minlength=len(leaves.position) << n)
    keys = np.flatnonzero(count)
    number = np.empty(len(count), dtype=np.int64)
    number[keys] = np.arange(len(keys))
    cell = number[key]

    # Within a unit cell two coordinates differ exactly if their parities do.
    parity = (leaves.position & 1) @ (1 << axes)
    corners = np.full((len(keys), 2**n), -1, dtype=np.int64)
    corners[cell[:, None], parity[leaves.simplices] ^ parity[first, None]] = leaves.simplices

    # A corner that no mixed simplex has agrees with x0, or each of its simplices would be mixed.
    above = np.where(corners >= 0, leaves.above[corners], leaves.above[corners[:, :1]])
    pattern = above @ (1 << np.arange(2**n))
    mirrored = (keys[:, None] >> axes & 1).sum(axis=1) % 2 == 1
    whole = count[keys] == cube_table(n).mixed[pattern]
    return corners[whole], pattern[whole], mirrored[whole]
