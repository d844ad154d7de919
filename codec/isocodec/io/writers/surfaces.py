"""Surfaces in the formats of trimesh, and as VTP: PLY, STL, OBJ, OFF, GLB, 3MF.

Triangles are seen counter-clockwise from the side of lower values, whatever the placement does.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import OptionError
from ...extras import optional

if TYPE_CHECKING:
    from ...drawing.contour import Contour

_UUID = re.compile(rb'"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}"')
_THE_DAY = (1980, 1, 1, 0, 0, 0)


def trimesh_for(suffix: str) -> Any:
    """The library.

    Raises
    ------
    MissingExtraError
    """
    if suffix == ".3mf":
        for module in ("networkx", "lxml"):
            optional(module, extra="mesh", purpose="writing .3mf")
    return optional("trimesh", extra="mesh", purpose=f"writing {suffix}")


def mesh_of(contour: Contour, suffix: str = "a mesh") -> Any:
    """A ``Trimesh``, its vertices and their order as they are."""
    whole = contour.joined
    return trimesh_for(suffix).Trimesh(vertices=whole.placed, faces=whole.placed_cells, process=False)


def render_single(contour: Contour, suffix: str) -> bytes:
    """PLY, STL (both binary) and OFF; the first two hold single precision by custom."""
    if suffix == ".off" and len(contour.cells) == 0:
        return b"OFF\n0 0 0\n"
    places = {"digits": _digits(contour)} if suffix == ".off" else {}
    return _bytes(mesh_of(contour, suffix).export(file_type=suffix[1:], **places))


def render_groups(contours: Iterable[Contour], suffix: str) -> bytes:
    """OBJ, GLB and 3MF: an object for each isovalue, named after it.

    OBJ has eight decimal places of a cell, 3MF all digits. GLB holds single precision, counted from the middle of each
    object, which the node that the object belongs to adds again: half of 2**-24 of its size is lost at most.
    """
    trimesh = trimesh_for(suffix)
    scene = trimesh.Scene()
    digits = 8
    for contour in contours:
        if len(contour.cells):
            mesh = mesh_of(contour, suffix)
            digits = max(digits, _digits(contour))
            matrix = np.eye(4)
            if suffix == ".glb":
                middle = mesh.bounds.mean(axis=0)
                matrix[:3, 3] = middle
                mesh.vertices = mesh.vertices - middle  # in place it would move the contour, which has them, too
            name = f"isovalue {contour.isovalue:.12g}"
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=matrix)
        del contour
    if not scene.geometry:
        # the library would write keywords without numbers, or none at all, which no reader takes
        if suffix == ".obj":
            return b"# empty isosurface\n"
        raise OptionError(f"the surface is empty, and {suffix} cannot hold that", code="empty")
    if suffix == ".obj":
        return _bytes(scene.export(file_type="obj", digits=digits, header=None))
    data = _bytes(scene.export(file_type=suffix[1:]))
    return _repacked(data) if suffix == ".3mf" else data


def _digits(contour: Contour) -> int:
    """Decimal places that are a hundred millionth of a cell."""
    steps = [1.0] if contour.frame is None else np.linalg.norm(contour.frame, axis=0)
    return 8 + max(0, math.ceil(-math.log10(min(steps))))


def _bytes(data: Any) -> bytes:
    return data.encode() if isinstance(data, str) else bytes(data)


def _repacked(data: bytes) -> bytes:
    """An archive without the time at which it was made, and with numbers of objects that are always the same."""
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
