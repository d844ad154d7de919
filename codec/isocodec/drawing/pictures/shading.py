"""Pictures of surfaces: parallel projection with a depth buffer, using only numpy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .view import View

_SURFACE = np.array([0.62, 0.72, 0.84])
_BAND = 32
"""Number of rows of a picture that are coloured at a time."""


def shade(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    view: View,
    centre: NDArray[np.float64],
    scale: float,
    pixels: int,
) -> NDArray[np.float64]:
    """Draw triangles in parallel projection with a depth buffer, lit by their normals.

    Triangles are drawn as lattices of points less than a pixel apart, so that the time depends on the area on screen
    rather than on the number of triangles.

    Parameters
    ----------
    points : (P, 3) float64
        World coordinates, with z upwards.
    cells : (M, 3) int64
    view : View
    centre : (2,) float64
        Centre of the picture, along right and up.
    scale : float
        Width and height of the part that the picture shows.
    pixels : int
        Width and height of the picture.

    Returns
    -------
    (pixels, pixels, 4) float64
        Red, green, blue and opacity in 0 .. 1; the first row is the lowest.
    """
    side = 2 * pixels  # averaged down below, against ragged edges
    # A margin of half a pixel, so that points on the border fall inside.
    screen = (points @ view.screen - centre) * ((side - 1) / scale) + side / 2
    depth = points @ view.towards
    nearest = np.full(side * side, -np.inf)
    shown = np.full(side * side, -1, dtype=np.int64)
    for chosen, weights in _lattices(screen, cells):
        corners = cells[chosen]
        at = weights @ screen[corners]
        inside = np.clip(np.floor(at).astype(np.int64), 0, side - 1)
        pixel = (inside[..., 1] * side + inside[..., 0]).ravel()
        near = (depth[corners] @ weights.T).ravel()
        np.maximum.at(nearest, pixel, near)
        front = near == nearest[pixel]
        shown[pixel[front]] = np.repeat(chosen, len(weights))[front]

    image = np.empty((pixels, pixels, 4))
    for start in range(0, pixels, _BAND):
        end = min(start + _BAND, pixels)
        seen = shown[2 * start * side : 2 * end * side]
        image[start:end] = _lit(points, cells, view, seen).reshape(end - start, 2, pixels, 2, 4).sum(axis=(1, 3))
    # Colours are weighted by opacity; otherwise empty pixels would darken the outline.
    image[..., :3] /= np.maximum(image[..., 3:], 1.0)
    image[..., 3] /= 4.0
    return image


def _lit(
    points: NDArray[np.float64], cells: NDArray[np.int64], view: View, shown: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Colour and opacity, (S, 4), of pixels, each of which shows a triangle or nothing (-1)."""
    image = np.zeros((len(shown), 4))
    seen = shown >= 0
    a, b, c = (points[cells[shown[seen], k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0, length, 1.0)[:, None]
    # Both sides are lit alike, since an open surface shows its inside.
    normal *= np.where(normal @ view.towards < 0, -1.0, 1.0)[:, None]
    image[seen, :3] = _SURFACE * (0.3 + 0.7 * np.clip(normal @ view.light, 0.0, 1.0))[:, None]
    image[seen, 3] = 1.0
    return image


def _lattices(
    screen: NDArray[np.float64], cells: NDArray[np.int64], batch: int = 1 << 17
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Yield batches of triangles, each with barycentric weights (S, 3) of sufficiently dense points."""
    if len(cells) == 0:
        return
    a, b, c = (screen[cells[:, k]] for k in range(3))
    longest = np.sqrt(np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0))
    # At 0.85 pixels, no pixel inside a triangle stays empty, since the widest gap in the lattice is below one pixel.
    steps = np.maximum(np.ceil(longest / 0.85), 1.0)
    sizes = np.unique([m << k for k in range(14) for m in (2, 3)] + [1])
    size = sizes[np.minimum(np.searchsorted(sizes, steps), len(sizes) - 1)]
    for n in np.unique(size):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        kept = i + j <= n
        weights = np.stack([i[kept], j[kept], n - i[kept] - j[kept]], axis=1) / n
        chosen = np.flatnonzero(size == n)
        count = max(1, batch // len(weights))
        for start in range(0, len(chosen), count):
            yield chosen[start : start + count], weights
