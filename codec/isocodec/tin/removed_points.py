"""Points that are not vertices of a triangulation: the triangle that contains each, and its error there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, inner, kernel, record
from ..kernel.types import FloatVector, Int32Vector, Integer, IntVector
from .heap import Heap, new_heap, set_key, take_out
from .triangulation import NONE, Triangulation, orientation


@record
class Surface(NamedTuple):
    """A triangulation that interpolates the values of its vertices, with the other points and the targets of all.

    ``target`` is the wanted value at each point, vertex or not, ``error`` the surface minus that, and ``weight`` the
    factor of a point's error where the largest is sought: with 0, a point never becomes a vertex for its error; with
    less, a vertex is never removed. ``first`` holds a point of each triangle, ``next`` the one after each point, -1 at
    the end; ``worst`` is a heap of triangles by negated largest error. ``loose`` holds the first of a list of points
    that are to be assigned to triangles.
    """

    tri: Triangulation
    value: FloatVector
    target: FloatVector
    weight: FloatVector
    first: Int32Vector
    next: Int32Vector
    error: FloatVector
    worst: Heap
    loose: IntVector


def surface(
    tri: Triangulation, value: NDArray[np.float64], target: NDArray[np.float64] | None = None,
    weight: NDArray[np.float64] | None = None,
) -> Surface:
    """Make a surface over a triangulation; points other than vertices are not assigned to triangles yet."""
    target = value if target is None else target
    weight = np.ones(len(value)) if weight is None else weight
    count, triangles = len(value), len(tri.origin) // 3
    return Surface(
        tri, value, target, weight, np.full(triangles, NONE, np.int32), np.full(count, NONE, np.int32), value - target,
        new_heap(triangles), np.full(1, NONE, np.int64),
    )


@inlined
def counted(s, p):
    """Weighted size of a point's error."""
    return abs(s.error[p]) * s.weight[p]


@inlined
def interpolated(s, a, b, c, q):
    """Interpolate at a point in the triangle (a, b, c); NaN outside of it."""
    tri = s.tri
    u = orientation(tri, b, c, q)
    v = orientation(tri, c, a, q)
    w = orientation(tri, a, b, q)
    if u < 0 or v < 0 or w < 0:
        return np.nan
    return (u * s.value[a] + v * s.value[b] + w * s.value[c]) / (u + v + w)


@inner
def at_triangle(s, t, q):
    """Interpolate at a point in a triangle that may contain it."""
    o = s.tri.origin
    return interpolated(s, np.int64(o[3 * t]), np.int64(o[3 * t + 1]), np.int64(o[3 * t + 2]), q)


@inner
def loosen(s):
    """Move all points of the gathered triangles to the loose list, and remove the triangles from the heap."""
    for i in range(s.tri.reg.cavity):
        t = np.int64(s.tri.cavity[i])
        p = np.int64(s.first[t])
        s.first[t] = NONE
        take_out(s.worst, t)
        while p >= 0:
            after = np.int64(s.next[p])
            # one may have become a vertex
            if s.tri.leaving[p] < 0:
                s.next[p] = s.loose[0]
                s.loose[0] = p
            p = after


@inner
def settle(s):
    """Assign the loose points to the triangles of ``cavity``, and compute their errors."""
    tri = s.tri
    for i in range(tri.reg.cavity):
        t = np.int64(tri.cavity[i])
        size = 0.0
        for side in range(3):
            size = max(size, counted(s, tri.origin[3 * t + side]))
        set_key(s.worst, t, -size, 0.0)
    p: Integer = s.loose[0]
    s.loose[0] = NONE
    at: Integer = np.int64(0)
    while p >= 0:
        after = np.int64(s.next[p])
        # points that lie in one triangle mostly come one after the other
        for turn in range(tri.reg.cavity):
            i = at + turn
            if i >= tri.reg.cavity:
                i -= tri.reg.cavity
            t = np.int64(tri.cavity[i])
            found = at_triangle(s, t, p)
            if not np.isnan(found):
                s.error[p] = found - s.target[p]
                s.next[p] = s.first[t]
                s.first[t] = p
                if -counted(s, p) < s.worst.key[t]:
                    set_key(s.worst, t, -counted(s, p), 0.0)
                at = i
                break
        p = after


@inner
def farthest_in(s, t):
    """Find the point of a triangle with the largest error, or -1, and this error."""
    point, size = np.int64(NONE), 0.0
    p = np.int64(s.first[t])
    while p >= 0:
        if counted(s, p) > size:
            point, size = p, counted(s, p)
        p = np.int64(s.next[p])
    return point, size


@kernel
def farthest(s: Surface, point: Int32Vector, size: FloatVector) -> None:
    """Find for each triangle the point with the largest error, or -1, and this error."""
    for t in range(len(point)):
        point[t] = NONE
        size[t] = 0.0
        if s.tri.origin[3 * t] >= 0:
            point[t], size[t] = farthest_in(s, t)


@inlined
def largest_error(s):
    """Largest weighted error of the surface."""
    return -s.worst.key[s.worst.item[0]]
