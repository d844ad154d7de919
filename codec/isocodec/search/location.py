"""Location of points in a mesh: the simplex of a level, the diamond around it, the leaf (spec clause 4.6)."""

from __future__ import annotations

import numpy as np

from ..grid.lattice.access import child, dimension, vertex
from ..grid.lattice.grid import clamped, edge_of, position
from ..grid.lattice.simplex import exists, middle_at
from ..grid.lattice.vertex_set import GONE
from ..kernel import inner, kernel
from ..kernel.types import Float32Matrix, FloatMatrix, FloatVector, IntMatrix, IntVector
from .reduced import OPEN, Domain, flags_of, number_of

_number_of = inner(number_of)


@inner
def _turn(a, b, c, d, n):
    """Signed volume, times n!, of the simplex of the first n + 1 of these points."""
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    if n == 2:
        return u0 * v1 - u1 * v0
    w0, w1, w2 = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    return u0 * (v1 * w2 - v2 * w1) - u1 * (v0 * w2 - v2 * w0) + u2 * (v0 * w1 - v1 * w0)


@inner
def _vertex_at(dm, edge, r, cls, b0, b1, b2, j):
    x, y, z = position(edge, b0, b1, b2, vertex(dm.grid.tables, r, cls, j))
    x, y, z = clamped(dm.grid, x, y, z)
    return float(x), float(y), float(z)


@inner
def _clamped_simplex_at(dm, level, cube, p):
    """Locate in a cube that the box cuts: clamped images of simplices are not nested, so each is looked at."""
    n = dimension(dm.grid.tables)
    r = level % n
    edge = edge_of(dm.grid, level)
    cube0, cube1, cube2 = cube
    b0, b1, b2 = np.int64(cube0 >> 1), np.int64(cube1 >> 1), np.int64(cube2 >> 1)
    count = (2 if n == 2 else 6) << r
    parity = (cube0 & 1) * 2 + (cube1 & 1)
    if n == 3:
        parity = parity * 2 + (cube2 & 1)
    best, found = -np.inf, np.int64(parity * count)
    for cls in range(parity * count, (parity + 1) * count):
        if not exists(dm.grid, edge, r, np.int64(cls), b0, b1, b2):
            continue
        x = _vertex_at(dm, edge, r, cls, b0, b1, b2, 0)
        y = _vertex_at(dm, edge, r, cls, b0, b1, b2, 1)
        z = _vertex_at(dm, edge, r, cls, b0, b1, b2, 2)
        w = _vertex_at(dm, edge, r, cls, b0, b1, b2, n)
        volume = _turn(x, y, z, w, n)
        least = min(_turn(p, y, z, w, n) / volume, _turn(x, p, z, w, n) / volume, _turn(x, y, p, w, n) / volume)
        if n == 3:
            least = min(least, _turn(x, y, z, p, n) / volume)
        if least > best:
            best, found = least, np.int64(cls)
    return found, b0, b1, b2


