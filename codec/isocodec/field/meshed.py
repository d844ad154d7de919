"""Values on a mesh, or at scattered points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .placement import COORDINATE_UNIT, CRS
from .times import Time

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
        over the plane and are triangulated (Delaunay); points that coincide are merged into one with the mean of their
        values.
    values : (V,) or (F, V) array_like of bool, integers or floats, or None
        With two axes, the values of F frames, which make a series. None for a bare mesh, which is what one gives to
        decode a file that does not store its mesh.
    stored : str or None
        What the file stores of the mesh. ``known``: decoders have points and cells in the same order; the file stores
        their hash. ``coded``: it stores the cells that contours cross. ``whole``: it stores all cells, or all scattered
        points. ``delaunay``, for scattered points: it stores those that contours need, the vertices of the triangles
        that a contour of any frame crosses; their triangulation has the same contours. The default is ``known`` with
        cells and ``delaunay`` without; and ``whole`` for points whose frames are added to an `Encoder` one by one.
    error : float or None
        For a mesh that the file stores, the largest distance between stored and given vertices, reduced where cells
        would fold. The default is 0.05 of the median edge length, or 1/8 of a distance that is asked for, if that is
        less. Scattered points keep the triangles that contours cross, or all of them if all points are stored: where
        rounding changes some, points are moved, within the error, or within twice the default one; if that is not
        enough, they are rounded more finely, or the file stores the triangles, too. They are not moved at all if all
        are multiples of a power of two of about that size. Contour points lie where the edges of the stored mesh meet
        the contour of the original mesh, where that is as near to the place on the original edge as the error.
    progressive : bool or None
        Code signs level by level, from a coarse mesh to the whole one, so that the first bytes show the whole curve;
        or, if False, along the curve. The default is level by level if encoder and decoder have the mesh, except for
        isovalues of less than 1 kB that this makes more than 2 % longer; with a distance, only if it takes that.
    times : sequence of numbers, texts or dates, or None
        The time of each frame, as for `Encoder.add`.
    crs : str or None
        Reference system of the coordinates.
    unit : str or None
        Unit of the coordinates, ``mm``; or one for each. A reference system that states its units comes before it.
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
    times: Sequence[Time] | None = None
    crs: str | None = None
    unit: str | None = None
    notes: Mapping[str, str] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    @property
    def metadata(self) -> dict[str, str]:
        """The notes that a file of this mesh gets."""
        own = {CRS: self.crs, COORDINATE_UNIT: self.unit}
        return {**self.notes, **{key: text for key, text in own.items() if text}}


def valued(points: ArrayLike, values: ArrayLike) -> NDArray[np.bool_] | None:
    """Find the scattered points with values in all frames, (V,) bool; None if all have."""
    found: NDArray[Any] = np.asarray(values)
    if found.dtype.kind != "f" or found.shape[-1:] != (len(np.asarray(points)),):
        return None
    there = ~np.isnan(found).reshape(-1, found.shape[-1]).any(axis=0)
    return None if there.all() else there
