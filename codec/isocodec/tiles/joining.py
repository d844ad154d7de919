"""Curves and surfaces of tiles as one: points on shared faces are the same from both sides (spec clause 12.7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour

Part = tuple[NDArray[np.int64], tuple[int, ...], Contour, NDArray[np.int64] | None]
"""Origin of a tile, its samples along each axis, what is drawn in it, in its own coordinates, and between which samples
the points lie."""
_GRAIN = 1 << 30
"""Points that were cut at missing samples are one if they agree to this part of a cell."""


def joined(parts: Sequence[Part], n: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points and cells of all tiles, a point on a face once: those on edges that lie in a face are the same from both
    sides.
    """
    points, cells, keys, faces, count = [np.zeros((0, n))], [np.zeros((0, n), np.int64)], [], [], 0
    by_ends = all(ends is not None for *_, ends in parts)
    for origin, size, contour, ends in parts:
        last = np.array(size) - 1
        points.append(contour.points + origin)
        cells.append(contour.cells + count)
        if by_ends and ends is not None:
            on_face = ((ends == 0).all(axis=1) | (ends == last).all(axis=1)).any(axis=1)
            keys.append((ends[on_face] + origin).reshape(-1, 2 * n))
        else:
            on_face = ((contour.points == 0) | (contour.points == last)).any(axis=1)
            keys.append(np.rint((contour.points[on_face] + origin) * _GRAIN).astype(np.int64))
        faces.append(count + np.flatnonzero(on_face))
        count += len(contour.points)
    number = np.arange(count)
    if parts:
        met = np.concatenate(faces)
        _, first, which = np.unique(np.concatenate(keys), axis=0, return_index=True, return_inverse=True)
        number[met] = met[first][which.reshape(-1)]
    kept, number = np.unique(number, return_inverse=True)
    return np.concatenate(points)[kept], number.reshape(-1)[np.concatenate(cells)]
