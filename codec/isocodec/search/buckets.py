"""Pieces of a curve or surface sorted into buckets, to find those near a place or a piece (docs/encoders.md, 3).

A piece is proven to lie within a limit of the others if all its vertices lie within the limit of one segment or
triangle (distance to a convex set is convex); otherwise it is halved. What is not proven counts as too far: bounds err
on the safe side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inner, kernel, record
from ..kernel.types import BoolVector, FloatMatrix, FloatVector, Int32Vector, IntVector, IntVolume
from .piece import apart, closest, crossing, halve, near

SMALLEST = 1e-3
"""Radius, in cells, below which a piece is not halved again: distances are certain to twice that."""
SLACK = 1e-9
"""Share of a bound that rounding may take."""
STACK = 64
"""Pieces that wait for their proof at most, when they are halved."""


@record
class Buckets(NamedTuple):
    """Pieces, and cubes of ``size`` cells that list those within ``limit`` of any place in them.

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
    size, limit : float
    """

    flat: FloatVector
    ball: FloatMatrix
    low: FloatVector
    shape: IntVector
    first: IntVector
    items: Int32Vector
    size: float
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
def sort(
    pieces: FloatMatrix, low: FloatVector, size: float, reach: float, place: IntVolume, items: Int32Vector
) -> None:
    """Move each bucket's ``place`` on by the pieces that come within ``reach`` of it.

    They are listed there, unless ``items`` is empty: then they are but counted.
    """
    for i in range(len(pieces)):
        x, y, z = (
            _span(pieces, i, 0, low, size, reach),
            _span(pieces, i, 1, low, size, reach),
            _span(pieces, i, 2, low, size, reach),
        )
        for p in range(max(x[0], 0), min(x[1], place.shape[0] - 1) + 1):
            for q in range(max(y[0], 0), min(y[1], place.shape[1] - 1) + 1):
                for r in range(max(z[0], 0), min(z[1], place.shape[2] - 1) + 1):
                    if len(items):
                        items[place[p, q, r]] = i
                    place[p, q, r] += 1


@inner
def _span(pieces, i, axis, low, size, reach):
    a, b, c = pieces[i, axis], pieces[i, 3 + axis], pieces[i, 6 + axis]
    return (
        int(np.floor((min(a, b, c) - reach - low[axis]) / size)),
        int(np.floor((max(a, b, c) + reach - low[axis]) / size)),
    )


@inner
def bucket_of(buckets, x, y, z):
    """The bucket that holds a place, -1 outside of all."""
    p = int(np.floor((x - buckets.low[0]) / buckets.size))
    q = int(np.floor((y - buckets.low[1]) / buckets.size))
    r = int(np.floor((z - buckets.low[2]) / buckets.size))
    s0, s1, s2 = buckets.shape[0], buckets.shape[1], buckets.shape[2]
    if 0 <= p < s0 and 0 <= q < s1 and 0 <= r < s2:
        return (p * s1 + q) * s2 + r
    return -1


@inner
def unproven(buckets, stack, last):
    """Whether the piece in the first row of ``stack`` is not proven to lie within the limit.

    Also where that shows: the row of the stack with a piece whose centre does. ``last`` is the place in ``flat`` of
    what proved the piece before, which proves this one, too, more often than not; it is returned, brought up to date.
    """
    limit = buckets.limit
    squared = limit * limit
    depth = 1
    while depth > 0:
        depth -= 1
        o = stack[depth]
        x, y, z = (o[0] + o[3] + o[6]) / 3.0, (o[1] + o[4] + o[7]) / 3.0, (o[2] + o[5] + o[8]) / 3.0
        radius = np.sqrt(max(apart(o, 0, x, y, z), apart(o, 3, x, y, z), apart(o, 6, x, y, z)))
        found = proven = last >= 0 and _far_corner(buckets.flat, last, o, 0, squared) < 0
        bucket = -1 if proven else bucket_of(buckets, x, y, z)
        if bucket >= 0:
            far = 0
            for k in range(buckets.first[bucket], buckets.first[bucket + 1]):
                item = np.int64(buckets.items[k])
                if _beyond(buckets.ball, item, x, y, z, limit):
                    continue
                if found:
                    if _useless(buckets.ball, item, o, x, y, z, radius, limit):
                        continue
                elif near(buckets.flat, 9 * item, x, y, z) > squared:
                    continue
                found = True
                # the corner that the one before did not reach is likely beyond the next one, too
                corner = _far_corner(buckets.flat, 9 * item, o, far, squared)
                if corner < 0:
                    proven, last = True, 9 * item
                    break
                far = corner
        if proven:
            continue
        if not found or radius < SMALLEST or depth + 2 > len(stack):
            return True, depth, last
        halve(stack, depth)
        depth += 2
    return False, 0, last


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


@kernel
def cross(source: FloatMatrix, buckets: Buckets, out: BoolVector, places: FloatMatrix) -> None:
    """Mark in ``out`` the segments of a plane that cross one of the sorted ones, inside both; where they do."""
    s0, s1, s2 = buckets.shape[0], buckets.shape[1], buckets.shape[2]
    for i in range(len(source)):
        x = _span(source, i, 0, buckets.low, buckets.size, 0.0)
        y = _span(source, i, 1, buckets.low, buckets.size, 0.0)
        for p in range(max(x[0], 0), min(x[1], s0 - 1) + 1):
            for q in range(max(y[0], 0), min(y[1], s1 - 1) + 1):
                bucket = (p * s1 + q) * s2
                for k in range(buckets.first[bucket], buckets.first[bucket + 1]):
                    share = crossing(source, i, buckets.flat, 9 * np.int64(buckets.items[k]))
                    if share > 0.0 and not out[i]:
                        out[i] = True
                        for axis in range(3):
                            places[i, axis] = source[i, axis] + share * (source[i, 3 + axis] - source[i, axis])


@inner
def _far_corner(flat, j, o, first, squared):
    """The first corner of a piece, beginning at ``first``, that is too far from one of the target's pieces.

    If no corner is, -1: the target's piece proves this one.
    """
    for i in range(first, first + 9, 3):
        corner = i if i < 9 else i - 9
        if near(flat, j, o[corner], o[corner + 1], o[corner + 2]) > squared:
            return corner
    return -1


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
    """The piece next to each point, -1 if none is within the limit, and the weights of its corners 1 and 2."""
    flat, ball = buckets.flat, buckets.ball
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        piece[i] = -1
        bucket = bucket_of(buckets, x, y, z)
        if bucket < 0:
            continue
        best, root = buckets.limit * buckets.limit, buckets.limit
        if i > 0 and piece[i - 1] >= 0:
            # the piece next to the point before is near this one, too: fewer others need a look
            d, s, t = closest(flat, 9 * piece[i - 1], x, y, z)
            if d < best:
                best, root = d, np.sqrt(d)
        for k in range(buckets.first[bucket], buckets.first[bucket + 1]):
            item = np.int64(buckets.items[k])
            if _beyond(ball, item, x, y, z, root):
                continue
            d, s, t = closest(flat, 9 * item, x, y, z)
            if d <= best:
                best, root = d, np.sqrt(d)
                piece[i] = item
                weight[i, 0] = s
                weight[i, 1] = t
