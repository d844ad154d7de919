"""How far curves or surfaces lie apart, both ways, by libraries that know nothing of the format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

Floats = NDArray[np.float64]
Triangles = tuple[Floats, NDArray[np.int64]]
"""Points (P, 3) and triangles (M, 3) of a surface."""
STEP = 0.02
"""Between the points that stand for a curve, in its own units."""
SIDE = 1.0
"""Longest side of the triangles whose corners are held against another surface."""


def along(lines: Sequence[Floats]) -> Floats:
    """Points (K, 2) along lines, close to one another."""
    coordinates: Floats = shapely.get_coordinates(
        shapely.segmentize([shapely.LineString(line) for line in lines if len(line) > 1], STEP)
    )
    return coordinates


def distances(points: Floats, lines: Sequence[Floats]) -> Floats:
    """Distance of points (K, 2) from a curve of several lines."""
    return np.asarray(KDTree(along(lines)).query(points)[0])


def curves_apart(one: Sequence[Floats], other: Sequence[Floats]) -> float:
    """The largest distance of two curves; infinite if only one of them is empty."""
    if not len(one) or not len(other):
        return 0.0 if len(one) == len(other) else np.inf
    return float(max(distances(along(one), other).max(), distances(along(other), one).max()))


def surfaces_apart(one: Triangles, other: Triangles) -> tuple[float, float]:
    """The largest distances of a surface from another and of that from it, by VTK: from corners to triangles.

    Triangles with sides longer than ``SIDE`` are divided first.
    """
    from vtkmodules.vtkFiltersModeling import vtkHausdorffDistancePointSetFilter

    measure = vtkHausdorffDistancePointSetFilter()
    measure.SetTargetDistanceMethodToPointToCell()
    for port, surface in enumerate((one, other)):
        measure.SetInputData(port, _divided(surface))
    measure.Update()
    there, back = measure.GetRelativeDistance()
    return float(there), float(back)


def _divided(surface: Triangles) -> Any:
    """A surface as VTK takes it, of small triangles."""
    from trimesh.remesh import subdivide_to_size
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells = subdivide_to_size(*surface, max_edge=SIDE, max_iter=20)
    places, table, out = vtkPoints(), vtkCellArray(), vtkPolyData()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float64), deep=True))
    offsets = np.arange(0, cells.size + 1, 3, dtype=np.int64)
    table.SetData(
        numpy_to_vtkIdTypeArray(offsets, deep=True),
        numpy_to_vtkIdTypeArray(np.ascontiguousarray(cells, np.int64).ravel(), deep=True),
    )
    out.SetPoints(places)
    out.SetPolys(table)
    return out
