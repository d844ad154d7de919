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
_BEGIN = b"$MeshFormat"
_FORMS = {_GMSH: "gmsh", ".ply": "ply", ".obj": "obj", ".stl": "stl", ".off": "off"}


def _by_meshio(source: InputFile, choice: Choice) -> MeshRead:
    meshio = optional("meshio", extra="vtk", purpose=f"reading {source.path.suffix}")
    pyvista = optional("pyvista", extra="vtk", purpose=f"reading {source.path.suffix}")
    suffix = source.path.suffix.lower()
    # the suffix is also that of files of ANSYS, whose reader may never end
    with source.path.open("rb") as file:
        if suffix == _GMSH and not file.read(1 << 16).lstrip().startswith((_BEGIN, b"$Comments")):
            raise InputError("is not a file of Gmsh", code="unreadable")
    with reading("mesh"):
        try:
            # the library prints its complaint on the console, and then ends the process
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                found = meshio.read(source.path, _FORMS[suffix])
        except SystemExit:
            raise InputError("cannot be read as a mesh", code="unreadable") from None
        grid = pyvista.from_meshio(found)
        return mesh_of({"": lambda: grid}, choice)


MESHES = (MeshFormat("mesh", tuple(_FORMS), _by_meshio, extra="vtk", options=("average",)),)
