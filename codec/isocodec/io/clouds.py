"""Scattered points: tables of text, point clouds of laspy, points of geopandas."""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..field.meshed import Mesh
from ..field.reference_system import crs_text
from ..verbs import Choice
from .arrays import valued
from .libraries import library, reading

TABLES, CLOUDS = (".csv", ".xyz", ".tsv"), (".las", ".laz")
LAYERS = {".fgb": "FlatGeobuf", ".shp": "ESRI Shapefile", ".geojson": "GeoJSON", ".gpkg": "GPKG"}
"""Drivers of GDAL by suffix: it goes by content, and files of other drivers name files and servers."""
SUFFIXES = (*TABLES, *CLOUDS, *LAYERS, ".parquet")
_X, _Y = {"x", "lon", "longitude", "easting"}, {"y", "lat", "latitude", "northing"}
_NOISE, _HIGH_NOISE = 7, 18
"""Classes of points that are no surface."""


def of_cloud(points: Any, choice: Choice) -> Mesh:
    """Read points of laspy with their height, or another dimension, without withheld points and noise (7, 18)."""
    library("pyproj", extra="vector", purpose="reading reference systems")
    withheld, kind = np.asarray(points.withheld) != 0, np.asarray(points.classification)
    # in older formats of points the other number is free
    noise = np.isin(kind, (_NOISE, _HIGH_NOISE) if points.point_format.id >= 6 else _NOISE) & ~withheld
    remarks = [f"{int(gone.sum()):,} {what} are left out" for gone, what in
               ((withheld, "withheld points"), (noise, "points of noise")) if gone.any()]
    kept = ~withheld & ~noise
    values = {"z": np.asarray(points.z, np.float64)[kept]}
    for name in points.point_format.dimension_names:
        if name in ("X", "Y", "Z"):
            continue
        each = np.asarray(points[name])[kept]
        values |= {name: each} if each.ndim == 1 else {f"{name}:{i}": part for i, part in enumerate(each.T)}
    with reading("point cloud"):
        crs = crs_text(points.header.parse_crs())
    return valued(np.stack([points.x, points.y], axis=1)[kept], None, values, choice.key, crs=crs, remarks=remarks)


def of_shapes(table: Any, choice: Choice) -> Mesh:
    """Read points of geopandas with the values of a column of numbers, or their third coordinate, ``z``."""
    shapes = table.geometry
    kinds = {*shapes.geom_type.fillna("rows without a shape")}
    if kinds != {"Point"}:
        raise InputError(f"holds {', '.join(sorted(kinds)) or 'nothing'}, not points alone", code="points",
                         remedy="take the layer of points")
    values = {str(name): table[name].to_numpy() for name in table.columns
              if name != shapes.name and table[name].dtype.kind in "iufb"}
    if shapes.has_z.all():
        values.setdefault("z", shapes.z.to_numpy())
    return valued(shapes.get_coordinates().to_numpy(), None, values, choice.key, crs=crs_text(table.crs))


def open_(path: Path, choice: Choice) -> Mesh:
    """Read a table of text, a point cloud, or the layer of points of a vector file."""
    suffix = path.suffix.lower()
    if suffix in TABLES:
        return _of_text(path, choice)
    if suffix in CLOUDS:
        laspy = library("laspy", extra="vector", purpose="reading point clouds")
        with reading("point cloud", "check that the file is complete"):
            return of_cloud(laspy.read(path), choice)
    geopandas, pyogrio = (library(each, extra="vector", purpose="reading vector files")
                          for each in ("geopandas", "pyogrio"))
    with reading("vector file", "is it of the format that its suffix names?"):
        if suffix not in LAYERS:
            return of_shapes(geopandas.read_parquet(path), choice)
        pyogrio.set_gdal_config_options({"CPL_VSIL_CURL_ALLOWED_FILENAME": "none"})
        layers = pyogrio.list_layers(path)
        layer = next((each for each, kind in layers if "Point" in str(kind)), layers[0][0])
        driver = pyogrio.read_info(path, layer=layer)["driver"]
        if driver != LAYERS[suffix]:
            raise InputError(f"is a {driver}, not what its suffix names", code="unreadable", remedy="rename it")
        return of_shapes(geopandas.read_file(path, layer=layer), choice)


def holds_raster(path: Path) -> bool:
    """Whether a GeoPackage holds a raster."""
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as file:
        kinds = {kind for (kind,) in file.execute("SELECT data_type FROM gpkg_contents")}
        return not kinds.isdisjoint({"tiles", "2d-gridded-coverage"})
    return False


def _number(text: str) -> float:
    return float("nan" if text.strip() in ("", "NA") else text)


def _of_text(path: Path, choice: Choice) -> Mesh:
    """Read a line for each point: x, y and values, divided by commas, semicolons, tabs or spaces.

    The first line may name the columns; x and y are those of such names (or lon and lat, easting and northing), else
    the first two. Without names the third is ``z``.
    """
    with (reading("table of points", "give x, y and values, divided by commas, semicolons, tabs or spaces"),
          path.open(encoding="utf-8-sig") as file):
        first = file.readline().strip().lstrip("# ")
        if not first:
            raise InputError("holds nothing", code="points")
        divider = next((each for each in ",;\t" if each in first), None)
        names = [name.strip(' "') for name in first.split(divider)]
        try:
            [*map(_number, names)]
            names = [*"xyz", *(f"column {i}" for i in range(4, len(names) + 1))][: len(names)]
            file.seek(0)
        except ValueError:
            pass
        rows = np.loadtxt(file, delimiter=divider, converters=_number, quotechar='"', ndmin=2)
    if len(names) < 3 or len(names) != rows.shape[1]:
        raise InputError(f"its first line has {len(names)} columns, and others have {rows.shape[1]}", code="shape",
                         remedy="give x, y and values, named in the first line or not at all")
    low = [name.lower() for name in names]
    x, y = (next((at for at, name in enumerate(low) if name in known), None) for known in (_X, _Y))
    if x is None or y is None:
        x, y = 0, 1
    values = {name: rows[:, at] for at, name in enumerate(names) if at not in (x, y)}
    return valued(rows[:, [x, y]], None, values, choice.key)
