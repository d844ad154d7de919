"""Reference systems of coordinates, and conversion to longitude and latitude for GeoJSON (RFC 7946, clause 4)."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError, one_line, plain
from ..extras import optional
from .placement import Placement

DEGREES = 4326
"""EPSG number of longitude and latitude on WGS 84."""
_ROUNDED = 1e-6
"""Degrees that latitudes may lie beyond a pole because of rounding."""
Transform = Callable[[NDArray[np.float64]], NDArray[np.float64]]
_SHORT = 60
_DEFINITION = re.compile(r"\s*([A-Za-z]\w*\s*\[|\{)")
"""Beginning of a definition in WKT or PROJJSON."""
_FILES = re.compile(r"PARAMETERFILE|grids=|\+init", re.IGNORECASE)
"""Parts of definitions that name files, which are read when coordinates are transformed."""


def is_named(placement: Placement | None) -> bool:
    """Whether coordinates have a reference system by its EPSG number, or by a definition that names no files."""
    if placement is None or not placement.placed or not placement.crs:
        return False
    return placement.epsg is not None or bool(_DEFINITION.match(placement.crs) and not _FILES.search(placement.crs))


def system_of(placement: Placement | None) -> Any:
    """The reference system that coordinates have, as pyproj knows it.

    Returns
    -------
    pyproj.CRS or None
        None unless the system `is_named`.

    Raises
    ------
    OptionError
        If there is no such system.
    MissingExtraError
        If pyproj is not installed.
    """
    if not is_named(placement):
        return None
    assert placement is not None and placement.crs
    name = short_name(placement.crs)
    pyproj = optional("pyproj", extra="vector", purpose=f"the reference system {name}")
    try:
        return pyproj.CRS.from_user_input(placement.crs)
    except pyproj.exceptions.CRSError as exc:
        raise OptionError(f"there is no reference system {name}", code="crs",
                          remedy="encode with a --crs that exists, or write samples: --in-samples") from exc


def short_name(crs: str) -> str:
    """A reference system in a few words: ``EPSG:32631``, or the name within its definition."""
    named = crs.split('"')[1:2] if "[" in crs else crs.partition('"name":')[2].split('"')[1:2]
    return one_line(named[0] if named else crs, _SHORT)


def crs_text(system: Any) -> str | None:
    """Name a reference system of pyproj or rasterio as files do: by its EPSG number, else its definition (WKT 2)."""
    if not system:
        return None
    text = str(system.to_wkt(version="WKT2_2019"))
    if text.startswith("ENGCRS"):
        return None  # of a place, not of the earth; GDAL makes one of keys that it does not know
    # one that is bound to a datum shift differs from the one of the number
    number = None if text.startswith("BOUNDCRS") else system.to_epsg()
    return text if number is None else f"EPSG:{number}"


def named_system(text: str) -> str:
    """Name the reference system that a user gives: an EPSG number, WKT, PROJJSON, or a text of PROJ.

    Raises `OptionError` if it is none, and `MissingExtraError` if pyproj is not installed.
    """
    pyproj = optional("pyproj", extra="vector", purpose="--crs")
    try:
        return crs_text(pyproj.CRS.from_user_input(f"EPSG:{text}" if text.isdigit() else text)) or ""
    except pyproj.exceptions.CRSError as exc:
        raise OptionError(f"{plain(text[:_SHORT])!r} is not a reference system", code="crs",
                          remedy="give EPSG:32631, for example, or a definition in WKT or PROJJSON") from exc


def to_degrees(system: Any) -> Transform:
    """Make a function from coordinates (P, 2 or 3) in a system of pyproj to longitude and latitude; heights stay.

    Longitudes and latitudes on WGS 84 stay as they are, also beyond 180 degrees. Raises `OptionError` if longitudes and
    latitudes do not follow from the coordinates, and `MissingExtraError` if pyproj is not installed.
    """
    pyproj = optional("pyproj", extra="vector", purpose="longitude and latitude")
    remedy = "is the placement right? .gpkg and .fgb keep the coordinates as they are"
    try:
        transform = pyproj.Transformer.from_crs(system, DEGREES, always_xy=True).transform
    except pyproj.exceptions.ProjError as exc:
        raise OptionError("the reference system has no longitude and latitude", code="crs", remedy=remedy) from exc

    def degrees(points: NDArray[np.float64]) -> NDArray[np.float64]:
        out = points if system == DEGREES else np.column_stack([*transform(*points[:, :2].T), points[:, 2:]])
        if not np.isfinite(out).all() or (abs(out[:, 1]) > 90 + _ROUNDED).any():
            raise OptionError("coordinates lie outside of what the reference system covers", code="crs", remedy=remedy)
        return np.column_stack([out[:, 0], out[:, 1].clip(-90, 90), out[:, 2:]])

    return degrees
