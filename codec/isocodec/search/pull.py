"""Change of distances between a drawing and the original as points move along their edges (spec annex G.3(4))."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inner, kernel, record
from ..kernel.types import FloatMatrix, FloatVector, IntMatrix, IntVector

_SLOPE = 1e-6
"""Slopes below this are left out."""
_TOUCH = 1e-9
"""Distance in cells below which curves touch: only normals show where a distance would grow."""


@inner
def _penalty(x):
    """Penalty of a distance as a share of the tolerance: small ones hardly count, those beyond outweigh all else."""
    y = x * x
    z = y * y
    return 0.02 * y + z * z


@record
class Pull(NamedTuple):
    """Change of distances of points of either curve as the points on edges move.

    Attributes
    ----------
    first : (E + 1,) int64
        ``samples[first[e] : first[e + 1]]`` are the points that notice edge e.
    samples : int64 vector
    slopes : float64 vector
        How much the distance of each of these falls as the point on the edge moves up.
    gap : (S,) float64
        The distance of each point.
    times : (S,) float64
        How often it counts.
    """

    first: IntVector
    samples: IntVector
    slopes: FloatVector
    gap: FloatVector
    times: FloatVector


@kernel
def relax(pull: Pull, where: FloatVector, step: FloatVector, most: int, scale: float, sweeps: int) -> None:
    """Move each edge's point by up to ``most`` steps to where the penalty is least; ``pull.gap`` is kept up to date.

    Where the step is 0 it stays.
    """
    first, samples, slopes, gap, times = pull.first, pull.samples, pull.slopes, pull.gap, pull.times
    for _ in range(sweeps):
        for e in range(len(where)):
            if first[e] == first[e + 1] or step[e] == 0.0:
                continue
            best, least = 0, np.inf
            for turn in range(2 * most + 1):
                move = turn - most
                if not 0.0 < where[e] + move * step[e] < 1.0:
                    continue
                total = 0.0
                for j in range(first[e], first[e + 1]):
                    i = samples[j]
                    total += times[i] * _penalty((gap[i] - slopes[j] * move * step[e]) * scale)
                if total < least:
                    best, least = move, total
            if best != 0:
                where[e] += best * step[e]
                for j in range(first[e], first[e + 1]):
                    gap[samples[j]] -= slopes[j] * best * step[e]


@kernel
def places_on(points: FloatMatrix, cells: IntMatrix, piece: IntVector, weight: FloatMatrix, out: FloatMatrix) -> None:
    """Places on pieces by the weights of their corners; nothing where the piece is -1."""
    for i in range(len(piece)):
        if piece[i] >= 0:
            for axis in range(out.shape[1]):
                total = 0.0
                for k in range(cells.shape[1]):
                    total += weight[i, k] * points[cells[piece[i], k], axis]
                out[i, axis] = total


@kernel
def slopes_of(
    points: FloatMatrix, way: FloatMatrix, cells: IntMatrix, piece: IntVector, weight: FloatMatrix, there: FloatMatrix,
    gap: FloatVector, slope: FloatMatrix,
) -> None:
    """Distances of places on pieces from others, and how they fall as the corners' points move along their edges.

    All are 0 where the piece is -1. ``there`` becomes the direction of each.
    """
    n = points.shape[1]
    for i in range(len(piece)):
        gap[i] = 0.0
        for k in range(n):
            slope[i, k] = 0.0
        if piece[i] < 0:
            continue
        corners, apart = cells[piece[i]], there[i]
        far = 0.0
        for axis in range(n):
            total = 0.0
            for k in range(n):
                total += weight[i, k] * points[corners[k], axis]
            apart[axis] -= total
            far += apart[axis] * apart[axis]
        far = np.sqrt(far)
        gap[i] = far
        if far > _TOUCH:
            for axis in range(n):
                apart[axis] /= far
        else:
            _normal(points, corners, apart)
        for k in range(n):
            along = 0.0
            for axis in range(n):
                along += way[corners[k], axis] * apart[axis]
            slope[i, k] = weight[i, k] * along


@inner
def _normal(points, corners, out):
    """Unit normal of a piece, 0 if it has no size."""
    a, b = points[corners[0]], points[corners[1]]
    if len(corners) == 2:
        out[0], out[1] = a[1] - b[1], b[0] - a[0]
        length = np.sqrt(out[0] * out[0] + out[1] * out[1])
    else:
        c = points[corners[2]]
        u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        out[0], out[1], out[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for axis in range(len(corners)):
        out[axis] /= max(length, 1e-12)


@record
class Follow(NamedTuple):
    """Coded edges that the point of each edge follows: ``told[start[e] : start[e + 1]]``, each by its share."""

    start: IntVector
    told: IntVector
    share: FloatVector


@kernel
def sort_by_told(
    follow: Follow, cells: IntMatrix, piece: IntVector, slope: FloatMatrix, before: int, place: IntVector,
    samples: IntVector, slopes: FloatVector,
) -> None:
    """Move each coded edge's ``place`` on by the samples that notice it; list them there unless ``samples`` is empty.

    Samples are numbered after those ``before``; they lie on pieces, or nowhere, as in `slopes_of`.
    """
    start, told, share = follow.start, follow.told, follow.share
    for i in range(len(piece)):
        if piece[i] < 0:
            continue
        for k in range(cells.shape[1]):
            e = cells[piece[i], k]
            for j in range(start[e], start[e + 1]):
                s = slope[i, k] * share[j]
                if abs(s) > _SLOPE:
                    at = place[told[j]]
                    if len(samples):
                        samples[at] = before + i
                        slopes[at] = s
                    place[told[j]] = at + 1