@inner
def simplex_at(dm, level, p0, p1, p2, weight):
    """Class and block of a simplex of a level that holds a point; ``weight`` is room for four numbers."""
    t = dm.grid.tables
    n = dimension(t)
    edge = edge_of(dm.grid, level)
    # a point on an upper face of the box belongs to the last cube
    box = dm.grid
    cube0 = min(int(p0) // edge, max(box.last0 - 1, 0) // edge)
    cube1 = min(int(p1) // edge, max(box.last1 - 1, 0) // edge)
    cube2 = min(int(p2) // edge, max(box.last2 - 1, 0) // edge)
    if (cube0 + 1) * edge > box.last0 or (cube1 + 1) * edge > box.last1 or (n == 3 and (cube2 + 1) * edge > box.last2):
        return _clamped_simplex_at(dm, level, (cube0, cube1, cube2), (float(p0), float(p1), float(p2)))
    u0, u1, u2 = p0 / edge - cube0, p1 / edge - cube1, p2 / edge - cube2
    parity = (cube0 & 1, cube1 & 1, cube2 & 1)
    u0 = 1.0 - u0 if parity[0] else u0
    u1 = 1.0 - u1 if parity[1] else u1
    u2 = 1.0 - u2 if parity[2] else u2
    # the path through the cube follows the axes by falling coordinate
    if n == 2:
        order = 0 if u0 >= u1 else 1
        cls = np.int64((parity[0] * 2 + parity[1]) * 2 + order)
        high, low = max(u0, u1), min(u0, u1)
        weight[0], weight[1], weight[2] = 1.0 - high, high - low, low
    else:
        first = 0 if u0 >= u1 and u0 >= u2 else (1 if u1 >= u2 else 2)
        if first == 0:
            order = 0 if u1 >= u2 else 1
        elif first == 1:
            order = 2 if u0 >= u2 else 3
        else:
            order = 4 if u0 >= u1 else 5
        cls = np.int64(((parity[0] * 2 + parity[1]) * 2 + parity[2]) * 6 + order)
        high, low = max(u0, u1, u2), min(u0, u1, u2)
        between = u0 + u1 + u2 - high - low
        weight[0], weight[1], weight[2], weight[3] = 1.0 - high, high - between, between - low, low
    b0, b1, b2 = np.int64(cube0 >> 1), np.int64(cube1 >> 1), np.int64(cube2 >> 1)
    for r in range(level % n):
        tag = n - r
        side = np.int64(0 if weight[0] >= weight[tag] else 1)
        if side == 0:
            weight[0], weight[tag] = weight[0] - weight[tag], 2.0 * weight[tag]
        else:
            rest, twice = weight[tag] - weight[0], 2.0 * weight[0]
            for i in range(tag - 1):
                weight[i] = weight[i + 1]
            weight[tag - 1] = rest
            weight[tag] = twice
        cls, d0, d1, d2 = child(t, np.int64(r), cls, side)
        b0, b1, b2 = b0 + d0, b1 + d1, b2 + d2
    return cls, b0, b1, b2


@kernel
def diamonds_of(dm: Domain, level: int, points: Float32Matrix, weight: FloatVector, keys: IntVector) -> int:
    """For each point the middle of its diamond as one number, or -1 if that is not open."""
    n = dimension(dm.grid.tables)
    count = 0
    for i in range(len(points)):
        cls, b0, b1, b2 = simplex_at(dm, level, points[i, 0], points[i, 1], points[i, 2], weight)
        x, y, z = middle_at(dm.grid, level, cls, b0, b1, b2)
        keys[i] = -1
        if flags_of(dm, x, y, z) & OPEN:
            keys[i] = _number_of(n, x, y, z)
            count += 1
    return count


@inner
def _middle_of(dm, level, points, i, weight):
    """Middle of the simplex of a level that holds a point, and whether the mesh lacks it."""
    cls, b0, b1, b2 = simplex_at(dm, level, points[i, 0], points[i, 1], points[i, 2], weight)
    x, y, z = middle_at(dm.grid, level, cls, b0, b1, b2)
    return x, y, z, (flags_of(dm, x, y, z) & GONE) != 0


@kernel
def found_leaves(dm: Domain, points: FloatMatrix, weight: FloatVector, out: IntMatrix) -> None:
    """For each point the middle and level of the leaf that holds it; level -1 on the full grid.

    Points that follow one another mostly lie in leaves of like levels: the search begins at the one before.
    """
    full = dimension(dm.grid.tables) * dm.grid.exponent
    level = np.int64(0)
    for i in range(len(points)):
        out[i, 3] = -1
        x, y, z, gone = np.int64(0), np.int64(0), np.int64(0), False
        while level < full:
            x, y, z, gone = _middle_of(dm, level, points, i, weight)
            if gone:
                break
            level += 1
        while level > 0:
            u0, u1, u2, above = _middle_of(dm, level - 1, points, i, weight)
            if not above:
                break
            x, y, z, gone = u0, u1, u2, above
            level -= 1
        if gone:
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, y, z, level
