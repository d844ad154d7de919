"""Scattered points: tables of pandas and of text, point clouds of laspy, points of geopandas."""

from __future__ import annotations

import csv
import sqlite3
from contextlib import closing
from typing import Any

import numpy as np

from ..errors import InputError
from ..field.meshed import Mesh
from ..field.reference_system import crs_text
from .arrays import valued
from .libraries import library, reading

TABLES, CLOUDS = (".csv", ".xyz", ".tsv"), (".las", ".laz")
LAYERS = {".fgb": "FlatGeobuf", ".shp": "ESRI Shapefile", ".geojson": "GeoJSON", ".gpkg": "GPKG"}
"""Drivers of GDAL by suffix: it goes by content, and files of other drivers name files and servers."""
SUFFIXES = (*TABLES, *CLOUDS, *LAYERS, ".parquet")
_X, _Y = ("x", "lon", "longitude", "easting"), ("y", "lat", "latitude", "northing")
_NOISE, _HIGH_NOISE = 7, 18
"""Classes of points that are no surface."""


def is_table(thing: object) -> bool:
    """Whether this is a DataFrame of pandas, or a GeoDataFrame."""
    return all(hasattr(thing, name) for name in ("index", "columns", "iloc"))


def is_cloud(thing: object) -> bool:
    """Whether these are points of laspy."""
    return hasattr(thing, "point_format") and hasattr(thing, "classification")


def of_columns(table: Any, key: str | None = None) -> Mesh:
    """Points of a table with columns x and y (or lon and lat, easting and northing), else the first two.

    Parameters
    ----------
    table : pandas.DataFrame
    key : str, optional
        Column of values; without it the only other one, or ``z``.

    Raises
    ------
    InputError
        If a column does not hold numbers.
    """
    names = [str(name).strip() for name in table.columns]
    if len(names) < 3:
        raise InputError(f"the table has {len(names)} columns", code="shape",
                         remedy="give x, y and values, named in the first line or not at all")
    low = [name.lower() for name in names]
    x, y = (next((low.index(each) for each in known if each in low), None) for known in (_X, _Y))
    if x is None or y is None:
        x, y = 0, 1
    with reading("table of points", "columns must hold numbers"):
        rows = table.to_numpy(np.float64, na_value=np.nan)
    values = {name: rows[:, i] for i, name in enumerate(names) if i not in (x, y)}
    return valued(np.ascontiguousarray(rows[:, [x, y]]), None, values, key)


def of_cloud(points: Any, key: str | None = None) -> Mesh:
    """Points of laspy with their height, or another dimension, without withheld points and noise (classes 7, 18).

    Raises
    ------
    InputError, MissingExtraError
    """
    withheld, kind = np.asarray(points.withheld) != 0, np.asarray(points.classification)
    # in older formats of points the other number is free
    noise = np.isin(kind, (_NOISE, _HIGH_NOISE) if points.point_format.id >= 6 else _NOISE) & ~withheld
    remarks = [f"{int(gone.sum()):,} {what} are left out" for gone, what in
               ((withheld, "withheld points"), (noise, "points of noise")) if gone.any()]
    kept = ~withheld & ~noise
    values = {"z": np.asarray(points.z, np.float64)[kept]}
    for name in map(str, points.point_format.dimension_names):
        if name not in ("X", "Y", "Z"):
            each = np.asarray(points[name])[kept]
            values |= {name: each} if each.ndim == 1 else {f"{name}:{i}": part for i, part in enumerate(each.T)}
    library("pyproj", extra="vector", purpose="reading reference systems")
    with reading("point cloud"):
        crs = crs_text(points.header.parse_crs())
    places = np.stack([np.asarray(points.x, np.float64), np.asarray(points.y, np.float64)], axis=1)[kept]
    return valued(places, None, values, key, crs=crs, remarks=remarks)


