"""A triangulated surface as samples on a grid (spec clause 10.9.6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, kernel
from ..kernel.types import FloatMatrix, FloatVector
from .triangulation import Triangulation, following


@inlined
def _left_of(tri, h, x, y):
    """Twice the area of the triangle of a half-edge and a place."""
    a, b = np.int64(tri.origin[h]), np.int64(tri.origin[following(h)])
    return (tri.x[b] - tri.x[a]) * (y - tri.y[a]) - (tri.y[b] - tri.y[a]) * (x - tri.x[a])


@kernel
def draw(tri: Triangulation, value: FloatVector, out: FloatMatrix) -> None:
    """Interpolate at each sample; samples outside of all triangles are left unchanged."""
    h = 3 * np.int64(tri.reg.last)
    for x in range(out.shape[0]):
        for turn in range(out.shape[1]):
            # back and forth: each sample lies next to the one before
            y = turn if x % 2 == 0 else out.shape[1] - 1 - turn
            passed = 0
            while passed < 3:
                if _left_of(tri, h, x, y) < 0:
                    if tri.twin[h] < 0:
                        break
                    h = np.int64(tri.twin[h])
                    passed = 0
                else:
                    passed += 1
                h = following(h)
            if passed == 3:
                o = 3 * (h // 3)
                u, v, w = _left_of(tri, o + 1, x, y), _left_of(tri, o + 2, x, y), _left_of(tri, o, x, y)
                a, b, c = np.int64(tri.origin[o]), np.int64(tri.origin[o + 1]), np.int64(tri.origin[o + 2])
                out[x, y] = (u * value[a] + v * value[b] + w * value[c]) / (u + v + w)


def raster(tri: Triangulation, value: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Interpolate the surface at all samples; NaN outside of it.
    """
    out = np.full(shape, np.nan)
    draw(tri, value, out)
    return out
