"""Windows of samples: their ends, and what of a drawing reaches into one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError

if TYPE_CHECKING:
    from .contour import Contour
    from .tessellation import Tessellation

Window = Sequence[Sequence[float]] | NDArray[np.float64]
"""Start and end along each axis."""


def ends_of(window: Window, d: int) -> NDArray[np.float64]:
    """Convert a window along d axes to its ends, (d, 2); raises `OptionError` if it is not valid."""
    ends = np.array(window, np.float64)
    if ends.shape != (d, 2) or not np.isfinite(ends).all() or (ends[:, 0] > ends[:, 1]).any():
        raise OptionError(
            f"the window is {window!r}; it must be {d} pairs, start and end along each axis", code="window"
        )
    return ends


def clipped(contour: Contour, window: Window | None) -> Contour:
    """Keep the cells of a contour that reach into a window of index coordinates (on a mesh: of its coordinates).

    Unless the window is as large as the grid, the part cannot be closed: rings may be missing from it.
    """
    if window is None:
        return contour
    if contour.origin_above is not None:
        low, high = ends_of(window, len(contour.shape)).T
        if (low > 0).any() or (high < np.array(contour.shape) - 1).any():
            contour = replace(contour, origin_above=None)
    inside = reaching(contour, window)
    used, number = np.unique(contour.cells[inside], return_inverse=True)
    return contour.part(used, number.reshape(-1, contour.cells.shape[1]))


def reaching(drawn: Contour | Tessellation, window: Window) -> NDArray[np.bool_]:
    """Find the cells that reach into a window."""
    bounds = ends_of(window, drawn.points.shape[1])
    corners = drawn.points[drawn.cells]
    inside = (corners.min(axis=1) < bounds[:, 1]) & (corners.max(axis=1) > bounds[:, 0])
    return np.asarray(inside.all(axis=1))


def bounds_of(
    shape: Sequence[int], box: Sequence[Sequence[float]] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the first and last samples of a box, by default all, clipped to the field.

    Raises `OptionError` if it is not a valid box, or lies outside the field.
    """
    last = np.array(shape, np.float64) - 1
    if box is None:
        return np.zeros(len(last)), last
    bounds = ends_of(box, len(last))
    if (bounds[:, 1] < 0).any() or (bounds[:, 0] > last).any():
        raise OptionError(f"the window lies outside the field of {tuple(shape)} samples", code="window")
    return np.clip(bounds[:, 0], 0, last), np.clip(bounds[:, 1], 0, last)
