"""Triangulated irregular networks: points, values, and their Delaunay triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..format.surface import TinHead
from .coded_tin import SurfaceLayers
from .delaunay import delaunay, triangles
from .points import Points
from .rank import by_rank
from .rasterize import raster


@dataclass(frozen=True)
class Removals:
    """The points that thinning took out of a surface, the least significant first.

    Attributes
    ----------
    points : Points
        All points.
    kept : (K,) int64
        Numbers of the remaining points, rising: rows of what was given (samples of a field row by row).
    order : (R,) int64
        Numbers of the points that were taken out, in the order in which they went.
    anticipated : (R,) float64
        What each removal was expected to cost, in the measure of the criterion.
    errors : (R,) float64
        Largest distance of the surface from the values of all points, after each removal.
    """

    points: Points
    kept: NDArray[np.int64]
    order: NDArray[np.int64]
    anticipated: NDArray[np.float64]
    errors: NDArray[np.float64]

    def ranks(self) -> NDArray[np.int64]:
        """Order all points by significance, the most significant first."""
        number = np.full(int(self.points.source.max()) + 1, -1)
        number[self.points.source] = np.arange(len(self.points.source))
        return number[np.concatenate([self.kept, self.order[::-1]])]


@dataclass(frozen=True, eq=False)
class Tin:
    """A surface over the plane that is linear on each triangle.

    Attributes
    ----------
    points : (V, 2) float64
    values : (V,) float64
    triangles : (T, 3) int64
        Numbers of points, anticlockwise (from axis 0 to axis 1).
    shape : tuple of int or None
        Of the field that the points are samples of; None if they were scattered.
    complete : bool
        Whether all is there that the file holds.
    metadata : mapping of str to str
        Notes of the file.
    coded : (TinHead, SurfaceLayers), or None
        Positions, numbers of values and layers as a file holds them; None of a surface that was not made for one.
    removals : Removals or None
        What thinning by a criterion took out.
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    triangles: NDArray[np.int64]
    shape: tuple[int, int] | None = None
    complete: bool = True
    metadata: Mapping[str, str] = field(default_factory=dict)
    coded: tuple[TinHead, SurfaceLayers] | None = None
    removals: Removals | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        of = "" if self.shape is None else f", of {self.shape[0]} x {self.shape[1]} samples"
        return f"Tin({len(self.points):,} points, {len(self.triangles):,} triangles{of})"

    @property
    def kept(self) -> NDArray[np.int64]:
        """(V,) int64: after thinning by a criterion, numbers of the points that are left, rising; see `Removals`."""
        return self._removed.kept

    @property
    def order(self) -> NDArray[np.int64]:
        """(R,) int64: numbers of the points that were taken out, in the order in which they went."""
        return self._removed.order

    @property
    def anticipated(self) -> NDArray[np.float64]:
        """(R,) float64: what each removal was expected to cost, in the measure of the criterion."""
        return self._removed.anticipated

    @property
    def errors(self) -> NDArray[np.float64]:
        """(R,) float64: largest distance of the surface from the values of all points, after each removal."""
        return self._removed.errors

    @property
    def merged(self) -> int:
        """Points that coincided with others: only the first is in `kept` or `order`, with their mean value."""
        return self._removed.points.merged

    @property
    def _removed(self) -> Removals:
        if self.removals is None:
            raise OptionError("the order of this surface's points is unknown", code="thin",
                              remedy="thin with a criterion")
        return self.removals

    def at(self, count: int) -> Tin:
        """The surface over the ``count`` most significant points.

        Raises
        ------
        OptionError
            If fewer points are asked for than are left, or more than there are; or if the surface was not thinned by a
            criterion.
        """
        removed = self._removed
        places = removed.ranks()
        if not (isinstance(count, Integral) and len(removed.kept) <= count <= len(places)):
            raise OptionError(
                f"the surface can have {len(removed.kept)} to {len(places)} points, not {count}", code="points"
            )
        return tin_of(removed.points, np.sort(places[:count]), self.shape, self.metadata, removed)

    def raster(self) -> NDArray[np.float64]:
        """The surface at the samples of the field: a picture again.

        Returns
        -------
        (s0, s1) float64
            NaN where no triangle is.

        Raises
        ------
        OptionError
            If the points were scattered.
        """
        if self.shape is None:
            raise OptionError("the points are not samples of a field", code="raster")
        at = self.points.astype(np.int64)
        order = by_rank(at[:, 0], at[:, 1])
        tri, _ = delaunay(*np.ascontiguousarray(at[order].T))
        return raster(tri, self.values[order], self.shape)


def tin_of(
    points: Points, some: NDArray[np.int64], shape: tuple[int, int] | None, metadata: Mapping[str, str],
    removals: Removals | None = None,
) -> Tin:
    """Make the surface over some points (K,), ascending by rank."""
    found = triangles(delaunay(points.x[some], points.y[some])[0])
    return Tin(points.positions[some], points.value[some], found.astype(np.int64), shape, metadata=metadata,
               removals=removals)
