"""A mesh in the file as its points alone: their Delaunay triangulation has the cells (spec clause 10.11)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..entropy.range_coder import DECODE, ENCODE, finish, start
from ..errors import FormatError, InputError, LimitError
from ..kernel import DONE
from .complex import Complex, assembled, neighbours
from .delaunay import delaunay, triangles
from .point_tree import code_positions
from .points import points_of
from .rank import by_rank
from .tin_models import new_coder

BYTES_PER_POINT = 400
"""Memory that decoding takes for a point, about."""
_UNLIMITED = 1 << 62
_ROOM = 64
"""Bytes of a run for each point at most, and some more."""
_STEPS = 16
"""Triangles that are looked at for a unit of work."""


def triangulated(
    points: ArrayLike, values: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[Any]]:  # fmt: skip
    """Scattered points of the plane as distinct ones, (V, 2), their Delaunay triangles, and their values.

    Parameters
    ----------
    points : (N, 2) array_like of numbers
    values : (N,) or (F, N) array_like

    Raises
    ------
    InputError
        If they are none, or cannot be triangulated.
    """
    found, numbers = np.asarray(points, np.float64), np.asarray(values)
    if found.ndim != 2 or found.shape[1] != 2:
        raise InputError(
            f"the points have shape {found.shape}, needed is (V, 2)", code="points",
            remedy="points of space take cells: give them",
        )  # fmt: skip
    if numbers.shape[-1:] != (len(found),):
        raise InputError(f"the values have shape {numbers.shape}, needed is ({len(found)},)", code="values")
    if not np.isfinite(found).all():
        raise InputError("coordinates that are not finite", code="points", remedy="leave those points out")
    found, numbers = _distinct(found, numbers)
    return found, _cells_of(found), numbers


def _distinct(
    points: NDArray[np.float64], values: NDArray[Any]
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Points of which none coincide, and their values: of those that do, the mean."""
    found, number = np.unique(points, axis=0, return_inverse=True)
    if len(found) == len(points):
        return points, values
    number = number.ravel()
    count = np.bincount(number)
    rows = np.atleast_2d(values)
    mean = np.array([np.bincount(number, row.astype(np.float64)) / count for row in rows])
    if rows.dtype.kind != "f":
        if (mean[:, number] != rows).any():
            raise InputError(
                f"{len(points) - len(found)} points coincide with others and have other values", code="coincident",
                remedy="merge them first, or give floats, which are averaged",
            )  # fmt: skip
        mean = np.rint(mean).astype(rows.dtype)
    return found, mean if np.ndim(values) == 2 else mean[0]


def _cells_of(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Delaunay triangles of distinct points as they are given, (T, 3), to 24 bits at least."""
    found = points_of(points, np.zeros(len(points)))
    if found.merged:
        raise InputError(
            f"{found.merged} points lie too near to others to be told apart", code="coincident",
            remedy="merge them first",
        )  # fmt: skip
    return found.source[triangles(delaunay(found.x, found.y)[0])]


def delaunay_complex(position: NDArray[np.int64], unit: float, work: int = _UNLIMITED) -> Complex:
    """The complex of distinct points (V, 2) in the order of ranks.

    Raises
    ------
    InputError
        If all lie on a line.
    LimitError
        If it takes more work than allowed.
    """
    x, y = np.ascontiguousarray(position.T)
    tri, count = delaunay(x, y, min(_STEPS * work, _UNLIMITED))
    cells = triangles(tri).astype(np.int64)
    if count < len(position) and len(np.unique(cells)) < len(position):
        raise LimitError(f"{len(position):,} points take more work than allowed", code="limit-work", clause="11.2")
    return assembled(position, cells, unit, neighbours(cells))


def encoded_points(
    position: NDArray[np.int64], extent: Sequence[int], unit: float
) -> tuple[bytes, Complex, NDArray[np.int64]]:
    """Code distinct points (V, 2) from 0 to below ``extent``.

    Returns
    -------
    bytes
        The run.
    Complex
        As a decoder has it.
    (V,) int64
        For each of its vertices the original one.
    """
    coder = new_coder()._replace(buf=np.zeros(_ROOM * len(position) + 4096, np.uint8))
    start(coder.reg, ENCODE)
    box = int(extent[0]), int(extent[1])
    status, _, _ = code_positions(coder, box, len(position), position, len(position), _UNLIMITED)
    assert status == DONE
    order = by_rank(position[:, 0], position[:, 1])
    return finish(coder), delaunay_complex(np.ascontiguousarray(position[order]), unit), order


def decoded_points(
    data: bytes, offset: int, size: tuple[int, int], extent: Sequence[int], unit: float, work: int
) -> Complex:  # fmt: skip
    """Inverse of ``encoded_points``; ``size`` are the numbers of points and triangles that there should be.

    Raises
    ------
    FormatError
        If the run violates the specification.
    LimitError
        If it takes more work than allowed.
    """
    coder = new_coder()._replace(buf=np.frombuffer(data, np.uint8).copy())
    start(coder.reg, DECODE)
    coder.reg.end, coder.reg.final = len(data), 1
    box = int(extent[0]), int(extent[1])
    try:
        status, position, work = code_positions(coder, box, size[0], None, size[0], work)
    except LimitError as error:
        if error.code != "limit-vertices":
            raise
        raise FormatError("more points than stated", code="domain", offset=offset, clause="10.11") from None
    if status != DONE:
        raise FormatError("a run is too short", code="overrun", offset=offset, clause="6.3")
    if coder.reg.pos - 4 + coder.reg.unknown // 8 + 4 < len(data):
        raise FormatError("bytes left over in a run", code="leftover", offset=offset, clause="6.3")
    order = by_rank(position[:, 0], position[:, 1])
    try:
        found = delaunay_complex(np.ascontiguousarray(position[order]), unit, work)
    except InputError:
        raise FormatError("all points lie on a line", code="domain", offset=offset, clause="10.11") from None
    if (len(found.mesh.position), len(found.mesh.cell)) != size:
        raise FormatError("other numbers of points or triangles", code="domain", offset=offset, clause="10.11")
    return found
