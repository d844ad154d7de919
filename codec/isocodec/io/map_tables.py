"""Contours as tables of geopandas, and tables as files of geographic information systems by pyogrio (GDAL).

A row is a line, the areas of an isovalue on one side, a band between neighbouring isovalues, or a triangle.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.areas import areas_of, lifted, oriented
from ..drawing.bands import band_areas
from ..drawing.contour import Contour
from ..errors import InputError, OptionError, plain
from ..field.placement import TURN, Placement
from ..field.reference_system import DEGREES, Transform, short_name, system_of, to_degrees
from .libraries import library

TAKEN = ("geometry", "geom", "fid", "ogc_fid", "wkt", "closed", "complete", "side")
"""Columns, in any case, that tables or files have beside those of isovalues."""
TILED = ("PMTiles", "MBTiles")
LOCATED = ("LIBKML", *TILED)
"""Drivers of GDAL whose files are in longitude and latitude by definition."""
LAYERED = ("GPKG", "SQLite", "GeoJSON", "FlatGeobuf", "GML", *LOCATED)
UNNAMED = ("DXF",)
"""Drivers without columns."""
_BY_RULE = ("GeoJSON", "GeoJSONSeq")
"""Drivers whose files have longitude and latitude unless another system is kept."""
_DATE = "2000-01-01T00:00:00.000Z"
"""Fixed time of writing, so that equal input gives equal bytes."""
_OPTIONS = {
    "ESRI Shapefile": {"DBF_DATE_LAST_UPDATE": _DATE[:10]}, "CSV": {"GEOMETRY": "AS_WKT"},
    "GeoJSON": {"SIGNIFICANT_FIGURES": "17"}, "GeoJSONSeq": {"COORDINATE_PRECISION": "15"},
}
"""Options of GDAL for a layer, by driver."""
_NOWHERE = {"crs": {"type": "name", "properties": {
    "name": 'ENGCRS["samples",EDATUM["samples"],CS[Cartesian,2],AXIS["x",east],AXIS["y",north],LENGTHUNIT["unit",1]]'}}}
"""Member of GeoJSON without a reference system, whose coordinates would be taken for longitudes and latitudes."""
_PIXELS, _EQUATOR, _MOST_ZOOM = 256, 40075016.68, 22
_LONGEST, _NEAR, _STEP = 1.5, 70.0, 2.0
"""Longest edge, in cells, whose ends are converted as they are; the latitude beyond which it is divided, and the most
that the longitude of a part changes, in degrees."""
_GAP = 1e-3
"""Half the width of the cut at 180 degrees, in cells."""


def check_names(*names: str) -> None:
    """Refuse names of columns that tables have for something else; raises `OptionError`."""
    wrong = [name for name in names if name.lower() in ("", *TAKEN)]
    if wrong or len({name.lower() for name in names}) < len(names):
        raise OptionError(f"isovalues cannot have the name {(wrong or [*names])[-1]!r} (--attribute): it is taken",
                          code="attribute", remedy=f"choose a name other than {', '.join(TAKEN)}")


def lines(contours: Iterable[Contour], attribute: str | None = None) -> Any:
    """Make a table with a row for each line of curves: isovalue, ``closed``, ``complete``.

    The column of isovalues is called ``attribute``, or else ``isovalue``, or ``label`` of contours of labels, beside
    which ``name`` has their names, if any. Each contour is released when its rows are made. Raises `OptionError` for
    surfaces and names that are taken.
    """
    return _joined((contour.to_geodataframe() for contour in contours), attribute)


def areas(
    contours: Iterable[Contour], side: str = "above", valid: NDArray[np.bool_] | None = None,
    attribute: str | None = None,
) -> Any:
    """Make a table with a row for the areas above or below each curve; other parameters are those of `lines`.

    ``bands`` as the side gives a row for each band between neighbouring isovalues, with the columns ``lower`` and
    ``upper`` (or those of ``attribute``: ``"low,high"``); the outer ones have one bound only. Raises the errors of
    `Contour.areas`.
    """
    if side == "bands":
        names, whole = (attribute or "lower,upper").split(",", 1), list(contours)
        check_names(*names)
        *bounds, shapes = zip(*band_areas(whole, valid), strict=True)
        return table_of(dict(zip(names, np.array(bounds, float), strict=True)), shapes, whole[0].placement)
    return _joined((
        table_of({**one.columns(1), "side": [side], "complete": [one.complete]},
                 [lifted(areas_of(one, above=side == "above", valid=valid), one.placement)], one.placement)
        for one in contours
    ), attribute)


def table_of(columns: Mapping[str, Any], shapes: Sequence[Any], placement: Placement | None) -> Any:
    """Make a table of shapes in the coordinates of a placement."""
    geopandas = library("geopandas", extra="vector", purpose="tables of lines and areas")
    return geopandas.GeoDataFrame(columns, geometry=list(shapes), crs=system_of(placement))


def _joined(tables: Iterable[Any], attribute: str | None) -> Any:
    """Join tables, and name the first column."""
    table = library("pandas", extra="vector", purpose="tables of lines and areas").concat([*tables], ignore_index=True)
    name = attribute if attribute is not None else table.columns[0]
    check_names(*(each for each in table.columns if each == "name"), name)
    return table.rename(columns={table.columns[0]: name})


# ---- Longitude and latitude -----------------------------------------------------------------------------------------


def degrees(table: Any, cell: float) -> Any:
    """Convert a table to longitude and latitude, cut at 180 degrees (RFC 7946); areas around a pole hold the pole.

    Edges longer than ``cell`` are divided before they are converted, since they bend. Raises `OptionError` if
    coordinates have no longitude and latitude.
    """
    shapely = library("shapely", extra="vector", purpose="longitude and latitude")
    shapes, move, straight = np.array(table.geometry), to_degrees(table.crs), table.crs == DEGREES
    if not len(table):
        return table.to_crs(DEGREES)

    def turned(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return abs(_within(np.diff(move(points), axis=0))[:, 0]) / _STEP

    shapes = shapes if straight else shapely.segmentize(shapes, _LONGEST * cell)
    there = shapely.transform(shapes, move, include_z=None)
    # of all points: around a pole, holes lie beyond the longitudes and latitudes of their shell
    points = shapely.get_coordinates(there)
    (west, south), (east, north) = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    crosses = west < -180 or east > 180 or (east - west > 180 and not straight)
    if crosses:
        seam = shapely.buffer(_seam(table.crs, cell, south, north, shapely), _GAP * cell, quad_segs=1, cap_style="flat")
        cut = shapely.intersects(shapes, seam)
        shapes[cut] = shapely.difference(shapes[cut], seam)
    if crosses or max(-south, north) > _NEAR:
        if not straight:
            shapes = _divided(shapely.segmentize(shapes, _LONGEST * cell), turned, shapely)
        there = shapely.transform(shapes, lambda points: _within(move(points)), include_z=None)
    invalid = ~shapely.is_valid(there) & ~shapely.has_z(there)  # where rounding has made rings touch
    there[invalid] = [oriented(shape) for shape in shapely.make_valid(there[invalid])]
    return table.set_geometry(there, crs=DEGREES)


def _seam(system: Any, cell: float, south: float, north: float, shapely: Any) -> Any:
    """Line of the longitude 180 in a reference system, between latitudes, or up to a pole that is near."""
    if system == DEGREES:
        return shapely.MultiLineString([[(turn + 180, -90), (turn + 180, 90)] for turn in (-TURN, 0, TURN)])
    pyproj = library("pyproj", extra="vector", purpose="longitude and latitude")
    latitudes = np.linspace(south - 1 if south > -_NEAR else -90, north + 1 if north < _NEAR else 90, 20001)
    found = np.column_stack(pyproj.Transformer.from_crs(DEGREES, system, always_xy=True).transform(
        np.full_like(latitudes, 180), latitudes))
    found = found[np.isfinite(found).all(axis=1)]
    return shapely.simplify(shapely.LineString(found if len(found) > 1 else []), _GAP * cell / 2)


def _divided(shapes: Any, measure: Transform, shapely: Any) -> Any:
    """Divide edges of lines or areas into as many pieces as is measured along their points, rounded up."""
    some = ~shapely.is_empty(shapes)  # shapely 2.2 crashes where it puts together polygons without rings
    if not some.any():
        return shapes
    kind, points, (ends, *more) = shapely.to_ragged_array(shapes[some])
    pieces = np.ceil(measure(points)).clip(1)
    pieces[ends[1:-1] - 1] = 1  # from one line to the next
    if (pieces <= 1).all():
        return shapes
    first, number = np.append(0, pieces.cumsum()).astype(np.int64), np.arange(len(points))
    at = np.interp(np.arange(first[-1] + 1), first, number)
    points = np.column_stack([np.interp(at, number, column) for column in points.T])
    out = shapes.copy()
    out[some] = shapely.from_ragged_array(kind, points, (np.append(first, len(points))[ends], *more))
    return out


def _within(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn longitudes, in the first column, to -180 .. 180."""
    return np.column_stack([points[:, 0] - TURN * np.rint(points[:, 0] / TURN), points[:, 1:]])


