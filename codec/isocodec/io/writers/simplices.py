"""The mesh under a curve or surface out: VTU for tools of simulation, PLY, and polygons as GeoJSON.

Coordinates are those of curves and surfaces (see `io.write`): of the placement, or of samples. Vertices have the sign
(1 above the isovalue, 0 not), simplices their level.
"""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.contour import Contour
from ...extras import optional
from ...field.reference_system import to_degrees
from .output_formats import Cost, Format

if TYPE_CHECKING:
    from ...drawing.tessellation import Tessellation

VALUES = "above", "level"
"""Names of the values at vertices and of simplices."""


def placed(mesh: Tessellation) -> NDArray[np.float64]:
    """Vertices in the coordinates x, y (, z) of the placement, or of samples (see `Contour.placed`)."""
    none = np.zeros((0, 2)), np.zeros((0, 2), np.int64)
    about = Contour(*none, mesh.isovalue, mesh.shape, placement=mesh.placement)
    return about.place(mesh.points.astype(np.float64))


def _in_space(mesh: Tessellation) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices with three coordinates, and simplices with a positive volume, or seen counter-clockwise from above."""
    points = placed(mesh)
    corners = points[mesh.cells[:1]]
    spanned = np.linalg.det(corners[:, 1:] - corners[:, :1])
    cells = mesh.cells
    if (spanned < 0).any():
        # all are oriented alike, and a placement that mirrors turns all over
        cells = np.concatenate([cells[:, :-2], cells[:, :-3:-1]], axis=1)
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), cells


def _meshio() -> Any:
    return optional("meshio", extra="vtu", purpose="writing .vtu")


def _vtu(mesh: Tessellation) -> bytes:
    points, cells = _in_space(mesh)
    written = _meshio().Mesh(
        points, [("triangle" if cells.shape[1] == 3 else "tetra", cells)],
        point_data={VALUES[0]: mesh.above.astype(np.uint8)}, cell_data={VALUES[1]: [mesh.levels.astype(np.uint8)]},
    )
    # the library writes to a path only
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.vtu"
        written.write(path, file_format="vtu")
        return path.read_bytes()


def _ply(mesh: Tessellation) -> bytes:
    """Binary PLY in double precision: triangles in the plane; in space the sides of the tetrahedra, each once.

    A side has the level of the finer of the two tetrahedra that share it.
    """
    points, cells = _in_space(mesh)
    levels = mesh.levels
    if cells.shape[1] == 4:
        sides = np.concatenate([cells[:, [1, 2, 3]], cells[:, [0, 3, 2]], cells[:, [0, 1, 3]], cells[:, [0, 2, 1]]])
        finest = np.argsort(-np.tile(levels, 4), kind="stable")
        _, first = np.unique(np.sort(sides[finest], axis=1), axis=0, return_index=True)
        kept = np.sort(finest[first])
        cells, levels = sides[kept], np.tile(levels, 4)[kept]
    vertex = np.empty(len(points), [("at", "<f8", 3), ("above", "u1")])
    vertex["at"], vertex["above"] = points, mesh.above
    face = np.empty(len(cells), [("count", "u1"), ("of", "<i4", 3), ("level", "u1")])
    face["count"], face["of"], face["level"] = 3, cells, levels
    head = [
        "ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", "property double x",
        "property double y", "property double z", "property uchar above", f"element face {len(cells)}",
        "property list uchar int vertex_indices", "property uchar level", "end_header\n",
    ]
    return "\n".join(head).encode() + vertex.tobytes() + face.tobytes()


def _geojson(mesh: Tessellation) -> bytes:
    """A polygon for each triangle, with its level and the signs of its corners."""
    points, cells = _in_space(mesh)
    points = to_degrees(mesh.placement)(points[:, :2])
    features = [
        {
            "type": "Feature",
            "properties": {VALUES[1]: level, VALUES[0]: above},
            "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
        }
        for corners, level, above in zip(
            points[cells].tolist(), mesh.levels.tolist(), mesh.above[cells].astype(int).tolist(), strict=True
        )
    ]
    whole = {"type": "FeatureCollection", "features": features}
    return json.dumps(whole, separators=(",", ":"), allow_nan=False).encode() + b"\n"


MESHES: dict[str, Format] = {
    ".vtu": Format((2, 3), _vtu, _meshio, cost={2: Cost(300, 200, 1 << 24), 3: Cost(300, 200, 1 << 24)}),
    ".ply": Format((2, 3), _ply, cost={2: Cost(80, 80), 3: Cost(80, 700)}),
    ".geojson": Format((2,), _geojson, cost={2: Cost(100, 2000)}),
}
"""Formats of meshes, by suffix."""
