"""Keep points of a curve or surface apart: on their edges, and where their coordinates are rounded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEAR_END = 2.0**-21
"""Share of its edge that a point keeps from either end (spec clause 9.5(6))."""
_SPREAD, _ROUNDS = 4, 9
"""Steps over which points that would be rounded to one place are spread in each direction; more in each round."""
_PRIMES = np.array([73856093, 19349663, 83492791])


def apart(ratio: NDArray[np.float64], out: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Limit places of points on edges, (E,), as fractions of the way; unknown ones (NaN) are in the middle.

    ``out`` may be the places themselves.

    Points at a sample that equals the isovalue would otherwise fall together: segments would have no length, triangles
    no area, and rings would touch. Moved into their edges they form the curve of a slightly higher isovalue.
    """
    out = np.positive(ratio, out)
    np.nan_to_num(out, copy=False, nan=0.5)
    return np.clip(out, NEAR_END, 1 - NEAR_END, out=out)


def single(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round points (P, d) to single precision; points that would coincide are spread over a few of its steps."""
    points = points.astype(np.float64)
    pitch = float(np.spacing(np.abs(points).max(initial=0).astype(np.float32)))
    for spread in range(_SPREAD, _ROUNDS * _SPREAD, _SPREAD):
        some, group = _together(points.astype(np.float32))
        if not len(some):
            break
        sums = np.stack([np.bincount(group, column) for column in points[some].T], axis=1)
        middle = (sums / np.bincount(group)[:, None])[group]
        way = points[some] - middle
        reach = np.zeros(len(sums))
        np.maximum.at(reach, group, np.abs(way).max(axis=1))
        points[some] = middle + way * (spread * pitch / np.maximum(reach, np.finfo(float).tiny))[group, None]
    return points.astype(np.float32)


def _together(points: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the points (P, d) that coincide with others, and of the place of each."""
    keys = (points + 0).view(np.int32).astype(np.int64) @ _PRIMES[: points.shape[1]]
    _, group, count = np.unique(keys, return_inverse=True, return_counts=True)
    some = np.flatnonzero(count[group] > 1)
    # other points may have the same key
    _, group, count = np.unique(points[some], axis=0, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    again = count[group] > 1
    return some[again], np.unique(group[again], return_inverse=True)[1]
