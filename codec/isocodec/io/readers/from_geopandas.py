"""Geopandas reads the points of vector files (GeoPackage, FlatGeobuf, Shapefile, GeoJSON)."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from typing import Any

import numpy as np

from ...errors import InputError
from ...extras import optional
from ...field.reference_system import DEGREES, crs_text, named_system
from .from_rasterio import PACKAGE
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .reading import reading
from .source import InputFile

_TEXT = ".geojson"
_BEGINNINGS = {
    PACKAGE: (b"SQLite format 3\0", 68, (b"GPKG", b"GP10", b"GP11")), ".fgb": (b"fgb", 4, (b"fgb",)),
    ".shp": (b"\0\0\x27\x0a", 28, (b"\xe8\x03\0\0",)),
}
"""First bytes of formats, and others further on: GDAL goes by content, and other drivers open what a file names."""
_STEPS = 1_000_000
"""Work of a query."""


def _vector(source: InputFile, _: object) -> MeshRead:
    geopandas = optional("geopandas", extra="vector", purpose=f"reading {source.path.suffix}")
    with reading("vector file"):
        found, crs = _table(geopandas, source)
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
            values.setdefault(HEIGHT, shapes.z.to_numpy())
    return MeshRead(points.astype(np.float64), None, values, crs=crs)


def _table(geopandas: Any, source: InputFile) -> tuple[Any, str | None]:
    """The points of a file as a table, those of the layer of points if there is one, and their reference system."""
    if source.named(_TEXT):
        whole = json.loads(source.path.read_text(encoding="utf-8"))
        named = whole.get("crs", {}).get("properties", {}).get("name")
        system = f"EPSG:{DEGREES}" if named is None else named_system(named)
        return geopandas.GeoDataFrame.from_features(whole["features"]), system
    first, at, further = _BEGINNINGS[source.path.suffix.lower()]
    with source.path.open("rb") as file:
        head = file.read(at + 4)
    if not head.startswith(first) or not head[at:].startswith(further):
        raise InputError("is not a file of the format that its suffix names", code="unreadable")
    layers = optional("pyogrio", extra="vector", purpose=f"reading {source.path.suffix}").list_layers(source.path)
    points = [name for name, kind in layers if "Point" in str(kind)]
    found = geopandas.read_file(source.path, layer=points[0] if len(points) == 1 else layers[0][0])
    return found, crs_text(found.crs)


def _holds_points(source: InputFile, _: object) -> bool:
    """Whether a GeoPackage holds no raster."""
    try:
        with closing(sqlite3.connect(f"{source.path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as file:
            file.set_progress_handler(lambda: 1, _STEPS)
            kinds = {kind for (kind,) in file.execute("SELECT data_type FROM gpkg_contents")}
    except (sqlite3.Error, OSError):
        return True
    return not kinds & {"tiles", "2d-gridded-coverage"}


MESHES = (
    MeshFormat("GeoPackage", (PACKAGE,), _vector, extra="vector", scattered=True, holds=_holds_points),
    MeshFormat("vector file", (".fgb", ".shp", _TEXT), _vector, extra="vector", scattered=True),
)
