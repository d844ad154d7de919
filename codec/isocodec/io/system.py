"""Reference systems of coordinates, and longitude and latitude, which GeoJSON has (RFC 7946, clause 4)."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.placement import CRS
from .extras import optional

if TYPE_CHECKING:
    from ..drawing.contour import Contour

_EPSG = re.compile("EPSG:([1-9][0-9]{0,5})")
DEGREES = "4326"
"""EPSG number of longitude and latitude on WGS 84."""
Transform = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def epsg_of(contour: Contour) -> str | None:
    """EPSG number of the system that the coordinates of a contour have; None without a placement, or if it has none."""
    found = _EPSG.fullmatch(contour.metadata.get(CRS, ""))
    return found[1] if found and is_placed(contour) else None


def is_placed(contour: Contour) -> bool:
    """Whether a contour has coordinates other than samples."""
    return contour.frame is not None


def named(contour: Contour) -> dict[str, Any]:
    """The member of a GeoJSON file that names its system, as GeoJSON had it before RFC 7946; none for degrees."""
    number = epsg_of(contour)
    if number in (None, DEGREES):
        return {}
    return {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{number}"}}}


def to_degrees(contour: Contour) -> Transform:
    """What makes longitudes and latitudes on WGS 84 of the coordinates of a contour (P, 2), where its system is known.

    Raises
    ------
    OptionError
        If there is no such system.
    MissingExtraError
        If pyproj is not installed.
    """
    number = epsg_of(contour)
    if number in (None, DEGREES):
        return lambda points: points
    pyproj = optional("pyproj", extra="geo", purpose=f"writing GeoJSON of EPSG:{number}, in longitude and latitude")
    try:
        transformer = pyproj.Transformer.from_crs(f"EPSG:{number}", f"EPSG:{DEGREES}", always_xy=True)
    except pyproj.exceptions.ProjError as exc:
        raise OptionError(f"there is no reference system EPSG:{number} to reproject from", code="crs",
                          remedy="--keep-crs writes the coordinates as they are") from exc  # fmt: skip

    def degrees(points: NDArray[np.float64]) -> NDArray[np.float64]:
        if not len(points):
            return points
        out = np.stack(transformer.transform(points[:, 0], points[:, 1]), axis=1)
        if not np.isfinite(out).all():
            raise OptionError(
                f"coordinates lie outside of what EPSG:{number} covers, and have no longitude and latitude", code="crs",
                remedy="is the placement right? --keep-crs writes the coordinates as they are",
            )  # fmt: skip
        return np.asarray(out)

    return degrees
