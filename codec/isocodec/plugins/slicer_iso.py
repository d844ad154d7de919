"""Module for 3D Slicer 5: opens ``.iso`` files of surfaces and labels as models, in right-anterior-superior.

Add the folder of this file to the modules in Edit, Application Settings; then ``.iso`` files open as any other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import isocodec

try:
    from slicer.ScriptedLoadableModule import ScriptedLoadableModule
except ImportError:  # outside of Slicer, where only `surfaces` can be used
    ScriptedLoadableModule = object

TO_RIGHT_FRONT = {"left-posterior-superior": np.array([-1.0, -1.0, 1.0])}
"""Factors that turn coordinates to the right, front and top of the body."""


def surfaces(path: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Decode the surfaces of a file: name, points (P, 3) in mm, triangles (M, 3); those of labels are closed.

    Raises
    ------
    isocodec.IsoError
        If the file is damaged or has no surfaces.
    """
    file = isocodec.open(path)
    labels, found = file.info.noun == "label", []
    for contour in file.contours():
        if contour.n == 2:
            raise ValueError("the file has curves, no surfaces")
        whole = (contour.capped() if labels else contour).joined
        turned = TO_RIGHT_FRONT.get(file.crs or "")
        points, cells = (whole.placed if turned is None else whole.placed * turned), whole.placed_cells
        # triangles are seen from outside where the frame, turned as it is, is right-handed
        mirrored = whole.placement is not None and whole.placement.mirrored()
        found.append((file.info.caption(contour.isovalue), points, cells[:, ::-1] if mirrored else cells))
    return found


class slicer_iso(ScriptedLoadableModule):
    def __init__(self, parent: Any) -> None:
        super().__init__(parent)
        parent.title, parent.categories, parent.hidden = "Isocontours", ["Informatics"], True
        parent.helpText = "Opens .iso files as models."


class slicer_isoFileReader:
    """Reader of Slicer."""

    def __init__(self, parent: Any) -> None:
        self.parent = parent

    def description(self) -> str:
        return "Isocontours"

    def fileType(self) -> str:
        return "IsocontourFile"

    def extensions(self) -> list[str]:
        return ["Isocontours (*.iso)"]

    def canLoadFile(self, path: str) -> bool:
        """Look at the first bytes: images of optical discs have the same suffix."""
        with open(path, "rb") as file:
            return file.read(4) in (b"\x89ISO", b"\x89IST")

    def load(self, properties: dict[str, Any]) -> bool:
        import slicer
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

        made = []
        try:
            found = surfaces(properties["fileName"])
        except (isocodec.IsoError, OSError, ValueError) as error:
            slicer.util.errorDisplay(str(error))
            return False
        for name, points, cells in found:
            places, faces, mesh = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
            places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
            faces.SetData(numpy_to_vtkIdTypeArray(np.arange(0, 3 * len(cells) + 1, 3, dtype=np.int64), deep=True),
                          numpy_to_vtkIdTypeArray(cells.astype(np.int64).ravel(), deep=True))
            mesh.SetPoints(places)
            mesh.SetPolys(faces)
            node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLModelNode", name)
            node.SetAndObservePolyData(mesh)
            node.CreateDefaultDisplayNodes()
            made.append(node.GetID())
        self.parent.loadedNodes = made
        return True
