"""Surfaces in the formats of trimesh: PLY, STL, OBJ, OFF, GLB, 3MF; meshes and triangulated surfaces as PLY.

PLY, STL, OBJ and GLB state where x, y, z run in a body. Triangles of surfaces are seen counter-clockwise from the side
of lower values, whatever the placement does.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.separation import single
from ...errors import OptionError
from ...extras import optional
from .output_formats import Cost, Output, OutputOptions
from .things import ABOVE, LEVEL, PlacedTin, in_space, space_of

if TYPE_CHECKING:
    from ...drawing.contour import Contour
    from ...drawing.tessellation import Tessellation

_PLY, _OBJ = ".ply", ".obj"
_UUID = re.compile(rb'"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}"')
_STL_HEADER = 80
_THE_DAY = (1980, 1, 1, 0, 0, 0)


def trimesh_for(suffix: str) -> Any:
    """The library.

    Raises
    ------
    MissingExtraError
    """
    return optional("trimesh", extra="mesh", purpose=f"writing {suffix}")


def mesh_of(contour: Contour, suffix: str = "a mesh") -> Any:
    """Make a ``Trimesh`` with unchanged vertices, in unchanged order."""
    whole = contour.joined
    return trimesh_for(suffix).Trimesh(vertices=whole.placed, faces=whole.placed_cells, process=False)


def _single(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    """Write PLY, STL (both binary) or OFF; by convention, the first two hold single precision."""
    contour = next(iter(contours))
    if suffix == ".off" and len(contour.cells) == 0:
        return b"OFF\n0 0 0\n"
    places = {"digits": _digits(contour)} if suffix == ".off" else {}
    mesh = mesh_of(contour, suffix)
    if suffix != ".off":
        mesh.vertices = single(mesh.vertices)
    data = _bytes(mesh.export(file_type=suffix[1:], **places))
    text = space_of(contour.placement)
    if suffix == ".stl":
        return text.encode().ljust(_STL_HEADER, b"\0") + data[_STL_HEADER:]
    return _with_comment(data, text) if suffix == _PLY else data


def _groups(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    """Write OBJ, GLB or 3MF, with an object for each isovalue, named after it.

    OBJ has eight decimals of a cell, 3MF all digits. GLB holds single precision relative to the middle of each object,
    which the object's node adds again, so that at most half of 2**-24 of its size is lost.
    """
    trimesh = trimesh_for(suffix)
    scene = trimesh.Scene()
    digits, text = 8, ""
    for contour in contours:
        if len(contour.cells):
            mesh = mesh_of(contour, suffix)
            digits = max(digits, _digits(contour))
            matrix = np.eye(4)
            if suffix == ".glb":
                middle = mesh.bounds.mean(axis=0)
                matrix[:3, 3] = middle
                mesh.vertices = single(mesh.vertices - middle)  # a copy: the contour has them, too
            name = f"isovalue {contour.isovalue:.12g}"
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=matrix)
            text = space_of(contour.placement)
        del contour
    if not scene.geometry:
        # the library would write keywords without numbers, or none at all, which no reader accepts
        if suffix == _OBJ:
            return b"# empty isosurface\n"
        raise OptionError(f"the surface is empty, and {suffix} cannot hold that", code="empty")
    if suffix == _OBJ:
        return _bytes(scene.export(file_type="obj", digits=digits, header=text or None))
    if text and suffix == ".glb":
        scene.metadata.update([text.split("=")])
    data = _bytes(scene.export(file_type=suffix[1:]))
    return _repacked(data) if suffix == ".3mf" else data


def _with_comment(data: bytes, text: str) -> bytes:
    """A PLY file with another comment than that of the library, before its elements."""
    head, elements, rest = data.partition(b"element ")
    lines = [line for line in head.splitlines() if not line.startswith(b"comment ")]
    return b"\n".join([*lines, *([b"comment " + text.encode()] if text else []), b""]) + elements + rest
def _in_three(contour: Contour) -> NDArray[np.float64]:
    """Points of a curve with three coordinates."""
    return np.pad(contour.placed, ((0, 0), (0, 3 - contour.points.shape[1])))


def _segments_ply(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """A curve, in the plane or in space, as PLY in double precision with an edge for each segment."""
    whole = next(iter(contours)).joined
    head = [
        "ply", "format binary_little_endian 1.0", f"element vertex {len(whole.points)}", "property double x",
        "property double y", "property double z", f"element edge {len(whole.cells)}", "property int vertex1",
        "property int vertex2", "end_header\n",
    ]
    return "\n".join(head).encode() + _in_three(whole).astype("<f8").tobytes() + whole.cells.astype("<i4").tobytes()


def _lines_obj(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """Curves, in the plane or in space, as lines of an object for each isovalue."""
    lines: list[str] = []
    start = 1
    for contour in contours:
        whole = contour.joined
        digits = _digits(whole)
        lines.append(f"o isovalue {contour.isovalue:.12g}")
        lines += ["v " + " ".join(f"{number:.{digits}f}" for number in point) for point in _in_three(whole).tolist()]
        lines += ["l " + " ".join(str(start + number) for number in walk) for walk in whole.walks]
        start += len(whole.points)
    return ("\n".join(lines) + "\n").encode()


def _digits(contour: Contour) -> int:
    """Number of decimals that resolve a hundred-millionth of a cell."""
    steps = [1.0] if contour.frame is None else np.linalg.norm(contour.frame, axis=0)
    return 8 + max(0, math.ceil(-math.log10(min(steps))))


def _bytes(data: Any) -> bytes:
    return data.encode() if isinstance(data, str) else bytes(data)


def _repacked(data: bytes) -> bytes:
    """Write an archive without timestamps and with fixed object identifiers, so that equal input gives equal bytes."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as given, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as made:
        for name in given.namelist():
            parts = _UUID.split(given.read(name))
            numbered = [part + b'"00000000-0000-4000-8000-%012x"' % i for i, part in enumerate(parts[:-1])]
            text = b"".join([*numbered, parts[-1]])
            info = zipfile.ZipInfo(name, _THE_DAY)
            info.compress_type = zipfile.ZIP_DEFLATED
            made.writestr(info, text)
    return out.getvalue()


