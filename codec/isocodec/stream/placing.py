"""A field on a mapped grid, on the encoder's side: axes closed, coordinates coded (spec clauses 3.7.4, 9.9)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, OptionError
from ..field.coordinates import Given, arrays_of, check_coordinates, whole_cells
from ..field.filling import filled_smoothly
from ..field.placement import placement_of
from ..field.samples import without_holes
from ..field.stretch import distance_of, largest_step
from ..format.coordinates import CoordinatesRecord, write_coordinates
from ..grid.passes.node_run import NodeGrid, encode_run
from ..grid.passes.nodes import AXES

DEFAULT_ERROR = 0.005
"""Largest distance in cells between coordinates given and kept, if nothing else is asked for."""
MOST_ERROR = 0.5
TURN = 360.0
"""Period of longitudes."""


def closed(array: NDArray[Any], periodic: Sequence[int]) -> NDArray[Any]:
    """An array with its first plane once more behind the last one, along periodic axes that it has samples along."""
    for axis in periodic:
        if array.shape[axis] > 1:
            array = np.concatenate([array, array.take([0], axis=axis)], axis=axis)
    return array


class GivenWorld:
    """Where the samples of a field lie, from what a user gives.

    Parameters
    ----------
    coordinates : sequence of array_like, or None
        As `encode` takes them; where only axes are periodic, the numbers of samples.
    error : float or None
        In cells.
    periodic : int or sequence of int, or None
    period : float or sequence of float, or None
        Of the coordinates x, y (, z); one number is that of x.

    Raises
    ------
    OptionError
        If options are out of range.
    """

    def __init__(self, coordinates: Any, error: Any, periodic: Any, period: Any) -> None:
        self._coordinates = coordinates
        self.periodic = _axes_of(periodic)
        self._period = period
        if error is not None and not (isinstance(error, Real) and 0 < float(error) <= MOST_ERROR):
            raise OptionError(
                f"coordinates_error is {error!r}; it must be a number of cells, at most {MOST_ERROR}",
                code="coordinates",
            )
        self._error = DEFAULT_ERROR if error is None else float(error)
        if coordinates is None and (error is not None or period is not None):
            name = "coordinates_error" if error is not None else "period"
            raise OptionError(f"{name} without coordinates", code="coordinates", remedy="give coordinates")

    @property
    def there(self) -> bool:
        """Whether there is something to be coded."""
        return self._coordinates is not None or bool(self.periodic)

    def cells_of(
        self, distance: str, field: ArrayLike, mask: ArrayLike | None = None, placement: ArrayLike | None = None
    ) -> float:
        """How many cells a distance in the world is at least, anywhere and in any direction.

        Parameters
        ----------
        distance : str
            A number with a unit: that of the coordinates, or m or km if these are longitudes (of a period of 360) and
            latitudes, on a sphere; without a unit cells.
        field, mask, placement
            As `encode` takes them.

        Raises
        ------
        OptionError
            If it is no distance, or if the field lies nowhere in the world.
        InputError
            As `given`.
        """
        number, unit = distance_of(distance)
        values, gone = without_holes(field, mask)
        shape, n = values.shape, values.ndim
        if not unit:
            return number
        if self._coordinates is None and placement is None:
            raise OptionError(
                f"a tolerance of {distance} for a field that lies nowhere in the world", code="tolerance",
                remedy="give a placement or coordinates, or a number of cells",
            )
        if self._coordinates is None and placement is not None:
            matrix = placement_of(placement, n)
            ends = np.indices((2,) * n).reshape(n, -1)
            arrays = [(sum(row[a] * ends[a] for a in range(n))).reshape((2,) * n) for row in matrix]
            return number / largest_step(arrays, [0.0] * n, np.ones((1,) * n, np.bool_), unit, False)
        arrays = arrays_of(self._coordinates, shape)
        periods = _periods_of(self._period, n)
        whole = np.ones([size - 1 for size in shape], np.bool_) if gone is None else whole_cells(gone)
        return number / largest_step(arrays, periods, whole, unit, periods[0] == TURN)

    def given(self, shape: tuple[int, ...], gone: NDArray[np.bool_] | None) -> Given:
        """The coordinates of a field, periodic axes closed; ``shape`` and ``gone`` are those of the closed one.

        Raises
        ------
        InputError
            If they cannot be those of samples.
        """
        n = len(shape)
        before = tuple(size - (axis in self.periodic) for axis, size in enumerate(shape))
        if self._coordinates is None:
            arrays = arrays_of([np.arange(size) for size in before], before)
            order = range(n - 1, -1, -1) if n == 2 else range(n)
            periods = [float(before[axis]) if axis in self.periodic else 0.0 for axis in order]
        else:
            arrays = arrays_of(self._coordinates, before)
            periods = _periods_of(self._period, n)
        arrays = [closed(array, self.periodic) for array in arrays]
        return check_coordinates(arrays, shape, gone, periods, self._error, self.periodic)

    def payload(self, shape: tuple[int, ...], gone: NDArray[np.bool_] | None) -> bytes:
        """Payload of the chunk of coordinates; parameters and errors as in `given`."""
        given = self.given(shape, gone)
        grids = [NodeGrid(array.shape, one.period) for one, array in zip(given.coordinates, given.arrays, strict=True)]
        free = [~_leant_on(needed) for needed in given.needed]
        # what is given where it does not matter may be smooth or not
        ways = [[np.isfinite(array) for array in given.arrays]]
        if not all(needed.all() for needed in given.needed):
            ways.append(list(given.needed))
        runs = [encode_run(grids, _units(given, known), free)[0] for known in ways]
        return write_coordinates(CoordinatesRecord(self.periodic, given.coordinates, min(runs, key=len)))


def _units(given: Given, known: Sequence[NDArray[np.bool_]]) -> list[NDArray[np.int64]]:
    """Coordinates in units from the first node on, with something smooth where they are not known."""
    out = []
    for one, array, there in zip(given.coordinates, given.arrays, known, strict=True):
        filled = array if there.all() else filled_smoothly(array, ~there)
        out.append(np.rint((filled - one.origin) / one.unit).astype(np.int64))
    return out


def _leant_on(needed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Nodes that matter, and those that they are predicted from, directly or not."""
    if needed.all():
        return needed
    out = needed.copy()
    stride = 1
    while stride < max(out.shape):
        for axis in range(out.ndim - 1, -1, -1):
            if out.shape[axis] > stride:
                steps = tuple(slice(None, None, stride if a <= axis else 2 * stride) for a in range(out.ndim))
                along = np.moveaxis(out[steps], axis, 0)
                here = along[1::2]
                place = 2 * np.arange(len(here)) + 1
                for step in (-5, -3, -1, 1, 3):
                    some = (place + step >= 0) & (place + step < len(along))
                    if step == -5:
                        some &= place + 1 >= len(along)
                    along[place[some] + step] |= here[some]
        stride *= 2
    return out