def of_shapes(table: Any, key: str | None = None) -> Mesh:
    """Points of geopandas with the values of a column of numbers, or their third coordinate, ``z``.

    Raises
    ------
    InputError
        If there are other shapes than points.
    """
    shapes = table.geometry
    kinds = {*map(str, shapes.geom_type)}
    if kinds != {"Point"}:
        raise InputError(f"holds {', '.join(sorted(kinds)) or 'nothing'}, not points", code="points",
                         remedy="take the layer of points")
    values = {str(name): table[name].to_numpy() for name in table.columns
              if name != shapes.name and table[name].dtype.kind in "iufb"}
    if shapes.has_z.all():
        values.setdefault("z", shapes.z.to_numpy())
    points = np.stack([shapes.x.to_numpy(), shapes.y.to_numpy()], axis=1).astype(np.float64)
    return valued(points, None, values, key, crs=crs_text(table.crs))


def open_(path: str, key: str | None = None) -> Mesh:
    """Read a table of text, a point cloud, or the layer of points of a vector file.

    A table has a line for each point, with x, y and values, divided by commas, semicolons, tabs or spaces. Its first
    line may name the columns; without names the third is ``z``.

    Raises
    ------
    OSError, InputError, MissingExtraError
    """
    name = path.lower()
    if name.endswith(TABLES):
        return of_columns(_table(path), key)
    if name.endswith(CLOUDS):
        laspy = library("laspy", extra="vector", purpose="reading point clouds")
        with reading("point cloud", "check that the file is complete"):
            found = laspy.read(path)
        return of_cloud(found, key)
    geopandas = library("geopandas", extra="vector", purpose="reading vector files")
    with reading("vector file", "is it of the format that its suffix names?"):
        if name.endswith(".parquet"):
            return of_shapes(geopandas.read_parquet(path), key)
        pyogrio = library("pyogrio", extra="vector", purpose="reading vector files")
        pyogrio.set_gdal_config_options({"CPL_VSIL_CURL_ALLOWED_FILENAME": "none"})
        layers = pyogrio.list_layers(path)
        layer = next((each for each, kind in layers if "Point" in str(kind)), layers[0][0])
        driver = pyogrio.read_info(path, layer=layer)["driver"]
        if driver != next(known for end, known in LAYERS.items() if name.endswith(end)):
            raise InputError(f"is a {driver}, not what its suffix names", code="unreadable", remedy="rename it")
        return of_shapes(geopandas.read_file(path, layer=layer), key)


def holds_raster(path: str) -> bool:
    """Whether a GeoPackage holds a raster."""
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as file:
            kinds = {kind for (kind,) in file.execute("SELECT data_type FROM gpkg_contents")}
    except sqlite3.Error:
        return False
    return bool(kinds & {"tiles", "2d-gridded-coverage"})


def _table(path: str) -> Any:
    pandas = library("pandas", extra="vector", purpose="reading tables")
    with reading("table of points", "give x, y and values, divided by commas, semicolons, tabs or spaces"):
        with open(path, newline="", encoding="utf-8-sig") as file:
            first = file.readline()
        if not first.strip():
            raise InputError("holds nothing", code="points")
        divider = next((each for each in ",;\t" if each in first), None)
        names = next(csv.reader([first], delimiter=divider, skipinitialspace=True)) if divider else first.split()
        try:
            [float(name) for name in names if name.strip()]
            named = False
        except ValueError:
            named = True
        names = names if named else [*"xyz", *(f"column {i}" for i in range(4, len(names) + 1))][: len(names)]
        found = pandas.read_csv(path, sep=divider or r"\s+", header=None, skiprows=int(named), names=names,
                               comment="#", skipinitialspace=True, encoding="utf-8-sig", index_col=False)
        if found.iloc[:, -1].isna().any():  # pandas fills up rows that are cut short
            with open(path, encoding="utf-8-sig") as file:
                rows = [row for line in file if (row := line.partition("#")[0].strip(" \r\n"))]
            if any(len(row.split(divider)) < len(names) for row in rows):
                raise InputError("has rows with fewer columns than the first one", code="shape",
                                 remedy="check that the file is complete")
        return found
