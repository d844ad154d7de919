"""Contours as tables of geopandas, and tables as files of geographic information systems by pyogrio (GDAL).

A row is a line, the areas of an isovalue on one side, a band between neighbouring isovalues, or a triangle.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.areas import areas_of, lifted, oriented
from ..drawing.bands import band_areas
from ..drawing.contour import Contour
from ..errors import InputError, OptionError, one_line
from ..field.labelling import noun_of
from ..field.placement import Placement
from ..field.reference_system import system_of
from .libraries import library

TAKEN = ("geometry", "geom", "fid", "ogc_fid", "wkt", "closed", "complete", "side", "index")
"""Columns, in any case, that tables or files have beside those of isovalues."""
LOCATED = ("LIBKML", "PMTiles", "MBTiles")
"""Drivers of GDAL whose files are in longitude and latitude by definition."""
LAYERED = ("GPKG", "SQLite", "GeoJSON", "FlatGeobuf", "GML", *LOCATED)
UNNAMED = ("DXF",)
"""Drivers without columns."""
DEGREES = ("GeoJSON", "GeoJSONSeq", *LOCATED)
EMPTY: Mapping[str, str] = MappingProxyType({})
_DATE = "2000-01-01T00:00:00.000Z"
"""Fixed time of writing, so that equal input gives equal bytes."""
_PIXELS, _EQUATOR, _MOST_ZOOM = 256, 40075016.68, 22
_LONGEST, _NEAR, _STEP, _ROUNDS = 1.5, 70.0, 2.0, 14
"""Cells that an edge is long at most before its ends are converted; beyond which latitude it is divided until
longitudes change by so many degrees at most, and how often."""
Move = Callable[[NDArray[np.float64]], NDArray[np.float64]]
_NOWHERE = (b'"crs": {"type": "name", "properties": {"name": '
            b'"ENGCRS[\\"samples\\",EDATUM[\\"samples\\"],CS[Cartesian,2],'
            b'AXIS[\\"x\\",east],AXIS[\\"y\\",north],LENGTHUNIT[\\"unit\\",1]]"}}')
"""Member of GeoJSON without a reference system, whose coordinates would be taken for longitudes and latitudes."""
_SLIVER = 2.0
"""Twice the area, in square degrees, of rings whose direction may be due to rounding."""


def check_names(*names: str) -> None:
    """Refuse names of columns that tables have for something else.

    Raises
    ------
    OptionError
    """
    wrong = [name for name in names if name.lower() in ("", *TAKEN)]
    if wrong or len({name.lower() for name in names}) < len(names):
        raise OptionError(f"isovalues cannot have the name {(wrong or [*names])[-1]!r} (--attribute): it is taken",
                          code="attribute", remedy=f"choose a name other than {', '.join(TAKEN)}")


def lines(contours: Iterable[Contour], attribute: str | None = None, index: Collection[float] | None = None) -> Any:
    """Make a table with a row for each line of some curves.

    Parameters
    ----------
    contours : iterable of Contour
        Curves of one field; each is released when its rows are made.
    attribute : str, optional
        Name of the column of isovalues; if not given, ``isovalue``, or ``label`` of contours of labels.
    index : collection of float, optional
        Isovalues of index contours, which a column ``index`` marks.

    Returns
    -------
    geopandas.GeoDataFrame
        In the reference system of the contours: isovalue, ``closed``, ``complete``.

    Raises
    ------
    OptionError
        For surfaces, and names that are taken.
    MissingExtraError
    """
    return _named(_joined(contour.to_geodataframe() for contour in contours), attribute, index)


def areas(
    contours: Iterable[Contour], side: str = "above", valid: NDArray[np.bool_] | None = None,
    attribute: str | None = None, index: Collection[float] | None = None,
) -> Any:
    """Make a table with a row for the areas above or below each of some curves; others as for `lines`.

    Parameters
    ----------
    side : {"above", "below"}
    valid : (s0, s1) bool, optional
        As for `Contour.areas`.

    Raises
    ------
    OptionError, TruncatedError, MissingExtraError
        As for `Contour.areas`.
    """
    return _named(_joined(
        _table({noun_of(contour.metadata): [float(contour.isovalue)], "side": [side], "complete": [contour.complete]},
               [lifted(areas_of(contour, above=side == "above", valid=valid), contour.placement)], contour.placement)
        for contour in contours
    ), attribute, index)


def bands(
    contours: Iterable[Contour], valid: NDArray[np.bool_] | None = None, lower: str = "lower", upper: str = "upper"
) -> Any:
    """Make a table with a row for each band between neighbouring isovalues; the outer ones have one bound only.

    Parameters and errors as for `areas`; ``lower`` and ``upper`` are names of columns.
    """
    check_names(lower, upper)
    whole = list(contours)
    low, high, shapes = zip(*band_areas(whole, valid), strict=True)
    return _table({lower: np.array(low, float), upper: np.array(high, float)}, shapes, whole[0].placement)


def triangles(
    points: NDArray[np.float64], cells: NDArray[np.int64], columns: Mapping[str, Any], placement: Placement | None
) -> Any:
    """Make a table with a row for each triangle, with three coordinates, and some columns."""
    shapely = library("shapely", extra="vector", purpose="tables of triangles")
    return _table(columns, shapely.polygons(points[cells[:, [0, 1, 2, 0]]]), placement)


def _table(columns: Mapping[str, Any], shapes: Sequence[Any], placement: Placement | None) -> Any:
    geopandas = library("geopandas", extra="vector", purpose="tables of lines and areas")
    return geopandas.GeoDataFrame(columns, geometry=list(shapes), crs=system_of(placement))


def _joined(tables: Iterable[Any]) -> Any:
    pandas = library("pandas", extra="vector", purpose="tables of lines and areas")
    return pandas.concat(list(tables), ignore_index=True)


def _named(table: Any, attribute: str | None, index: Collection[float] | None) -> Any:
    """Name the first column, and mark index contours."""
    usual = table.columns[0]
    check_names(usual if attribute is None else attribute)
    if index is not None:
        table.insert(1, "index", table[usual].isin(list(index)))
    return table if attribute is None else table.rename(columns={usual: attribute})


# ---- Longitude and latitude -----------------------------------------------------------------------------------------


def degrees(table: Any, cell: float | None = None) -> Any:
    """Convert a table to longitude and latitude, cut at 180 degrees (RFC 7946); areas around a pole hold the pole.

    Parameters
    ----------
    table : geopandas.GeoDataFrame
        With a reference system.
    cell : float, optional
        Size of a cell; longer edges are divided before they are converted, since they bend.

    Raises
    ------
    OptionError
        If coordinates have no longitude and latitude.
    """
    shapely = library("shapely", extra="vector", purpose="longitude and latitude")
    shapes, move = table.geometry.to_numpy(), _move(table.crs)
    straight = bool(table.crs.is_geographic)
    if cell is not None and not straight:
        shapes = shapely.segmentize(shapes, _LONGEST * cell)
    there = shapely.transform(shapes, move, include_z=bool(shapely.has_z(shapes).any()))
    west, south, east, north = shapely.bounds(there).T
    near = (np.maximum(-south, north) > _NEAR) & (not straight)
    for at in np.flatnonzero((west < -180) | (east > 180) | (east - west > 180) | near):
        there[at] = _cut(shapes[at], shapely, move, straight)
    return table.set_geometry(there, crs=4326)


def _move(system: Any) -> Move:
    """Make a function from coordinates (P, 2 or 3) to longitude and latitude; the third stays as it is."""
    pyproj = library("pyproj", extra="vector", purpose="longitude and latitude")
    remedy = "is the placement right? --keep-crs writes the coordinates as they are"
    try:
        transform = pyproj.Transformer.from_crs(system, 4326, always_xy=True).transform
    except pyproj.exceptions.ProjError as error:
        raise OptionError("the reference system has no longitude and latitude", code="crs", remedy=remedy) from error

    def moved(points: NDArray[np.float64]) -> NDArray[np.float64]:
        out = points if system == 4326 else np.column_stack([*transform(*points[:, :2].T), points[:, 2:]])
        if not np.isfinite(out).all() or (abs(out[:, 1]) > 90 + 1e-6).any():
            raise OptionError("coordinates lie outside of what the reference system covers", code="crs", remedy=remedy)
        return np.column_stack([out[:, 0], out[:, 1].clip(-90, 90), out[:, 2:]])

    return moved


def _cut(shape: Any, shapely: Any, move: Move, straight: bool) -> Any:
    """Convert lines or areas, and cut them at 180 degrees where their longitudes jump, or go on."""
    parts = shapely.get_parts(shape)
    if shapely.get_dimensions(shape) == 1:
        found = [_within(shapely.LineString(_continued(line, shapely, move, straight)), shapely) for line in parts]
        return shapely.multilinestrings(shapely.get_parts(found))
    out = []
    for part in parts:
        rings = part.exterior, *(ring.reverse() for ring in part.interiors)
        shell, *holes = (_ringed(_continued(ring, shapely, move, straight), shapely) for ring in rings)
        out.append(shapely.difference(shell, shapely.union_all(holes)) if holes else shell)
    return oriented(shapely.GeometryCollection(out))


def _continued(line: Any, shapely: Any, move: Move, straight: bool) -> NDArray[np.float64]:
    """Convert a line: with more points where its longitudes change fast, which go on instead of jumping by 360."""
    points = shapely.get_coordinates(line, include_z=line.has_z)
    there = move(points)
    if straight:
        return there
    for _ in range(_ROUNDS):
        at = np.flatnonzero(abs((np.diff(there[:, 0]) + 180) % 360 - 180) > _STEP)
        if not len(at):
            break
        half = (points[at] + points[at + 1]) / 2
        points, there = np.insert(points, at + 1, half, axis=0), np.insert(there, at + 1, move(half), axis=0)
    return np.column_stack([np.unwrap(there[:, 0], period=360), there[:, 1:]])


def _ringed(points: NDArray[np.float64], shapely: Any) -> Any:
    """Make the area on the left of a ring: one around a pole holds the pole, one that turns right what is outside."""
    turns = round((points[-1, 0] - points[0, 0]) / 360)
    if turns:
        # closed over the pole from the point that is nearest to it, above which no part of the ring lies
        first = int(np.argmax(points[:, 1] * np.sign(turns)))
        points = np.concatenate([points[first:], points[1 : first + 1] + np.eye(1, points.shape[1]) * 360 * turns])
        ends = points[[-1, 0]].copy()
        ends[:, 1] = 90 * np.sign(turns)
        points = np.concatenate([points, ends])
    x, y = (points[:, :2] - points[0, :2]).T
    inside = _within(shapely.make_valid(shapely.Polygon(points)), shapely)
    if not turns and (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() < -_SLIVER:
        return shapely.difference(shapely.box(-180, -90, 180, 90), inside)
    return inside


def _within(shape: Any, shapely: Any) -> Any:
    """Cut a shape of longitudes that go on into parts from -180 to 180."""
    found = []
    for turn in range(int((shape.bounds[0] + 180) // 360), int((shape.bounds[2] + 180) // 360) + 1):
        part = shapely.intersection(shape, shapely.box(360 * turn - 180, -90, 360 * turn + 180, 90))
        found.append(shapely.transform(part, lambda points, turn=turn: points - np.eye(1, points.shape[1]) * 360 * turn,
                                       include_z=part.has_z))
    kept = [part for one in found for part in shapely.get_parts(one)
            if shapely.get_dimensions(part) == shapely.get_dimensions(shape)]
    return shapely.union_all(kept) if shapely.get_dimensions(shape) == 2 else shapely.multilinestrings(kept)


# ---- Files ----------------------------------------------------------------------------------------------------------


def write_table(
    table: Any, path: Path, driver: str, *, layer: str, keep_crs: bool = False, cell: float | None = None,
    members: Mapping[str, str] = EMPTY,
) -> None:
    """Write a table by GDAL, or a GeoParquet file by geopandas; an existing GeoPackage keeps its other layers.

    Parameters
    ----------
    driver : str
        Name of GDAL's driver, or ``Parquet``.
    layer : str
        Name of the layer, where the format has them.
    keep_crs : bool
        Keep the reference system in GeoJSON.
    cell : float, optional
        As for `degrees`.
    members : mapping of str to str
        Further members of a GeoJSON file.

    Raises
    ------
    InputError
        If there is a file of the name of a GeoPackage that is none.
    OptionError, MissingExtraError
    """
    if driver == "Parquet":
        table.to_parquet(path, index=False)
        return
    pyogrio = library("pyogrio", extra="vector", purpose="writing maps")
    if driver in LOCATED and table.crs is None:
        raise OptionError("the format is in longitude and latitude, but the file does not state where its samples lie, "
                          "or in which system", code="crs", remedy="encode with a placement and --crs EPSG:..")
    nowhere = table.crs is None
    if driver in DEGREES and not nowhere and not (keep_crs and driver not in LOCATED):
        table = degrees(table, cell)
    if driver == "GeoJSON" and not nowhere and table.crs.to_epsg() == 4326:  # names no system, as RFC 7946 has it
        table = table.set_crs(None, allow_override=True)
    flat = not table.geometry.has_z.any()
    if not flat:
        table = table[~table.geometry.is_empty]  # these have no height, and formats one number of coordinates
    if not (valid := table.geometry.is_valid).all():  # where rounding has made rings touch
        made = table.geometry.make_valid()
        table = table.set_geometry(table.geometry.where(valid, [oriented(shape) for shape in made]))
    options: dict[str, Any] = {"GPKG": {}, "ESRI Shapefile": {"DBF_DATE_LAST_UPDATE": _DATE[:10]},
                               "CSV": {"GEOMETRY": "AS_WKT"}}.get(driver, {})
    if driver == "GPKG" and path.exists() and path.read_bytes()[68:70] != b"GP":  # GDAL would replace it
        raise InputError("there is a file of this name that is no GeoPackage", code="geopackage",
                         remedy="write to another name, or delete it")
    if driver in DEGREES and driver not in LOCATED:
        options = {"SIGNIFICANT_FIGURES": "17"} if driver == "GeoJSON" else {"COORDINATE_PRECISION": "15"}
        if members:
            native = {"type": "FeatureCollection", **members}
            options |= {"NATIVE_DATA": json.dumps(native), "NATIVE_MEDIA_TYPE": "application/vnd.geo+json"}
    if driver == "FlatGeobuf" and table.geometry.is_empty.any():
        options = {"SPATIAL_INDEX": "NO"}  # it cannot have one of what lies nowhere
    if driver == "DXF":
        table = _drawing(table, flat)
    more: dict[str, Any] = {}
    if driver in ("PMTiles", "MBTiles"):
        if table.geometry.is_empty.all():
            raise OptionError("there is nothing to show, and vector tiles cannot hold that", code="empty",
                              remedy="choose an isovalue within the data, or write .gpkg")
        more = {"dataset_options": {"MAXZOOM": str(zoom_of(table)), "NAME": layer}}
    if not len(table):
        more["geometry_type"] = "LineString"
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _DATE})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "'crs' was not provided")  # which the caller knows
            pyogrio.write_dataframe(table, path, driver=driver, layer=layer, layer_options=options, **more)
        if driver == "GeoJSON" and nowhere:
            text = path.read_bytes()
            path.write_bytes(text.replace(b'"features"', _NOWHERE + b',\n"features"', 1))
    except pyogrio.errors.CRSError as error:
        raise OptionError(f"the reference system is unknown to GDAL, which writes maps: {one_line(str(error))}",
                          code="crs", remedy="write .geojson, which has longitude and latitude") from error
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _drawing(table: Any, flat: bool) -> Any:
    """Make a table for CAD: a layer for each isovalue, at whose height its lines lie; labels are no heights."""
    values = table.select_dtypes("float").to_numpy()
    shapes, ends, kind = table.geometry, ("min", "max"), "LABEL" if table.columns[0] == "label" else "ISO"
    if flat and kind == "ISO" and values.shape[1:] == (1,):
        shapes = shapes.force_3d(values[:, 0])
    numbers = ([f"{value:.12g}" if value == value else end for value, end in zip(row, ends, strict=False)]
               for row in values)
    names = ["_".join([kind, *row]) for row in numbers]
    return table[["geometry"]].set_geometry(shapes).assign(Layer=names)


def zoom_of(table: Any) -> int:
    """Find the lowest zoom level of a web map at which a pixel is no wider than the mean edge of a table's shapes."""
    shapes = table.to_crs(3857).geometry
    edges = shapes.count_coordinates().sum()
    length = shapes.length.sum() / max(edges, 1)
    if not np.isfinite(length) or not length:
        return 0
    return int(np.clip(np.ceil(np.log2(_EQUATOR / _PIXELS / length)), 0, _MOST_ZOOM))
