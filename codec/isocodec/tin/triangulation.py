"""A triangulation as half-edges, and the exact tests on its points (spec clause 10.5).

Half-edge ``3 * t + i`` of triangle ``t`` goes from the triangle's corner ``i`` to the next one, anticlockwise. Vertices
are numbered by rank, so comparing numbers compares ranks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, inner, record
from ..kernel.types import Int32Matrix, Int32Vector, Integer, IntVector, Registers, UInt8Vector

NONE = -1
_ONE_WORD = 1 << 14
"""Bound of coordinates up to which the in-circle test stays below 2**63."""
_HALF = 29
_LOW = (1 << _HALF) - 1


class TriangulationCounters(Registers):
    """Numbers of a triangulation.

    Attributes
    ----------
    free : int
        Triangles on the stack of free ones.
    ring, ears : int
        Vertices of the last polygon, and triangles that fill it.
    open : int
        Whether that polygon was closed along the hull.
    cavity : int
        Triangles removed last.
    wide : int
        Whether coordinates need the in-circle test of two words.
    last : int
        Triangle at which the next walk begins.
    work : int
        Triangles visited.
    """

    free: int
    ring: int
    ears: int
    open: int
    cavity: int
    wide: int
    last: int
    work: int


@record
class Triangulation(NamedTuple):
    """Points, half-edges, and scratch space for changes.

    ``origin`` and ``twin`` have an entry per half-edge: its vertex of origin, -1 in free triangles, and the opposite
    half-edge, -1 on the hull. ``leaving`` is a half-edge out of each vertex, -1 for points that are not vertices.
    ``free`` is the stack of free triangles. ``ring`` holds the vertices of a star's polygon, ``outer`` the half-edges
    across its edges, ``far`` the second vertex of each edge, ``cavity`` its triangles, ``mark`` flags them during the
    search, ``ear`` the triangles that fill it: three places in the ring, and the side of the ear that the base
    continues.
    """

    x: IntVector
    y: IntVector
    origin: Int32Vector
    twin: Int32Vector
    leaving: Int32Vector
    free: Int32Vector
    ring: Int32Vector
    far: Int32Vector
    outer: Int32Vector
    cavity: Int32Vector
    mark: UInt8Vector
    ear: Int32Matrix
    reg: TriangulationCounters


def empty(x: NDArray[np.int64], y: NDArray[np.int64]) -> Triangulation:
    """Make an empty triangulation with room for all points; x and y in the order of ranks."""
    count = len(x)
    triangles = 2 * count + 2
    reg = TriangulationCounters()
    reg.free = triangles
    reg.wide = int(max(x.max(initial=0), y.max(initial=0)) >= _ONE_WORD)
    vertex, edges = (lambda: np.zeros(count + 3, np.int32)), (lambda: np.full(3 * triangles, NONE, np.int32))
    return Triangulation(
        np.ascontiguousarray(x, np.int64), np.ascontiguousarray(y, np.int64), edges(), edges(),
        np.full(count, NONE, np.int32), np.arange(triangles, dtype=np.int32)[::-1].copy(), vertex(), vertex(), vertex(),
        np.zeros(triangles, np.int32), np.zeros(triangles, np.uint8), np.zeros((count + 3, 4), np.int32), reg,
    )


@inlined
def orientation(tri, a, b, c):
    """Twice the area of a triangle, greater than 0 if its vertices are anticlockwise."""
    x, y = tri.x, tri.y
    return (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a])


@inlined
def _lifted(x, y):
    return x * x + y * y


@inlined
def _crossed(ax, ay, bx, by):
    return ax * by - ay * bx


@inner
def _two_words(l0, c0, l1, c1, l2, c2):
    """Sign of the sum of products ``l * c``, each factor below 2**58 in absolute value, ``l`` not negative."""
    high = (l0 >> _HALF) * (c0 >> _HALF) + (l1 >> _HALF) * (c1 >> _HALF) + (l2 >> _HALF) * (c2 >> _HALF)
    middle = (
        (l0 >> _HALF) * (c0 & _LOW) + (l0 & _LOW) * (c0 >> _HALF)
        + (l1 >> _HALF) * (c1 & _LOW) + (l1 & _LOW) * (c1 >> _HALF)
        + (l2 >> _HALF) * (c2 & _LOW) + (l2 & _LOW) * (c2 >> _HALF)
    )
    low = (l0 & _LOW) * (c0 & _LOW) + (l1 & _LOW) * (c1 & _LOW) + (l2 & _LOW) * (c2 & _LOW)
    middle += low >> _HALF
    high += middle >> _HALF
    if high != 0:
        return high
    return (middle & _LOW) | (low & _LOW)


@inner
def in_circle(tri, a, b, c, d):
    """Whether ``d`` lies within the circle through the anticlockwise ``a``, ``b``, ``c`` (spec clause 10.5.3).

    On the circle, the lifted point of lowest rank counts as raised by an infinitesimal amount, unless the other three
    are collinear: then the next one.
    """
    x, y = tri.x, tri.y
    ax, ay, bx, by, cx, cy = x[a] - x[d], y[a] - y[d], x[b] - x[d], y[b] - y[d], x[c] - x[d], y[c] - y[d]
    bc, ca, ab = _crossed(bx, by, cx, cy), _crossed(cx, cy, ax, ay), _crossed(ax, ay, bx, by)
    if tri.reg.wide:
        found = _two_words(_lifted(ax, ay), bc, _lifted(bx, by), ca, _lifted(cx, cy), ab)
    else:
        found = _lifted(ax, ay) * bc + _lifted(bx, by) * ca + _lifted(cx, cy) * ab
    if found != 0:
        return found > 0
    # bc, ca, ab are what the determinant grows by if a, b, c are raised; raising d takes their sum
    first = d
    raised = -(bc + ca + ab)
    if bc != 0 and a < first:
        first, raised = a, bc
    if ca != 0 and b < first:
        first, raised = b, ca
    if ab != 0 and c < first:
        raised = ab
    return raised > 0


@inlined
def following(h):
    """Next half-edge of the same triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@inlined
