"""A mesh in the file as its points alone: their Delaunay triangulation has the cells (spec clause 10.11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..entropy.range_coder import UNLIMITED
from ..entropy.run import Account, Run, WritingRun, whole_run
from ..errors import FormatError, InputError, LimitError
from ..tin.coded_tin import STEPS
from ..tin.delaunay import delaunay, triangles
from ..tin.models import new_coder
from ..tin.point_tree import code_positions
from ..tin.points import Points, points_of
from ..tin.rank import by_rank
from .complex import Complex, assembled, determinants, neighbours
from .quantised import EXTENT

BYTES_PER_POINT = 400
"""Approximate memory for decoding a point, in bytes."""
FLAT, FLAT_BITS = 2, 22
"""Height, in units or as ``2**-FLAT_BITS`` of the longer side, up to which a triangle of rounded points is flat."""
_ROOM = 32
"""Most symbols of a run per point."""


class Triangulated(NamedTuple):
    """Distinct points of the plane with their Delaunay triangles and values.

    Attributes
    ----------
    points : (V, 2) float64
    cells : (T, 3) int64
        Anticlockwise triangles.
    values : (V,) or (F, V) array
    position : (V, 2) int64
        The points that were triangulated, with at least 24 bits.
    unit : float
        Unit of positions.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    values: NDArray[Any]
    position: NDArray[np.int64]
    unit: float

    @property
    def domain(self) -> Complex:
        """The complex of the triangles."""
        return assembled(self.position, self.cells, self.unit, neighbours(self.cells))


def triangulated(points: ArrayLike, values: ArrayLike) -> Triangulated:
    """Triangulate scattered points of the plane.

    Triangles at the border that are flat to within rounding are left out: their points lie on a line but for rounding.
    Raises `InputError` if these are not points (N, 2) with values (N,) or (F, N), or cannot be triangulated.
    """
    found, numbers = np.asarray(points, np.float64), np.asarray(values)
    if found.ndim != 2 or found.shape[1] != 2:
        raise InputError(
            f"the points have shape {found.shape}, not (V, 2)", code="points",
            remedy="points of space take cells: give them",
        )
    if numbers.shape[-1:] != (len(found),):
        raise InputError(f"the values have shape {numbers.shape}, not ({len(found)},)", code="values")
    if not np.isfinite(found).all():
        raise InputError("some coordinates are not finite", code="points", remedy="leave those points out")
    found, numbers = _distinct(found, numbers)
    fine = _fine(found)
    cells = fine.source[triangles(delaunay(fine.x, fine.y)[0])]
    position = np.empty((len(found), 2), np.int64)
    position[fine.source] = np.stack([fine.x, fine.y], axis=1)
    span = int(position.max())
    if span >= EXTENT or not np.array_equal(fine.positions, found[fine.source]):
        cells = _without_slivers(position, cells, max(FLAT, span >> FLAT_BITS))
    return Triangulated(found, cells, numbers, position, fine.unit)


def _distinct(
    points: NDArray[np.float64], values: NDArray[Any]
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Merge points that coincide, and take the mean of their values."""
    found, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    if len(found) == len(points):
        return points, values
    number = number.ravel()
    if values.dtype.kind != "f":
        merged = values[..., first]
        if (merged[..., number] != values).any():
            raise InputError(
                f"{len(points) - len(found)} points coincide with others and have other values", code="coincident",
                remedy="merge them first, or give floats, which are averaged",
            )
        return found, merged
    mean = np.array([np.bincount(number, row) / np.bincount(number) for row in np.atleast_2d(values)])
    return found, mean if values.ndim == 2 else mean[0]


def _fine(points: NDArray[np.float64]) -> Points:
    """Distinct points as they are given, to 24 bits at least."""
    found = points_of(points, np.zeros(len(points)))
    if found.merged:
        raise InputError(
            f"{found.merged} points lie too near to others to be stored apart from them", code="coincident",
            remedy="merge them first",
        )
    return found


def _without_slivers(position: NDArray[np.int64], cells: NDArray[np.int64], flat: int) -> NDArray[np.int64]:
    """Leave out triangles at the border whose height is at most ``flat``."""
    while True:
        corners = position[cells]
        sides = corners[:, [1, 2, 0]] - corners
        longest = np.sqrt((sides.astype(np.float64) ** 2).sum(axis=2)).max(axis=1)
        thin = np.abs(determinants(position, cells)).astype(np.float64) <= flat * longest
        outside = thin & (neighbours(cells) < 0).any(axis=1) if thin.any() else thin
        if not outside.any() or outside.all():
            return cells
        cells = cells[~outside]


def delaunay_complex(position: NDArray[np.int64], unit: float, run: Run | None = None) -> Complex:
    """Triangulate distinct points (V, 2) in the order of ranks.

    Raises `InputError` if all lie on a line, `LimitError` if the run that they come from allows no more work.
    """
    x, y = np.ascontiguousarray(position.T)
    tri, _ = delaunay(x, y, UNLIMITED if run is None else run.left(STEPS))
    if run is not None:
        # where it has stopped, this exceeds what was left
        run.spend(tri.reg.work, STEPS)
    cells = triangles(tri).astype(np.int64)
    return assembled(position, cells, unit, neighbours(cells))


def encoded_points(
    position: NDArray[np.int64], extent: Sequence[int], unit: float
) -> tuple[bytes, Complex, NDArray[np.int64]]:
    """Code distinct points (V, 2) from 0 to below ``extent``; returns what `encoded_mesh` does."""
    run = WritingRun(new_coder())
    run.room(_ROOM * len(position) + 2048)
    box = int(extent[0]), int(extent[1])
    run.check(code_positions(run, box, len(position), position, len(position))[0])
    order = by_rank(position[:, 0], position[:, 1])
    return run.end(), delaunay_complex(np.ascontiguousarray(position[order]), unit), order


def decoded_points(
    data: bytes, at: int, size: tuple[int, int], extent: Sequence[int], unit: float, account: Account,
    hold: Callable[[int, int], None],
) -> Complex:
    """Inverse of ``encoded_points``; parameters and errors as for `decoded_mesh`.
    """
    run = whole_run(new_coder(), data, account, at)
    box = int(extent[0]), int(extent[1])
    try:
        status, position = code_positions(run, box, size[0], None, size[0], hold)
    except LimitError as error:
        if error.code != "limit-vertices":
            raise
        raise FormatError("more points than stated", code="domain", offset=at, clause="10.11") from None
    run.check(status)
    run.end()
    if len(position) != size[0]:
        raise FormatError("fewer points than stated", code="domain", offset=at, clause="10.11")
    # the triangulation and the complex
    hold(BYTES_PER_POINT * len(position), 0)
    order = by_rank(position[:, 0], position[:, 1])
    try:
        found = delaunay_complex(np.ascontiguousarray(position[order]), unit, run)
    except InputError:
        raise FormatError("all points lie on a line", code="domain", offset=at, clause="10.11") from None
    if len(found.mesh.cell) != size[1]:
        raise FormatError("another number of triangles", code="domain", offset=at, clause="10.11")
    return found
