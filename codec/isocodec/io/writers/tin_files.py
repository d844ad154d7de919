"""Triangulated terrains and pictures out: NPZ, PLY, VTU and GeoJSON.

The third coordinate is the value. Of points that were scattered, x and y are the two columns; of the samples of a
field, those of its placement, without one x runs along axis 1 and y along axis 0 (see `io.write`).
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...extras import optional
from ...field.placement import Placement
from ...tin.tin import Tin
from .geojson import named
from .output_formats import Format, find_suffix


@dataclass(frozen=True)
class PlacedTin:
    """A surface, where it lies, and what a format may hold beside.

    Attributes
    ----------
    tin : Tin
    placement : Placement
        With a matrix.
    notes : dict
        Arrays for NPZ.
    """

    tin: Tin
    placement: Placement
    notes: dict[str, NDArray[Any]]

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(V, 3) float64: x, y, value."""
        return np.column_stack([self.placement.place(self.tin.points), self.tin.values])

    @property
    def triangles(self) -> NDArray[np.int64]:
        """(T, 3) int64: seen anticlockwise from above."""
        return self.tin.triangles[:, ::-1] if self.placement.mirrored() else self.tin.triangles


def check_tin(path: Path) -> str:
    """The suffix of ``path``, if a surface can be written to it.

    Raises
    ------
    OptionError, MissingExtraError
    """
    suffix = find_suffix(_FORMATS, path)
    _FORMATS[suffix].check_libraries()
    return suffix


def render_tin(tin: PlacedTin, suffix: str) -> bytes:
    """The whole file of a surface in the format that ``suffix`` (``".ply"``) names."""
    return bytes(_FORMATS[suffix].render(tin))


def _npz(placed: PlacedTin) -> bytes:
    """Points in the order of the array's axes."""
    buffer = io.BytesIO()
    tin = placed.tin
    arrays: dict[str, Any] = {
        "points": tin.points, "values": tin.values, "triangles": tin.triangles, "placement": placed.placement.matrix,
        "crs": np.asarray(placed.placement.crs or ""), **placed.notes,
    }
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _ply(placed: PlacedTin) -> bytes:
    """Binary PLY in double precision."""
    triangles = placed.triangles
    face = np.empty(len(triangles), [("count", "u1"), ("of", "<i4", 3)])
    face["count"], face["of"] = 3, triangles
    head = [
        "ply", "format binary_little_endian 1.0", f"element vertex {len(placed.tin.points)}", "property double x",
        "property double y", "property double z", f"element face {len(face)}",
        "property list uchar int vertex_indices", "end_header\n",
    ]
    return "\n".join(head).encode() + placed.vertices.astype("<f8").tobytes() + face.tobytes()


def _meshio() -> Any:
    return optional("meshio", extra="vtu", purpose="writing .vtu")


def _vtu(placed: PlacedTin) -> bytes:
    mesh = _meshio().Mesh(
        placed.vertices, [("triangle", placed.triangles)], point_data={"value": placed.tin.values.copy()}
    )
    # the library writes to a path only
    with TemporaryDirectory() as folder:
        path = Path(folder) / "tin.vtu"
        mesh.write(path, file_format="vtu")
        return path.read_bytes()


def _geojson(placed: PlacedTin) -> bytes:
    """A polygon with heights for each triangle."""
    features = [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
        }
        for corners in placed.vertices[placed.triangles].tolist()
    ]
    whole = {"type": "FeatureCollection", **named(placed.placement), "features": features}
    return json.dumps(whole, separators=(",", ":"), allow_nan=False).encode() + b"\n"


_FORMATS: dict[str, Format] = {
    ".npz": Format((2,), _npz),
    ".ply": Format((2,), _ply),
    ".vtu": Format((2,), _vtu, _meshio),
    ".geojson": Format((2,), _geojson),
}
"""Formats of surfaces, by suffix."""
