"""Reference systems of coordinates, and conversion to longitude and latitude for GeoJSON (RFC 7946, clause 4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..extras import optional
from .placement import Placement

DEGREES = "4326"
"""EPSG number of longitude and latitude on WGS 84."""
Transform = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def epsg_of(placement: Placement | None) -> str | None:
    """EPSG number of the reference system of coordinates; None without coordinates, or without such a number."""
    return None if placement is None else placement.epsg


def to_degrees(placement: Placement | None) -> Transform:
    """Make a function from coordinates (P, 2) to longitudes and latitudes on WGS 84.

    Coordinates without a reference system stay as they are, as do the heights of a plane in space.

    Raises
    ------
    OptionError
        If there is no reference system with this number.
    MissingExtraError
        If pyproj is not installed.
    """
    number = epsg_of(placement)
    if number in (None, DEGREES):
        return lambda points: points
    pyproj = optional("pyproj", extra="geo", purpose=f"writing GeoJSON of EPSG:{number}, in longitude and latitude")
    try:
        transformer = pyproj.Transformer.from_crs(f"EPSG:{number}", f"EPSG:{DEGREES}", always_xy=True)
    except pyproj.exceptions.ProjError as exc:
        raise OptionError(f"unknown reference system EPSG:{number}", code="crs",
                          remedy="--keep-crs writes the coordinates as they are") from exc

    def degrees(points: NDArray[np.float64]) -> NDArray[np.float64]:
        if not len(points):
            return points
        out = np.column_stack([*transformer.transform(points[:, 0], points[:, 1]), points[:, 2:]])
        if not np.isfinite(out).all():
            raise OptionError(
                f"coordinates lie outside the area of EPSG:{number}, and have no longitude and latitude", code="crs",
                remedy="is the placement right? --keep-crs writes the coordinates as they are",
            )
        return np.asarray(out)

    return degrees
