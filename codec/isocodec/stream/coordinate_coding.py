"""Encode and decode the coordinates of samples in a file (spec clauses 3.7.4, 9.9)."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, LimitError
from ..field.coordinates import Given, arrays_of, check_coordinates, folds
from ..field.filling import filled_smoothly
from ..field.mapped import Mapped
from ..field.placement import DEFAULT_ERROR, Placement, closed, coded_placement, read_placement
from ..format.coordinate_record import CoordinatesRecord, write_coordinates
from ..limits import Budget, Limits


class DecodedCoordinates:
    """Coordinates of a file, decoded when they are needed for a drawing.

    Parameters
    ----------
    budget : Budget
    limits : Limits
        Limits for the run of coordinates, separate from those for all other runs, because it is decoded when something
        is drawn, and later decoding must not depend on that.
    """

    def __init__(self, budget: Budget, limits: Limits) -> None:
        self._budget = budget
        self._limits = limits
        self._record: CoordinatesRecord | None = None
        self._mapped: Mapped | None = None

    def mapped(self, record: CoordinatesRecord | None, shape: tuple[int, ...]) -> Mapped | None:
        """Decode a chunk of coordinates; None without one, or if its run is malformed and therefore ignored.

        Raises
        ------
        LimitError
            If it takes more than the limits allow; nothing is kept then.
        """
        if record is not self._record:
            self.drop()
            if record is not None:
                from ..entropy.run import Account
                from ..grid.passes.node_run import NodeGrid, decode_run

                grids = [NodeGrid(one.counts(shape), one.period) for one in record.coordinates]
                self._budget.hold(self, 8 * sum(grid.nodes for grid in grids))
                try:
                    values = decode_run(record.run, grids, Account(self._limits.symbols, self._limits.work))
                except LimitError:
                    self._budget.release(self)
                    raise
                if values is None:
                    self._budget.release(self)
                else:
                    self._mapped = Mapped(shape, record.coordinates, tuple(values), record.periodic)
            self._record = record
        return self._mapped

    def placement(
        self, record: CoordinatesRecord | None, shape: tuple[int, ...], metadata: Mapping[str, str]
    ) -> Placement | None:
        """Placement of a file of this shape, from its coordinates or otherwise its notes; errors as for `mapped`."""
        mapped = self.mapped(record, shape)
        return read_placement(metadata, len(shape)) if mapped is None else coded_placement(mapped, metadata)

    def drop(self) -> None:
        """Free the memory."""
        self._record = self._mapped = None
        self._budget.release(self)


def without_folds(
    placement: Placement, shape: tuple[int, ...], gone: NDArray[np.bool_] | None
) -> NDArray[np.bool_] | None:
    """Check periodic axes, and leave cells that fold out of a field; a warning counts them.

    A sample of each is taken for missing.

    Parameters
    ----------
    placement : Placement
    shape : tuple of int
        Of the field, periodic axes open.
    gone : (s0, .., sn-1) bool, optional
        Which samples are missing.

    Returns
    -------
    (s0, .., sn-1) bool or None
        Which are then.

    Raises
    ------
    InputError
        If the field lacks a periodic axis, or it is too short.
    """
    periodic = placement.periodic
    for axis in periodic:
        if axis >= len(shape):
            raise InputError(f"axis {axis} is periodic, but the field has {len(shape)} axes", code="periodic")
        if shape[axis] < 3:
            raise InputError(
                f"axis {axis} is periodic, but the field has {shape[axis]} samples along it", code="periodic",
                remedy="a periodic axis must have at least 3 samples",
            )
    if placement.coordinates is None:
        return gone
    closed_shape = tuple(size + (axis in periodic) for axis, size in enumerate(shape))
    arrays, _, _, periods, error, _ = _arguments(placement, closed_shape, None)
    if all(np.count_nonzero(np.array(array.shape) > 1) == 1 for array in arrays):
        return gone
    found = folds(arrays, closed_shape, None if gone is None else closed(gone, periodic), periods, error)
    if found is None:
        return gone
    count, some = found
    out = np.zeros(shape, np.bool_) if gone is None else gone.copy()
    places = np.argwhere(some)
    out[tuple((places % shape).T)] = True
    warnings.warn(
        f"cells that fold or all but vanish in their coordinates: {count:,}; they are left out, with {len(places):,} "
        "of their samples", stacklevel=6,
    )
    return out


def _arguments(placement: Placement, shape: tuple[int, ...], gone: NDArray[np.bool_] | None) -> tuple[Any, ...]:
    """Arguments of `check_coordinates`."""
    n = len(shape)
    periodic = placement.periodic
    before = tuple(size - (axis in periodic) for axis, size in enumerate(shape))
    coordinates = placement.with_nodes(before).coordinates
    if coordinates is None:
        arrays = arrays_of([np.arange(size) for size in before], before)
        order = range(n - 1, -1, -1) if n == 2 else range(n)
        periods = [float(before[axis]) if axis in periodic else 0.0 for axis in order]
    else:
        arrays = arrays_of(coordinates, before)
        periods = placement.periods_of(n)
    arrays = [closed(array, periodic) for array in arrays]
    error = DEFAULT_ERROR if placement.error is None else float(placement.error)
    return arrays, shape, gone, periods, error, periodic


def coordinates_payload(
    placement: Placement | None, shape: tuple[int, ...], gone: NDArray[np.bool_] | None
) -> bytes:
    """Write the payload of the chunk of coordinates (empty without any); for the closed field.

    Raises
    ------
    InputError
        If they cannot be coordinates of samples.
    """
    if placement is None or (placement.coordinates is None and not placement.periodic):
        return b""
    from ..grid.passes.node_run import NodeGrid, encode_run

    given = check_coordinates(*_arguments(placement, shape, gone))
    grids = [NodeGrid(array.shape, one.period) for one, array in zip(given.coordinates, given.arrays, strict=True)]
    free = [~_leant_on(needed) for needed in given.needed]
    # given values that do not matter may or may not be smooth
    ways = [[np.isfinite(array) for array in given.arrays]]
    if not all(needed.all() for needed in given.needed):
        ways.append(list(given.needed))
    runs = [encode_run(grids, _units(given, known), free)[0] for known in ways]
    return write_coordinates(CoordinatesRecord(placement.periodic, given.coordinates, min(runs, key=len)))


def _units(given: Given, known: Sequence[NDArray[np.bool_]]) -> list[NDArray[np.int64]]:
    """Coordinates in units, relative to the first node, continued smoothly where they are not known."""
    out = []
    for one, array, there in zip(given.coordinates, given.arrays, known, strict=True):
        filled = array if there.all() else filled_smoothly(array, ~there)
        out.append(np.rint((filled - one.origin) / one.unit).astype(np.int64))
    return out


def _leant_on(needed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Nodes that matter, and those that they are predicted from, directly or indirectly."""
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
