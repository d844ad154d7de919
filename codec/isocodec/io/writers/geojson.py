"""GeoJSON (RFC 7946): curves as lines, areas as polygons, in longitude and latitude where their system is known."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.areas import polygons
from ...drawing.bands import bands
from ...drawing.contour import Contour
from ...field.placement import Placement
from ...field.reference_system import DEGREES, epsg_of, to_degrees


def render_lines(contours: Iterable[Contour], keep: bool = False) -> bytes:
    """A feature for the curve of a contour, or of each of several; ``keep`` leaves coordinates in their system.

    Raises
    ------
    OptionError, MissingExtraError
        As `to_degrees`.
    """

    def feature(contour: Contour) -> bytes:
        move = (lambda points: points) if keep else to_degrees(contour.placement)
        whole = contour.joined
        coordinates = [move(whole.along(walk)).tolist() for walk in whole.walks]
        return _feature(contour, {"type": "MultiLineString", "coordinates": coordinates})

    return _features(contours, feature, keep)


def render_areas(
    contours: Iterable[Contour], side: str, valid: NDArray[np.bool_] | None = None, keep: bool = False
) -> bytes:
    """Likewise the areas above or below each contour, or the ``bands`` between them; ``valid`` as in `Contour.areas`.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `Contour.areas` and `to_degrees`.
    """

    def moved(contour: Contour, geometry: dict[str, Any]) -> dict[str, Any]:
        if keep:
            return geometry
        shapely = polygons()
        shape = shapely.transform(shapely.geometry.shape(geometry), to_degrees(contour.placement))
        parts = [shapely.geometry.polygon.orient(part) for part in shape.geoms]
        return dict(shapely.geometry.mapping(shapely.MultiPolygon(parts)))

    def feature(contour: Contour) -> bytes:
        geometry = contour.areas(above=side == "above", valid=valid)
        return _feature(contour, moved(contour, geometry), area=side)

    if side != "bands":
        return _features(contours, feature, keep)
    whole = list(contours)
    texts = [
        _json({"type": "Feature", "properties": {"lower": band.lower, "upper": band.upper},
               "geometry": moved(whole[0], band.geometry)})
        for band in bands(whole, valid=valid)
    ]
    return _collection(texts, named(whole[0].placement) if keep else None)


def _feature(contour: Contour, geometry: dict[str, Any], **properties: str) -> bytes:
    """The text of a feature with the properties isovalue, shape and complete; an empty curve is an empty geometry."""
    return _json(
        {
            "type": "Feature",
            "properties": {
                "isovalue": float(contour.isovalue),
                "shape": [int(n) for n in contour.shape],
                "complete": bool(contour.complete),
                **properties,
            },
            "geometry": geometry,
        }
    )


def _features(contours: Iterable[Contour], feature: Callable[[Contour], bytes], keep: bool) -> bytes:
    """The file of the feature of a contour, or of a collection of several of the same placement."""
    texts, name = [], None
    for contour in contours:
        texts.append(feature(contour))
        name = named(contour.placement) if keep else None
        # of a contour no more is kept than its text
        del contour
    if len(texts) == 1:
        return b"".join([texts[0][:-1], _member(name), b"}\n"])
    return _collection(texts, name)


def _collection(texts: list[bytes], system: dict[str, Any] | None) -> bytes:
    """The file of several features."""
    start = b'{"type":"FeatureCollection","features":['
    return b"".join([start, b",".join(texts), b"]", _member(system), b"}\n"])


def named(placement: Placement | None) -> dict[str, Any]:
    """The member of a GeoJSON file that names its system, as GeoJSON had it before RFC 7946; none for degrees."""
    number = epsg_of(placement)
    if number in (None, DEGREES):
        return {}
    return {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{number}"}}}


def _member(system: dict[str, Any] | None) -> bytes:
    """The reference system, as it stands behind the other members of a file."""
    return b"," + _json(system)[1:-1] if system else b""


def _json(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
