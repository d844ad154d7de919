"""Exact distances from points to segments or triangles, by a tree of boxes."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAF = 4
"""Segments or triangles of a leaf."""
BITS = 16
"""Of each coordinate of a place along the curve that orders them."""


class Boxes:
    """Segments (M, 2, n) or triangles (M, 3, n) in a full binary tree: node k has the children 2 k and 2 k + 1.

    Leaves hold neighbours on a space-filling curve (Morton's), nodes the box around all below them.
    """

    def __init__(self, corners: Floats) -> None:
        corners = _spatial(corners)
        self.corners = np.ascontiguousarray(corners[np.argsort(_morton(corners.mean(axis=1)))])
        self.leaves = 1 << max(math.ceil(math.log2(len(corners) / LEAF)), 0)
        self.low = np.full((2 * self.leaves, 3), np.inf)
        self.high = np.full((2 * self.leaves, 3), -np.inf)
        begins = np.arange(0, len(corners), LEAF)
        used = slice(self.leaves, self.leaves + len(begins))
        self.low[used] = np.minimum.reduceat(self.corners.min(axis=1), begins)
        self.high[used] = np.maximum.reduceat(self.corners.max(axis=1), begins)
        size = self.leaves
        while size > 1:
            size //= 2
            self.low[size : 2 * size] = self.low[2 * size : 4 * size].reshape(size, 2, 3).min(axis=1)
            self.high[size : 2 * size] = self.high[2 * size : 4 * size].reshape(size, 2, 3).max(axis=1)

    def distances(self, points: Floats) -> Floats:
        """Of points (K, n) to the nearest of all."""
        return _search(np.ascontiguousarray(_spatial(points)), self.corners, self.low, self.high, self.leaves)


def _spatial(points: Floats) -> Floats:
    """Three coordinates instead of two."""
    return np.concatenate([points, np.zeros((*points.shape[:-1], 3 - points.shape[-1]))], axis=-1)


def _morton(points: Floats) -> NDArray[np.int64]:
    """Place of points (K, 3) along a space-filling curve."""
    points = points - points.min(axis=0)
    cells = (points * (((1 << BITS) - 1) / max(float(points.max()), 1e-9))).astype(np.int64)
    places = np.zeros(len(points), np.int64)
    for bit in range(BITS):
        for axis in range(3):
            places |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return places


@njit(cache=True)
def _search(points, corners, low, high, leaves):
    out = np.empty(len(points))
    stack = np.empty(64, np.int64)
    nearest = 0
    for k in range(len(points)):
        x, y, z = points[k]
        # the last point's nearest is near this one's, as a rule
        best = _square(x, y, z, corners, nearest)
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if _to_box(x, y, z, low, high, node) >= best:
                continue
            if node >= leaves:
                begin = (node - leaves) * LEAF
                for j in range(begin, min(begin + LEAF, len(corners))):
                    square = _square(x, y, z, corners, j)
                    if square < best:
                        best, nearest = square, j
            else:
                a, b = 2 * node, 2 * node + 1
                if _to_box(x, y, z, low, high, a) < _to_box(x, y, z, low, high, b):
                    a, b = b, a
                stack[top], stack[top + 1] = a, b
                top += 2
        out[k] = math.sqrt(best)
    return out


@njit(cache=True)
def _to_box(x, y, z, low, high, node):
    """Squared distance of a point to a box; infinite if the box is empty."""
    x = max(low[node, 0] - x, x - high[node, 0], 0.0)
    y = max(low[node, 1] - y, y - high[node, 1], 0.0)
    z = max(low[node, 2] - z, z - high[node, 2], 0.0)
    return x * x + y * y + z * z


@njit(cache=True)
def _square(x, y, z, corners, j):
    """Squared distance of a point to segment or triangle j."""
    if corners.shape[1] == 2:
        return _to_segment(x, y, z, corners, j, 0, 1)
    u0, u1, u2 = _step(corners, j, 0, 1)
    v0, v1, v2 = _step(corners, j, 0, 2)
    w0, w1, w2 = x - corners[j, 0, 0], y - corners[j, 0, 1], z - corners[j, 0, 2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    square = n0 * n0 + n1 * n1 + n2 * n2
    if square > 1e-24:
        s = ((w1 * v2 - w2 * v1) * n0 + (w2 * v0 - w0 * v2) * n1 + (w0 * v1 - w1 * v0) * n2) / square
        t = ((u1 * w2 - u2 * w1) * n0 + (u2 * w0 - u0 * w2) * n1 + (u0 * w1 - u1 * w0) * n2) / square
        if s >= 0 and t >= 0 and s + t <= 1:
            return (w0 * n0 + w1 * n1 + w2 * n2) ** 2 / square
    return min(
        _to_segment(x, y, z, corners, j, 0, 1),
        _to_segment(x, y, z, corners, j, 1, 2),
        _to_segment(x, y, z, corners, j, 2, 0),
    )


@njit(cache=True)
def _to_segment(x, y, z, corners, j, a, b):
    d0, d1, d2 = _step(corners, j, a, b)
    w0, w1, w2 = x - corners[j, a, 0], y - corners[j, a, 1], z - corners[j, a, 2]
    square = d0 * d0 + d1 * d1 + d2 * d2
    t = 0.0
    if square > 0:
        t = min(max((w0 * d0 + w1 * d1 + w2 * d2) / square, 0.0), 1.0)
    w0, w1, w2 = w0 - t * d0, w1 - t * d1, w2 - t * d2
    return w0 * w0 + w1 * w1 + w2 * w2


@njit(cache=True)
def _step(corners, j, a, b):
    """From corner a to corner b."""
    return corners[j, b, 0] - corners[j, a, 0], corners[j, b, 1] - corners[j, a, 1], corners[j, b, 2] - corners[j, a, 2]
