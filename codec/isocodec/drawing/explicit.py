"""Draw the contour on a mesh: one piece for each crossed cell (spec clause 10.7)."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .separation import apart
from .simplices import simplex_table


def crossed_cells(cells: NDArray[np.int64], above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find which simplices (T, n + 1) have vertices on both sides."""
    mixed = above[cells]
    return np.asarray(mixed.any(axis=1) & ~mixed.all(axis=1))


def crossed_edges(cells: NDArray[np.int64], above: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Crossed edges of simplices (L, n + 1), whose ends lie on different sides: (E, 2), lower vertex first, sorted."""
    pairs = [*combinations(range(cells.shape[1]), 2)]
    ends = np.sort(cells[:, pairs].reshape(-1, 2), axis=1)
    ends = ends[above[ends[:, 0]] != above[ends[:, 1]]]
    # sorted as one number each, which is much faster than as pairs
    return np.stack(np.divmod(np.unique(ends[:, 0] * np.int64(len(above)) + ends[:, 1]), len(above)), axis=1)


def surface_contour(
    points: NDArray[np.float64], values: NDArray[np.float64], triangles: NDArray[np.int64], isovalue: float,
    *, measured: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Draw the points (P, 2) and segments (M, 2) of a contour of a surface that is linear on its triangles (T, 3).

    If ``measured``, points lie exactly where values equal the isovalue, even at ends of edges, where several coincide.
    """
    above = values > isovalue
    cells = triangles[crossed_cells(triangles, above)]
    edges = crossed_edges(cells, above)
    low, high = values[edges[:, 0]], values[edges[:, 1]]
    # halved first, since the difference of two large floats may overflow
    ratio = np.clip((isovalue / 2 - low / 2) / (high / 2 - low / 2), 0.0, 1.0)
    return draw_cells(
        points, cells, np.zeros(len(cells), np.bool_), above, edges, ratio if measured else apart(ratio)
    )


def draw_cells(
    points: NDArray[np.float64], cells: NDArray[np.int64], mirrored: NDArray[np.bool_], above: NDArray[np.bool_],
    edges: NDArray[np.int64], ratio: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Make points (E, d) on the crossed edges of crossed cells (L, n + 1), and cells (M, n) between them.

    ``mirrored`` (L,) are cells with the reverse of the orientation that `Contour` describes. ``edges`` (E, 2) have
    their lower vertex first; ``ratio`` (E,) measures the position of the points from there.
    """
    corners = cells.shape[1]
    pattern = above[cells] @ (1 << np.arange(corners))
    ends, _ = simplex_table(corners - 1).lookup(pattern, cells, mirrored)
    ends.sort(axis=2)
    key = edges[:, 0] * np.int64(len(points)) + edges[:, 1]
    order = np.argsort(key)
    place = np.searchsorted(key[order], ends[..., 0] * np.int64(len(points)) + ends[..., 1])
    low, high = points[edges[:, 0]], points[edges[:, 1]]
    # halved first, since the difference of two large floats may overflow
    at = ratio[:, None]
    return low * (1 - at) + high * at, order[place]
