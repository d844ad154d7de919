"""Whether the curve stays near enough when a vertex goes (rows C2-distortion, S3-distortion).

The points of the original curve in a diamond are held against the pieces of the coarser curve there, drawn as a decoder
will draw them. This one-way test chooses the mesh; the promise itself is proven afterwards, on the decoded curve.
"""

from __future__ import annotations

import numpy as np

from ..kernel import inner, kernel
from ..kernel.types import BoolVolume, Float32Matrix, FloatVector, IntVector
from ..mesh.access import child, corner, dimension, member, middle, vertex
from ..mesh.access import corners as corner_count
from ..mesh.access import kind as kind_of
from ..mesh.access import members as member_count
from ..mesh.diamond import existing
from ..mesh.grid import clamped, edge_of, position
from ..mesh.simplex import exists
from .domain import FAILED, OPEN, Domain, flags_of, number_of, place_of, set_flags, signs_of
from .edges import told_on

_number_of, _place_of = inner(number_of), inner(place_of)
MOST_PIECES = 16


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
def _clamped_simplex_at(dm, level, edge, cube0, cube1, cube2, p0, p1, p2):
    """The same in a cube that the box cuts: clamped images of simplices are not nested, so each is looked at."""
    n = dimension(dm.grid.tables)
    r = level % n
    b0, b1, b2 = np.int64(cube0 >> 1), np.int64(cube1 >> 1), np.int64(cube2 >> 1)
    count = (2 if n == 2 else 6) << r
    parity = (cube0 & 1) * 2 + (cube1 & 1)
    if n == 3:
        parity = parity * 2 + (cube2 & 1)
    p = (float(p0), float(p1), float(p2))
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
        return _clamped_simplex_at(dm, level, edge, cube0, cube1, cube2, p0, p1, p2)
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
    edge = edge_of(dm.grid, level)
    count = 0
    for i in range(len(points)):
        cls, b0, b1, b2 = simplex_at(dm, level, points[i, 0], points[i, 1], points[i, 2], weight)
        w0, w1, w2 = middle(dm.grid.tables, level % n, cls, b0, b1, b2)
        x, y, z = (w0 * edge) >> 1, (w1 * edge) >> 1, (w2 * edge) >> 1
        keys[i] = -1
        if flags_of(dm, x, y, z) & OPEN:
            keys[i] = _number_of(n, x, y, z)
            count += 1
    return count


@inner
def _crossing(dm, edge, kind, w0, w1, w2, i, j, parts, unit):
    """Point that a decoder has on the edge between two corners, from the lexicographically smaller one."""
    b0, b1, b2 = w0 >> 2, w1 >> 2, w2 >> 2
    p = position(edge, b0, b1, b2, corner(dm.grid.tables, kind, i))
    q = position(edge, b0, b1, b2, corner(dm.grid.tables, kind, j))
    p = clamped(dm.grid, p[0], p[1], p[2])
    q = clamped(dm.grid, q[0], q[1], q[2])
    if p[0] > q[0] or (p[0] == q[0] and (p[1] > q[1] or (p[1] == q[1] and p[2] > q[2]))):
        p, q = q, p
    s = told_on(dm, p, q, parts, unit)
    return p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), p[2] + s * (q[2] - p[2])


@inner
def _implied(dm, edge, kind, corners, above, w0, w1, w2, parts, unit):
    """Point on the subdivision edge of a whole diamond, which follows from those at the ring (clause 9.5)."""
    t = dm.grid.tables
    count = corner_count(t, kind)
    b0, b1, b2 = w0 >> 2, w1 >> 2, w2 >> 2
    a = position(edge, b0, b1, b2, corner(t, kind, np.int64(0)))
    b = position(edge, b0, b1, b2, corner(t, kind, np.int64(1)))
    total, pairs = 0.0, 0
    for i in range(2, count):
        c = position(edge, b0, b1, b2, corner(t, kind, np.int64(i)))
        for j in range(i + 1, count):
            d = position(edge, b0, b1, b2, corner(t, kind, np.int64(j)))
            if c[0] + d[0] != a[0] + b[0] or c[1] + d[1] != a[1] + b[1] or c[2] + d[2] != a[2] + b[2]:
                continue
            at_a = (above >> i) & 1 != above & 1
            p = _crossing(dm, edge, kind, w0, w1, w2, np.int64(0 if at_a else 1), np.int64(i), parts, unit)
            s = _fraction(a if at_a else b, c, p)
            x_one = 0.0 if at_a else 1.0 - s
            at_a = (above >> j) & 1 != above & 1
            p = _crossing(dm, edge, kind, w0, w1, w2, np.int64(0 if at_a else 1), np.int64(j), parts, unit)
            u = _fraction(a if at_a else b, d, p)
            x_two = u if at_a else 1.0
            # both at the ends themselves, where samples equal the isovalue
            total += (x_one * u + x_two * s) / (s + u) if s + u > 0.0 else 0.5 * (x_one + x_two)
            pairs += 1
    s = total / pairs if pairs else 0.5
    return a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])


@inner
def _fraction(p, q, x):
    """Which fraction of the way from p to q the point x lies at."""
    for axis in range(3):
        if q[axis] != p[axis]:
            return (x[axis] - p[axis]) / (q[axis] - p[axis])
    return 0.5


