"""Meshio reads meshes that VTK does not read with their values: Gmsh, PLY, and surfaces without values (OBJ, STL, OFF).

PyVista makes an object of VTK of them.
"""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout

from ...errors import InputError
from ...extras import optional
from .from_vtk import mesh_of
from .mesh_formats import MeshFormat, MeshRead
from .opened import Choice
from .reading import reading
from .source import InputFile

_GMSH = ".msh"
_FORMS = {_GMSH: "gmsh", ".ply": "ply", ".obj": "obj", ".stl": "stl", ".off": "off"}


def _by_meshio(source: InputFile, choice: Choice) -> MeshRead:
    meshio = optional("meshio", extra="vtk", purpose=f"reading {source.path.suffix}")
    pyvista = optional("pyvista", extra="vtk", purpose=f"reading {source.path.suffix}")
    form = _FORMS[source.path.suffix.lower()]
    if source.named(_GMSH):
        text = source.path.read_bytes().strip()
        if text.startswith(b"("):
            form = "ansys"
        # the reader of ANSYS looks for the end of a list for ever
        if not text.startswith((b"$", b"(")) or (form == "ansys" and not text.endswith(b")")):
            raise InputError("is not a mesh of Gmsh or ANSYS, or ends early", code="unreadable")
    with reading("mesh"):
        try:
            # the library prints its complaint on the console, and then ends the process
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                found = meshio.read(source.path, form)
        except SystemExit:
            raise InputError("cannot be read as a mesh", code="unreadable") from None
        grid = pyvista.from_meshio(found)
        return mesh_of({"": lambda: grid}, choice)


MESHES = (
    MeshFormat("mesh", tuple(_FORMS), _by_meshio, extra="vtk", options=("average",), confined="meshio"),
)
