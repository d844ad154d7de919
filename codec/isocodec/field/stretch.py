"""Distances between samples in the world, in cells (spec clauses 3.7.2, 9.9)."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..extras import optional
from .coordinates import steps_at_corners
from .units import DEGREE, METRES, distance_of, units_of

WGS84 = (6378137.0, 6356752.314245179)
"""Half axes of the ellipsoid, in metres."""
UNSTATED = (WGS84[0] ** 2 / WGS84[1],) * 2
"""Radii that are at least those of any direction anywhere, for degrees on an unknown ellipsoid."""
_WGS84 = re.compile("(EPSG:(4326|4979|4258|4269)|OGC:CRS84|CRS:84)", re.I)
"""Systems of longitudes and latitudes on that ellipsoid, or on one within a tenth of a millimetre of it."""
SAMPLED = 17
"""Places along each axis at which the scale of a projection is looked at."""
_CHUNK = 4096

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GroundScale:
    """Scale of coordinates on the ground.

    Attributes
    ----------
    metres : tuple of float
        Of one unit of each coordinate; of longitude and latitude, radians.
    axes : (float, float) or None
        Half axes of the ellipsoid in metres, if x and y are longitude and latitude.
    """

    metres: tuple[float, ...]
    axes: tuple[float, float] | None = None

    def factors(self, latitude: Array | None) -> list[Any]:
        """Metres of a step of one of each coordinate within each unit cell, at most.

        ``latitude`` is the coordinate y at the nodes, where x and y are longitude and latitude, else None.
        """
        if self.axes is None or latitude is None:
            return [*self.metres]
        size = tuple(max(count - 1, 1) for count in latitude.shape)
        corners = [
            latitude[tuple(slice(c, c + s) if count > 1 else slice(None)
                           for c, s, count in zip(corner, size, latitude.shape, strict=True))]
            for corner in product((0, 1), repeat=latitude.ndim)
        ]
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        nearest = np.where(low * high > 0, np.minimum(np.abs(low), np.abs(high)), 0.0)
        farthest = np.maximum(np.abs(low), np.abs(high))
        turn = self.metres[0]
        east, north = radii(np.minimum(nearest * turn, np.pi / 2), np.minimum(farthest * turn, np.pi / 2), self.axes)
        return [east * turn, north * turn, *self.metres[2:]]

    def of_lines(self, places: Array, first: NDArray[np.int64]) -> Array:
        """Points of lines, which begin at ``first``, in metres.

        Longitudes and latitudes of each line get a scale that is nowhere too small.
        """
        if self.axes is None:
            return places * np.array(self.metres)
        latitude = places[:, 1] * self.metres[0]
        low, high = np.minimum.reduceat(latitude, first), np.maximum.reduceat(latitude, first)
        near = np.where(low * high > 0, np.minimum(abs(low), abs(high)), 0.0)
        far = np.maximum(abs(low), abs(high))
        scale = np.stack(radii(np.minimum(near, np.pi / 2), np.minimum(far, np.pi / 2), self.axes), axis=1)
        return np.asarray(places * np.repeat(scale * self.metres[0], np.diff(first, append=len(places)), axis=0))


def radii(near: Any, far: Any, axes: tuple[float, float]) -> tuple[Any, Any]:
    """Metres of a radian of longitude at the latitude ``near``, and of latitude at ``far``, on an ellipsoid."""
    long, short = axes
    flat = 1 - (short / long) ** 2
    root = np.sqrt(1 - flat * np.sin(near) ** 2)
    return long / root * np.cos(near), long * (1 - flat) / (1 - flat * np.sin(far) ** 2) ** 1.5


def largest_step(
    arrays: Sequence[Array], periods: Sequence[float], whole: NDArray[np.bool_], ground: GroundScale
) -> float:
    """The farthest that a step of a cell leads in the world, in metres, over all whole cells and directions.

    ``whole`` (s0 - 1, .., sn-1 - 1) marks the unit cells that count. Within a cell, where coordinates are multilinear,
    nothing is farther.
    """
    n = len(arrays)
    most = 0.0
    with np.errstate(invalid="ignore", over="ignore"):
        factors = ground.factors(arrays[1])
        for steps in steps_at_corners(arrays, periods):
            j = [[step * factor if np.ndim(step) else step for step in row]
                 for row, factor in zip(steps, factors, strict=True)]
            gram = [[sum(row[a] * row[b] for row in j) for b in range(n)] for a in range(n)]
            most = _largest(gram, whole, most)
    return float(np.sqrt(most))


def _largest(gram: list[list[Any]], whole: NDArray[np.bool_], most: float) -> float:
    """The largest eigenvalue of symmetric matrices, one for each cell that counts, or ``most`` if that is larger."""
    n = len(gram)
    if not any(np.ndim(gram[a][b]) or gram[a][b] for a, b in product(range(n), repeat=2) if a != b):
        return max(most, *(float(np.max(np.broadcast_to(gram[a][a], whole.shape), where=whole, initial=0.0))
                           for a in range(n)))
    # the largest sum of a row is at least the largest eigenvalue: most cells need no more
    bound = np.maximum.reduce([np.broadcast_to(sum(np.abs(one) for one in row), whole.shape) for row in gram])
    at = np.flatnonzero(whole & (bound > most))
    bounds = bound.ravel()[at]
    order = np.argsort(-bounds)
    for first in range(0, len(order), _CHUNK):
        some = order[first : first + _CHUNK]
        if bounds[some[0]] <= most:
            break
        place = np.unravel_index(at[some], whole.shape)
        matrices = np.empty((len(some), n, n))
        for a, b in product(range(n), repeat=2):
            matrices[:, a, b] = np.broadcast_to(gram[a][b], whole.shape)[place]
        good = np.isfinite(matrices).all(axis=(1, 2))
        if good.any():
            most = max(most, float(np.linalg.eigvalsh(matrices[good])[:, -1].max()))
    return most


def ground_of(
    unit: str | None, crs: str | None, degrees: bool, n: int, some: Callable[[], Array], distance: str
) -> GroundScale:
    """Find the scale of n coordinates on the ground.

    ``degrees`` states that x and y are known to be longitudes and latitudes in some other way, and ``some`` gives some
    points (P, n) within the field. Raises `OptionError`, naming the ``distance`` that is converted, if the unit of the
    coordinates is unknown, and `MissingExtraError` if it takes pyproj to find out.
    """
    units = units_of(unit, n)
    if crs and (found := _by_system(crs, n, some, distance)) is not None:
        rest = [METRES.get(one or "") for one in units[2:]]
        if None not in rest:
            return GroundScale((*found.metres, *(one for one in rest if one is not None)), found.axes)
        units = [DEGREE, DEGREE, None]
    if degrees:
        units[:2] = [DEGREE] * 2
    if units[:2] == [DEGREE] * 2 and all(one in METRES for one in units[2:]):
        return GroundScale((np.pi / 180,) * 2 + tuple(METRES[str(one)] for one in units[2:]), UNSTATED)
    if not all(one in METRES for one in units):
        remedy = ("give a number without a unit, or state the system with --crs, or the unit in the note "
                  "coordinate_unit: mm, or degree degree m")
        why = "is unknown" if None in units else f"is {', '.join(str(one) for one in units)}"
        raise OptionError(f"a distance of {distance} needs the unit of the coordinates, which {why}", code="unit",
                          remedy=remedy)
    return GroundScale(tuple(METRES[str(one)] for one in units))


def in_unit(distance: str, points: Array, unit: str | None, crs: str | None) -> float:
    """A distance in the unit of points, at least as long in any direction and at any point; a number alone as it is.

    Raises the errors of `ground_of`.
    """
    number, given = distance_of(distance)
    points = np.asarray(points, np.float64)
    n = points.shape[1]
    if given == DEGREE and (n > 2 or (units_of(unit, n) != [DEGREE] * n and not is_geographic(crs))):
        raise OptionError(f"a distance of {distance} needs points of longitudes and latitudes", code="unit",
                          remedy="give a number in the unit of the points")
    if given in ("", DEGREE):
        return number
    ground = ground_of(unit, crs, False, n, lambda: points[:: max(len(points) // SAMPLED**2, 1)], distance)
    latitude = None if ground.axes is None else np.array([points[:, 1].min(), points[:, 1].max()])
    metres = max(float(np.max(factor)) for factor in ground.factors(latitude))
    return float(f"{number * METRES[given] / metres:.12g}")


def is_geographic(crs: str | None) -> bool:
    """Whether a reference system is one of longitudes and latitudes."""
    if not crs or _WGS84.fullmatch(crs.strip()):
        return bool(crs)
    pyproj = optional("pyproj", extra="vector", purpose=f"a distance in degrees in the system {crs[:40]}")
    try:
        return bool(pyproj.CRS.from_user_input(crs).is_geographic)
    except pyproj.exceptions.CRSError:
        return False


def _by_system(crs: str, n: int, some: Callable[[], Array], distance: str) -> GroundScale | None:
    """The first two coordinates by their reference system; None if nobody knows it."""
    if _WGS84.fullmatch(crs.strip()):
        return GroundScale((np.pi / 180,) * 2, WGS84)
    pyproj = optional("pyproj", extra="vector", purpose=f"a distance of {distance} in the system {crs[:40]}")
    try:
        system = pyproj.CRS.from_user_input(crs)
    except pyproj.exceptions.CRSError:
        return None
    while system.sub_crs_list or system.is_bound:
        system = system.source_crs if system.is_bound else system.sub_crs_list[0]
    if not system.axis_info:
        return None
    unit = float(system.axis_info[0].unit_conversion_factor)
    if system.is_geographic:
        axes = system.ellipsoid.semi_major_metre, system.ellipsoid.semi_minor_metre
        # with a pole of its own, latitudes are others than those that radii depend on
        return GroundScale((unit,) * 2, (axes[0] ** 2 / axes[1],) * 2 if system.is_derived else axes)
    scale = _scale_of(pyproj, system, some()[:, :2]) if system.is_projected else None
    return GroundScale(((unit if scale is None else scale),) * 2)


def _scale_of(pyproj: Any, system: Any, points: Array) -> float | None:
    """Metres on the ellipsoid of a unit of a projected system, at most at these points; None if none lies in it."""
    base = system.geodetic_crs
    to = pyproj.Transformer.from_crs(system, base, always_xy=True)
    size = max(float(np.ptp(points, axis=0).max()) * 1e-4, 1e-3)
    around = np.array([[size, 0], [-size, 0], [0, size], [0, -size]])
    x, y = to.transform(*(points[:, None] + around).reshape(-1, 2).T)
    turn = float(base.axis_info[0].unit_conversion_factor)
    lon, lat = (np.reshape(one, (-1, 4)) * turn for one in (x, y))
    with np.errstate(invalid="ignore"):
        east, north = radii(lat[:, 0], lat[:, 0], (base.ellipsoid.semi_major_metre, base.ellipsoid.semi_minor_metre))
        dlon = (lon[:, ::2] - lon[:, 1::2] + np.pi) % (2 * np.pi) - np.pi
        j = np.stack([dlon * east[:, None], (lat[:, ::2] - lat[:, 1::2]) * north[:, None]], axis=1) / (2 * size)
    j = j[np.isfinite(j).all(axis=(1, 2))]
    if not len(j):
        return None
    # as many digits as every version of the library agrees in, rounded up
    most = float(np.linalg.svd(j, compute_uv=False)[:, 0].max())
    return float(f"{most * (1 + 5e-7):.7g}")
