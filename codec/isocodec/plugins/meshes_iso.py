"""For PyVista 0.48, meshio and trimesh: once this module is imported, ``pyvista.read``, ``meshio.read`` and
``trimesh.load`` read ``.iso`` files.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

import isocodec


def of_meshio(path: Any) -> Any:
    """Read all isovalues as one mesh, with ``isovalue`` at its cells."""
    import meshio

    contours = [contour.joined for contour in isocodec.open(path).contours()]
    first = np.cumsum([0, *(len(contour.points) for contour in contours)])
    cells = np.concatenate([contour.placed_cells + start for contour, start in zip(contours, first, strict=False)])
    counts = [len(contour.cells) for contour in contours]
    values = np.repeat([float(contour.isovalue) for contour in contours], counts)
    kind = "triangle" if contours[0].n == 3 else "line"
    return meshio.Mesh(np.concatenate([contour.placed for contour in contours]), {kind: cells},
                       cell_data={"isovalue": [values]})


def of_pyvista(path: Any, /, **_: Any) -> Any:
    """Read a ``pyvista.PolyData``, or of several isovalues a ``MultiBlock``, by isovalue."""
    import pyvista

    file = isocodec.open(path)
    contours = file.contours()
    if len(contours) == 1:
        return contours[0].to_pyvista()
    return pyvista.MultiBlock({file.info.caption(each.isovalue): each.to_pyvista() for each in contours})


def of_trimesh(file_obj: Any, file_type: str = "iso", **_: Any) -> dict[str, Any]:
    """Read the first isovalue of an open file."""
    contour = isocodec.decode(file_obj.read()).joined
    return {"vertices": contour.placed, "faces": contour.placed_cells, "process": False}


with suppress(ImportError):
    import meshio

    meshio.register_format("iso", [".iso"], of_meshio, {})
with suppress(ImportError):
    from pyvista import register_reader

    register_reader(".iso", of_pyvista)
with suppress(ImportError):
    from trimesh.exchange.load import mesh_loaders

    mesh_loaders["iso"] = of_trimesh
