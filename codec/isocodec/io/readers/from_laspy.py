"""Laspy reads point clouds (LAS, LAZ)."""

from __future__ import annotations

import numpy as np

from ...extras import optional
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .reading import reading
from .source import InputFile


def _cloud(source: InputFile) -> MeshRead:
    laspy = optional("laspy", extra="points", purpose=f"reading {source.path.suffix}")
    with reading("point cloud"), laspy.open(source.path) as file:
        source.check_count(file.header.point_count)
        found = file.read()
        points = np.stack([np.asarray(found.x, np.float64), np.asarray(found.y, np.float64)], axis=1)
        values = {HEIGHT: np.asarray(found.z, np.float64)}
        for name in found.point_format.dimension_names:
            if name not in ("X", "Y", "Z"):
                values[str(name)] = np.asarray(found[name])
    return MeshRead(points, None, values)


MESHES = (MeshFormat("point cloud", (".las", ".laz"), _cloud, extra="points", scattered=True, confined="laspy"),)
