"""Check that the curve stays near enough when a vertex goes (rows C2-distortion, S3-distortion; docs/encoders.md, 2).

Each point of the original curve is carried along with the place of the coarser curve that is nearest to it: whenever
the diamond around that place is drawn anew, the point is held against the new pieces. The other way, each new piece is
held against the original. Points are those that a decoder will have. What this leaves open (pieces of the original
between its points, and implied points that other diamonds move later) the proof on the decoded curve looks after.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..grid.lattice.access import corners as corner_count
from ..grid.lattice.access import dimension, member
from ..grid.lattice.access import members as member_count
from ..grid.lattice.grid import clamped
from ..kernel import inner, kernel, record
from ..kernel.types import Float32Matrix, FloatMatrix, IntMatrix, IntVector
from .buckets import Buckets, unproven
from .edges import told_on
from .piece import closest
from .reduced import FAILED, LINEAR_POINTS, Domain, corner_at, diamond_at, flags_of, place_of, set_flags

_place_of = inner(place_of)
MOST_PIECES = 16
_INWARDS = 1.0 / 64.0
"""Share of the way that places on pieces move to the pieces' centres, to lie inside simplices rather than between."""


@record
class Carried(NamedTuple):
    """Points of the original curve, and the places nearest to them on the coarser one.

    Attributes
    ----------
    points, places : (P, 3) float32
    moved : (P, 3) float32
        Room for places to come.
    order : (P,) int64
        Numbers of the points, those of one diamond one after the other.
    spans : (D, 2) int64
        Where those of each diamond begin and end.
    stack : (S, 9) float64
        Room for pieces.
    """

    points: Float32Matrix
    places: Float32Matrix
    moved: Float32Matrix
    order: IntVector
    spans: IntMatrix
    stack: FloatMatrix


@inner
def _crossing(dm, diamond, i, j):
    """Point that a decoder has on the edge between two corners, from the lexicographically smaller one."""
    p = corner_at(dm, diamond, i)
    q = corner_at(dm, diamond, j)
    p = clamped(dm.grid, p[0], p[1], p[2])
    q = clamped(dm.grid, q[0], q[1], q[2])
    if p[0] > q[0] or (p[0] == q[0] and (p[1] > q[1] or (p[1] == q[1] and p[2] > q[2]))):
        p, q = q, p
    s = told_on(dm, p, q)
    return p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), p[2] + s * (q[2] - p[2])


@inner
def _implied(dm, diamond):
    """Point on the subdivision edge of a whole diamond, which follows from those at the ring (clause 9.5)."""
    count = corner_count(dm.grid.tables, diamond.kind)
    above = diamond.above
    a = corner_at(dm, diamond, np.int64(0))
    b = corner_at(dm, diamond, np.int64(1))
    total, pairs = 0.0, 0
    for i in range(2, count):
        c = corner_at(dm, diamond, np.int64(i))
        for j in range(i + 1, count):
            d = corner_at(dm, diamond, np.int64(j))
            if c[0] + d[0] != a[0] + b[0] or c[1] + d[1] != a[1] + b[1] or c[2] + d[2] != a[2] + b[2]:
                continue
            at_a = (above >> i) & 1 != above & 1
            p = _crossing(dm, diamond, np.int64(0 if at_a else 1), np.int64(i))
            s = _fraction(a if at_a else b, c, p)
            x_one = 0.0 if at_a else 1.0 - s
            at_a = (above >> j) & 1 != above & 1
            p = _crossing(dm, diamond, np.int64(0 if at_a else 1), np.int64(j))
            u = _fraction(a if at_a else b, d, p)
            x_two = u if at_a else 1.0
            # both at the ends themselves, where samples equal the isovalue
            total += (x_one * u + x_two * s) / (s + u) if s + u > 0.0 else 0.5 * (x_one + x_two)
            pairs += 1
    s = total / pairs if pairs else 0.5
    return a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])


@inner
def _fraction(p, q, x):
    """Fraction of the way from p to q at which the point x lies."""
    for axis in range(3):
        if q[axis] != p[axis]:
            return (x[axis] - p[axis]) / (q[axis] - p[axis])
    return 0.5


