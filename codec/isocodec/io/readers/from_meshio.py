"""Meshio reads meshes: VTU, MSH, PLY, XDMF."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

import numpy as np

from ...errors import InputError, plain
from ...extras import optional
from .mesh_formats import MeshFormat, MeshRead
from .reading import reading
from .source import InputFile

_SERIES = ".xdmf"
"""Suffix of files that may hold time steps; all of them are read."""
_CELLS = {"triangle": 3, "tetra": 4}
_LOWER = ("vertex", "line")
"""Cells of lower dimension that files hold beside, often as boundaries; they are left out."""


def _series(meshio: Any, source: InputFile) -> Any:
    """A series of an XDMF file as a mesh whose values have an axis of frames; None if the file holds none."""
    try:
        with meshio.xdmf.TimeSeriesReader(source.path) as series:
            points, cells = series.read_points_cells()
            steps = [series.read_data(number)[1] for number in range(series.num_steps)]
    except meshio.ReadError:
        return None
    mesh = meshio.Mesh(points, cells)
    names = set(steps[0]).intersection(*steps)
    # set behind the library's back, which knows values of one frame only
    mesh.point_data.update({name: np.stack([step[name] for step in steps]) for name in sorted(names)})
    return mesh


def _by_meshio(source: InputFile) -> MeshRead:
    meshio = optional("meshio", extra="vtu", purpose=f"reading {source.path.suffix}")
    with reading("mesh"):
        try:
            # the library prints its complaint on the console, and then ends the process
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                found = (source.named(_SERIES) and _series(meshio, source)) or meshio.read(source.path)
        except SystemExit:
            raise InputError("cannot be read as a mesh", code="unreadable") from None
        kinds = {block.type for block in found.cells}
        wanted = "tetra" if "tetra" in kinds else "triangle"
        left = sorted(kinds - {wanted, *_LOWER} - ({"triangle"} if wanted == "tetra" else set()))
        if left or wanted not in kinds:
            raise InputError(
                f"holds cells of other kinds: {', '.join(map(plain, left)) or 'no triangles'}", code="mesh",
                remedy="cut them into triangles or tetrahedra first",
            )
        cells = np.concatenate([block.data for block in found.cells if block.type == wanted]).astype(np.int64)
        points = np.asarray(found.points, np.float64)
        values = {str(name): np.asarray(each) for name, each in found.point_data.items()}
        of_cells = [str(name) for name in found.cell_data]
    return MeshRead(points, cells.reshape(-1, _CELLS[wanted]), values, of_cells)


MESHES = (MeshFormat("mesh", (".vtu", ".msh", ".ply", _SERIES), _by_meshio, extra="vtu", confined="meshio"),)
