"""GeoJSON (RFC 7946): curves as lines, areas as polygons, in longitude and latitude where their system is known."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .areas import areas, polygons
from .system import named, to_degrees

if TYPE_CHECKING:
    from ..drawing.contour import Contour


def render_lines(contours: Iterable[Contour], keep: bool = False) -> bytes:
    """A feature for the curve of a contour, or of each of several; ``keep`` leaves coordinates in their system.

    Raises
    ------
    OptionError, MissingExtraError
        As `to_degrees`.
    """

    def feature(contour: Contour) -> bytes:
        move = (lambda points: points) if keep else to_degrees(contour)
        whole = contour.joined
        coordinates = [move(whole.along(walk)).tolist() for walk in whole.walks]
        return _feature(contour, {"type": "MultiLineString", "coordinates": coordinates})

    return _features(contours, feature, keep)


def render_areas(
    contours: Iterable[Contour], above: bool, valid: NDArray[np.bool_] | None = None, keep: bool = False
) -> bytes:
    """Likewise the areas on one side of each contour; ``valid`` as in `areas`.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As `areas` and `to_degrees`.
    """
    side = "above" if above else "below"

    def feature(contour: Contour) -> bytes:
        geometry = areas(contour, above=above, valid=valid)
        if not keep:
            shapely = polygons()
            moved = shapely.transform(shapely.geometry.shape(geometry), to_degrees(contour))
            geometry = shapely.geometry.mapping(
                shapely.MultiPolygon([shapely.geometry.polygon.orient(part) for part in moved.geoms])
            )
        return _feature(contour, geometry, area=side)

    return _features(contours, feature, keep)


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
    texts, system = [], b""
    for contour in contours:
        texts.append(feature(contour))
        if keep and (name := named(contour)):
            system = b"," + _json(name)[1:-1]
        # of a contour no more is kept than its text
        del contour
    if len(texts) == 1:
        return b"".join([texts[0][:-1], system, b"}\n"])
    return b"".join([b'{"type":"FeatureCollection","features":[', b",".join(texts), b"]", system, b"}\n"])


def _json(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
