"""A triangulated irregular network: points, values, and the Delaunay triangles between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from .delaunay import delaunay
from .rank import by_rank
from .rasterize import raster


@dataclass(frozen=True)
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
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    triangles: NDArray[np.int64]
    shape: tuple[int, int] | None = None
    complete: bool = True
    metadata: Mapping[str, str] = field(default_factory=dict)

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
            raise OptionError("the points are no samples of a field", code="raster")
        at = self.points.astype(np.int64)
        order = by_rank(at[:, 0], at[:, 1])
        tri, _ = delaunay(*np.ascontiguousarray(at[order].T))
        return raster(tri, self.values[order], self.shape)
