"""A triangulated irregular network: points, values, and the Delaunay triangles between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Tin:
    """A surface over the plane that is linear on each triangle.

    Attributes
    ----------
    points : (V, 2) float64
    values : (V,) float64
    triangles : (T, 3) int64
        Numbers of points, anticlockwise (from axis 0 to axis 1).
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    triangles: NDArray[np.int64]