# ---- Files ----------------------------------------------------------------------------------------------------------


def write_table(
    table: Any, path: Path, driver: str, *, layer: str, cell: float = 1.0,
    members: Mapping[str, Any] | None = None,
) -> None:
    """Write a table by a driver of GDAL, or (``Parquet``) geopandas; a GeoPackage keeps its other layers.

    ``members`` are added to a GeoJSON file. Raises `InputError` if a file that is no GeoPackage has the name of one.
    """
    if driver == "Parquet":
        table.to_parquet(path, index=False)
        return
    pyogrio, pyproj = (library(each, extra="vector", purpose="writing maps") for each in ("pyogrio", "pyproj"))
    if table.crs is None:
        members = {**_NOWHERE, **(members or {})}
        if driver in LOCATED:
            raise OptionError("the format is in longitude and latitude, but the file does not state where its samples "
                              "lie, or in which system", code="crs", remedy="encode with a placement and --crs EPSG:..")
    elif driver in (*LOCATED, *_BY_RULE):
        table = degrees(table, cell)
    if driver == "GeoJSON" and table.crs == DEGREES:  # names no system, as RFC 7946 has it
        table = table.set_crs(None, allow_override=True)
    solid, empty = table.geometry.has_z.any(), table.geometry.is_empty
    if solid:
        table = table[~empty]  # these have no height, and formats one number of coordinates
    if driver == "GPKG" and path.exists():  # GDAL would replace what is none
        try:
            pyogrio.list_layers(f"GPKG:{path}")
        except RuntimeError as error:
            raise InputError(f"{plain(path.name)} exists, and is no GeoPackage that a layer can be added to",
                             code="geopackage", remedy="write to another name, or delete it") from error
    if driver in TILED and empty.all():
        raise OptionError("there is nothing to show, and vector tiles cannot hold that", code="empty",
                          remedy="choose an isovalue within the data, or write .gpkg")
    options: dict[str, Any] = {"layer_options": _OPTIONS.get(driver, {})}
    if driver == "FlatGeobuf" and empty.any():
        options["layer_options"] = {"SPATIAL_INDEX": "NO"}  # it cannot have one of what lies nowhere
    if driver in TILED:
        options["dataset_options"] = {"MAXZOOM": str(zoom_of(table)), "NAME": layer}
    if not len(table):
        options["geometry_type"] = "LineString"
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "'crs' was not provided")  # which the caller knows
            pyogrio.write_dataframe(_drawing(table, solid) if driver == "DXF" else table, path, driver=driver,
                                    layer=layer, **options)
    except (pyogrio.errors.CRSError, pyproj.exceptions.CRSError) as error:
        raise OptionError(f"GDAL does not know the reference system {short_name(str(table.crs))}", code="crs",
                          remedy="write .parquet or .geojson") from error
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})
    if driver == "GeoJSON" and members:
        text, first = path.read_bytes(), b'\n"features": ['
        path.write_bytes(text.replace(first, b"\n" + json.dumps(members)[1:-1].encode() + b"," + first, 1))


def _drawing(table: Any, solid: bool) -> Any:
    """Make a table for CAD: a layer for each isovalue, at whose height its lines lie; labels are no heights."""
    values = table.select_dtypes("float").to_numpy()
    shapes, kind = table.geometry, "LABEL" if table.columns[0] == "label" else "ISO"
    if not solid and kind == "ISO" and values.shape[1:] == (1,):
        shapes = shapes.force_3d(values[:, 0])
    names = ["_".join([kind, *(f"{value:.12g}" if value == value else end
                               for value, end in zip(row, ("min", "max"), strict=False))]) for row in values]
    return table[["geometry"]].set_geometry(shapes).assign(Layer=names)


def zoom_of(table: Any) -> int:
    """Find the lowest zoom level of a web map at which a pixel is no wider than the mean edge of a table's shapes."""
    shapes = table.to_crs(3857).geometry
    edge = shapes.length.sum() / max(shapes.count_coordinates().sum(), 1)
    return int(np.clip(np.ceil(np.log2(_EQUATOR / _PIXELS / edge)), 0, _MOST_ZOOM)) if 0 < edge < np.inf else 0
