"""Values on a mesh, or at scattered points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .placement import CRS

StoredName: TypeAlias = Literal["known", "coded", "whole", "delaunay"]
"""Ways to store a mesh in a file."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points, cells between them and values at the points.

    Attributes
    ----------
    points : (V, 2) or (V, 3) array_like of numbers
        Coordinates x, y (, z).
    cells : (T, 3) or (T, 4) array_like of int, or None
        Vertices of triangles, in the plane or of a surface in space, or of tetrahedra. None: the points are scattered
        over the plane, and are joined to their Delaunay triangulation; those that coincide become one, with the mean of
        their values.
    values : (V,) or (F, V) array_like of bool, integers or floats, or None
        With two axes, those of F frames: a series. None of a mesh alone, as files that do not hold theirs need it.
    stored : str or None
        What the file stores of the mesh. ``known``: decoders have points and cells in the same order; the file stores
        their hash. ``coded``: the cells that contours cross, ``whole``: all cells. ``delaunay``, without cells: the
        points. By default ``known`` with cells, ``delaunay`` without.
    error : float or None
        For a mesh in the file, the largest distance between vertices and their points; less where cells would fold. By
        default 0.05 of the median edge. Points of contours lie on the edges of that mesh, where these meet the contour
        of the given one, so that they may be much nearer to it.
    progressive : bool or None
        Code signs level by level, from a coarse mesh to the whole one, so that the first bytes show all of the curve:
        for triangles in the plane, the default if both sides have the mesh. Else they come along the curve.
    crs : str or None
        Reference system of the coordinates.
    notes : mapping of str to str
        Words and single numbers from the source.
    remarks : sequence of str
        What of the source is left out or changed.
    """

    points: ArrayLike
    cells: ArrayLike | None
    values: ArrayLike | None = None
    _: KW_ONLY
    stored: StoredName | None = None
    error: float | None = None
    progressive: bool | None = None
    crs: str | None = None
    notes: Mapping[str, str] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    @property
    def metadata(self) -> dict[str, str]:
        """The notes that a file of this mesh gets."""
        return {**self.notes, **({CRS: self.crs} if self.crs else {})}


def valued(points: ArrayLike, values: ArrayLike) -> NDArray[np.bool_] | None:
    """Find which scattered points have values in all frames, (V,) bool; None if all of them have."""
    found: NDArray[Any] = np.asarray(values)
    if found.dtype.kind != "f" or found.shape[-1:] != (len(np.asarray(points)),):
        return None
    there = ~np.isnan(found).reshape(-1, found.shape[-1]).any(axis=0)
    return None if there.all() else there
