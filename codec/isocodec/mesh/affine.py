"""Continuation of a function linear in a cell beyond one of its faces, in integers (spec clause 10.4.2)."""

from __future__ import annotations

import math

import numpy as np

from ..kernel import inlined, inner

SPAN = 14
"""Most bits of differences of positions."""
UNIT = 1 << 10
"""Denominator of coefficients."""
MOST = 8 * UNIT
"""Largest coefficient."""


@inlined
def _dot(mesh, x, y, a, shift):
    """Product of the sides from a to x and to y."""
    total = np.int64(0)
    for k in range(mesh.position.shape[1]):
        total += ((mesh.position[x, k] - mesh.position[a, k]) >> shift) * (
            (mesh.position[y, k] - mesh.position[a, k]) >> shift
        )
    return total


@inlined
def _side(mesh, x, a, k, shift):
    """A coordinate of the side from a to x."""
    return (mesh.position[x, k] - mesh.position[a, k]) >> shift


@inlined
def _volume(mesh, a, sides, shift):
    """Determinant of three sides that begin at a."""
    x, y, z = sides
    x0, x1, x2 = _side(mesh, x, a, 0, shift), _side(mesh, x, a, 1, shift), _side(mesh, x, a, 2, shift)
    y0, y1, y2 = _side(mesh, y, a, 0, shift), _side(mesh, y, a, 1, shift), _side(mesh, y, a, 2, shift)
    z0, z1, z2 = _side(mesh, z, a, 0, shift), _side(mesh, z, a, 1, shift), _side(mesh, z, a, 2, shift)
    return x0 * (y1 * z2 - y2 * z1) - x1 * (y0 * z2 - y2 * z0) + x2 * (y0 * z1 - y1 * z0)


@inlined
def root(x):
    """Whole part of the square root of a number below 2**62; 0 for those below 0."""
    out = np.int64(math.sqrt(max(x, 0)))
    while out * out > x and out > 0:
        out -= 1
    while (out + 1) * (out + 1) <= x:
        out += 1
    return out


@inlined
def ratio(a, b):
    """a / b in units, within bounds."""
    if b == 0:
        return np.int64(0)
    return min(max(a * UNIT // b, -MOST), MOST)


@inlined
def shift_for(mesh, t, v):
    """Shift that keeps differences between a cell and a vertex within SPAN bits."""
    far = np.int64(0)
    a = mesh.cell[t, 0]
    for k in range(mesh.position.shape[1]):
        far = max(far, abs(mesh.position[v, k] - mesh.position[a, k]))
        for j in range(1, mesh.cell.shape[1]):
            far = max(far, abs(mesh.position[mesh.cell[t, j], k] - mesh.position[a, k]))
    shift = np.int64(0)
    while far >> shift >= 1 << (SPAN - 1):
        shift += 1
    return shift


@inner
def beyond(mesh, value, t, o, v):
    """Value at v of the function that is linear in cell t, v being the vertex beyond the face opposite vertex o of t.

    In space the triangles of a surface are unfolded.
    """
    shift = shift_for(mesh, t, v)
    left = mesh.cell[t, o]
    corners = mesh.cell.shape[1]
    a = mesh.cell[t, (o + 1) % corners]
    b = mesh.cell[t, (o + 2) % corners]
    va, vb, vl = value[a], value[b], value[left]
    if corners == 3:
        base = _dot(mesh, b, b, a, shift)
        at_v = _dot(mesh, v, b, a, shift)
        at_l = _dot(mesh, left, b, a, shift)
        area_v = root(max(base * (_dot(mesh, v, v, a, shift)) - at_v * at_v, 0))
        area_l = root(max(base * (_dot(mesh, left, left, a, shift)) - at_l * at_l, 0))
        foot_v = va + ((vb - va) * ratio(at_v, base)) // UNIT
        foot_l = va + ((vb - va) * ratio(at_l, base)) // UNIT
        return foot_v + ((foot_l - vl) * ratio(area_v, area_l)) // UNIT
    c = mesh.cell[t, (o + 3) % corners]
    vc = value[c]
    whole = _volume(mesh, a, (b, c, left), shift)
    of_b = ratio(_volume(mesh, a, (v, c, left), shift), whole)
    of_c = ratio(_volume(mesh, a, (b, v, left), shift), whole)
    of_l = ratio(_volume(mesh, a, (b, c, v), shift), whole)
    return va + ((vb - va) * of_b + (vc - va) * of_c + (vl - va) * of_l) // UNIT
