"""Keep points of a curve or surface apart: on their edges, and where their coordinates are rounded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEAR_END = 2.0**-21
"""Share of its edge that a point keeps from either end (spec clause 9.5(6))."""
_SPREAD = 4
"""Steps over which points that would be rounded to one place are spread in each direction."""
_ROUNDS = 8
_PRIMES = np.array([73856093, 19349663, 83492791])


def apart(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """Limit places of points on edges, (E,), as fractions of the way; unknown ones (NaN) are in the middle.

    Points at a sample that equals the isovalue would otherwise fall together: segments would have no length, triangles
    no area, and rings would touch. Moved into their edges they form the curve of a slightly higher isovalue.
    """
    return np.clip(np.nan_to_num(ratio, nan=0.5), NEAR_END, 1 - NEAR_END)


def single(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round points (P, d) to single precision; those that would fall together are spread over a few steps of it."""
    points = points.astype(np.float64)
    pitch = float(np.spacing(np.abs(points).max(initial=0).astype(np.float32)))
    for _ in range(_ROUNDS):
        some = _together(np.rint(points / pitch).astype(np.int64))
        if not len(some):
            break
        _, group = np.unique(np.rint(points[some] / pitch), axis=0, return_inverse=True)
        group = group.reshape(-1)
        sums = np.stack([np.bincount(group, column) for column in points[some].T], axis=1)
        middle = (sums / np.bincount(group)[:, None])[group]
        way = points[some] - middle
        reach = np.zeros(len(sums))
        np.maximum.at(reach, group, np.abs(way).max(axis=1))
        points[some] = middle + way * (_SPREAD * pitch / np.maximum(reach, np.finfo(float).tiny))[group, None]
    return points.astype(np.float32)


def _together(places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the places (P, d) that coincide with others."""
    _, group, count = np.unique(places @ _PRIMES[: places.shape[1]], return_inverse=True, return_counts=True)
    some = np.flatnonzero(count[group.reshape(-1)] > 1)
    _, group, count = np.unique(places[some], axis=0, return_inverse=True, return_counts=True)
    return some[count[group.reshape(-1)] > 1]
