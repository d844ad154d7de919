"""Pieces of a curve or surface sorted into buckets, and which of them lies near a place or a piece (spec annex G.3).

A piece is proven to lie within a limit of the others if all its vertices lie within the limit of one segment or
triangle (distance to a convex set is convex), or if its centre does with the piece's radius to spare; otherwise it is
halved. What is not proven counts as too far: bounds err on the safe side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inner, kernel, record
from ..kernel.types import BoolVector, FloatMatrix, FloatVector, Int32Vector, IntVector, IntVolume
from .piece import apart, closest, halve, near

SMALLEST = 1e-3
"""Radius, in cells, below which a piece is not halved again: distances are certain to twice that."""
SLACK = 1e-9
"""What rounding may take from a bound."""
FLAT = 1e-6
"""Area below which a triangle has no normal that is certain, and what rounding may take from places along one."""
STACK = 64
"""Pieces that wait for their proof at most, when they are halved."""


@record
class Buckets(NamedTuple):
    """Pieces, and cubes of ``size`` cells that list those that pass through them.

    Attributes
    ----------
    flat : (9 M,) float64
        Corners of the pieces, one after the other.
    ball : (M, 4) float64
        Centre and radius of a ball around each.
    low : (3,) float64
        Lower corner of the first bucket.
    shape : (3,) int64
        Buckets along each axis.
    first : (buckets + 1,) int64
        The pieces of bucket b are ``items[first[b] : first[b + 1]]``.
    items : int32 vector
    size : float
    widest : float
        Radius of the largest ball.
    limit : float
        How far away pieces are looked for.
    """

    flat: FloatVector
    ball: FloatMatrix
    low: FloatVector
    shape: IntVector
    first: IntVector
    items: Int32Vector
    size: float
    widest: float
    limit: float


@kernel
def balls(pieces: FloatMatrix, ball: FloatMatrix) -> None:
    """Centre and radius of a ball around each piece."""
    for i in range(len(pieces)):
        o = pieces[i]
        radius = 0.0
        for axis in range(3):
            u, v, w = o[axis], o[3 + axis], o[6 + axis]
            low, high = min(u, v, w), max(u, v, w)
            ball[i, axis] = (low + high) / 2
        x, y, z = ball[i, 0], ball[i, 1], ball[i, 2]
        for corner in range(0, 9, 3):
            radius = max(radius, apart(o, corner, x, y, z))
        ball[i, 3] = np.sqrt(radius)


@kernel
def sort(pieces: FloatMatrix, low: FloatVector, size: float, place: IntVolume, items: Int32Vector) -> None:
    """Move each bucket's ``place`` on by the pieces that pass through it.

    They are listed there, unless ``items`` is empty: then they are but counted.
    """
    for i in range(len(pieces)):
        x, y, z = (
            _span(pieces, i, 0, low, size, place.shape[0]),
            _span(pieces, i, 1, low, size, place.shape[1]),
            _span(pieces, i, 2, low, size, place.shape[2]),
        )
        n0, n1, n2 = _normal(pieces[i])
        reach = (0.5 * size + FLAT) * (abs(n0) + abs(n1) + abs(n2))
        for p in range(x[0], x[1] + 1):
            a0 = n0 * (low[0] + (p + 0.5) * size - pieces[i, 0])
            for q in range(y[0], y[1] + 1):
                a1 = a0 + n1 * (low[1] + (q + 0.5) * size - pieces[i, 1])
                for r in range(z[0], z[1] + 1):
                    # the plane of a large triangle passes by most buckets of its box
                    if abs(a1 + n2 * (low[2] + (r + 0.5) * size - pieces[i, 2])) > reach:
                        continue
                    if len(items):
                        items[place[p, q, r]] = i
                    place[p, q, r] += 1


@inner
def _span(pieces, i, axis, low, size, count):
    a, b, c = pieces[i, axis], pieces[i, 3 + axis], pieces[i, 6 + axis]
    return (
        max(int(np.floor((min(a, b, c) - SLACK - low[axis]) / size)), 0),
        min(int(np.floor((max(a, b, c) + SLACK - low[axis]) / size)), count - 1),
    )


@inner
def _normal(o):
    """Unit normal of a triangle, 0 of a segment and of one that is nearly one."""
    u0, u1, u2 = o[3] - o[0], o[4] - o[1], o[5] - o[2]
    v0, v1, v2 = o[6] - o[0], o[7] - o[1], o[8] - o[2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if length < FLAT:
        return 0.0, 0.0, 0.0
    return n0 / length, n1 / length, n2 / length


@inner
def _cell(buckets, x, y, z):
    """The bucket that holds a place, along each axis; it may lie outside of all."""
    return (
        int(np.floor((x - buckets.low[0]) / buckets.size)),
        int(np.floor((y - buckets.low[1]) / buckets.size)),
        int(np.floor((z - buckets.low[2]) / buckets.size)),
    )


@inner
def _off(buckets, axis, p, x):
    """Squared distance along an axis from a place to the buckets in row p."""
    low = buckets.low[axis] + p * buckets.size
    d = max(low - x, x - low - buckets.size, 0.0)
    return d * d


@inner
def _within(buckets, c, x, y, z):
    """Distance from a place to the nearest side of its bucket c."""
    out = buckets.size
    for axis in range(3):
        p = c[0] if axis == 0 else (c[1] if axis == 1 else c[2])
        u = x if axis == 0 else (y if axis == 1 else z)
        low = buckets.low[axis] + p * buckets.size
        out = min(out, u - low, low + buckets.size - u)
    return max(out, 0.0)


@inner
def unproven(buckets, stack, last):
    """Whether the piece in the first row of ``stack`` is not proven to lie within the limit.

    Also where that shows: the row of the stack with a piece whose centre does. ``last`` is the place in ``flat`` of
    what proved the piece before, which proves this one, too, more often than not; it is returned, brought up to date.
    """
    limit = buckets.limit
    depth = 1
    while depth > 0:
        depth -= 1
        o = stack[depth]
        x, y, z = (o[0] + o[3] + o[6]) / 3.0, (o[1] + o[4] + o[7]) / 3.0, (o[2] + o[5] + o[8]) / 3.0
        radius = np.sqrt(max(apart(o, 0, x, y, z), apart(o, 3, x, y, z), apart(o, 6, x, y, z)))
        found = False
        if last >= 0:
            d = near(buckets.flat, last, x, y, z)
            found = d <= limit * limit
            if _proves(buckets.flat, last, o, radius, d, limit):
                continue
        found, item = _prover(buckets, o, (x, y, z), radius, found)
        if item >= 0:
            last = 9 * item
        elif not found or radius < SMALLEST or depth + 2 > len(stack):
            return True, depth, last
        else:
            halve(stack, depth)
            depth += 2
    return False, 0, last


@inner
def _prover(buckets, o, centre, radius, found):
    """Whether a piece's centre is within the limit of any other, and one that proves the piece, or -1."""
    x, y, z = centre
    limit = buckets.limit
    squared = limit * limit
    # no piece of the target is as long as that takes
    long = radius > limit and _longest(o) > 2.0 * (limit + buckets.widest) + SLACK
    s0, s1, s2 = buckets.shape[0], buckets.shape[1], buckets.shape[2]
    c = _cell(buckets, x, y, z)
    within = _within(buckets, c, x, y, z)
    far = squared + SLACK
    ring = 0
    while not (found and long) and (ring == 0 or (ring - 1) * buckets.size + within <= limit + SLACK):
        for p in range(max(c[0] - ring, 0), min(c[0] + ring, s0 - 1) + 1):
            off0 = _off(buckets, 0, p, x)
            for q in range(max(c[1] - ring, 0), min(c[1] + ring, s1 - 1) + 1):
                off1 = off0 + _off(buckets, 1, q, y)
                if off1 > far:
                    continue
                side = ring == 0 or abs(p - c[0]) == ring or abs(q - c[1]) == ring
                for r in range(c[2] - ring, c[2] + ring + 1, 1 if side else 2 * ring):
                    if r < 0 or r >= s2 or off1 + _off(buckets, 2, r, z) > far:
                        continue
                    b = (p * s1 + q) * s2 + r
                    for k in range(buckets.first[b], buckets.first[b + 1]):
                        item = np.int64(buckets.items[k])
                        if _beyond(buckets.ball, item, x, y, z, limit):
                            continue
                        if found and _useless(buckets.ball, item, o, x, y, z, radius, limit):
                            continue
                        d = near(buckets.flat, 9 * item, x, y, z)
                        found = found or d <= squared
                        if _proves(buckets.flat, 9 * item, o, radius, d, limit):
                            return True, item
        ring += 1
    return found, np.int64(-1)


