"""Smoothing: points move within the parts of edges that a file states, so that the curve bends evenly.

The middle of a part is right on average, but turns smooth curves into steps. Each point moves along its edge until the
curve bends there as much as at its neighbours, but not beyond the end of its part (spec clause 9.10).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import kernel, record
from ..kernel.types import FloatMatrix, FloatVector, IntMatrix

ROUNDS = 6
"""Default number of rounds; more bring points closer where a field is smooth, and farther where it is rough."""
MOST_ROUNDS = 64
SMOOTHING = "smoothing"
"""Note with the number of rounds that a file asks for."""
STEP = 0.5
"""Share of its way that a point moves in a round; with more, points on a straight line oscillate."""
NEAR = 1 / 64
"""Margin of a point at the ends of its part, where points of several edges would coincide, as a share of it."""
GRAZING = 1e-6
"""Squared cosine below which an edge runs along the curve, and its point stays."""


@record
class _Ways(NamedTuple):
    """Ways along which points may move.

    Attributes
    ----------
    start, way : (P, n) float64
        Lower ends of their edges, and vectors from there to the upper ends; 0 for points in the middles of cells.
    least, most : (P,) float64
        Bounds of the ratio; equal for points that stay.
    ratio : (P,) float64
        Position of each point along its edge.
    """

    start: FloatMatrix
    way: FloatMatrix
    least: FloatVector
    most: FloatVector
    ratio: FloatVector


def rounds_of(notes: Mapping[str, str], smooth: bool | None = None) -> int:
    """Number of rounds of a drawing: by default that in the notes of a file (spec clause 3.7.2), or 0."""
    if smooth is not None and not smooth:
        return 0
    text = notes.get(SMOOTHING, "")
    stated = text.isascii() and text.isdecimal() and text[0] != "0" and len(text) < 3 and int(text) <= MOST_ROUNDS
    return int(text) if stated else ROUNDS if smooth else 0


def evened(
    points: NDArray[np.float64], cells: NDArray[np.int64], low: NDArray[np.float64], along: NDArray[np.float64],
    where: NDArray[np.float64], part: NDArray[np.float64], rounds: int,
) -> NDArray[np.float64]:
    """Move points (P, n) of cells (M, n) along edges; those in the middles of cells, which come last, follow.

    Edges run from ``low`` (E, n) along ``along`` (E, n); points lie at ``where`` (E,) on them, and stay between
    ``part[:, 0]`` and ``part[:, 1]``.
    """
    count = len(points) - len(low)
    start = np.concatenate([low, points[len(low) :]])
    way = np.concatenate([along, np.zeros_like(start[:count])])
    ratio = np.concatenate([where, np.zeros(count)])
    near = NEAR * (part[:, 1] - part[:, 0])
    least, most = (np.concatenate([end, np.zeros(count)]) for end in (part[:, 0] + near, part[:, 1] - near))
    ways = _Ways(start, way, least, most, ratio)
    points = points.copy()
    total, normal = np.empty_like(points), np.empty_like(points)
    neighbours, bend, around = (np.empty(len(points)) for _ in range(3))
    for _ in range(rounds):
        for array in (total, normal, neighbours, around):
            array[:] = 0
        _gather(points, cells, total, normal, neighbours)
        _bend(points, total, neighbours, normal, bend)
        _around(cells, bend, around)
        _move(points, ways, total, neighbours, normal, bend, around)
    return points


def normals(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Compute unit normals (P, n) at points, the mean over their cells by length or area; 0 where that vanishes."""
    total, normal, count = np.zeros_like(points), np.zeros_like(points), np.zeros(len(points))
    _gather(points, cells, total, normal, count)
    _bend(points, total, count, normal, np.empty(len(points)))
    return normal


@kernel
def _gather(points: FloatMatrix, cells: IntMatrix, total: FloatMatrix, normal: FloatMatrix, count: FloatVector) -> None:
    """Sum up, for each point, its neighbours, their number, and the normals of its cells by length or area."""
    n = points.shape[1]
    for i in range(len(cells)):
        if n == 2:
            a, b = cells[i, 0], cells[i, 1]
            d0, d1 = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
            for v in (a, b):
                normal[v, 0] -= d1
                normal[v, 1] += d0
        else:
            a, b, c = cells[i, 0], cells[i, 1], cells[i, 2]
            u0, u1, u2 = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
            v0, v1, v2 = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
            for v in (a, b, c):
                normal[v, 0] += u1 * v2 - u2 * v1
                normal[v, 1] += u2 * v0 - u0 * v2
                normal[v, 2] += u0 * v1 - u1 * v0
        for j in range(n):
            v = cells[i, j]
            count[v] += n - 1
            for k in range(n):
                if k != j:
                    for axis in range(n):
                        total[v, axis] += points[cells[i, k], axis]


@kernel
def _bend(points: FloatMatrix, total: FloatMatrix, count: FloatVector, normal: FloatMatrix, bend: FloatVector) -> None:
    """Distance of the mean of a point's neighbours from it, along the normal, which is normalised."""
    n = points.shape[1]
    for i in range(len(points)):
        bend[i] = 0
        length = 0.0
        for axis in range(n):
            length += normal[i, axis] * normal[i, axis]
        if length == 0 or count[i] == 0:
            continue
        for axis in range(n):
            normal[i, axis] /= np.sqrt(length)
            bend[i] += normal[i, axis] * (total[i, axis] / count[i] - points[i, axis])


@kernel
def _around(cells: IntMatrix, bend: FloatVector, around: FloatVector) -> None:
    """Sum up the bends of the neighbours of each point."""
    n = cells.shape[1]
    for i in range(len(cells)):
        for j in range(n):
            for k in range(n):
                if k != j:
                    around[cells[i, j]] += bend[cells[i, k]]


@kernel
def _move(
    points: FloatMatrix, ways: _Ways, total: FloatMatrix, count: FloatVector, normal: FloatMatrix, bend: FloatVector,
    around: FloatVector,
) -> None:
    """Move each point a step along its edge; ends of open curves (n = 2), with one neighbour, stay."""
    n = points.shape[1]
    way, ratio = ways.way, ways.ratio
    for i in range(len(points)):
        if count[i] < 2:
            continue
        length, across = 0.0, 0.0
        for axis in range(n):
            length += way[i, axis] * way[i, axis]
            across += way[i, axis] * normal[i, axis]
        if length > 0 and across * across > GRAZING * length:
            to = ratio[i] + STEP * (bend[i] - around[i] / count[i]) / across
            ratio[i] = min(max(to, ways.least[i]), ways.most[i])
        for axis in range(n):
            points[i, axis] = ways.start[i, axis] + ratio[i] * way[i, axis] if length > 0 else total[i, axis] / count[i]
