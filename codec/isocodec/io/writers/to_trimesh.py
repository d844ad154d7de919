"""Surfaces in the formats of trimesh: PLY, STL, OBJ, OFF, GLB, 3MF; meshes and triangulated surfaces as PLY.

PLY, STL, OBJ and GLB state where x, y, z run in a body. Triangles of surfaces are seen counter-clockwise from the side
of lower values, whatever the placement does.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...drawing.separation import single
from ...errors import OptionError
from ...extras import optional
from ...field.labelling import caption
from .output_formats import Cost, Output, OutputOptions
from .things import ABOVE, LEVEL, PlacedTin, in_space, space_of

if TYPE_CHECKING:
    from ...drawing.contour import Contour
    from ...drawing.tessellation import Tessellation

_PLY, _OBJ = ".ply", ".obj"
_UUID = re.compile(rb'"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}"')
_STL_HEADER = 80
_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
_THE_DAY = (1980, 1, 1, 0, 0, 0)
EMPTY: Mapping[str, NDArray[Any]] = MappingProxyType({})


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

    OBJ has eight decimals of a cell, 3MF all digits. GLB has x, z, -y, since its y is up; it holds single precision
    relative to the middle of each object, which the object's node adds again, so that at most half of 2**-24 of its
    size is lost.
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
                matrix[:3, 3] = _Y_UP @ middle
                mesh.vertices = single((mesh.vertices - middle) @ _Y_UP.T)  # a copy: the contour has them, too
            name = caption(contour.isovalue, contour.metadata)
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
    if suffix == ".glb":
        scene.metadata.update([("up", "y"), *([text.split("=")] if text else [])])
    data = _bytes(scene.export(file_type=suffix[1:]))
    return _repacked(data) if suffix == ".3mf" else data


def _with_comment(data: bytes, text: str) -> bytes:
    """A PLY file with another comment than that of the library, before its elements."""
    head, elements, rest = data.partition(b"element ")
    lines = [line for line in head.splitlines() if not line.startswith(b"comment ")]
    return b"\n".join([*lines, *([b"comment " + text.encode()] if text else []), b""]) + elements + rest


def _in_three(contour: Contour) -> NDArray[np.float64]:
    """Points of a curve with three coordinates."""
    return np.pad(contour.placed, ((0, 0), (0, 3 - contour.placed.shape[1])))


def _segments_ply(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """A curve, in the plane or in space, as PLY in double precision with an edge for each segment."""
    whole = next(iter(contours)).joined
    return _binary_ply(_in_three(whole), whole.cells, text=space_of(whole.placement))


def _lines_obj(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """Curves, in the plane or in space, as lines of an object for each isovalue."""
    lines: list[str] = []
    start = 1
    for contour in contours:
        whole = contour.joined
        digits = _digits(whole)
        lines += [f"# {text}" for text in [space_of(whole.placement)] if text and not lines]
        lines.append(f"o {caption(contour.isovalue, contour.metadata)}")
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
    from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

    out = io.BytesIO()
    with ZipFile(io.BytesIO(data)) as given, ZipFile(out, "w", ZIP_DEFLATED) as made:
        for name in given.namelist():
            parts = _UUID.split(given.read(name))
            numbered = [part + b'"00000000-0000-4000-8000-%012x"' % i for i, part in enumerate(parts[:-1])]
            text = b"".join([*numbered, parts[-1]])
            info = ZipInfo(name, _THE_DAY)
            info.compress_type = ZIP_DEFLATED
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
    return _binary_ply(points, cells, {ABOVE: mesh.above}, {LEVEL: levels}, space_of(mesh.placement))


def _tin_ply(placed: PlacedTin, _: str, __: OutputOptions) -> bytes:
    return _binary_ply(placed.vertices, placed.triangles)


def _binary_ply(
    points: NDArray[np.float64], cells: NDArray[np.int64], at_points: Mapping[str, NDArray[Any]] = EMPTY,
    of_cells: Mapping[str, NDArray[Any]] = EMPTY, text: str = "",
) -> bytes:
    """Write binary PLY in double precision: edges or triangles, with one-byte values at points and cells."""
    edges = cells.shape[1] == 2
    vertex = np.empty(len(points), [("at", "<f8", 3), *((name, "u1") for name in at_points)])
    cell = np.empty(len(cells), [*([] if edges else [("count", "u1")]), ("of", "<i4", cells.shape[1]),
                                 *((name, "u1") for name in of_cells)])
    vertex["at"], cell["of"] = points, cells
    for array, values in ((vertex, at_points), (cell, of_cells if edges else {"count": 3, **of_cells})):
        for name, some in values.items():
            array[name] = some
    corners = ["int vertex1", "int vertex2"] if edges else ["list uchar int vertex_indices"]
    head = [
        "ply", "format binary_little_endian 1.0", *([f"comment {text}"] if text else []),
        f"element vertex {len(points)}", *(f"property double {name}" for name in "xyz"),
        *(f"property uchar {name}" for name in at_points), f"element {'edge' if edges else 'face'} {len(cells)}",
        *(f"property {corner}" for corner in corners), *(f"property uchar {name}" for name in of_cells), "end_header\n",
    ]
    return "\n".join(head).encode() + vertex.tobytes() + cell.tobytes()


def _surfaces(suffix: str, cost: Cost, *libraries: str, **given: Any) -> Output:
    more: Any = {"names_space": True, "render": _groups, "several": (3,), "holds": "a named object each"} | given
    return Output("contour", (suffix,), suffix[1:].upper(), dimensions=(3,), sampled=False, extra="mesh",
                  libraries=(*libraries, "trimesh"), cost={3: cost}, **more)


_ONE: Any = {"render": _single, "several": (), "holds": ""}
OUTPUTS = (
    _surfaces(_PLY, Cost(70, 52), single=True, **_ONE),
    Output("contour", (_PLY,), "PLY", _segments_ply, sampled=False, names_space=True, cost={2: Cost(100, 60)}),
    _surfaces(".stl", Cost(120, 280), single=True, **_ONE),
    _surfaces(".off", Cost(170, 220), names_space=False, **_ONE),
    _surfaces(_OBJ, Cost(140, 200)),
    Output("contour", (_OBJ,), "OBJ", _lines_obj, (2,), (2,), "an object each", sampled=False,
           names_space=True, cost={2: Cost(1000, 400)}),
    _surfaces(".glb", Cost(90, 90)),
    _surfaces(".3mf", Cost(600, 900), "networkx", "lxml", names_space=False),
    Output("mesh", (_PLY,), "PLY", _mesh_ply, (2, 3), names_space=True, cost={2: Cost(80, 80), 3: Cost(80, 700)}),
    Output("tin", (_PLY,), "PLY", _tin_ply, sampled=False),
)
