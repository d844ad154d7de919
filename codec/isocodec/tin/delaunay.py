"""Exact Delaunay triangulation of points with integer coordinates: insertion and removal (spec clause 10.5).

It does not depend on the order of the points or the machine: among points on a common circle, ranks decide.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..kernel import inner, kernel
from ..kernel.types import Int32Vector, IntVector
from .rank import BITS, by_rank
from .triangulation import (
    NONE,
    Triangulation,
    allot,
    empty,
    fill,
    following,
    gather,
    in_circle,
    join,
    orientation,
    release,
    replace,
)

_HILBERT = 14
"""Bits of each coordinate that determine the order of insertion."""
_FIRST = 64
"""Points of the first round of insertion; each later one takes four times as many."""
_ROUND = 4


@inner
def locate(tri, p):
    """Find a triangle that contains a point of the hull, its border included."""
    h = 3 * np.int64(tri.reg.last)
    if tri.origin[h] < 0:
        h = np.int64(0)
        while tri.origin[h] < 0:
            h += 3
    steps = 0
    i = 0
    while i < 3:
        a, b = np.int64(tri.origin[h]), np.int64(tri.origin[following(h)])
        if orientation(tri, a, b, p) < 0:
            h = np.int64(tri.twin[h])
            steps += 1
            i = 0
        else:
            i += 1
        h = following(h)
    tri.reg.work += steps
    return h // 3


@inner
def _carve(tri, p, skipped, depth):
    """Collect the triangles on the stack and all adjacent ones whose circle contains ``p``; list the cavity's edges.

    The stack is ``cavity``, initially with ``depth`` marked triangles. Half-edges on the hull are not edges of the
    cavity if they are ``skipped`` or collinear with ``p``.
    """
    reg = tri.reg
    count, done = reg.ring, 0
    while done < depth:
        t = np.int64(tri.cavity[done])
        done += 1
        for i in range(3):
            h = 3 * t + i
            a, b = np.int64(tri.origin[h]), np.int64(tri.origin[following(h)])
            g = np.int64(tri.twin[h])
            if g < 0:
                if h == skipped or orientation(tri, a, b, p) == 0:
                    reg.open = 1
                    continue
            else:
                other = g // 3
                if tri.mark[other] == 1:
                    continue
                o = 3 * other
                if in_circle(tri, np.int64(tri.origin[o]), np.int64(tri.origin[o + 1]), np.int64(tri.origin[o + 2]), p):
                    tri.mark[other] = 1
                    tri.cavity[depth] = other
                    depth += 1
                    continue
            tri.ring[count] = a
            tri.far[count] = b
            tri.outer[count] = g
            count += 1
    reg.ring = count
    reg.cavity = depth
    reg.work += depth


@inner
def fan(tri, p):
    """Build a triangle with the apex ``p`` on each edge of the cavity, and list them in ``cavity``."""
    reg = tri.reg
    for i in range(reg.cavity):
        t = np.int64(tri.cavity[i])
        tri.mark[t] = 0
        release(tri, t)
    for i in range(reg.ring):
        a, b = np.int64(tri.ring[i]), np.int64(tri.far[i])
        t = allot(tri, a, b, p)
        join(tri, 3 * t, np.int64(tri.outer[i]))
        tri.leaving[a] = 3 * t
        tri.cavity[i] = t
    for i in range(reg.ring):
        t = np.int64(tri.cavity[i])
        b = np.int64(tri.far[i])
        g = np.int64(tri.leaving[b])
        # an edge of the cavity that begins where this one ends; an open cavity's last edge has none
        if g >= 0 and g % 3 == 0 and tri.origin[g] == b and tri.origin[g + 2] == p:
            join(tri, 3 * t + 1, g + 2)
        else:
            tri.twin[3 * t + 1] = NONE
            tri.leaving[b] = 3 * t + 1
    reg.cavity = reg.ring
    t = np.int64(tri.cavity[0])
    tri.leaving[p] = 3 * t + 2
    reg.last = t


@inner
def _mark(tri, t):
    tri.cavity[0] = t
    tri.mark[t] = 1


@inner
def carve_at(tri, p, t):
    """Collect the cavity of a point inside triangle ``t``."""
    tri.reg.ring = 0
    tri.reg.open = 0
    _mark(tri, t)
    _carve(tri, p, NONE, 1)


@inner
def insert_inside(tri, p):
    """Add a point within the hull."""
    carve_at(tri, p, locate(tri, p))
    fan(tri, p)


@inner
def _insert_outside(tri, p, h):
    """Add a point that sees a single edge of the hull, half-edge ``h``."""
    reg = tri.reg
    reg.ring = 0
    reg.open = 1
    o = 3 * (h // 3)
    if in_circle(tri, np.int64(tri.origin[o]), np.int64(tri.origin[o + 1]), np.int64(tri.origin[o + 2]), p):
        _mark(tri, h // 3)
        _carve(tri, p, h, 1)
    else:
        tri.ring[0] = tri.origin[following(h)]
        tri.far[0] = tri.origin[h]
        tri.outer[0] = h
        reg.ring = 1
        reg.cavity = 0
    fan(tri, p)


@kernel
def hull_of(tri: Triangulation, order: IntVector, hull: Int32Vector) -> int:
    """List the corners of the convex hull, anticlockwise; returns their number. ``order`` goes by x, then y."""
    count = 0
    for turn in range(2):
        start = count
        for i in range(len(order)):
            p = order[i] if turn == 0 else order[len(order) - 1 - i]
            while count >= start + 2 and orientation(tri, np.int64(hull[count - 2]), np.int64(hull[count - 1]), p) <= 0:
                count -= 1
            hull[count] = p
            count += 1
        count -= 1
    return count


@kernel
def build_hull(
    tri: Triangulation, hull: Int32Vector, order: Int32Vector, before: Int32Vector, after: Int32Vector
) -> None:
    """Triangulate the corners of the hull, one by one, each from beyond the edge between its neighbours.

    ``hull`` lists them anticlockwise, ``order`` by rank. ``before`` and ``after`` are scratch space.
    """
    count = len(hull)
    for i in range(count):
        before[hull[i]] = hull[(i + count - 1) % count]
        after[hull[i]] = hull[(i + 1) % count]
    for i in range(count - 1, 2, -1):
        p = order[i]
        after[before[p]] = after[p]
        before[after[p]] = before[p]
    a = np.int64(order[0])
    t = allot(tri, a, np.int64(after[a]), np.int64(before[a]))
    for i in range(3):
        tri.leaving[tri.origin[3 * t + i]] = 3 * t + i
    tri.reg.last = t
    for i in range(3, count):
        p = np.int64(order[i])
        h = np.int64(tri.leaving[before[p]])
        # the half-edge along the hull
        while tri.twin[h] >= 0:
            h = following(np.int64(tri.twin[h]))
        _insert_outside(tri, p, h)


@kernel
def insert_all(tri: Triangulation, order: Int32Vector, most: int) -> int:
    """Add those points of a list that are missing, all inside the hull; returns how many were visited.

    Stops early once ``most`` triangles have been visited.
    """
    for i in range(len(order)):
        if tri.leaving[order[i]] < 0:
            if tri.reg.work > most:
                return i
            insert_inside(tri, np.int64(order[i]))
    return len(order)


@kernel
def remove(tri: Triangulation, v: int) -> bool:
    """Remove a vertex, unless it is a corner of the hull."""
    gather(tri, v)
    if tri.reg.open and not straight(tri, v):
        return False
    fill(tri)
    replace(tri)
    tri.leaving[v] = NONE
    tri.reg.last = int(tri.cavity[0])
    return True


@inner
def straight(tri, v):
    """Whether a vertex whose open star has been gathered is collinear with its neighbours on the hull."""
    return orientation(tri, v, np.int64(tri.ring[0]), np.int64(tri.ring[tri.reg.ring - 1])) == 0


def _along_curve(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
    """Positions of points along Hilbert's curve."""
    shift = max(int(max(x.max(initial=0), y.max(initial=0))).bit_length() - _HILBERT, 0)
    u, v = x >> shift, y >> shift
    out = np.zeros(len(x), np.int64)
    for bit in range(_HILBERT - 1, -1, -1):
        right, up = u >> bit & 1, v >> bit & 1
        out = out << 2 | (3 * right ^ up)
        turned, low = up == 0, (1 << bit) - 1
        flipped = turned & (right == 1)
        u, v = np.where(flipped, low - (u & low), u & low), np.where(flipped, low - (v & low), v & low)
        u, v = np.where(turned, v, u), np.where(turned, u, v)
    return out


