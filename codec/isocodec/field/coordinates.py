"""Coordinates that a user gives for samples: checks, and the precision that they are stored with (spec clause 9.9)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .mapped import Coordinate

MOST_UNITS = 1 << 50
"""Largest number of units between two coordinates."""
MOST_PERIOD = 1 << 32
"""Periods have fewer units than this, so that values beyond many periods still fit 64 bits (clause 3.7.4)."""
MOST_FOLDS = 0.25
"""Share of the cells that may fold: more are no coordinates."""
PARTS = 8.5
"""Units per permitted error: half a quantum of coding, and half a unit of rounding (clause 3.7.4)."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Given:
    """Coordinates of the samples, checked.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        x, y (, z), with units small enough for the error.
    arrays : tuple of (s0 or 1, .., sn-1 or 1) float64
        One array for each coordinate, with one node along each axis that the coordinate does not depend on.
    needed : tuple of (s0 or 1, .., sn-1 or 1) bool
        Where coordinates matter: at nodes of unit cells without missing corners.
    """

    coordinates: tuple[Coordinate, ...]
    arrays: tuple[Array, ...]
    needed: tuple[NDArray[np.bool_], ...]


def arrays_of(given: Any, shape: tuple[int, ...]) -> list[Array]:
    """Convert coordinates x, y (, z) to arrays that broadcast to the shape of the field.

    They are given as an array of one axis for each axis of the field, in its order (in the plane x runs along axis 1,
    in space x, y, z along the axes 0, 1, 2), or as arrays of n axes that broadcast to its shape.
    """
    n = len(shape)
    try:
        parts = [np.asarray(part) for part in given]
    except (TypeError, ValueError):
        parts = []
    if len(parts) != n or any(part.dtype.kind not in "iuf" for part in parts):
        raise InputError(
            f"coordinates must be {n} arrays of numbers, one for each axis of the field, or x, y{', z' * (n == 3)}",
            code="coordinates",
        )
    parts = [part.astype(np.float64) for part in parts]
    if all(part.ndim == 1 for part in parts):
        for axis, part in enumerate(parts):
            if len(part) != shape[axis]:
                raise InputError(
                    f"{len(part)} coordinates for axis {axis} of the field, which has {shape[axis]} samples",
                    code="coordinates", remedy="give one for each sample, with axes in the order of the field",
                )
            parts[axis] = part.reshape([-1 if a == axis else 1 for a in range(n)])
        return parts[::-1] if n == 2 else parts
    for name, part in zip("xyz", parts, strict=False):
        if part.ndim != n or any(count not in (1, size) for count, size in zip(part.shape, shape, strict=True)):
            raise InputError(
                f"the coordinates {name} have shape {part.shape}, but the field has {shape}", code="coordinates",
                remedy="give one for each sample, with the field's axes",
            )
    return [_least(part) for part in parts]


def _least(array: Array) -> Array:
    """Drop the axes along which an array does not vary."""
    for axis in range(array.ndim):
        first = array.take([0], axis=axis)
        if np.array_equal(np.broadcast_to(first, array.shape), array):
            array = first
    return array