@inner
def _longest(o):
    """Length of a piece's longest side."""
    return np.sqrt(max(apart(o, 0, o[3], o[4], o[5]), apart(o, 0, o[6], o[7], o[8]), apart(o, 3, o[6], o[7], o[8])))


@kernel
def exceed(source: FloatMatrix, buckets: Buckets, stack: FloatMatrix, out: BoolVector, places: FloatMatrix) -> None:
    """Mark in ``out`` the pieces of the source that are not proven to lie within the limit; places of them."""
    last = np.int64(-1)
    for i in range(len(source)):
        for k in range(9):
            stack[0, k] = source[i, k]
        far, row, last = unproven(buckets, stack, last)
        if far:
            out[i] = True
            for axis in range(3):
                places[i, axis] = (stack[row, axis] + stack[row, 3 + axis] + stack[row, 6 + axis]) / 3.0


@inner
def _proves(flat, j, o, radius, d, limit):
    """Whether one of the target's pieces, at the squared distance ``d`` from the centre, proves a piece."""
    if np.sqrt(d) + radius <= limit:
        return True
    squared = limit * limit
    return (
        d <= squared
        and near(flat, j, o[0], o[1], o[2]) <= squared
        and near(flat, j, o[3], o[4], o[5]) <= squared
        and near(flat, j, o[6], o[7], o[8]) <= squared
    )


