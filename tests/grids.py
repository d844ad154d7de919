"""Mapped grids that tests share: fields with coordinates x, y (, z) for each sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isocodec import Field
from isocodec.field.placement import Placement
from libraries import Late

RegularGridInterpolator = Late("scipy.interpolate.RegularGridInterpolator")

Array = NDArray[np.float64]


def placed(field: NDArray[Any], coordinates: Sequence[NDArray[Any]] | None = None, **where: Any) -> Field:
    """A field on the nodes of such a grid."""
    return Field(field, placement=Placement(None, coordinates, **where))


def rotated_pole(rows: int = 40, columns: int = 50) -> tuple[Array, list[Array]]:
    """Hills over longitude and latitude of a grid whose pole lies elsewhere, across the date line."""
    down, along = np.radians(np.linspace(-20, 25, rows))[:, None], np.radians(np.linspace(-28, 30, columns))[None]
    x, y, z = np.cos(down) * np.cos(along), np.cos(down) * np.sin(along), np.broadcast_to(np.sin(down), (rows, columns))
    tilt = np.radians(40.0)
    x, z = x * np.cos(tilt) - z * np.sin(tilt), x * np.sin(tilt) + z * np.cos(tilt)
    longitude = (np.degrees(np.arctan2(y, x)) + 170.0 + 180.0) % 360.0 - 180.0
    field = np.sin(9 * down) * np.cos(7 * along) + 0.3 * np.sin(5 * along + 11 * down)
    return field, [longitude, np.degrees(np.arcsin(z))]


def polar(rows: int = 24, columns: int = 60) -> tuple[Array, list[Array]]:
    """Rings around a centre, axis 1 goes round: a curve that winds around it."""
    radius = np.linspace(1.0, 3.0, rows)[:, None]
    angle = 2 * np.pi * np.arange(columns)[None] / columns
    field = radius - 2.0 - 0.4 * np.cos(3 * angle + 0.3) - 0.2 * np.sin(5 * angle)
    return field, [radius * np.cos(angle), radius * np.sin(angle)]


def elliptic(rows: int = 30, columns: int = 70) -> tuple[Array, list[Array]]:
    """Ellipses of one family around a mean contour."""
    reach = np.linspace(0.4, 1.6, rows)[:, None]
    angle = 2 * np.pi * np.arange(columns)[None] / columns
    x, y = 3 * np.cosh(reach) * np.cos(angle), 3 * np.sinh(reach) * np.sin(angle)
    return np.hypot(x, 1.3 * y) - 5.0 - 0.5 * np.cos(4 * angle), [x, y]


def cylinder() -> tuple[Array, list[Array]]:
    """A bumpy pipe, axis 1 goes round."""
    height = np.linspace(0.0, 2.0, 9)[:, None, None]
    angle = 2 * np.pi * np.arange(24)[None, :, None] / 24
    radius = np.linspace(1.0, 2.0, 11)[None, None]
    field = radius - 1.5 - 0.2 * np.cos(3 * angle + height) + 0.1 * np.sin(4 * height)
    full = (9, 24, 11)
    places = radius * np.cos(angle), radius * np.sin(angle), height
    return field, [np.broadcast_to(one, full).copy() for one in places]


def interpolated(array: Array, points: Array) -> Array:
    """An array between its samples, at points in index coordinates: multilinear."""
    return np.asarray(RegularGridInterpolator([np.arange(size) for size in array.shape], array)(points))


def off(contour_points: Array, placed: Array, arrays: list[Array]) -> float:
    """How far points lie from their place at most, in cells: found by the differences of the coordinates there."""
    step = 1e-4
    last = np.array(arrays[0].shape) - 1
    slopes = []
    for axis in range(arrays[0].ndim):
        before, behind = contour_points.copy(), contour_points.copy()
        before[:, axis] = np.maximum(before[:, axis] - step, 0)
        behind[:, axis] = np.minimum(behind[:, axis] + step, last[axis])
        wide = (behind - before)[:, axis]
        slopes.append([(interpolated(a, behind) - interpolated(a, before)) / wide for a in arrays])
    jacobian = np.array(slopes).transpose(2, 1, 0)
    missed = placed - np.stack([interpolated(a, contour_points) for a in arrays], axis=1)
    return float(np.linalg.norm(np.linalg.solve(jacobian, missed[..., None])[..., 0], axis=1).max(initial=0.0))