@inner
def pieces_of(dm, level, kind, w0, w1, w2, parts, unit):
    """Pieces of the curve in the members of a diamond: triples of points in ``Domain.room``; their number.

    In two dimensions the third point is the second.
    """
    t = dm.grid.tables
    n = dimension(t)
    edge = edge_of(dm.grid, level)
    whole, members, corners = existing(dm.grid, edge, level % n, kind, w0, w1, w2)
    above = signs_of(dm, edge, kind, corners, w0, w1, w2)
    out = dm.room
    count = 0
    split = (above & 1) != (above >> 1) & 1
    e = (0.0, 0.0, 0.0)
    if split:
        if whole:
            e = _implied(dm, edge, kind, corners, above, w0, w1, w2, parts, unit)
        else:
            e = _crossing(dm, edge, kind, w0, w1, w2, np.int64(0), np.int64(1), parts, unit)
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
                    p = _crossing(dm, edge, kind, w0, w1, w2, np.int64(i), np.int64(j), parts, unit)
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
def closest(out, o, x, y, z):
    """The point of the triangle, or segment, at ``o`` that is nearest: squared distance, weights of corners 1 and 2."""
    a0, a1, a2 = out[o], out[o + 1], out[o + 2]
    u0, u1, u2 = out[o + 3] - a0, out[o + 4] - a1, out[o + 5] - a2
    v0, v1, v2 = out[o + 6] - a0, out[o + 7] - a1, out[o + 8] - a2
    p0, p1, p2 = x - a0, y - a1, z - a2
    uu, uv, vv = u0 * u0 + u1 * u1 + u2 * u2, u0 * v0 + u1 * v1 + u2 * v2, v0 * v0 + v1 * v1 + v2 * v2
    pu, pv = p0 * u0 + p1 * u1 + p2 * u2, p0 * v0 + p1 * v1 + p2 * v2
    det = uu * vv - uv * uv
    if det > 1e-12 * uu * vv:
        s, r = (vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det
        if s >= 0.0 and r >= 0.0 and s + r <= 1.0:
            d0, d1, d2 = p0 - s * u0 - r * v0, p1 - s * u1 - r * v1, p2 - s * u2 - r * v2
            return d0 * d0 + d1 * d1 + d2 * d2, s, r
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


@kernel
def spread(points: Float32Matrix, radius: float, near: BoolVolume) -> None:
    """Mark the samples within ``radius`` of a point."""
    squared = radius * radius
    for i in range(len(points)):
        x, y, z = np.float64(points[i, 0]), np.float64(points[i, 1]), np.float64(points[i, 2])
        for p in range(max(int(np.ceil(x - radius)), 0), min(int(x + radius), near.shape[0] - 1) + 1):
            for q in range(max(int(np.ceil(y - radius)), 0), min(int(y + radius), near.shape[1] - 1) + 1):
                rest = squared - (p - x) * (p - x) - (q - y) * (q - y)
                if rest < 0.0:
                    continue
                reach = np.sqrt(rest)
                for r in range(max(int(np.ceil(z - reach)), 0), min(int(z + reach), near.shape[2] - 1) + 1):
                    near[p, q, r] = True


@inner
def _strays(room, count, near):
    """Whether the centre of a piece lies next to no sample that is near."""
    for k in range(count):
        o = 9 * k
        x = int((room[o] + room[o + 3] + room[o + 6]) / 3.0 + 0.5)
        y = int((room[o + 1] + room[o + 4] + room[o + 7]) / 3.0 + 0.5)
        z = int((room[o + 2] + room[o + 5] + room[o + 8]) / 3.0 + 0.5)
        if not (0 <= x < near.shape[0] and 0 <= y < near.shape[1] and 0 <= z < near.shape[2]) or not near[x, y, z]:
            return True
    return False


@kernel
def too_far(
    dm: Domain, level: int, points: Float32Matrix, keys: IntVector, order: IntVector, limit: float, close: BoolVolume,
    parts: int, unit: int,
) -> int:  # fmt: skip
    """Mark the diamonds in which a point of the original curve is farther than ``limit`` from the coarser curve.

    Also those in which the centre of a piece of that lies next to no sample of ``close``, unless that is empty.
    ``order`` sorts the points by diamond. Returns the number of diamonds that failed.
    """
    n = dimension(dm.grid.tables)
    edge = edge_of(dm.grid, level)
    squared = limit * limit
    failed = 0
    i = 0
    while i < len(order):
        key = keys[order[i]]
        stop = i
        while stop < len(order) and keys[order[stop]] == key:
            stop += 1
        x, y, z = _place_of(n, key)
        w0, w1, w2 = 2 * x // edge, 2 * y // edge, 2 * z // edge
        kind = kind_of(dm.grid.tables, level % n, w0, w1, w2)
        count = pieces_of(dm, level, kind, w0, w1, w2, parts, unit)
        held = 0
        if len(close) and _strays(dm.room, count, close):
            set_flags(dm, x, y, z, flags_of(dm, x, y, z) | FAILED)
            failed += 1
            i = stop
        while i < stop:
            p = order[i]
            i += 1
            best = np.inf
            # neighbouring points mostly lie near the same piece
            if held < count:
                best = near(dm.room, 9 * held, points[p, 0], points[p, 1], points[p, 2])
            k = 0
            while best > squared and k < count:
                best = min(best, near(dm.room, 9 * k, points[p, 0], points[p, 1], points[p, 2]))
                held = k
                k += 1
            if best > squared:
                set_flags(dm, x, y, z, flags_of(dm, x, y, z) | FAILED)
                failed += 1
                break
        i = stop
    return failed
