"""Entry point of drawing: chooses between edges of the grid and edges of simplices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..grid.lattice.tables import cube_exponent
from .clipping import Check, clipped
from .contour import Contour
from .crossing import Drawn, enter_points
from .full_grid import draw_grid
from .leaves import Leaves
from .separation import apart
from .simplices import draw_simplices
from .smoothing import evened

_SMOOTHED = 260
"""Bytes that smoothing takes for each point."""


def unlimited(size: int) -> None:
    """Accept a drawing of any size."""


def draw(
    leaves: Leaves, *, complete: bool = True, smooth: int = 0, measured: bool = False, check: Check = unlimited
) -> Contour:
    """Draw the isocontour (n = 2) or isosurface (n = 3) that runs through mixed leaf simplices.

    On the full grid (``leaves.full``), and in unit cells where the mesh is as fine, points lie on grid edges, as in
    marching squares and marching cubes. Elsewhere every leaf gives one segment, one triangle, or one quadrangle cut in
    two (Lewiner et al. 2004), with one point on each crossed edge of the mesh. Parts in unit cells with missing corners
    (``leaves.whole``) are omitted.

    Points move within the parts of their edges in ``smooth`` rounds (spec clause 9.10). An encoder, which measures
    distances from points where samples equal the isovalue, leaves them at the ends of edges (``measured``); otherwise
    they are moved into their edges (`isocodec.drawing.separation.apart`). ``check`` is called with the bytes that
    smoothing and cutting need, and raises an error if they are too many. Raises `OptionError` unless the field has 2 or
    3 axes.
    """
    return _drawn(leaves, complete, smooth, measured, check)[0]


def draw_with_ends(
    leaves: Leaves, *, complete: bool = True, check: Check = unlimited
) -> tuple[Contour, NDArray[np.int64]]:
    """Draw as `draw` does, and also return the samples (E, 2, n) between which the first E points lie.

    Other points lie inside cells, or where pieces were cut at missing samples.
    """
    contour, edges = _drawn(leaves, complete, 0, False, check)
    return contour, leaves.position[edges].astype(np.int64)


def _drawn(
    leaves: Leaves, complete: bool, smooth: int, measured: bool, check: Check
) -> tuple[Contour, NDArray[np.int32]]:
    """Draw a contour; also returns the vertices at the ends of the edges of its first points."""
    n = len(leaves.shape)
    if n not in (2, 3):
        raise OptionError(f"cannot draw a field with {n} axes, only with 2 or 3", code="dimension")
    drawn = draw_grid(leaves, parts=smooth > 0)[0] if leaves.full else _drawn_together(leaves)
    if not measured:
        # those in the middle of cells stay
        apart(drawn.ratio, out=drawn.ratio)
    cells, edges, masked = drawn.cells, drawn.edges, leaves.whole is not None
    points = np.empty((len(edges) + len(drawn.centres), n))
    enter_points(leaves.vertex, edges, drawn.ratio, points[: len(edges)])
    points[len(edges) :] = drawn.centres
    if smooth:
        check(_SMOOTHED * len(points))
        low, high = (leaves.position[edges[:, end]].astype(np.float64) for end in (0, 1))
        points = evened(points, cells, low, high - low, drawn.ratio, apart(drawn.part), smooth)
    if leaves.whole is not None and not leaves.full:
        points, cells, kept = clipped(points, cells, tuple(leaves.shape), leaves.whole, check)
        edges = edges[kept[kept < len(edges)]]
    return Contour(points, cells, leaves.isovalue, tuple(leaves.shape), complete, masked=masked), edges


def _drawn_together(leaves: Leaves) -> Drawn:
    """Draw leaves that fill unit cells as on the full grid, and the others one by one (spec clause 9.1).

    Cubes are drawn in this way only if all leaves fill some; otherwise diagonals of their faces would have points on
    only one side.
    """
    finest = leaves.levels == len(leaves.shape) * cube_exponent(leaves.shape)
    plane = len(leaves.shape) == 2
    if not (finest.any() if plane else finest.all()):
        return draw_simplices(leaves)
    grid, whole = draw_grid(replace(leaves, simplices=leaves.simplices[finest], levels=leaves.levels[finest]))
    alone = np.ones(len(finest), np.bool_)
    alone[finest] = ~whole
    if not alone.any():
        return grid
    return _joined(leaves, grid, draw_simplices(leaves, alone)) if plane else draw_simplices(leaves)


def _joined(leaves: Leaves, grid: Drawn, other: Drawn) -> Drawn:
    """Merge two drawings, with one point on each edge."""
    both = np.concatenate([grid.edges, other.edges])
    keys = both.astype(np.int64) @ (len(leaves.vertex), 1)
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    of_grid = np.concatenate([number[: len(grid.edges)], len(first) + np.arange(len(grid.centres))])
    of_other = number[len(grid.edges) :]
    ratio = np.concatenate([grid.ratio, other.ratio])[first]
    part = np.concatenate([grid.part, other.part])[first]
    cells = np.concatenate([of_grid[grid.cells], of_other[other.cells]])
    return Drawn(grid.centres, cells, both[first], ratio, part)