def _mesh_ply(mesh: Tessellation, _: str, __: OutputOptions) -> bytes:
    """Triangles of a mesh: in 2-D its cells, in 3-D the faces of the tetrahedra, each once.

    A face has the level of the finer of the two tetrahedra that share it.
    """
    points, cells = in_space(mesh)
    levels = mesh.levels
    if cells.shape[1] == 4:
        sides = np.concatenate([cells[:, [1, 2, 3]], cells[:, [0, 3, 2]], cells[:, [0, 1, 3]], cells[:, [0, 2, 1]]])
        finest = np.argsort(-np.tile(levels, 4), kind="stable")
        first = np.unique(np.sort(sides[finest], axis=1), axis=0, return_index=True)[1]
        kept = np.sort(finest[first])
        cells, levels = sides[kept], np.tile(levels, 4)[kept]
    made = _binary_ply(points, cells, {ABOVE: mesh.above}, {LEVEL: levels})
    return _with_comment(made, space_of(mesh.placement))


def _tin_ply(placed: PlacedTin, _: str, __: OutputOptions) -> bytes:
    return _binary_ply(placed.vertices, placed.triangles, {}, {})


def _binary_ply(
    points: NDArray[np.float64], triangles: NDArray[np.int64], at_points: dict[str, NDArray[Any]],
    of_faces: dict[str, NDArray[Any]],
) -> bytes:
    """Write binary PLY in double precision, with one-byte values at points and faces."""
    vertex = np.empty(len(points), [("at", "<f8", 3), *((name, "u1") for name in at_points)])
    face = np.empty(len(triangles), [("count", "u1"), ("of", "<i4", 3), *((name, "u1") for name in of_faces)])
    vertex["at"], face["count"], face["of"] = points, 3, triangles
    for array, values in ((vertex, at_points), (face, of_faces)):
        for name, some in values.items():
            array[name] = some
    head = [
        "ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", "property double x",
        "property double y", "property double z", *(f"property uchar {name}" for name in at_points),
        f"element face {len(face)}", "property list uchar int vertex_indices",
        *(f"property uchar {name}" for name in of_faces), "end_header\n",
    ]
    return "\n".join(head).encode() + vertex.tobytes() + face.tobytes()




def _one(suffix: str, cost: Cost, single: bool = True) -> Output:
    return Output("contour", (suffix,), suffix[1:].upper(), _single, (3,), single=single, sampled=False, extra="mesh",
                  libraries=("trimesh",), cost={3: cost})


def _many(suffix: str, cost: Cost, *libraries: str) -> Output:
    return Output("contour", (suffix,), suffix[1:].upper(), _groups, (3,), (3,), "a named object each", sampled=False,
                  extra="mesh", libraries=(*libraries, "trimesh"), cost={3: cost})


OUTPUTS = (
    _one(_PLY, Cost(70, 52)),
    Output("contour", (_PLY,), "PLY", _segments_ply, sampled=False, cost={2: Cost(100, 60)}),
    _one(".stl", Cost(120, 280)),
    _one(".off", Cost(170, 220), single=False),
    _many(_OBJ, Cost(140, 200)),
    Output("contour", (_OBJ,), "OBJ", _lines_obj, (2,), (2,), "an object each", sampled=False,
           cost={2: Cost(1000, 400)}),
    _many(".glb", Cost(90, 90)),
    _many(".3mf", Cost(600, 900), "networkx", "lxml"),
    Output("mesh", (_PLY,), "PLY", _mesh_ply, (2, 3), cost={2: Cost(80, 80), 3: Cost(80, 700)}),
    Output("tin", (_PLY,), "PLY", _tin_ply, sampled=False),
)
