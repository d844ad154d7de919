"""Laspy reads point clouds (LAS, LAZ)."""

from __future__ import annotations

import struct

import numpy as np

from ...errors import InputError
from ...extras import optional
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .reading import reading
from .source import InputFile


def _check_counts(source: InputFile) -> None:
    """Check that records, of which the library makes as many as are stated, fit into the file."""
    size = source.path.stat().st_size
    with source.path.open("rb") as file:
        head = file.read(255).ljust(255, b"\0")
    records, width, points = *struct.unpack_from("<I", head, 100), *struct.unpack_from("<HI", head, 105)
    further = 0
    if head[25] >= 4:
        further, points = struct.unpack_from("<IQ", head, 243)
    source.check_count(points)
    stated = 54 * records + 60 * further + (0 if source.named(".laz") else width * points)
    if head[:4] != b"LASF" or stated > size:
        raise InputError(f"is no point cloud, or cut short: its header states {stated:,} bytes", code="unreadable")


def _cloud(source: InputFile) -> MeshRead:
    laspy = optional("laspy", extra="points", purpose=f"reading {source.path.suffix}")
    _check_counts(source)
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
