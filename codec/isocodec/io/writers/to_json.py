"""GeoJSON (RFC 7946): curves as lines, areas and triangles as polygons, in longitude and latitude where possible."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.areas import areas_of, geometry_of, lifted, oriented, polygons
from ...drawing.bands import band_areas
from ...drawing.contour import Contour
from ...drawing.globe import Globe, ragged, rounded, rounded_areas
from ...drawing.tessellation import Tessellation
from ...field.labelling import noun_of
from ...field.placement import Placement
from ...field.reference_system import DEGREES, epsg_of, is_named
from .output_formats import Cost, Output, OutputOptions
from .things import ABOVE, LEVEL, Areas, PlacedTin, in_space

_MANY = 1 << 12
"""Points of a contour from which on a native encoder is worth loading."""
_NOWHERE = 'ENGCRS["{}",EDATUM["{}"],CS[Cartesian,2],AXIS["x",east],AXIS["y",north],LENGTHUNIT["unit",1]]'
"""The system of coordinates without one, which readers would otherwise take for longitudes and latitudes."""


def _lines(contours: Iterable[Contour], _: str, options: OutputOptions) -> bytes:
    """Write a feature for the curve of each contour."""

    def feature(contour: Contour) -> bytes:
        whole = contour.joined
        points, starts = ragged([whole.along(walk) for walk in whole.walks])
        if not options.keep_crs and (globe := Globe.of(contour.placement, whole.placed, whole.cells)):
            points, starts = globe.lines(points, starts)
        if options.decimals is not None:
            points, starts = rounded(points, starts, options.decimals)
        return _feature(contour, _multiline(points, starts), options)

    return _features(contours, feature, options)


def _areas(what: Areas, _: str, options: OutputOptions) -> bytes:
    """Write a feature for the areas above or below each contour, or for each band between contours."""

    def moved(contour: Contour, area: Any) -> dict[str, Any]:
        shapely = polygons()
        if not options.keep_crs and (globe := Globe.of(contour.placement, contour.placed, contour.cells)):
            area = oriented(shapely.GeometryCollection([*globe.areas(shapely.get_parts(area))]))
        if options.decimals is not None:
            area = oriented(rounded_areas(area, options.decimals))
        return geometry_of(area)

    def feature(contour: Contour) -> bytes:
        area = lifted(areas_of(contour, above=what.side == "above", valid=what.valid), contour.placement)
        return _feature(contour, _json(moved(contour, area)), options, area=what.side)

    if what.side != "bands":
        return _features(what.contours, feature, options)
    whole = list(what.contours)
    texts = [
        _json({"type": "Feature", "properties": {"lower": lower, "upper": upper},
               "geometry": moved(whole[0], area)})
        for lower, upper, area in band_areas(whole, what.valid)
    ]
    return _collection(texts, system(whole[0].placement, options))


def _mesh(mesh: Tessellation, _: str, options: OutputOptions) -> bytes:
    """Write a polygon for each triangle, with its level and the signs of its corners."""
    points, cells = in_space(mesh)
    flat = mesh.placement is None or not mesh.placement.in_space
    values = [
        {LEVEL: level, ABOVE: above}
        for level, above in zip(mesh.levels.tolist(), mesh.above[cells].astype(int).tolist(), strict=True)
    ]
    return _triangles(points[:, :2] if flat else points, cells, values, mesh.placement, options)


def _tin(placed: PlacedTin, _: str, options: OutputOptions) -> bytes:
    """Write a polygon with heights for each triangle."""
    values: list[dict[str, Any]] = [{} for _ in placed.triangles]
    return _triangles(placed.vertices, placed.triangles, values, placed.placement, options)


def _triangles(
    points: NDArray[np.float64], cells: NDArray[np.int64], values: list[dict[str, Any]], placement: Placement | None,
    options: OutputOptions,
) -> bytes:
    """Write a polygon for each triangle, with some values."""
    corners = points[cells[:, [0, 1, 2, 0]]]
    shapes: list[dict[str, Any]]
    globe = None if options.keep_crs else Globe.of(placement, points, cells)
    if globe is None and options.decimals is None:
        shapes = [{"type": "Polygon", "coordinates": [ring]} for ring in corners.tolist()]
    else:
        shapely = polygons()
        found = shapely.polygons(corners)
        found = found if globe is None else globe.areas(found)
        found = found if options.decimals is None else rounded_areas(found, options.decimals)
        shapes = [shapely.geometry.mapping(shape) for shape in found]
    features = [_json({"type": "Feature", "properties": some, "geometry": shape})
                for some, shape in zip(values, shapes, strict=True)]
    return _collection(features, system(placement, options))


def _multiline(points: NDArray[np.float64], starts: NDArray[np.int64]) -> bytes:
    """Write lines, many of them by a native encoder, which takes a quarter of the time for the same text."""
    if len(points) >= _MANY and find_spec("shapely") is not None:
        shapely = polygons()
        owner = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        return str(shapely.to_geojson(shapely.multilinestrings(shapely.linestrings(points, indices=owner)))).encode()
    lines = [line.tolist() for line in np.split(points, starts[1:-1])] if len(starts) > 1 else []
    return _json({"type": "MultiLineString", "coordinates": lines})


def _feature(contour: Contour, geometry: bytes, options: OutputOptions, **properties: Any) -> bytes:
    """Write a feature with the properties isovalue or label, shape, complete; an empty curve has an empty geometry."""
    if options.index is not None:
        properties["index"] = contour.isovalue in options.index
    about = {
        options.attribute or noun_of(contour.metadata): None if isnan(contour.isovalue) else float(contour.isovalue),
        "shape": [int(n) for n in contour.shape],
        "complete": bool(contour.complete),
        **properties,
    }
    return b"".join([_json({"type": "Feature", "properties": about})[:-1], b',"geometry":', geometry, b"}"])


def _features(contours: Iterable[Contour], feature: Callable[[Contour], bytes], options: OutputOptions) -> bytes:
    """Write the file of one contour's feature, or of a collection of several with the same placement."""
    texts, name = [], None
    for contour in contours:
        texts.append(feature(contour))
        name = system(contour.placement, options)
        # of a contour no more is kept than its text
        del contour
    if len(texts) == 1:
        return b"".join([texts[0][:-1], _member(name), b"}\n"])
    return _collection(texts, name)


