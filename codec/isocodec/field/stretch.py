"""Distances between samples in the world, in cells (spec clauses 3.7.2, 9.9)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from .coordinates import at_corner, steps_along

DEGREE = 111194.92664455873
"""Metres of a degree of a great circle: on a sphere of 6371 km."""
_METRES = {"m": 1.0, "km": 1000.0}
_DISTANCE = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([A-Za-z\u00b0\u00b5]*)\s*")

Array = NDArray[np.float64]


def distance_of(text: str) -> tuple[float, str]:
    """Number and unit of a distance.

    Raises
    ------
    OptionError
        If it is none.
    """
    found = _DISTANCE.fullmatch(text)
    try:
        return float(found[1] if found else ""), found[2] if found else ""
    except ValueError:
        raise OptionError(
            f"{text!r} is not a distance", code="tolerance", remedy="a number of cells, or one with a unit: 100m"
        ) from None


def largest_step(
    arrays: Sequence[Array], periods: Sequence[float], whole: NDArray[np.bool_], unit: str, degrees: bool
) -> float:
    """The farthest that a step of a cell leads in the world, in ``unit``, over all whole cells and directions.

    Parameters
    ----------
    arrays : sequence of (s0 or 1, .., sn-1 or 1) float64
        Coordinates x, y (, z).
    periods : sequence of float
        Of each; 0 if it is not periodic.
    whole : (s0 - 1, .., sn-1 - 1) bool
        Which unit cells count.
    unit : str
        That of the coordinates; or m or km if they are degrees.
    degrees : bool
        Whether x and y are longitude and latitude.

    Returns
    -------
    float
        A bound, which is exact where axes are at right angles.
    """
    n = len(arrays)
    metres = _METRES.get(unit) if degrees else None
    steps = [
        [steps_along(array, axis, period) if array.shape[axis] > 1 else None for axis in range(n)]
        for array, period in zip(arrays, periods, strict=True)
    ]
    most = 0.0
    with np.errstate(invalid="ignore", over="ignore"):
        for corner in product((0, 1), repeat=n):
            j = [[at_corner(step, axis, corner) for axis, step in enumerate(row)] for row in steps]
            if metres is not None:
                at = tuple(slice(c, c + size - 1) if size > 1 else slice(None)
                           for c, size in zip(corner, arrays[1].shape, strict=True))
                east = np.cos(np.radians(arrays[1][at])) * DEGREE / metres
                j[:2] = [[step * east for step in j[0]], [step * (DEGREE / metres) for step in j[1]]]
            for a in range(n):
                # the largest eigenvalue is at most the largest sum of a row
                row = sum(np.abs(sum(one[a] * one[b] for one in j)) for b in range(n))
                most = max(most, float(np.max(np.broadcast_to(row, whole.shape), where=whole, initial=0.0)))
    return float(np.sqrt(most))
