"""GeoJSON (RFC 7946): curves as lines, areas and triangles as polygons, in longitude and latitude where possible."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from math import isnan
from typing import Any

from ...drawing.areas import polygons
from ...drawing.bands import bands
from ...drawing.contour import Contour
from ...drawing.tessellation import Tessellation
from ...field.placement import Placement
from ...field.reference_system import DEGREES, epsg_of, to_degrees
from .output_formats import Cost, Output, OutputOptions
from .things import ABOVE, LEVEL, Areas, PlacedTin, in_space


def _lines(contours: Iterable[Contour], _: str, options: OutputOptions) -> bytes:
    """Write a feature for the curve of each contour."""
    keep = options.keep_crs

    def feature(contour: Contour) -> bytes:
        move = (lambda points: points) if keep else to_degrees(contour.placement)
        whole = contour.joined
        coordinates = [move(whole.along(walk)).tolist() for walk in whole.walks]
        return _feature(contour, {"type": "MultiLineString", "coordinates": coordinates}, options)

    return _features(contours, feature, keep)


def _areas(what: Areas, _: str, options: OutputOptions) -> bytes:
    """Write a feature for the areas above or below each contour, or for each band between contours."""
    keep = options.keep_crs

    def moved(contour: Contour, geometry: dict[str, Any]) -> dict[str, Any]:
        if keep:
            return geometry
        shapely = polygons()
        flat = contour.placement is None or not contour.placement.in_space
        shape = shapely.transform(shapely.geometry.shape(geometry), to_degrees(contour.placement), include_z=not flat)
        parts = [shapely.geometry.polygon.orient(part) for part in shape.geoms]
        return dict(shapely.geometry.mapping(shapely.MultiPolygon(parts)))

    def feature(contour: Contour) -> bytes:
        geometry = contour.areas(above=what.side == "above", valid=what.valid)
        return _feature(contour, moved(contour, geometry), options, area=what.side)

    if what.side != "bands":
        return _features(what.contours, feature, keep)
    whole = list(what.contours)
    texts = [
        _json({"type": "Feature", "properties": {"lower": band.lower, "upper": band.upper},
               "geometry": moved(whole[0], band.geometry)})
        for band in bands(whole, valid=what.valid)
    ]
    return _collection(texts, _about(whole[0], keep))


def _mesh(mesh: Tessellation, _: str, __: OutputOptions) -> bytes:
    """Write a polygon for each triangle, with its level and the signs of its corners."""
    points, cells = in_space(mesh)
    flat = mesh.placement is None or not mesh.placement.in_space
    points = to_degrees(mesh.placement)(points[:, :2] if flat else points)
    features = [
        {
            "type": "Feature",
            "properties": {LEVEL: level, ABOVE: above},
            "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
        }
        for corners, level, above in zip(
            points[cells].tolist(), mesh.levels.tolist(), mesh.above[cells].astype(int).tolist(), strict=True
        )
    ]
    return _json({"type": "FeatureCollection", "features": features}) + b"\n"


def _tin(placed: PlacedTin, _: str, __: OutputOptions) -> bytes:
    """Write a polygon with heights for each triangle."""
    features = [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
        }
        for corners in placed.vertices[placed.triangles].tolist()
    ]
    return _json({"type": "FeatureCollection", **named(placed.placement), "features": features}) + b"\n"


def _feature(contour: Contour, geometry: dict[str, Any], options: OutputOptions, **properties: Any) -> bytes:
    """Write a feature with the properties isovalue, shape and complete; an empty curve has an empty geometry."""
    if options.index is not None:
        properties["index"] = contour.isovalue in options.index
    return _json(
        {
            "type": "Feature",
            "properties": {
                options.attribute: None if isnan(contour.isovalue) else float(contour.isovalue),
                "shape": [int(n) for n in contour.shape],
                "complete": bool(contour.complete),
                **properties,
            },
            "geometry": geometry,
        }
    )


def _features(contours: Iterable[Contour], feature: Callable[[Contour], bytes], keep: bool) -> bytes:
    """Write the file of one contour's feature, or of a collection of several with the same placement."""
    texts, name = [], None
    for contour in contours:
        texts.append(feature(contour))
        name = _about(contour, keep)
        # of a contour no more is kept than its text
        del contour
    if len(texts) == 1:
        return b"".join([texts[0][:-1], _member(name), b"}\n"])
    return _collection(texts, name)


def _collection(texts: list[bytes], system: dict[str, Any] | None) -> bytes:
    """Write the file of several features."""
    start = b'{"type":"FeatureCollection","features":['
    return b"".join([start, b",".join(texts), b"]", _member(system), b"}\n"])


def named(placement: Placement | None) -> dict[str, Any]:
    """The member ``crs`` of a GeoJSON file, as in GeoJSON before RFC 7946; omitted for degrees."""
    number = epsg_of(placement)
    if number in (None, DEGREES):
        return {}
    return {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{number}"}}}


def _about(contour: Contour, keep: bool) -> dict[str, Any]:
    """Members of a file about its coordinates: the system, if it is kept, and that of a body."""
    placement = contour.placement
    body = {} if placement is None or placement.space is None else {"space": placement.crs}
    return (named(placement) if keep else {}) | body


def _member(system: dict[str, Any] | None) -> bytes:
    """Format the reference system, as the last member of a file."""
    return b"," + _json(system)[1:-1] if system else b""


def _json(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


_CURVES = Cost(300, 240, kept=100)
_TITLE = "GeoJSON (RFC 7946)"
OUTPUTS = (
    Output("contour", (".geojson",), _TITLE, _lines, (2,), (2,), "a feature each", "degrees", sampled=False,
           cost={2: _CURVES}),
    Output("areas", (".geojson",), _TITLE, _areas, (2,), (2,), "a feature each", "degrees", extra="geo",
           libraries=("shapely",), cost={2: _CURVES}),
    Output("mesh", (".geojson",), _TITLE, _mesh, coordinates="degrees", cost={2: Cost(100, 2000)}),
    Output("tin", (".geojson",), "GeoJSON", _tin, names_crs=True, sampled=False),
)