def _axes_of(periodic: Any) -> tuple[int, ...]:
    """Numbers of periodic axes."""
    if periodic is None:
        return ()
    axes = list(periodic) if isinstance(periodic, Sequence) and not isinstance(periodic, str) else [periodic]
    if any(isinstance(axis, bool) or not isinstance(axis, int | np.integer) for axis in axes):
        raise OptionError(f"periodic is {periodic!r}; it must be the number of an axis, or several", code="periodic")
    if len(set(axes)) < len(axes) or not all(0 <= axis < AXES for axis in axes):
        raise OptionError(f"periodic is {periodic!r}; axes are counted from 0, each once", code="periodic")
    return tuple(sorted(int(axis) for axis in axes))


def _periods_of(period: Any, n: int) -> list[float]:
    """Periods of the coordinates x, y (, z)."""
    given = [period] if isinstance(period, Real) or period is None else list(period)
    periods = [0.0 if one is None else float(one) for one in given]
    periods += [0.0] * (n - len(periods)) if len(periods) == 1 else []
    if len(periods) != n or not all(math.isfinite(one) and one >= 0 for one in periods):
        raise OptionError(
            f"period is {period!r}; it must be a positive number for x, or one for each of {n} coordinates",
            code="period", remedy="0 for coordinates without a period",
        )
    return periods


def check_axes(periodic: Sequence[int], shape: tuple[int, ...]) -> None:
    """Refuse periodic axes that a field does not have, or that are too short.

    Raises
    ------
    InputError
    """
    for axis in periodic:
        if axis >= len(shape):
            raise InputError(f"axis {axis} is periodic, and the field has {len(shape)} axes", code="periodic")
        if shape[axis] < 3:
            raise InputError(
                f"axis {axis} is periodic, and the field has {shape[axis]} samples along it", code="periodic",
                remedy="a periodic axis has 3 samples or more",
            )