def _collection(texts: list[bytes], system: dict[str, Any] | None) -> bytes:
    """Write the file of several features."""
    start = b'{"type":"FeatureCollection","features":['
    return b"".join([start, b",".join(texts), b"]", _member(system), b"}\n"])


def system(placement: Placement | None, options: OutputOptions) -> dict[str, Any]:
    """Members of a file about its coordinates; omitted for longitude and latitude.

    ``crs``, as in GeoJSON before RFC 7946, names the system that is kept, or one without a place; ``space`` is that
    of a body.
    """
    if placement is not None and is_named(placement):
        number = epsg_of(placement)
        if not options.keep_crs or number == DEGREES:
            return {}
        name = placement.crs if number is None else f"urn:ogc:def:crs:EPSG::{number}"
    else:
        name = "samples" if placement is None or not placement.placed else placement.space or "unnamed"
        name = _NOWHERE.format(name, name)
    body = {} if placement is None or placement.space is None else {"space": placement.crs}
    return {"crs": {"type": "name", "properties": {"name": name}}, **body}


def _member(system: dict[str, Any] | None) -> bytes:
    """Format the reference system, as the last member of a file."""
    return b"," + _json(system)[1:-1] if system else b""


def _json(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


_CURVES = Cost(300, 240, kept=100)
_SHARED: Any = {"suffixes": (".geojson",), "title": "GeoJSON (RFC 7946)", "coordinates": "degrees", "decimal": True,
                "names_crs": True, "names_space": True}
OUTPUTS = (
    Output("contour", render=_lines, several=(2,), holds="a feature each", sampled=False, cost={2: _CURVES}, **_SHARED),
    Output("areas", render=_areas, several=(2,), holds="a feature each", extra="geo", libraries=("shapely",),
           cost={2: _CURVES}, **_SHARED),
    Output("mesh", render=_mesh, cost={2: Cost(100, 2000)}, **_SHARED),
    Output("tin", render=_tin, sampled=False, **_SHARED),
)
