"""Geopandas reads the points of vector files (GeoPackage, FlatGeobuf, Shapefile)."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...extras import optional
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .reading import reading
from .source import InputFile


def _vector(source: InputFile, _: object) -> MeshRead:
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
            values.setdefault(HEIGHT, shapes.z.to_numpy())
    return MeshRead(points.astype(np.float64), None, values)


MESHES = (MeshFormat("vector file", (".gpkg", ".fgb", ".shp"), _vector, extra="vector", scattered=True),)
