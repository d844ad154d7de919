"""Smoothing: points move within the parts of edges that a file states, to where the curve bends as evenly as possible.

The middle of a part is right in the mean, but makes steps of what is smooth. Here each point goes along its edge until
it bends away from its neighbours as much as these do from theirs, and no farther than to the end of its part
(spec clause 9.10).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import kernel, record
from ..kernel.types import FloatMatrix, FloatVector, IntMatrix
from .crossing import Drawn, edge_ends
from .leaves import Leaves

ROUNDS = 6
"""Default number; more come nearer where a field is smooth, and get farther where it is rough."""
MOST_ROUNDS = 64
SMOOTHING = "smoothing"
"""Name of the note with the rounds that a file asks for."""
STEP = 0.5
"""Share of the way that a point goes in a round; with more than that, points on a straight line swing."""
NEAR = 1 / 64
"""Share of its part that a point keeps from the ends, where points of several edges would fall together."""
GRAZING = 1e-6
"""Edges along which a curve runs do not determine its shape."""


@record
class _Ways(NamedTuple):
    """Ways along which points may move.

    Attributes
    ----------
    start, way : (P, n) float64
        The lower ends of their edges, and the way from there to the upper ends; of points in the middles of cells
        the way is 0.
    least, most : (P,) float64
        How far along its edge each may go; the same of points that stay.
    ratio : (P,) float64
        How far along its edge each is.
    """

    start: FloatMatrix
    way: FloatMatrix
    least: FloatVector
    most: FloatVector
    ratio: FloatVector


def rounds_of(notes: Mapping[str, str], smooth: bool | None = None) -> int:
    """Rounds of a drawing: by default those of a file's notes (spec clause 3.7.2), 0 if they ask for none."""
    if smooth is not None and not smooth:
        return 0
    text = notes.get(SMOOTHING, "")
    stated = text.isascii() and text.isdecimal() and text[0] != "0" and len(text) < 3 and int(text) <= MOST_ROUNDS
    return int(text) if stated else ROUNDS if smooth else 0


def smoothed(
    leaves: Leaves, drawn: Drawn, points: NDArray[np.float64], rounds: int = ROUNDS
) -> NDArray[np.float64]:
    """Points (P, n) of a drawing, moved along their edges; those in the middles of cells follow their neighbours."""
    low, high = edge_ends(leaves, drawn.edges)
    return evened(points, drawn.cells, low, high - low, drawn.ratio, drawn.part, rounds)


def evened(
    points: NDArray[np.float64], cells: NDArray[np.int64], low: NDArray[np.float64], along: NDArray[np.float64],
    where: NDArray[np.float64], part: NDArray[np.float64], rounds: int,
) -> NDArray[np.float64]:
    """Points (P, n) of cells (M, n), moved along edges, those in the middles of cells, which come last, with them.

    Edges go from ``low`` (E, n) along ``along`` (E, n); points lie ``where`` (E,) on them, and may go from
    ``part[:, 0]`` to ``part[:, 1]``.
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
    """Unit normals (P, n) at points, the mean of those of their cells by length or area; 0 where that is none."""
    total, normal, count = np.zeros_like(points), np.zeros_like(points), np.zeros(len(points))
    _gather(points, cells, total, normal, count)
    _bend(points, total, count, normal, np.empty(len(points)))
    return normal


@kernel
def _gather(points: FloatMatrix, cells: IntMatrix, total: FloatMatrix, normal: FloatMatrix, count: FloatVector) -> None:
    """Sum for each point its neighbours, their number, and the normals of its cells by length or area."""
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
    """Distance of the middle of its neighbours in front of each point, along the normal, which becomes of length 1."""
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
    """Sum what `_bend` yields for the neighbours of each point."""
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
    """One step of each point along its edge; ends of open curves (n = 2), with one neighbour, stay."""
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
