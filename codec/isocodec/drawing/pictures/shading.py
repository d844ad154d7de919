"""Pictures of surfaces: parallel projection with a depth buffer, using only numpy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from .view import View

SURFACE = np.array([0.62, 0.72, 0.84])
"""Colour of a surface that is drawn alone."""
_VEIL = 0.35
"""Opacity of a surface around another one."""
_BAND = 32
"""Number of rows of a picture that are averaged at a time."""
_PIXELS = 1 << 18
"""Number of pixels that are coloured at a time."""


@dataclass(frozen=True)
class Solid:
    """A surface: (P, 3) points with z upwards, (M, 3) triangles, and red, green and blue in 0 .. 1."""

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    colour: NDArray[np.float64] = field(default_factory=lambda: SURFACE)


def shade(
    solids: Sequence[Solid], view: View, centre: NDArray[np.float64], scale: float, pixels: int
) -> NDArray[np.float64]:
    """Draw surfaces in parallel projection with a depth buffer, lit by the normals of their vertices.

    Triangles are drawn as lattices of points less than a pixel apart, so that the time depends on the area on screen
    rather than on the number of triangles.

    Parameters
    ----------
    solids : sequence of Solid
        From the inside out: the first one is opaque, the others are seen through.
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
    colours = np.zeros((side * side, 4), np.float32)
    opaque = np.full(side * side, -np.inf, np.float32)
    for number, solid in enumerate(solids):
        nearest, normals = _nearest(solid, view, centre, scale, side)
        visible = np.flatnonzero(nearest > opaque)
        for start in range(0, len(visible), _PIXELS):
            seen = visible[start : start + _PIXELS]
            lit, facing = _lit(solid, view, normals[seen])
            # what is seen through is denser where it is seen from the side
            share = (_VEIL + (1 - _VEIL) * 0.8 * (1 - facing) ** 2 if number else np.ones(len(seen)))[:, None]
            colours[seen] *= 1 - share
            colours[seen] += share * np.append(lit, np.ones((len(seen), 1)), axis=1)
        if not number:
            opaque = nearest
    image = np.empty((pixels, pixels, 4))
    for start in range(0, pixels, _BAND):
        end = min(start + _BAND, pixels)
        band = colours[2 * start * side : 2 * end * side].reshape(end - start, 2, pixels, 2, 4)
        image[start:end] = band.sum(axis=(1, 3), dtype=np.float64)
    # Colours are weighted by opacity; otherwise empty pixels would darken the outline.
    image[..., :3] /= np.where(image[..., 3:] > 0, image[..., 3:], 1.0)
    image[..., 3] /= 4.0
    return image


def _nearest(
    solid: Solid, view: View, centre: NDArray[np.float64], scale: float, side: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Find at each pixel the depth of the nearest point of a surface, -inf if none, and its normal, (side**2, 3)."""
    points, cells = solid.points, solid.cells
    # A margin of half a pixel, so that points on the border fall inside.
    screen = (points @ view.screen - centre) * ((side - 1) / scale) + side / 2
    depth = points @ view.towards
    normal = vertex_normals(points, cells)
    nearest = np.full(side * side, -np.inf, np.float32)
    shown = np.zeros((side * side, 3), np.float32)
    for chosen, weights in _lattices(screen, cells):
        corners = cells[chosen]
        at = weights @ screen[corners]
        inside = np.clip(np.floor(at).astype(np.int64), 0, side - 1)
        pixel = (inside[..., 1] * side + inside[..., 0]).ravel()
        near = (depth[corners] @ weights.T).astype(np.float32).ravel()
        np.maximum.at(nearest, pixel, near)
        front = near == nearest[pixel]
        triangle, place = np.divmod(np.flatnonzero(front), len(weights))
        shown[pixel[front]] = np.einsum("pk,pkc->pc", weights[place], normal[corners[triangle]])
    return nearest, shown


def vertex_normals(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals of vertices, (P, 3): the mean of those of their triangles by area; 0 of a vertex without any."""
    a, b, c = (points[cells[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normal = np.stack(
        [sum(np.bincount(cells[:, k], across[:, axis], len(points)) for k in range(3)) for axis in range(3)], axis=1
    )
    length = np.linalg.norm(normal, axis=1)
    return np.asarray(normal / np.where(length > 0, length, 1.0)[:, None])


def _lit(
    solid: Solid, view: View, normal: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Colours, (S, 3), of pixels with these normals, and cosines, (S,), of the angles to the viewer."""
    length = np.linalg.norm(normal, axis=1)
    towards = normal @ view.towards
    # Both sides are lit alike, since an open surface shows its inside.
    turned = np.where(towards < 0, -1.0, 1.0) / np.where(length > 0, length, 1.0)
    shades = 0.3 + 0.7 * np.clip(normal @ view.light * turned, 0.0, 1.0)
    return shades[:, None] * solid.colour, np.clip(towards * turned, 0.0, 1.0)


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