def check_coordinates(
    arrays: Sequence[Array], shape: tuple[int, ...], gone: NDArray[np.bool_] | None, periods: Sequence[float],
    error: float, periodic: Sequence[int] = (),
) -> Given:
    """Check that coordinates do not fold, and find units in which they are stored to within ``error`` cells.

    ``gone`` marks missing samples; cells with a missing corner do not count. The period of a coordinate is 0 if it has
    none. ``periodic`` lists the axes whose last plane repeats the first one. Raises `InputError` if a coordinate that
    matters is not finite, if axes are not strictly increasing or decreasing, or if cells fold.
    """
    whole = np.ones([size - 1 for size in shape], np.bool_) if gone is None else whole_cells(gone)
    used = np.full(shape, gone is None)  # nodes of cells without missing corners
    for corner in product((0, 1), repeat=len(shape)):
        used[tuple(slice(c, c + size) for c, size in zip(corner, whole.shape, strict=True))] |= whole
    needed: list[NDArray[np.bool_]] = []
    for name, array in zip("xyz", arrays, strict=False):
        flat = tuple(axis for axis, count in enumerate(array.shape) if count == 1)
        some = used.any(axis=flat, keepdims=True) if array.ndim > len(flat) else np.ones_like(array, np.bool_)
        bad = some & ~np.isfinite(array)
        if bad.any():
            where = tuple(np.argwhere(bad)[0].tolist())
            raise InputError(
                f"the coordinate {name} of sample {where} is {array[where]}", code="coordinates",
                remedy="mask samples without coordinates: NaN, or the option mask",
            )
        needed.append(np.asarray(some))
    varying = [[axis for axis, count in enumerate(array.shape) if count > 1] for array in arrays]
    if all(len(axes) == 1 for axes in varying) and len({axes[0] for axes in varying}) == len(varying):
        reach = [_along_axis(array, axes[0], period, periodic)
                 for array, axes, period in zip(arrays, varying, periods, strict=True)]
    else:
        reach = _inverse(arrays, periods, whole, periodic)
    coordinates = []
    for name, array, axes, period, far in zip("xyz", arrays, varying, periods, reach, strict=False):
        unit = error / (len(arrays) * far * PARTS)
        units = int(np.ceil(period / unit)) if period else 0
        unit = period / units if units else unit
        finite = array[np.isfinite(array)]
        if units >= MOST_PERIOD or float(np.ptp(finite)) / unit >= MOST_UNITS:
            raise InputError(
                f"the coordinates {name} would take too many units of {unit:g}", code="coordinates",
                remedy="allow a larger coordinates_error, or check for cells of almost no size",
            )
        first = array.flat[0]
        coordinates.append(Coordinate(tuple(axes), float(first if np.isfinite(first) else finite[0]), unit, units))
    return Given(tuple(coordinates), tuple(arrays), tuple(needed))


