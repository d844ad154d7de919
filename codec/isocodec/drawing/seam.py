"""Join a contour across the ends of periodic axes (spec clause 9.9(4))."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def joined(
    points: NDArray[np.float64], cells: NDArray[np.int64], shape: Sequence[int], axes: Sequence[int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Replace the points in the last plane along periodic axes by those in the first.

    Returns the numbers of the points that are kept, and the cells between these.
    """
    number = np.arange(len(points))
    for axis in axes:
        beside = np.delete(points, axis, axis=1)
        first, last = (np.flatnonzero(points[:, axis] == end) for end in (0, shape[axis] - 1))
        there = {tuple(place): i for place, i in zip(beside[first].tolist(), first.tolist(), strict=True)}
        for i, place in zip(last.tolist(), beside[last].tolist(), strict=True):
            number[i] = there.get(tuple(place), i)
        # with two axes, a point may be replaced twice
        number = number[number]
    kept, cells = np.unique(number[cells], return_inverse=True)
    return kept, cells.reshape(-1, points.shape[1])
