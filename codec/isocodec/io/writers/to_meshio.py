"""Files of VTK: lines of curves and triangles of surfaces as VTP, and as VTU by meshio, with meshes and surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...extras import optional
from ...field.labelling import noun_of
from .output_formats import Cost, Output, OutputOptions
from .things import ABOVE, LEVEL, PlacedTin, in_space, library_files, space_of

if TYPE_CHECKING:
    from ...drawing.contour import Contour
    from ...drawing.tessellation import Tessellation

_CELLS = {2: "line", 3: "triangle", 4: "tetra"}
_TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64"}


def _vtp(contours: Iterable[Contour], _: str, __: OutputOptions) -> bytes:
    """All isovalues in one file, in double precision; cells have the value ``isovalue`` or ``label``, points normals.

    A field ``SPACE`` states where x, y, z run in a body.
    """
    points: list[NDArray[np.float64]] = []
    normals: list[NDArray[np.float64]] = []
    cells: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    values: list[NDArray[np.float64]] = []
    start, plane, text, noun = 0, True, "", ""
    for contour in contours:
        plane, text, noun = contour.n == 2, space_of(contour.placement), noun_of(contour.metadata)
        contour = contour.joined
        placed = contour.placed
        points.append(np.pad(placed, ((0, 0), (0, 3 - placed.shape[1]))))
        if plane:
            walks = contour.walks
            cells.append(start + np.array([point for walk in walks for point in walk], np.int64))
            sizes.append(np.array([len(walk) for walk in walks], np.int64))
        else:
            normals.append(contour.normals)
            cells.append(start + contour.placed_cells.ravel())
            sizes.append(np.full(len(contour.cells), 3, np.int64))
        values.append(np.full(len(sizes[-1]), float(contour.isovalue)))
        start += len(placed)
        del contour, placed
    body: list[bytes] = []
    ends = np.cumsum(np.concatenate(sizes))
    count = len(ends)
    lines, polygons = (count, 0) if plane else (0, count)
    parts = [
        "<PointData" + ("" if plane else ' Normals="Normals"') + ">",
        "" if plane else _array("Normals", np.concatenate(normals).astype(np.float32), body), "</PointData>",
        f'<CellData Scalars="{noun}">', _array(noun, np.concatenate(values), body), "</CellData>",
        "<Points>", _array("Points", np.concatenate(points), body), "</Points>",
        "<Lines>" if plane else "<Polys>", _array("connectivity", np.concatenate(cells), body),
        _array("offsets", ends.astype(np.int64), body), "</Lines>" if plane else "</Polys>",
    ]
    head = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<PolyData>{_field(text)}<Piece NumberOfPoints="{start}" NumberOfVerts="0" NumberOfLines="{lines}" '
        f'NumberOfStrips="0" NumberOfPolys="{polygons}">\n'
    )
    tail = '</Piece></PolyData>\n<AppendedData encoding="raw">\n_'
    text = head + "\n".join(parts) + tail
    return b"".join([text.encode(), *body, b"\n</AppendedData>\n</VTKFile>\n"])


def _field(text: str) -> str:
    """A text ``NAME=value`` as an element of VTK, its characters as numbers."""
    name, _, value = text.partition("=")
    codes = " ".join(str(code) for code in [*value.encode(), 0])
    return "" if not text else (
        f'<FieldData><Array type="String" Name="{name}" NumberOfTuples="1" format="ascii">{codes}</Array></FieldData>'
    )


def _array(name: str, array: NDArray[Any], body: list[bytes]) -> str:
    """Write the element of an array, whose bytes, preceded by their number, go to the end of the file."""
    at = sum(map(len, body))
    kind = f"{array.dtype.kind}{array.dtype.itemsize}"
    data = np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()
    body.append(len(data).to_bytes(8, "little") + data)
    columns = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    return f'<DataArray type="{_TYPES[kind]}" Name="{name}"{columns} format="appended" offset="{at}"/>'


def _mesh_vtu(mesh: Tessellation, suffix: str, _: OutputOptions) -> bytes:
    points, cells = in_space(mesh)
    values = {"point_data": {ABOVE: mesh.above.astype(np.uint8)}, "cell_data": {LEVEL: [mesh.levels.astype(np.uint8)]}}
    return _vtu(points, cells, suffix, values)


def _contour_vtu(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    """All isovalues in one file: segments or triangles with the value ``isovalue`` or ``label``."""
    points: list[NDArray[np.float64]] = []
    cells: list[NDArray[np.int64]] = []
    values: list[NDArray[np.float64]] = []
    start, noun = 0, ""
    for contour in contours:
        noun, whole = noun_of(contour.metadata), contour.joined
        points.append(np.pad(whole.placed, ((0, 0), (0, 3 - whole.placed.shape[1]))))
        cells.append(start + whole.placed_cells)
        values.append(np.full(len(cells[-1]), float(contour.isovalue)))
        start += len(points[-1])
    return _vtu(np.concatenate(points), np.concatenate(cells), suffix,
                {"cell_data": {noun: [np.concatenate(values)]}})


def _tin_vtu(placed: PlacedTin, suffix: str, _: OutputOptions) -> bytes:
    return _vtu(placed.vertices, placed.triangles, suffix, {"point_data": {"value": placed.tin.values.copy()}})


def _vtu(points: NDArray[np.float64], cells: NDArray[np.int64], suffix: str, values: dict[str, Any]) -> bytes:
    meshio = optional("meshio", extra="vtu", purpose=f"writing {suffix}")
    mesh = meshio.Mesh(points, [(_CELLS[cells.shape[1]], cells)], **values)
    # the library writes to a path only
    with library_files(suffix) as folder:
        path = folder / f"mesh{suffix}"
        mesh.write(path, file_format="vtu")
        return path.read_bytes()


_MESHIO: Any = {"suffixes": (".vtu",), "title": "VTU", "extra": "vtu", "libraries": ("meshio",)}
OUTPUTS = (
    Output("contour", (".vtp",), "VTP", _vtp, (2, 3), (2, 3), "a value of cells",
           sampled=False, names_space=True, cost={2: Cost(120, 100), 3: Cost(200, 160)}),
    Output("contour", render=_contour_vtu, dimensions=(2, 3), several=(2, 3), holds="a value of cells", sampled=False,
           **_MESHIO, cost={2: Cost(300, 200, 1 << 24), 3: Cost(300, 200, 1 << 24)}),
    Output("mesh", render=_mesh_vtu, dimensions=(2, 3), **_MESHIO,
           cost={2: Cost(300, 200, 1 << 24), 3: Cost(300, 200, 1 << 24)}),
    Output("tin", render=_tin_vtu, sampled=False, **_MESHIO),
)
