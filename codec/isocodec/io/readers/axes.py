"""Coordinates of samples on mapped grids: NetCDF arrays by the CF conventions, and .npz files with them beside.

Of a field over latitude and longitude, x is the longitude. An axis is periodic if the longitudes along it, a step
behind the last one, are at the first one again.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .numpyfile import read_numpy
from .source import Source

TURN = 360.0
"""Period of longitudes."""
_EVEN = 0.25
"""How far the step from the last to the first longitude may be from the others, in steps."""
_WEST_EAST = ("degrees_east", "degree_east", "degree_E", "degrees_E", "degreeE", "degreesE")
_SOUTH_NORTH = ("degrees_north", "degree_north", "degree_N", "degrees_N", "degreeN", "degreesN")
_PAIRS = (("lon", "lat"), ("longitude", "latitude"), ("rlon", "rlat"), ("nav_lon", "nav_lat"), ("x", "y"))
"""Names of coordinates x and y in .npz files."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MappedPlace:
    """Where samples lie on a mapped grid.

    Attributes
    ----------
    coordinates : list of float64
        x, y (, z), each with as many axes as the field, one node along those that it does not depend on.
    periodic : tuple of int
    period : tuple of float
        Of x, y (, z).
    """

    coordinates: list[Array]
    periodic: tuple[int, ...]
    period: tuple[float, ...]


def open_grid(axes: Sequence[Array]) -> list[Array]:
    """Coordinates x, y (, z) from one for each axis of the array, x along the last one."""
    n = len(axes)
    return [axis.reshape([-1 if a == n - 1 - c else 1 for a in range(n)]) for c, axis in enumerate(reversed(axes))]


def placed_grid(coordinates: list[Array], shape: Sequence[int], turns: bool) -> MappedPlace:
    """Coordinates of which x is a longitude, if it ``turns``, with the axes that are periodic then."""
    n = len(shape)
    periodic = tuple(a for a in range(n) if turns and _goes_round(coordinates[0], a, shape[a]))
    return MappedPlace(coordinates, periodic, (TURN if turns else 0.0,) + (0.0,) * (n - 1))


def _goes_round(longitude: Array, axis: int, size: int) -> bool:
    """Whether steps of longitudes along an axis, that from the last to the first included, make up a whole turn."""
    if longitude.shape[axis] != size or size < 3:
        return False
    steps = np.diff(longitude, axis=axis, append=longitude.take([0], axis=axis))
    steps = (steps + TURN / 2) % TURN - TURN / 2
    with np.errstate(invalid="ignore"):
        last, first = (np.abs(steps.take([i], axis=axis)) for i in (-1, 0))
        # on curvilinear grids rows beyond a pole do not go around anything
        round_it = np.abs(np.abs(steps.sum(axis=axis, keepdims=True)) - TURN) < 1e-3
        typical = np.abs(steps).max(axis=axis, keepdims=True)
        closes = (last <= (1 + _EVEN) * typical) & (last > 0) & (first > 0)
    return bool(np.count_nonzero(round_it & closes) * 2 > round_it.size)


def scales_of(scales: Sequence[tuple[Array, str]]) -> MappedPlace:
    """A mapped grid from the coordinates along each axis and their units."""
    units = scales[-1][1]
    coordinates = open_grid([scale for scale, _ in scales])
    return placed_grid(coordinates, [len(scale) for scale, _ in scales], units in _WEST_EAST)


def auxiliary(stored: Any, shape: Sequence[int], scale: Array | None) -> MappedPlace | None:
    """Longitude and latitude for each sample of the last two axes, as the attribute ``coordinates`` names them.

    ``scale`` are coordinates along the first of three axes.
    """
    found: dict[str, Array] = {}
    for name in text_of(stored, "coordinates").split():
        other = stored.parent.get(name)
        if other is None or getattr(other, "shape", None) is None or other.is_virtual or other.external:
            continue
        units = text_of(other, "units")
        counts = tuple(count for count in other.shape if count > 1)
        if counts == tuple(shape[-2:]) and other.dtype.kind in "iuf":
            which = "x" if units in _WEST_EAST else "y" if units in _SOUTH_NORTH else ""
            found[which] = _valid(other).reshape((1,) * (len(shape) - 2) + counts)
    if not {"x", "y"} <= found.keys() or (len(shape) == 3 and scale is None):
        return None
    coordinates = [found["x"], found["y"]] + ([] if scale is None else [scale.reshape(-1, 1, 1)])
    return placed_grid(coordinates, shape, True)


def text_of(stored: Any, name: str) -> str:
    """The text of an attribute; nothing where there is none."""
    text = stored.attrs.get(name, "")
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text)


def _valid(stored: Any) -> Array:
    """Numbers of a dataset, NaN where it has its fill value."""
    out = np.asarray(stored[()], np.float64)
    for name in ("_FillValue", "missing_value"):
        if name in stored.attrs:
            out = np.where(out == float(np.ravel(stored.attrs[name])[0]), np.nan, out)
    return out


def beside(source: Source, n: int) -> MappedPlace | None:
    """Coordinates in an .npz file of a field of two axes, under the usual names: along the axes, or for each sample."""
    if n != 2 or not zipfile.is_zipfile(source.path):
        return None
    with zipfile.ZipFile(source.path) as archive:
        names = {info.filename.removesuffix(".npy") for info in archive.infolist()}
    for pair in _PAIRS:
        if names.issuperset(pair):
            x, y = (np.asarray(read_numpy(source, name, None), np.float64) for name in pair)
            if x.ndim == 2 and x.shape == y.shape:
                return placed_grid([x, y], x.shape, pair[0] != "x")
            if x.ndim == y.ndim == 1:
                return placed_grid(open_grid([y, x]), (len(y), len(x)), pair[0] != "x")
    return None
