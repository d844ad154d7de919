"""Curvature of the extracted curve or surface at its points (row C2-curvature; docs/encoders.md, 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour

SIDE = 3
"""Points on either side of a curve's that its curvature is estimated from."""
_LEAST = 1e-12


def curvature(contour: Contour) -> NDArray[np.float64]:
    """Curvature of a curve, or mean curvature of a surface (half the sum of both), at its points, in 1 / cells (on a
    mesh by the unit of its points).

    Along a curve the estimator is that of T. Lewiner, J. D. Gomes, H. Lopes and M. Craizer (*Curvature and torsion
    estimators based on parametric curve fitting*, 2005): parabolas through the point, over the length of arc, fitted to
    `SIDE` neighbours on each side. On a surface it is the cotangent Laplacian (M. Meyer et al., 2003), summed over the
    ring around each vertex as the area is, so that the slivers of extracted surfaces do not count for more than
    their area. Borders of surfaces leave it to the vertices inside.

    Returns
    -------
    (P,) float64
    """
    return along(contour) if contour.n == 2 else across(contour)


def along(contour: Contour) -> NDArray[np.float64]:
    """Curvature of polylines, in the plane or in space, at their points."""
    points, (count, d) = contour.points, contour.points.shape
    step = np.full((2, count), -1)
    step[0, contour.cells[:, 0]] = contour.cells[:, 1]
    step[1, contour.cells[:, 1]] = contour.cells[:, 0]
    # sums over the neighbours: moments of the length of arc, and those with the way to the neighbour
    moments, ways = np.zeros((3, count)), np.zeros((2, count, d))
    for side, sign in enumerate((1.0, -1.0)):
        at, arc = np.arange(count), np.zeros(count)
        for _ in range(SIDE):
            there = np.where(at >= 0, step[side, at], -1)
            arc += np.where(there >= 0, np.linalg.norm(points[there] - points[at], axis=1), 0.0)
            at = there
            s, way = sign * arc, points[at] - points
            some = at >= 0
            for power in range(3):
                moments[power, some] += s[some] ** (power + 2)
            for power in range(2):
                ways[power, some] += s[some, None] ** (power + 1) * way[some]
    # way = first s + second s**2 / 2, by least squares
    a, b, c = moments[0], moments[1] / 2, moments[2] / 4
    det = a * c - b * b
    good = det > _LEAST * a * c
    scale = 1.0 / np.where(good, det, 1.0)
    u, v = ways[0], ways[1] / 2
    first = (c[:, None] * u - b[:, None] * v) * scale[:, None]
    second = (a[:, None] * v - b[:, None] * u) * scale[:, None]
    speed = np.maximum(np.linalg.norm(first, axis=1), _LEAST)
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) if d == 2 else np.linalg.norm(
        np.cross(first, second), axis=1)
    return np.where(good, area / speed**3, 0.0)


def across(contour: Contour) -> NDArray[np.float64]:
    """Mean curvature of triangle meshes at their vertices."""
    points, cells, count = contour.points, contour.cells, len(contour.points)
    corner = points[cells]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    twice = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(twice, _LEAST)[:, None]
    area, pull = np.zeros(count), np.zeros((count, 3))
    sides = np.concatenate([cells[:, [k, (k + 1) % 3]] for k in range(3)])
    for k in range(3):
        # the gradient of the triangle's area: what cotangents add up to
        opposite = corner[:, (k + 2) % 3] - corner[:, (k + 1) % 3]
        np.add.at(pull, cells[:, k], np.cross(unit, opposite) / 2)
        np.add.at(area, cells[:, k], twice / 6)
    # a side of one triangle only is a border
    key = np.sort(sides, axis=1) @ (count, 1)
    _, number, used = np.unique(key, return_inverse=True, return_counts=True)
    border = np.zeros(count, np.bool_)
    border[sides[used[number] == 1]] = True
    area[border], pull[border] = 0.0, 0.0
    one, two = sides.T
    total, around = area.copy(), pull.copy()
    # each side belongs to two triangles, turned one way in either: both ends see the other once
    np.add.at(total, one, area[two])
    np.add.at(around, one, pull[two])
    return np.linalg.norm(around, axis=1) / (2 * np.maximum(total, _LEAST))
