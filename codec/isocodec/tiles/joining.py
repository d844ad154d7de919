"""Join the curves and surfaces of tiles: points on shared faces are the same from both sides (spec clause 12.7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .closing import Closing, TilePart

_GRAIN = 1 << 30
"""Points cut at missing samples are merged if they agree to within this fraction of a cell."""


def joined(parts: Sequence[TilePart], n: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Join the points and cells of all tiles, with each point on a shared face only once.

    If neighbours are drawn up to different stages, gaps are closed (`Closing`).
    """
    # if an edge has points in two stages, the later stage's position is used
    parts = sorted(parts, key=lambda part: -part.stage)
    points, cells, keys, faces, count = [np.zeros((0, n))], [np.zeros((0, n), np.int64)], [], [], 0
    for part in parts:
        origin, last = np.array(part.origin), np.array(part.size) - 1
        drawn, ends = part.contour, part.ends
        points.append(drawn.points + origin)
        cells.append(drawn.cells + count)
        edges, others = len(ends), drawn.points[len(ends) :]
        on_face = ((ends == 0).all(axis=1) | (ends == last).all(axis=1)).any(axis=1)
        keys.append((ends[on_face] + origin).reshape(-1, 2 * n))
        # points inside cells, or on a face where pieces were cut at missing samples
        cut = ((others == 0) | (others == last)).any(axis=1)
        places = np.rint((others[cut] + origin) * _GRAIN).astype(np.int64)
        keys.append(np.hstack([places, np.full_like(places, -1)]))
        faces += [count + np.flatnonzero(on_face), count + edges + np.flatnonzero(cut)]
        count += len(drawn.points)
    number = np.arange(count)
    if parts:
        met = np.concatenate(faces)
        _, first, which = np.unique(np.concatenate(keys), axis=0, return_index=True, return_inverse=True)
        number[met] = met[first][which.reshape(-1)]
    kept, number = np.unique(number, return_inverse=True)
    number = number.reshape(-1)
    whole, all_cells = np.concatenate(points)[kept], number[np.concatenate(cells)]
    if len({part.stage for part in parts}) > 1:
        ends_of_parts = np.cumsum([len(part.contour.points) for part in parts])
        numbers = np.split(number, ends_of_parts[:-1])
        more, closing = Closing(parts, numbers, whole).cells()
        whole, all_cells = np.concatenate([whole, more]), np.concatenate([all_cells, closing])
    return whole, all_cells
