"""Background of a map: the field in relief, lit from the upper left, and its holes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...extras import optional
from ..curve import Curve

Shades = NDArray[np.float64]

_STEEP = 0.7
"""Slope, after exaggeration, below which nine tenths of a field lie."""
_SHARE = 90


def colour_map(shadow: str, light: str) -> Any:
    """Colours from shadow, 0, to light, 1."""
    colors = optional("matplotlib.colors", extra="plot", purpose="drawing a picture")
    return colors.LinearSegmentedColormap.from_list("relief", [shadow, light])


def draw_relief(
    axes: Any, contour: Curve, field: NDArray[Any], valid: NDArray[np.bool_] | None, colours: Any
) -> None:
    """Draw a field in relief; heights are exaggerated so that slopes are visible, regardless of the unit."""
    every = max(1, int(min(np.array(field.shape) / axes.bbox.size[::-1])))
    heights = np.asarray(field[::every, ::every], np.float64)
    if valid is not None:
        heights = np.where(valid[::every, ::every], heights, np.nan)
    if min(heights.shape) < 2:
        return
    index = (np.argwhere(np.ones(heights.shape, np.bool_)) * every).astype(np.float64)
    x, y = contour.place(index).T.reshape(2, *heights.shape)
    pixels = axes.transData.transform(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(*heights.shape, 2)
    # on a curved grid, the steps in the middle represent all
    row, column = heights.shape[0] // 2 - 1, heights.shape[1] // 2 - 1
    corner = pixels[row, column]
    steps = np.stack([pixels[row + 1, column] - corner, pixels[row, column + 1] - corner], axis=1)
    image = shaded(heights, steps)
    look = {"cmap": colours, "vmin": 0, "vmax": 1, "zorder": 0}
    if not contour.bent and not steps.diagonal().any():
        half = np.array([x[0, 1] - x[0, 0], y[1, 0] - y[0, 0]]) / 2
        axes.imshow(
            np.ma.masked_invalid(image), origin="lower", aspect="auto", interpolation="bilinear",
            extent=(x[0, 0] - half[0], x[0, -1] + half[0], y[0, 0] - half[1], y[-1, 0] + half[1]), **look,
        )
    else:
        cells = (image[:-1, :-1] + image[1:, :-1] + image[:-1, 1:] + image[1:, 1:]) / 4
        axes.pcolormesh(x, y, np.ma.masked_invalid(cells), rasterized=True, **look)


def shaded(heights: Shades, steps: NDArray[np.float64]) -> Shades:
    """Compute the light on a field from the upper left, 45 degrees high: 0 .. 1, NaN where samples are missing.

    Parameters
    ----------
    heights : (s0, s1) float64
    steps : (2, 2) float64
        A column for each axis: what a step along it adds to x (to the right) and y (upwards) in the picture.
    """
    # next to missing samples, the field is taken to be level
    slopes = np.nan_to_num(np.stack([np.gradient(heights, axis=axis) for axis in (0, 1)]))
    # the difference along an axis is the gradient in the picture times the step of that axis
    x, y = np.tensordot(np.linalg.inv(steps).T, slopes, axes=1)
    steep = np.hypot(x, y)
    exaggerated = _STEEP / np.percentile(steep[steep > 0], _SHARE) if steep.any() else 0.0
    x, y = x * exaggerated, y * exaggerated
    # the light comes from (-1, 1, sqrt 2) / 2; normals are (-x, -y, 1)
    lit = (x - y + np.sqrt(2)) / (2 * np.sqrt(1 + x * x + y * y))
    return np.where(np.isfinite(heights), np.clip(lit, 0, 1), np.nan)


def hole_cells(valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find unit cells with a missing corner, where curves end."""
    return ~(valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:])


def within_holes(valid: NDArray[np.bool_], finest: tuple[int, ...]) -> NDArray[np.float64]:
    """Index coordinates (P, 2) of points that fill the cells of holes, as dense as the cells of a page."""
    missing = hole_cells(valid)
    row, column = np.nonzero(missing)
    cells = np.stack([row, column], axis=1).astype(np.float64)
    count = int(np.ceil(max(np.array(finest) / missing.shape))) + 1
    within = (np.argwhere(np.ones((count, count), np.bool_)) + 0.5) / count
    return np.asarray((cells[:, None] + within).reshape(-1, 2))


def hole_path(contour: Curve, valid: NDArray[np.bool_]) -> Any:
    """Make one path, in world coordinates, of the cells of holes: the runs of cells in each row."""
    path = optional("matplotlib.path", extra="plot", purpose="drawing a picture")
    missing = hole_cells(valid)
    ends = np.diff(missing.astype(np.int8), axis=1, prepend=0, append=0)
    row, first = np.nonzero(ends == 1)
    last = np.nonzero(ends == -1)[1]
    if contour.bent:
        # edges bend with the grid, so each cell is drawn separately
        row, first = np.nonzero(missing)
        last = first + 1
    corners = np.stack(
        [np.stack([row + down, where], axis=1) for down, where in ((0, first), (0, last), (1, last), (1, first))],
        axis=1,
    ).astype(np.float64)
    closed = np.concatenate([corners, corners[:, :1]], axis=1)
    codes = np.tile([path.Path.MOVETO, *[path.Path.LINETO] * 3, path.Path.CLOSEPOLY], len(closed))
    return path.Path(contour.place(closed.reshape(-1, 2)), codes)
