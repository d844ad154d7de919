"""Shapes of cells between integer positions: their quality, and how far a face turns (spec clause 10.8.2)."""

from __future__ import annotations

import numpy as np

from ..kernel import inlined, inner
from .affine import root

EXACT = 20
"""Bits of differences up to which determinants are exact in 64 bits."""
LARGE = float(1 << 62)
"""A determinant in floating point that is this large has the sign of the exact one; smaller ones are exact modulo
2**64."""
TRIANGLE, TETRAHEDRON, TURN = 12, 11, 10
"""Bits of differences for the quality of triangles and of tetrahedra, and for turns."""


@inlined
def shift_of(far, bits):
    """Shift that leaves at most ``bits`` bits of a number."""
    shift = np.int64(0)
    while far >> shift >= np.int64(1) << bits:
        shift += 1
    return shift


@inlined
def _far(p, a, b, c, e):
    """Greatest difference of a coordinate of three vertices from that of ``a``."""
    far = np.int64(0)
    for k in range(3):
        far = max(far, abs(p[b, k] - p[a, k]), abs(p[c, k] - p[a, k]), abs(p[e, k] - p[a, k]))
    return far


@inner
def _positive(p, a, b, c, e, far):
    """Whether the determinant of the sides of a tetrahedron from ``a`` is positive, exactly."""
    x0, x1, x2 = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    y0, y1, y2 = p[c, 0] - p[a, 0], p[c, 1] - p[a, 1], p[c, 2] - p[a, 2]
    z0, z1, z2 = p[e, 0] - p[a, 0], p[e, 1] - p[a, 1], p[e, 2] - p[a, 2]
    m0, m1, m2 = y1 * z2 - y2 * z1, y0 * z2 - y2 * z0, y0 * z1 - y1 * z0
    if far >> EXACT > 0:
        rough = float(x0) * float(m0) - float(x1) * float(m1) + float(x2) * float(m2)
        if abs(rough) >= LARGE:
            return rough > 0
    return x0 * m0 - x1 * m1 + x2 * m2 > 0


@inlined
def _squares(x0, x1, x2):
    """Squared length."""
    return x0 * x0 + x1 * x1 + x2 * x2


@inner
def tetrahedron_quality(p, a, b, c, e):
    """Quality of a tetrahedron: 0 if its determinant is not positive, else 1 or more."""
    far = _far(p, a, b, c, e)
    if not _positive(p, a, b, c, e, far):
        return np.int64(0)
    s = shift_of(far, TETRAHEDRON)
    x0, x1, x2 = (p[b, 0] - p[a, 0]) >> s, (p[b, 1] - p[a, 1]) >> s, (p[b, 2] - p[a, 2]) >> s
    y0, y1, y2 = (p[c, 0] - p[a, 0]) >> s, (p[c, 1] - p[a, 1]) >> s, (p[c, 2] - p[a, 2]) >> s
    z0, z1, z2 = (p[e, 0] - p[a, 0]) >> s, (p[e, 1] - p[a, 1]) >> s, (p[e, 2] - p[a, 2]) >> s
    volume = x0 * (y1 * z2 - y2 * z1) - x1 * (y0 * z2 - y2 * z0) + x2 * (y0 * z1 - y1 * z0)
    sides = _squares(x0, x1, x2) + _squares(y0, y1, y2) + _squares(z0, z1, z2)
    sides += _squares(x0 - y0, x1 - y1, x2 - y2) + _squares(x0 - z0, x1 - z1, x2 - z2)
    sides += _squares(y0 - z0, y1 - z1, y2 - z2)
    return max((max(volume, np.int64(0)) << 17) // max(sides * root(sides), np.int64(1)), np.int64(1))


@inner
def triangle_quality(p, a, b, c, planar):
    """Quality of a triangle: 0 if it has no area, or in the plane is not counter-clockwise, else 1 or more."""
    if planar and (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) <= (p[b, 1] - p[a, 1]) * (p[c, 0] - p[a, 0]):
        return np.int64(0)
    s = shift_of(_far(p, a, b, c, c), TRIANGLE)
    x0, x1, x2 = (p[b, 0] - p[a, 0]) >> s, (p[b, 1] - p[a, 1]) >> s, (p[b, 2] - p[a, 2]) >> s
    y0, y1, y2 = (p[c, 0] - p[a, 0]) >> s, (p[c, 1] - p[a, 1]) >> s, (p[c, 2] - p[a, 2]) >> s
    area = root(_squares(x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0))
    if area == 0 and not planar:
        return np.int64(0)
    sides = _squares(x0, x1, x2) + _squares(y0, y1, y2) + _squares(x0 - y0, x1 - y1, x2 - y2)
    return max((area << 16) // max(sides, np.int64(1)), np.int64(1))


@inner
def turned(p, v, u, x, y, limit):
    """Whether the triangle x, y, v, or the edge x, v if y is x, turns with u in the place of v.

    It turns if the cosine of the angle between its normals, or directions, is below ``limit`` / 100.
    """
    s = shift_of(_far(p, x, y, v, u), TURN)
    x0, x1, x2 = (p[y, 0] - p[x, 0]) >> s, (p[y, 1] - p[x, 1]) >> s, (p[y, 2] - p[x, 2]) >> s
    a0, a1, a2 = (p[v, 0] - p[x, 0]) >> s, (p[v, 1] - p[x, 1]) >> s, (p[v, 2] - p[x, 2]) >> s
    b0, b1, b2 = (p[u, 0] - p[x, 0]) >> s, (p[u, 1] - p[x, 1]) >> s, (p[u, 2] - p[x, 2]) >> s
    if x != y:
        a0, a1, a2 = x1 * a2 - x2 * a1, x2 * a0 - x0 * a2, x0 * a1 - x1 * a0
        b0, b1, b2 = x1 * b2 - x2 * b1, x2 * b0 - x0 * b2, x0 * b1 - x1 * b0
    along = a0 * b0 + a1 * b1 + a2 * b2
    return along <= 0 or 100 * along < limit * root(_squares(a0, a1, a2)) * root(_squares(b0, b1, b2))
