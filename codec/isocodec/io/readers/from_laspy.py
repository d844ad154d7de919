"""Laspy reads point clouds (LAS, LAZ): without withheld points and noise, or of some classes only."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from ...errors import InputError
from ...extras import optional
from ...field.reference_system import crs_text
from .mesh_formats import HEIGHT, MeshFormat, MeshRead
from .opened import Choice
from .reading import reading
from .source import InputFile

_LAZ = ".laz"
_NOISE, _HIGH_NOISE = 7, 18
_VLR, _EVLR = 54, 60
"""Bytes that a variable length record takes at least."""


def _cloud(source: InputFile, choice: Choice) -> MeshRead:
    laspy = optional("laspy", extra="points", purpose=f"reading {source.path.suffix}")
    _check_header(source)
    with reading("point cloud"), laspy.open(source.path) as file:
        found = file.read()
        kept, remarks = _kept(found, choice.classes)
        names = [name for name in found.point_format.dimension_names if name not in ("X", "Y", "Z")]
        values = {HEIGHT: np.asarray(found.z, np.float64)[kept]}
        for name, each in ((name, np.asarray(found[name])[kept]) for name in names):
            values |= {str(name): each} if each.ndim == 1 else {f"{name}:{i}": part for i, part in enumerate(each.T)}
        points = np.stack([np.asarray(found.x, np.float64), np.asarray(found.y, np.float64)], axis=1)[kept]
        optional("pyproj", extra="points", purpose="reading reference systems")
        crs = crs_text(file.header.parse_crs())
    return MeshRead(points, None, values, crs=crs, remarks=remarks)


def _check_header(source: InputFile) -> None:
    """Check the counts of a header against the bytes of the file: the library allocates what they state."""
    size = source.path.stat().st_size
    with source.path.open("rb") as file:
        head = file.read(375)
    if head[:4] != b"LASF" or len(head) < 227:
        raise InputError("is not a point cloud (LAS, LAZ)", code="unreadable")
    start, at, records = struct.unpack_from("<HII", head, 94)
    length, count = struct.unpack_from("<HI", head, 105)
    if head[25] >= 4 and len(head) == 375:
        extended, extensions, count = struct.unpack_from("<QIQ", head, 235)
        source.check_bytes(extended + _EVLR * extensions if extensions else 0)
    source.check_count(count)
    source.check_bytes(start + _VLR * records, min(at, size))
    source.check_bytes(at if source.named(_LAZ) else at + count * length)


def _kept(found: Any, classes: tuple[int, ...]) -> tuple[Any, list[str]]:
    """Find which points are taken, (N,) bool, with remarks on the others."""
    withheld, kind = np.asarray(found.withheld) != 0, np.asarray(found.classification)
    remarks = [f"{int(withheld.sum()):,} withheld points are left out"] if withheld.any() else []
    if classes:
        return ~withheld & np.isin(kind, classes), remarks
    # in older formats of points the other number is free
    noise = np.isin(kind, (_NOISE, _HIGH_NOISE) if found.point_format.id >= 6 else _NOISE) & ~withheld
    if noise.any():
        remarks.append(f"{int(noise.sum()):,} points of noise are left out; choose other classes with --classes")
    return ~withheld & ~noise, remarks


MESHES = (
    MeshFormat("point cloud", (".las", _LAZ), _cloud, extra="points", scattered=True, options=("classes",),
               confined="laspy"),
)