def preceding(h):
    """Previous half-edge of the same triangle."""
    return h + 2 if h % 3 == 0 else h - 1


@inlined
def join(tri, g, h):
    """Link two half-edges, or one and the outside, as twins."""
    if g >= 0:
        tri.twin[g] = h
    if h >= 0:
        tri.twin[h] = g


@inlined
def allot(tri, a, b, c):
    """Give these vertices to a free triangle; the caller sets its twins."""
    reg = tri.reg
    reg.free -= 1
    t = np.int64(tri.free[reg.free])
    tri.origin[3 * t] = a
    tri.origin[3 * t + 1] = b
    tri.origin[3 * t + 2] = c
    return t


@inlined
def release(tri, t):
    """Free a triangle."""
    reg = tri.reg
    for i in range(3):
        tri.origin[3 * t + i] = NONE
        tri.twin[3 * t + i] = NONE
    tri.free[reg.free] = t
    reg.free += 1


@inner
def gather(tri, v):
    """List the polygon around a vertex, anticlockwise: its vertices, the half-edges across, and the star's triangles.

    Around a vertex on the hull the polygon is open: its last vertex begins no edge.
    """
    reg = tri.reg
    first = np.int64(tri.leaving[v])
    h = first
    reg.open = 0
    while True:
        g = np.int64(tri.twin[h])
        if g < 0:
            reg.open = 1
            break
        h = following(g)
        if h == first:
            break
    first = h
    count = 0
    while True:
        rim = following(h)
        tri.ring[count] = tri.origin[rim]
        tri.outer[count] = tri.twin[rim]
        tri.cavity[count] = h // 3
        count += 1
        back = preceding(h)
        h = np.int64(tri.twin[back])
        if h < 0:
            tri.ring[count] = tri.origin[back]
            break
        if h == first:
            break
    reg.cavity = count
    reg.ring = count + reg.open
    reg.work += count


@inner
def fill(tri):
    """Fill the gathered polygon with Delaunay triangles, as ears (spec clause 10.5.1).

    Starting from the base edge, which ends where the polygon begins, the apex of each ear is the vertex whose circle
    through the base contains no other; the ear's other sides are bases in turn.
    """
    reg, ear, ring = tri.reg, tri.ear, tri.ring
    # a row that waits is an ear without its apex
    ear[0, 0], ear[0, 2], ear[0, 3] = 0, reg.ring - 1, NONE
    count, done = 1, 0
    while done < count:
        i, j = np.int64(ear[done, 0]), np.int64(ear[done, 2])
        k: Integer = i
        for m in range(i + 1, j):
            if orientation(tri, ring[i], ring[m], ring[j]) > 0 and (
                k == i or in_circle(tri, ring[i], ring[k], ring[j], ring[m])
            ):
                k = m
        ear[done, 1] = k
        if k > i + 1:
            ear[count, 0], ear[count, 2], ear[count, 3] = i, k, 3 * done
            count += 1
        if j > k + 1:
            ear[count, 0], ear[count, 2], ear[count, 3] = k, j, 3 * done + 1
            count += 1
        done += 1
        reg.work += j - i
    reg.ears = count


@inlined
def beyond_base(tri):
    """Half-edge across the polygon's base edge: the hull, if it is open."""
    return np.int64(NONE) if tri.reg.open else np.int64(tri.outer[tri.reg.ring - 1])


@inner
def replace(tri):
    """Replace the gathered triangles by the ears; ``cavity`` then lists the new triangles, ear by ear."""
    reg, ear, ring = tri.reg, tri.ear, tri.ring
    base = beyond_base(tri)
    for old in range(reg.cavity):
        release(tri, np.int64(tri.cavity[old]))
    for e in range(reg.ears):
        i, k, j = np.int64(ear[e, 0]), np.int64(ear[e, 1]), np.int64(ear[e, 2])
        t = allot(tri, ring[i], ring[k], ring[j])
        tri.cavity[e] = t
        parent = np.int64(ear[e, 3])
        if parent < 0:
            join(tri, 3 * t + 2, base)
        else:
            join(tri, 3 * t + 2, 3 * np.int64(tri.cavity[parent // 3]) + parent % 3)
        if k == i + 1:
            join(tri, 3 * t, np.int64(tri.outer[i]))
        if j == k + 1:
            join(tri, 3 * t + 1, np.int64(tri.outer[k]))
        tri.leaving[ring[i]] = 3 * t
        tri.leaving[ring[k]] = 3 * t + 1
        tri.leaving[ring[j]] = 3 * t + 2
    reg.cavity = reg.ears
