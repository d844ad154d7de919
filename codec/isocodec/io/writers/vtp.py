"""VTP, the polygons of VTK: lines of curves or triangles of surfaces, each with its isovalue, in double precision."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ...drawing.contour import Contour

_TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64"}


def render_vtp(contours: Iterable[Contour]) -> bytes:
    """All isovalues in one file: cells have the value ``isovalue``, points of surfaces ``Normals``."""
    points: list[NDArray[np.float64]] = []
    normals: list[NDArray[np.float64]] = []
    cells: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    values: list[NDArray[np.float64]] = []
    start, plane = 0, True
    for contour in contours:
        plane = contour.n == 2
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
        '<CellData Scalars="isovalue">', _array("isovalue", np.concatenate(values), body), "</CellData>",
        "<Points>", _array("Points", np.concatenate(points), body), "</Points>",
        "<Lines>" if plane else "<Polys>", _array("connectivity", np.concatenate(cells), body),
        _array("offsets", ends.astype(np.int64), body), "</Lines>" if plane else "</Polys>",
    ]
    head = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<PolyData><Piece NumberOfPoints="{start}" NumberOfVerts="0" NumberOfLines="{lines}" NumberOfStrips="0" '
        f'NumberOfPolys="{polygons}">\n'
    )
    tail = '</Piece></PolyData>\n<AppendedData encoding="raw">\n_'
    text = head + "\n".join(parts) + tail
    return b"".join([text.encode(), *body, b"\n</AppendedData>\n</VTKFile>\n"])


def _array(name: str, array: NDArray[Any], body: list[bytes]) -> str:
    """The element of an array, whose bytes go to the end of the file, their number before them."""
    at = sum(map(len, body))
    kind = f"{array.dtype.kind}{array.dtype.itemsize}"
    data = np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()
    body.append(len(data).to_bytes(8, "little") + data)
    columns = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    return f'<DataArray type="{_TYPES[kind]}" Name="{name}"{columns} format="appended" offset="{at}"/>'
