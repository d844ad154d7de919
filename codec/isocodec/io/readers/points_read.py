"""Scattered points in: tables (CSV, XYZ), point clouds (LAS, LAZ), points of vector files (GeoPackage and others)."""

from __future__ import annotations

import csv
import os

import numpy as np

from ...errors import InputError, plain
from ...extras import optional
from .mesh_read import MeshRead
from .reading import reading
from .source import Source, source_of

TABLES, CLOUDS, VECTORS = (".csv", ".xyz"), (".las", ".laz"), (".gpkg", ".fgb", ".shp")
POINTS = TABLES + CLOUDS + VECTORS
"""Suffixes of what is read."""
_ACROSS = ("x", "lon", "longitude", "easting")
_UP = ("y", "lat", "latitude", "northing")
_HEIGHT = "z"


def read_points(path: str | os.PathLike[str], samples: int | None = None) -> MeshRead:
    """Read scattered points.

    Parameters
    ----------
    path : path
        Its suffix, one of ``POINTS``, names the format. A table has a line for each point, with x, y and values,
        divided by commas, semicolons, tabs or spaces; its first line may name the columns. Columns of x and y are those
        that are named so (or lon, lat, easting, northing), else the first two; without names, the third is ``z``.
    samples : int, optional
        As of `read_field`: most points.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no points.
    MissingExtraError
        If the library of its format is not installed.
    """
    source = source_of(path, samples)
    if source.named(*TABLES):
        found = _table(source)
    elif source.named(*CLOUDS):
        found = _cloud(source)
    elif source.named(*VECTORS):
        found = _vector(source)
    else:
        raise InputError(
            f"the suffix {plain(source.path.suffix)!r} names no format of points", code="suffix",
            remedy=f"known are {', '.join(POINTS)}",
        )
    source.check_count(len(found.points))
    return found


def _table(source: Source) -> MeshRead:
    with reading("table of points"):
        with source.path.open(newline="", encoding="utf-8-sig") as file:
            start = file.read(1 << 16)
        if not start.strip():
            raise InputError("holds nothing", code="points")
        first = start.splitlines()[0]
        divider = next((each for each in ",;\t" if each in first), " ")
        names = next(csv.reader([first], delimiter=divider, skipinitialspace=True), [])
        names = [name.strip() for name in names if name.strip()]
        named = not all(map(_is_number, names))
        if not named:
            names = [*"xyz", *(f"column {i}" for i in range(4, len(names) + 1))][: len(names)]
        rows = np.loadtxt(
            source.path, delimiter=None if divider == " " else divider, skiprows=int(named), ndmin=2,
            encoding="utf-8-sig",
        )
    if rows.shape[1] != len(names) or len(names) < 3:
        raise InputError(
            f"the table has {rows.shape[1]} columns, and {len(names)} are named", code="shape",
            remedy="give x, y and values, named in the first line or not at all",
        )
    low = [name.lower() for name in names]
    across, up = (next((low.index(each) for each in wanted if each in low), None) for wanted in (_ACROSS, _UP))
    if across is None or up is None:
        across, up = 0, 1
    values = {name: rows[:, i] for i, name in enumerate(names) if i not in (across, up)}
    return MeshRead(np.ascontiguousarray(rows[:, [across, up]]), None, values)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cloud(source: Source) -> MeshRead:
    laspy = optional("laspy", extra="points", purpose=f"reading {source.path.suffix}")
    with reading("point cloud"), laspy.open(source.path) as file:
        source.check_count(file.header.point_count)
        found = file.read()
        points = np.stack([np.asarray(found.x, np.float64), np.asarray(found.y, np.float64)], axis=1)
        values = {_HEIGHT: np.asarray(found.z, np.float64)}
        for name in found.point_format.dimension_names:
            if name not in ("X", "Y", "Z"):
                values[str(name)] = np.asarray(found[name])
    return MeshRead(points, None, values)


def _vector(source: Source) -> MeshRead:
    geopandas = optional("geopandas", extra="vector", purpose=f"reading {source.path.suffix}")
    with reading("vector file"):
        found = geopandas.read_file(source.path)
        shapes = found.geometry
        kinds = set(shapes.geom_type)
        if kinds != {"Point"}:
            raise InputError(
                f"holds {', '.join(sorted(map(str, kinds))) or 'nothing'}, not points", code="points",
                remedy="take the layer of points",
            )
        points = np.stack([shapes.x.to_numpy(), shapes.y.to_numpy()], axis=1)
        values = {
            str(name): found[name].to_numpy() for name in found.columns
            if name != shapes.name and found[name].dtype.kind in "iufb"
        }
        if shapes.has_z.all():
            values.setdefault(_HEIGHT, shapes.z.to_numpy())
    return MeshRead(points.astype(np.float64), None, values)