def insertion_order(x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int32]:
    """Order points in rounds of rising rank, each along Hilbert's curve: near to the last, and not chosen by a file."""
    place = _along_curve(x, y)
    ends = [0]
    while ends[-1] < len(x):
        ends.append(min(max(_FIRST, _ROUND * ends[-1]), len(x)))
    rounds = [a + np.argsort(place[a:b], kind="stable") for a, b in pairwise(ends)]
    return np.concatenate(rounds).astype(np.int32) if rounds else np.zeros(0, np.int32)


def hull_alone(x: NDArray[np.int64], y: NDArray[np.int64]) -> tuple[Triangulation, NDArray[np.int32]]:
    """Triangulate the corners of the hull of distinct points, and list them anticlockwise: fewer than 3 on a line."""
    tri, room = empty(x, y), np.zeros(2 * len(x) + 2, np.int32)
    hull = room[: hull_of(tri, np.lexsort((y, x)), room) if len(x) > 2 else 0].copy()
    if len(hull) > 2:
        build_hull(tri, hull, np.sort(hull), np.zeros(len(x), np.int32), np.zeros(len(x), np.int32))
    return tri, hull


def delaunay(x: NDArray[np.int64], y: NDArray[np.int64], most: int = 1 << 62) -> tuple[Triangulation, int]:
    """Triangulate distinct points with coordinates from 0 to below ``2**28``, in the order of `rank.by_rank`.

    Stops once ``most`` triangles have been visited, and returns the number of points inserted, too. Raises `InputError`
    if all points lie on a line.
    """
    tri, hull = hull_alone(x, y)
    if len(hull) < 3:
        raise InputError("all points lie on a line", code="collinear", remedy="give three that do not")
    return tri, insert_all(tri, insertion_order(x, y), most)


def triangles(tri: Triangulation) -> NDArray[np.int32]:
    """List all triangles (T, 3) anticlockwise, the vertex of lowest rank first, in lexicographic order.
    """
    found = tri.origin.reshape(-1, 3)
    found = found[found[:, 0] >= 0]
    first = found.argmin(axis=1)
    found = np.stack([found[np.arange(len(found)), (first + i) % 3] for i in range(3)], axis=1)
    return found[np.lexsort(found.T[::-1])]


def triangulate(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """List the Delaunay triangles (T, 3) of distinct points (N, 2) with coordinates from 0 to below ``2**28``.

    They are anticlockwise (from axis 0 to axis 1), in an order that depends on the positions alone. Raises `InputError`
    if coordinates are out of range, points coincide, or all lie on a line.
    """
    if len(points) and not (points.min() >= 0 and points.max() < 1 << BITS):
        raise InputError(f"coordinates outside of 0 to 2**{BITS} - 1", code="range")
    order = by_rank(points[:, 0], points[:, 1])
    x, y = points[order].T
    if np.any((x[1:] == x[:-1]) & (y[1:] == y[:-1])):
        raise InputError("points coincide", code="coincident", remedy="merge them")
    return order[triangles(delaunay(x, y)[0])]
