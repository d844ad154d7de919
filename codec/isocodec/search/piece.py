"""Segments and triangles as nine numbers, three corners of three axes: distances from points, and halves.

A segment has its second point twice.
"""

from __future__ import annotations

import numpy as np

from ..kernel import inner

TOUCH = 1e-9
"""A segment that reaches this far beyond another one only touches it."""
SLIVER = 1e-12
"""Squared area, as a share of the product of two squared sides, up to which a triangle is a sliver."""


@inner
def closest(out, o, x, y, z):
    """The point of the triangle, or segment, at ``o`` that is nearest: squared distance, weights of corners 1 and 2.

    Signs decide between corners and sides: at most one division. Rounding may take another point of the piece, which
    is farther away, if anything.
    """
    a0, a1, a2 = out[o], out[o + 1], out[o + 2]
    u0, u1, u2 = out[o + 3] - a0, out[o + 4] - a1, out[o + 5] - a2
    v0, v1, v2 = out[o + 6] - a0, out[o + 7] - a1, out[o + 8] - a2
    p0, p1, p2 = x - a0, y - a1, z - a2
    pu, pv = p0 * u0 + p1 * u1 + p2 * u2, p0 * v0 + p1 * v1 + p2 * v2
    if pu <= 0.0 and pv <= 0.0:
        return p0 * p0 + p1 * p1 + p2 * p2, 0.0, 0.0
    uu, uv, vv = u0 * u0 + u1 * u1 + u2 * u2, u0 * v0 + u1 * v1 + u2 * v2, v0 * v0 + v1 * v1 + v2 * v2
    s, r, sure = _weights(pu, pv, uu, uv, vv)
    if not sure:
        return _by_sides(out, o, x, y, z)
    d0, d1, d2 = p0 - s * u0 - r * v0, p1 - s * u1 - r * v1, p2 - s * u2 - r * v2
    return d0 * d0 + d1 * d1 + d2 * d2, s, r


@inner
def _weights(pu, pv, uu, uv, vv):
    """Those of corners 1 and 2, from products of the way to the point and of both sides; False if it is a sliver."""
    # from corners 1 and 2, along both sides at corner 0
    one_u, one_v, two_u, two_v = pu - uu, pv - uv, pu - uv, pv - vv
    if one_u >= 0.0 and one_v <= one_u:
        return 1.0, 0.0, True
    if two_v >= 0.0 and two_u <= two_v:
        return 0.0, 1.0, True
    # parts of the area opposite corners 2, 1, 0
    two, one, zero = pu * one_v - one_u * pv, two_u * pv - pu * two_v, one_u * two_v - two_u * one_v
    up, down = one_v - one_u, two_u - two_v
    if two <= 0.0 and pu >= 0.0 and one_u <= 0.0 and uu > 0.0:
        return pu / uu, 0.0, True
    if one <= 0.0 and pv >= 0.0 and two_v <= 0.0 and vv > 0.0:
        return 0.0, pv / vv, True
    if zero <= 0.0 and up >= 0.0 and down >= 0.0 and up + down > 0.0:
        return 1.0 - up / (up + down), up / (up + down), True
    if zero > 0.0 and one > 0.0 and two > 0.0 and zero + one + two > SLIVER * uu * vv:
        whole = 1.0 / (zero + one + two)
        return one * whole, two * whole, True
    return 0.0, 0.0, False


@inner
def _by_sides(out, o, x, y, z):
    """``closest`` for a sliver, whose sides hold all its points."""
    p0, p1, p2 = x - out[o], y - out[o + 1], z - out[o + 2]
    u0, u1, u2 = out[o + 3] - out[o], out[o + 4] - out[o + 1], out[o + 5] - out[o + 2]
    v0, v1, v2 = out[o + 6] - out[o], out[o + 7] - out[o + 1], out[o + 8] - out[o + 2]
    best, s = _side(p0, p1, p2, u0, u1, u2)
    r = 0.0
    other, along = _side(p0, p1, p2, v0, v1, v2)
    if other < best:
        best, s, r = other, 0.0, along
    other, along = _side(p0 - u0, p1 - u1, p2 - u2, v0 - u0, v1 - u1, v2 - u2)
    if other < best:
        best, s, r = other, 1.0 - along, along
    return best, s, r


@inner
def near(out, o, x, y, z):
    """Squared distance from a point to the triangle, or segment, at ``o``."""
    return closest(out, o, x, y, z)[0]


@inner
def _side(p0, p1, p2, u0, u1, u2):
    """Squared distance to the segment from the origin to u, and where on it that is."""
    uu = u0 * u0 + u1 * u1 + u2 * u2
    s = 0.0
    if uu > 0.0:
        s = min(max((p0 * u0 + p1 * u1 + p2 * u2) / uu, 0.0), 1.0)
    d0, d1, d2 = p0 - s * u0, p1 - s * u1, p2 - s * u2
    return d0 * d0 + d1 * d1 + d2 * d2, s


@inner
def apart(o, i, x, y, z):
    # squares as products: plain Python's powers are rounded otherwise
    u, v, w = o[i] - x, o[i + 1] - y, o[i + 2] - z
    return u * u + v * v + w * w


@inner
def halve(stack, depth):
    """Replace the piece at ``depth`` by its two halves across its longest side."""
    o = stack[depth]
    longest, a, b, c = -1.0, 0, 3, 6
    for i in range(3):
        p, q = 3 * i, 3 * ((i + 1) % 3)
        d = apart(o, p, o[q], o[q + 1], o[q + 2])
        if d > longest:
            longest, a, b, c = d, p, q, 3 * ((i + 2) % 3)
    segment = apart(o, c, o[b], o[b + 1], o[b + 2]) == 0.0 or apart(o, c, o[a], o[a + 1], o[a + 2]) == 0.0
    for axis in range(3):
        u, v, w = o[a + axis], o[b + axis], o[c + axis]
        m = 0.5 * (u + v)
        stack[depth, axis], stack[depth, 3 + axis], stack[depth, 6 + axis] = u, m, m if segment else w
        stack[depth + 1, axis], stack[depth + 1, 3 + axis], stack[depth + 1, 6 + axis] = v, m, m if segment else w


@inner
def crossing(a, i, b, j):
    """Share of a segment of the plane at which it crosses another one, inside both; 0 if it does not."""
    u0, u1 = a[i, 3] - a[i, 0], a[i, 4] - a[i, 1]
    v0, v1 = b[j + 3] - b[j], b[j + 4] - b[j + 1]
    uu, vv = u0 * u0 + u1 * u1, v0 * v0 + v1 * v1
    w0, w1 = b[j] - a[i, 0], b[j + 1] - a[i, 1]
    # twice the areas of triangles: with both ends of either segment
    first, second = u0 * w1 - u1 * w0, u0 * (w1 + v1) - u1 * (w0 + v0)
    third, fourth = v1 * w0 - v0 * w1, v1 * (w0 - u0) - v0 * (w1 - u1)
    if first * second >= 0.0 or third * fourth >= 0.0:
        return 0.0
    if min(abs(first), abs(second)) <= TOUCH * np.sqrt(uu) or min(abs(third), abs(fourth)) <= TOUCH * np.sqrt(vv):
        return 0.0
    return third / (third - fourth)
