"""Matrices and coordinates of other libraries as a `Placement`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..field.placement import RAS, TURN, Placement

Array = NDArray[np.float64]
BODY_TURN = np.diag([-1.0, -1.0, 1.0])
"""Between coordinates to the right, front and top of a body and those to the left, back and top."""
EVEN = 0.01
"""Largest distance of coordinates from even steps, in steps: files often keep them in single precision."""
_CLOSES = 0.25
"""Largest difference of the step from the last to the first longitude from the others, in steps."""


def kept_axes(shape: Sequence[int]) -> list[int]:
    """Axes of more than one sample, or the first two."""
    kept = [axis for axis, size in enumerate(shape) if size > 1]
    return kept if len(kept) > 1 else list(range(min(2, len(shape))))


def by_matrix(matrix: Array, kept: Sequence[int] | None = None, **more: Any) -> Placement:
    """Place samples by a matrix: a row for each of x, y (, z), a column for each axis of the array, the origin last.

    Of axes that are not ``kept`` there is one sample.
    """
    return Placement(matrix if kept is None else matrix[:, [*kept, -1]], **more)


def in_body(matrix: Array, kept: Sequence[int], lps: bool, unit: str = "mm") -> Placement:
    """Place samples by a matrix (3, axes + 1) to the right, front and top of a body, or (lps) left, back and top."""
    turn = BODY_TURN if lps else np.eye(3)
    return by_matrix(turn @ matrix[:3], kept, crs=RAS, unit=unit)


def even_steps(values: Array) -> tuple[float, float] | None:
    """Start and step of coordinates along an axis, None if the steps differ."""
    if len(values) < 2:
        return float(values[0]), 1.0
    step = (float(values[-1]) - float(values[0])) / (len(values) - 1)
    off = np.abs(values - (values[0] + step * np.arange(len(values)))).max()
    rounding = np.finfo(values.dtype).eps * np.abs(values).max() if values.dtype.kind == "f" else 0.0
    most = max(EVEN * abs(step), min(2 * float(rounding), abs(step) / 4))
    return (float(values[0]), step) if step and off <= most else None


def along_axes(axes: Sequence[Array], across: Sequence[int], turns: bool = False, **more: Any) -> Placement:
    """Place samples by the coordinates along each axis of the array: by steps if they are even, else one by one.

    ``across`` gives the coordinate (0 x, 1 y, 2 z) that runs along each axis. With ``turns``, x is a longitude in
    degrees, whose ends are joined if it goes round.
    """
    n = len(axes)
    nodes = [
        np.reshape(axes[axis], [-1 if other == axis else 1 for other in range(n)])
        for axis in (across.index(c) for c in range(n))
    ]
    even = [even_steps(np.asarray(values)) for values in axes]
    round_ = turns and goes_round(nodes[0], across.index(0))
    if round_ or any(one is None for one in even):
        return Placement(None, nodes, periodic=[across.index(0)] if round_ else (), periods=TURN if turns else 0.0,
                         inferred=True, **more)
    matrix = np.zeros((n, n + 1))
    for axis, found in enumerate(even):
        assert found is not None
        matrix[across[axis], n], matrix[across[axis], axis] = found
    return Placement(matrix, **more)


def at_nodes(nodes: Sequence[Array], turns: bool = False, **more: Any) -> Placement:
    """Place samples that have coordinates x, y (, z) each; of longitudes (``turns``) ends that meet are joined."""
    periodic = [axis for axis in range(nodes[0].ndim) if turns and goes_round(nodes[0], axis)]
    return Placement(None, nodes, periodic=periodic, periods=TURN if turns else 0.0, inferred=True, **more)


def goes_round(longitude: Array, axis: int) -> bool:
    """Whether longitudes along an axis, with the step from the last to the first, make up one turn."""
    if longitude.shape[axis] < 3:
        return False
    steps = np.diff(longitude, axis=axis, append=longitude.take([0], axis=axis))
    steps = (steps + TURN / 2) % TURN - TURN / 2
    with np.errstate(invalid="ignore"):
        turn = steps.sum(axis=axis, keepdims=True)
        # the last step goes on, also where columns repeat
        last, first = (steps.take([i], axis=axis) * np.sign(turn) for i in (-1, 0))
        typical = np.abs(steps.take(range(steps.shape[axis] - 1), axis=axis)).max(axis=axis, keepdims=True)
        # on curvilinear grids rows beyond a pole do not go around anything
        closes = (np.abs(np.abs(turn) - TURN) < 1e-3) & (last <= (1 + _CLOSES) * typical) & (last > 0) & (first != 0)
    return bool(np.count_nonzero(closes) * 2 > closes.size)


def as_integers(values: NDArray[Any]) -> NDArray[Any]:
    """Whole numbers that scaling made floats of, as int32 or int64; others as they are."""
    if values.dtype.kind != "f":
        return values
    with np.errstate(invalid="ignore"):
        whole = (values == np.rint(values)).all() and np.abs(values).max(initial=0) < 2**53
    return values.astype(np.int32 if np.abs(values).max(initial=0) < 2**31 else np.int64) if whole else values
