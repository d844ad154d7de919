"""Placement of the samples of an input: by a matrix, or by coordinates along axes or of each sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import OptionError
from ...field.placement import RAS, TURN, Placement, placement_of
from .volumes import kept_axes

EVEN = 0.01
"""Largest distance of coordinates from even steps, in steps: files often keep them in single precision."""
SLICE = "the position of a slice in space is ignored"
_CLOSES = 0.25
"""Largest difference of the step from the last to the first longitude from the others, in steps."""

Array = NDArray[np.float64]


def open_grid(axes: Sequence[Array]) -> list[Array]:
    """Coordinates x, y (, z) from one for each axis of the array, x along the last one."""
    n = len(axes)
    return [axis.reshape([-1 if a == n - 1 - c else 1 for a in range(n)]) for c, axis in enumerate(reversed(axes))]


def placed_grid(coordinates: Sequence[Array], shape: Sequence[int], turns: bool, crs: str | None = None) -> Placement:
    """Place samples at coordinates of which x is a longitude, if it ``turns``, with the axes that are periodic then."""
    periodic = [a for a in range(len(shape)) if turns and goes_round(coordinates[0], a, shape[a])]
    return Placement(None, coordinates, crs, periodic, TURN if turns else 0.0, inferred=True)


def goes_round(longitude: Array, axis: int, size: int) -> bool:
    """Whether steps of longitudes along an axis, that from the last to the first included, make up a whole turn."""
    if longitude.shape[axis] != size or size < 3:
        return False
    steps = np.diff(longitude, axis=axis, append=longitude.take([0], axis=axis))
    steps = (steps + TURN / 2) % TURN - TURN / 2
    with np.errstate(invalid="ignore"):
        turn = steps.sum(axis=axis, keepdims=True)
        # the last step goes on, also where columns repeat
        last, first = (steps.take([i], axis=axis) * np.sign(turn) for i in (-1, 0))
        # on curvilinear grids rows beyond a pole do not go around anything
        round_it = np.abs(np.abs(turn) - TURN) < 1e-3
        typical = np.abs(steps.take(range(size - 1), axis)).max(axis=axis, keepdims=True)
        closes = (last <= (1 + _CLOSES) * typical) & (last > 0) & (np.abs(first) > 0)
    return bool(np.count_nonzero(round_it & closes) * 2 > round_it.size)


def placed(numbers: Any, n: int, crs: str | None = None, unit: str | None = None) -> Placement:
    """Place samples by a matrix of n axes; only a remark if it cannot be that of a placement."""
    try:
        place = placement_of(Placement(numbers, crs=crs, unit=unit), n)
    except OptionError as error:
        return Placement(remark=f"its coordinates are ignored: {error.message}")
    assert place is not None
    return place


def placed_volume(
    matrix: Array, shape: Sequence[int], n: int, crs: str | None = RAS, unit: str = "mm"
) -> Placement:
    """Place the samples of a volume or series of that shape, or of a plane in space (one sample along an axis).

    A field of fewer axes ``n`` is one of several slices, whose place is left out with a remark.
    """
    axes = kept_axes(shape[:3])
    return placed(matrix[:3, [*axes, 3]], n, crs, unit) if len(axes) == n else Placement(remark=SLICE)


def in_steps(steps: Sequence[tuple[float, float]], unit: str | None = None) -> Placement:
    """Place samples by the step and the start along each axis: x runs along the last axis, y along the one before."""
    n = len(steps)
    matrix = np.zeros((n, n + 1))
    for axis, step in enumerate(steps):
        matrix[n - 1 - axis, [axis, n]] = step
    return placed(matrix, n, unit=unit)


def to_right_front_up(matrix: Array) -> Array:
    """Turn coordinates as ITK and DICOM have them (left, back, up), a matrix (3, 4), into right, front and up."""
    return np.diag([-1.0, -1.0, 1.0]) @ matrix