def whole_cells(gone: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Unit cells without a missing corner."""
    out = np.ones([size - 1 for size in gone.shape], np.bool_)
    for corner in product((0, 1), repeat=gone.ndim):
        out &= ~gone[tuple(slice(c, c + size) for c, size in zip(corner, out.shape, strict=True))]
    return out


def steps_along(array: Array, axis: int, period: float) -> Array:
    """Differences of neighbours along an axis, up to the period."""
    steps = np.diff(array, axis=axis)
    return (steps + period / 2) % period - period / 2 if period else steps


def _no_wrap(periodic: Sequence[int], periods: Sequence[float]) -> str | None:
    """Remedy if the last cell of a periodic axis folds."""
    if periodic and not any(periods):
        return "give the period of the coordinate (360 for longitudes), unless both ends are the same place"
    return None


def _along_axis(array: Array, axis: int, period: float, periodic: Sequence[int]) -> float:
    """Largest number of cells that a unit of a coordinate amounts to, for a coordinate that varies along one axis."""
    steps = steps_along(array, axis, period).ravel()
    falling = np.count_nonzero(steps < 0) > len(steps) / 2
    bad = np.flatnonzero(steps >= 0 if falling else steps <= 0)
    if len(bad):
        i = int(bad[0])
        raise InputError(
            f"the coordinates along axis {axis} neither increase nor decrease throughout: {array.ravel()[i]:g} is "
            "followed by "
            f"{array.ravel()[i + 1]:g} at sample {i + 1}", code="coordinates",
            remedy=_no_wrap([a for a in periodic if a == axis], [period]) or "sort the samples along that axis",
        )
    return float(1 / np.abs(steps).min())


def folds(
    arrays: Sequence[Array], shape: tuple[int, ...], gone: NDArray[np.bool_] | None, periods: Sequence[float],
    error: float,
) -> tuple[int, NDArray[np.bool_]] | None:
    """Find the few samples without which no cell folds or all but vanishes.

    Takes what `check_coordinates` takes. Returns how many cells fold, and a mask with a sample of each; None if no cell
    folds, or more than `MOST_FOLDS` do.
    """
    whole = np.ones([size - 1 for size in shape], np.bool_) if gone is None else whole_cells(gone)
    bad = np.zeros(whole.shape, np.bool_)
    n = len(arrays)
    finest = []
    for array, period in zip(arrays, periods, strict=True):
        most = MOST_PERIOD / period if period else MOST_UNITS / (float(np.ptp(array[np.isfinite(array)])) or 1.0)
        finest.append(most * error / (2 * n * PARTS))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for size, columns in _corners(arrays, periods, whole):
            bad |= size <= 0
            for column, least in zip(columns, finest, strict=True):
                bad |= column > least
    bad &= whole
    count = int(np.count_nonzero(bad))
    if not 0 < count <= MOST_FOLDS * np.count_nonzero(whole):
        return None
    near = np.zeros(shape, np.int64)
    corners = [np.array(corner) for corner in product((0, 1), repeat=n)]
    cells = np.argwhere(bad)
    for corner in corners:
        near[tuple((cells + corner).T)] += 1
    out = np.zeros(shape, np.bool_)
    # those that most of these cells have in common first
    for place in sorted(np.argwhere(near).tolist(), key=lambda place: -near[tuple(place)]):
        around = [tuple(place - corner) for corner in corners]
        around = [cell for cell in around if min(cell) >= 0 and (np.array(cell) < bad.shape).all()]
        if any(bad[cell] for cell in around):
            out[tuple(place)] = True
            for cell in around:
                bad[cell] = False
    return count, out


def _corners(
    arrays: Sequence[Array], periods: Sequence[float], whole: NDArray[np.bool_]
) -> Iterator[tuple[Array, list[Array]]]:
    """At each corner of all cells their size, positive for most, and for each coordinate the cells by a unit of it."""
    n, turned = len(arrays), 0
    for j in steps_at_corners(arrays, periods):
        cofactors = [_cofactors(j[(c + 1) % n], j[(c + n - 1) % n]) for c in range(n)]
        size = np.broadcast_to(np.asarray(sum(j[0][a] * cofactors[0][a] for a in range(n))), whole.shape)
        turned = turned or (1 if 2 * np.count_nonzero(whole & (size > 0)) >= np.count_nonzero(whole) else -1)
        yield size * turned, [
            np.broadcast_to(np.sqrt(sum(part * part for part in own)) / np.abs(size), whole.shape) for own in cofactors
        ]


def _inverse(
    arrays: Sequence[Array], periods: Sequence[float], whole: NDArray[np.bool_], periodic: Sequence[int]
) -> list[float]:
    """For each coordinate, the most cells that one unit of it makes, over all corners of whole cells; none may fold."""
    far = [0.0] * len(arrays)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for size, columns in _corners(arrays, periods, whole):
            bad = whole & ~(size > 0)
            if bad.any():
                where = tuple(np.argwhere(bad)[0].tolist())
                raise InputError(
                    f"the coordinates fold: the cell at sample {where} is turned over or has no size, as are "
                    f"{np.count_nonzero(bad) - 1:,} more", code="coordinates",
                    remedy=_no_wrap(periodic, periods) or "mask those samples, or remove repeated rows",
                )
            for c, column in enumerate(columns):
                far[c] = max(far[c], float(np.max(column, where=whole, initial=0.0)))
    return [reach or 1.0 for reach in far]


def steps_at_corners(arrays: Sequence[Array], periods: Sequence[float]) -> Iterator[list[list[Any]]]:
    """At each corner of all cells the step of each coordinate along each axis; 0.0 where it does not vary."""
    n = len(arrays)
    steps = [
        [steps_along(array, axis, period) if array.shape[axis] > 1 else None for axis in range(n)]
        for array, period in zip(arrays, periods, strict=True)
    ]
    for corner in product((0, 1), repeat=n):
        yield [[_at_corner(step, axis, corner) for axis, step in enumerate(row)] for row in steps]


def _at_corner(step: Array | None, axis: int, corner: tuple[int, ...]) -> Any:
    if step is None:
        return 0.0
    return step[tuple(
        slice(None) if a == axis or step.shape[a] == 1 else slice(corner[a], corner[a] + step.shape[a] - 1)
        for a in range(step.ndim)
    )]


def _cofactors(u: list[Any], v: list[Any]) -> list[Any]:
    """Cofactors of a row of a matrix, from the other row (2-D) or the product of the other two (3-D)."""
    if len(u) == 2:
        return [u[1], -u[0]]
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