@inner
def _useless(ball, item, o, x, y, z, radius, limit):
    """Whether one of the target's pieces certainly does not prove a piece, by the ball around it."""
    return (radius > limit or _beyond(ball, item, x, y, z, limit - radius)) and (
        _beyond(ball, item, o[0], o[1], o[2], limit)
        or _beyond(ball, item, o[3], o[4], o[5], limit)
        or _beyond(ball, item, o[6], o[7], o[8], limit)
    )


@inner
def _beyond(ball, item, x, y, z, limit):
    """Whether a piece is certainly farther from a point than the limit, by the ball around it."""
    u, v, w = ball[item, 0] - x, ball[item, 1] - y, ball[item, 2] - z
    far = limit + ball[item, 3] + SLACK
    return u * u + v * v + w * w > far * far


@kernel
def nearest(points: FloatMatrix, buckets: Buckets, piece: IntVector, weight: FloatMatrix) -> None:
    """The piece next to each point, -1 if none is within the limit, and the weights of its corners 1 and 2.

    Of several at the same distance that of the highest number. ``piece`` holds a guess for each point, or -1.
    """
    held = np.int64(-1)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        best, found = buckets.limit * buckets.limit, np.int64(-1)
        # what is near the point before is mostly near this one, too: fewer buckets need a look
        for turn in range(2):
            item = piece[i] if turn == 0 else held
            if item >= 0 and item != found:
                best, found = _nearer(buckets, item, x, y, z, best, found)
        found = _searched(buckets, x, y, z, best, found)
        piece[i] = found
        if found >= 0:
            held = found
            _, weight[i, 0], weight[i, 1] = closest(buckets.flat, 9 * found, x, y, z)


@inner
def _nearer(buckets, item, x, y, z, best, found):
    """The smaller of the squared distances of a piece and of the best one so far, and which it is."""
    d = near(buckets.flat, 9 * item, x, y, z)
    if d < best or (d == best and item > found):
        return d, item
    return best, found


@inner
def _searched(buckets, x, y, z, best, found):
    """The piece that is nearest to a place, bucket by bucket outwards, if it is nearer than ``found``."""
    s0, s1, s2 = buckets.shape[0], buckets.shape[1], buckets.shape[2]
    c = _cell(buckets, x, y, z)
    within = _within(buckets, c, x, y, z)
    root = np.sqrt(best) + SLACK
    far = root * root
    ring = 0
    while ring == 0 or (ring - 1) * buckets.size + within <= root:
        for p in range(max(c[0] - ring, 0), min(c[0] + ring, s0 - 1) + 1):
            off0 = _off(buckets, 0, p, x)
            for q in range(max(c[1] - ring, 0), min(c[1] + ring, s1 - 1) + 1):
                off1 = off0 + _off(buckets, 1, q, y)
                if off1 > far:
                    continue
                side = ring == 0 or abs(p - c[0]) == ring or abs(q - c[1]) == ring
                for r in range(c[2] - ring, c[2] + ring + 1, 1 if side else 2 * ring):
                    if r < 0 or r >= s2 or off1 + _off(buckets, 2, r, z) > far:
                        continue
                    b = (p * s1 + q) * s2 + r
                    for k in range(buckets.first[b], buckets.first[b + 1]):
                        item = np.int64(buckets.items[k])
                        if item == found or _beyond(buckets.ball, item, x, y, z, root):
                            continue
                        now, at = _nearer(buckets, item, x, y, z, best, found)
                        if at != found:
                            best, found = now, at
                            root = np.sqrt(best) + SLACK
                            far = root * root
        ring += 1
    return found
