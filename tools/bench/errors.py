"""How far two curves or surfaces lie apart: densely sampled, both ways, in cells.

Each is sampled: a curve every ``STEP[2]`` cells along its length, both ends of every segment included; a surface in the
middles of the parts of its triangles, divided until no part has an edge longer than ``STEP[3]``, and at their corners.
The distance of a sample to the other curve or surface is exact. The mean is weighted by length or area (corners
of triangles count for the largest distance alone); of the two ways the larger mean and the larger distance are taken.
Surfaces of more than ``MOST`` samples are measured at ``MOST`` of them, drawn with a fixed seed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .nearest import Boxes

Floats = NDArray[np.float64]

STEP = {2: 0.1, 3: 0.5}
MOST = 100_000
MOST_PARTS = 64
"""Along an edge of a triangle or a segment of a curve: bounds memory."""


class Shape:
    """Segments (M, 2, 2) or triangles (M, 3, 3) by their corners, sampled for measuring."""

    def __init__(self, corners: Floats, ends: Floats) -> None:
        self.corners = np.asarray(corners, float)
        self.ends = np.asarray(ends, float)
        self.n = self.corners.shape[1]

    @staticmethod
    def of_lines(lines: Sequence[Floats]) -> Shape:
        """Of polylines (K, 2)."""
        parts = [np.stack([line[:-1], line[1:]], 1) for line in lines if len(line) > 1]
        if not parts:
            return Shape(np.zeros((0, 2, 2)), np.zeros((0, 2)))
        return Shape(np.concatenate(parts), np.concatenate(lines))

    @staticmethod
    def of_mesh(points: Floats, cells: NDArray[np.integer]) -> Shape:
        """Of points (P, n) and cells (M, n)."""
        return Shape(np.asarray(points, float)[cells], np.asarray(points, float)[np.unique(cells)])

    @cached_property
    def _boxes(self) -> Boxes:
        return Boxes(self.corners)

    @cached_property
    def samples(self) -> tuple[Floats, Floats]:
        """Points (S, n) and what length or area each stands for (S,)."""
        points, weights = spread(self.corners, STEP[self.n])
        ends = self.ends
        if len(points) + len(ends) > MOST and self.n == 3:
            generator = np.random.default_rng(0)
            points_at = generator.permutation(len(points))[: MOST * 3 // 4]
            points, weights = points[points_at], weights[points_at]
            ends = ends[generator.permutation(len(ends))[: MOST // 4]]
        return np.concatenate([points, ends]), np.concatenate([weights, np.zeros(len(ends))])

    def distances(self, points: Floats) -> Floats:
        """Of points (K, n) to this."""
        return self._boxes.distances(points)


def apart(a: Shape, b: Shape) -> tuple[float, float]:
    """Mean and largest distance of two shapes, the larger of both ways; infinite if just one of them is empty."""
    if len(a.corners) == 0 or len(b.corners) == 0:
        return (0.0, 0.0) if len(a.corners) == len(b.corners) else (math.inf, math.inf)
    mean = largest = 0.0
    for one, other in ((a, b), (b, a)):
        points, weights = one.samples
        distances = other.distances(points)
        mean = max(mean, float(np.average(distances, weights=weights) if weights.sum() > 0 else distances.mean()))
        largest = max(largest, float(distances.max()))
    return mean, largest


def spread(corners: Floats, step: float) -> tuple[Floats, Floats]:
    """Points in the middles of equal parts no longer than ``step``, and the length or area each stands for."""
    n = corners.shape[1]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    parts = np.clip(np.ceil(longest / step).astype(int), 1, MOST_PARTS)
    points, weights = [], []
    for m in np.unique(parts):
        chosen = np.flatnonzero(parts == m)
        mix = middles(int(m), n)
        points.append(np.einsum("pk,mkd->mpd", mix, corners[chosen]).reshape(-1, n))
        weights.append(np.repeat(sizes(corners[chosen]) / len(mix), len(mix)))
    if not points:
        return np.zeros((0, n)), np.zeros(0)
    return np.concatenate(points), np.concatenate(weights)


def middles(m: int, n: int) -> Floats:
    """Barycentric coordinates (P, n) of the middles of a segment's m parts or a triangle's m * m."""
    if n == 2:
        t = (np.arange(m) + 0.5) / m
        return np.stack([1 - t, t], 1)
    i, j = (a.ravel() for a in np.mgrid[:m, :m])
    up, down = i + j < m, i + j < m - 1
    a = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / m
    b = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / m
    return np.stack([1 - a - b, a, b], 1)


def sizes(corners: Floats) -> Floats:
    """Length of segments or area of triangles (M,)."""
    u = corners[:, 1] - corners[:, 0]
    if corners.shape[1] == 2:
        return np.linalg.norm(u, axis=1)
    return np.linalg.norm(np.cross(u, corners[:, 2] - corners[:, 0]), axis=1) / 2