@inner
def pieces_of(dm, diamond):
    """Pieces of the curve in the members of a diamond: triples of points in ``Domain.room``; their number.

    In two dimensions the third point is the second.
    """
    t = dm.grid.tables
    n = dimension(t)
    kind, members, above = diamond.kind, diamond.members, diamond.above
    out = dm.room
    count = 0
    split = (above & 1) != (above >> 1) & 1
    e = (0.0, 0.0, 0.0)
    if split:
        if diamond.whole and dm.parts != LINEAR_POINTS:
            e = _implied(dm, diamond)
        else:
            e = _crossing(dm, diamond, np.int64(0), np.int64(1))
    for m in range(member_count(t, kind)):
        bits = member(t, kind, m)[4]
        if not (members >> m) & 1 or above & bits == 0 or above & bits == bits:
            continue
        # points of this member's crossed edges, so that neighbours share a vertex: above by above
        used = 0
        base = 9 * MOST_PIECES
        for i in range(corner_count(t, kind)):
            if not (bits >> i) & 1 or not (above >> i) & 1:
                continue
            for j in range(corner_count(t, kind)):
                if not (bits >> j) & 1 or (above >> j) & 1:
                    continue
                p = e
                if i > 1 or j > 1:
                    p = _crossing(dm, diamond, np.int64(i), np.int64(j))
                for axis in range(3):
                    out[base + 3 * used + axis] = p[axis]
                used += 1
        # two, three, or four points: in the last case rows (0, 1) and (2, 3) share a vertex each
        for k in range(used - 2 if n == 3 else 1):
            for axis in range(3):
                out[9 * count + axis] = out[base + 3 * k + axis]
                out[9 * count + 3 + axis] = out[base + 3 * (k + 1) + axis]
                out[9 * count + 6 + axis] = out[base + 3 * (k + 2 if n == 3 else k + 1) + axis]
            count += 1
    return count


@inner
def _forward(dm, count, carried, span, squared):
    """Whether the points of a diamond lie near enough to its ``count`` pieces; their places to come in ``moved``."""
    out = dm.room
    held = 0
    for i in range(carried.spans[span, 0], carried.spans[span, 1]):
        p = carried.order[i]
        x, y, z = np.float64(carried.points[p, 0]), np.float64(carried.points[p, 1]), np.float64(carried.points[p, 2])
        best, s, r = np.inf, 0.0, 0.0
        if held < count:
            # neighbouring points mostly lie near the same piece
            best, s, r = closest(out, 9 * held, x, y, z)
        for k in range(count):
            if k != held and _reaches(out, 9 * k, x, y, z, best):
                d, u, v = closest(out, 9 * k, x, y, z)
                if d < best:
                    best, s, r, held = d, u, v, k
        if best > squared:
            return False
        for axis in range(3):
            a, b, c = out[9 * held + axis], out[9 * held + 3 + axis], out[9 * held + 6 + axis]
            at = a + s * (b - a) + r * (c - a)
            carried.moved[p, axis] = at + _INWARDS * ((a + b + c) / 3.0 - at)
    return True


@inner
def _reaches(out, o, x, y, z, squared):
    """Whether a piece may lie within a squared distance of a point: its box does."""
    total = 0.0
    for axis in range(3):
        p = x if axis == 0 else (y if axis == 1 else z)
        a, b, c = out[o + axis], out[o + 3 + axis], out[o + 6 + axis]
        d = max(min(a, b, c) - p, p - max(a, b, c), 0.0)
        total += d * d
    return total < squared


@inner
def _backward(dm, count, original, stack):
    """Whether the first ``count`` pieces of the room are proven to lie near the original."""
    last = np.int64(-1)
    for k in range(count):
        for i in range(9):
            stack[0, i] = dm.room[9 * k + i]
        far, _, last = unproven(original, stack, last)
        if far:
            return False
    return True


@kernel
def too_far(dm: Domain, opened: IntVector, carried: Carried, original: Buckets, limit: float) -> int:
    """Mark the diamonds of ``opened`` (middles as numbers) where the curve would get too far from the original.

    A point of that farther than ``limit`` from the new pieces, or a new piece farther than its own limit from it.
    Where neither is, the points move on to the new pieces. Returns the number of diamonds that failed.
    """
    n = dimension(dm.grid.tables)
    level = np.int64(dm.counters.level)
    squared = limit * limit
    failed = 0
    for i in range(len(opened)):
        x, y, z = _place_of(n, opened[i])
        bits = flags_of(dm, x, y, z)
        if bits & FAILED:
            continue
        count = pieces_of(dm, diamond_at(dm, level, x, y, z))
        if _forward(dm, count, carried, i, squared) and _backward(dm, count, original, carried.stack):
            for j in range(carried.spans[i, 0], carried.spans[i, 1]):
                p = carried.order[j]
                for axis in range(3):
                    carried.places[p, axis] = carried.moved[p, axis]
        else:
            set_flags(dm, x, y, z, bits | FAILED)
            failed += 1
    return failed
