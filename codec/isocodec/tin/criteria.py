"""Criteria of adaptive thinning: how much the surface loses if a vertex is removed.

L. Demaret, N. Dyn, M. Floater and A. Iske: *Adaptive thinning for terrain modelling and image compression* (2005), with
the names given there; NAT is the thinning of scattered points by M. Floater and A. Iske (1998), which ignores values.
"""

from __future__ import annotations

import numpy as np

from ..kernel import inlined, inner
from .delaunay import straight
from .removed_points import interpolated
from .triangulation import fill, gather, orientation

NAT, AT1, AT2, AT3, LARGEST, SQUARED = range(6)
NAMES = {"NAT": NAT, "AT1": AT1, "AT2": AT2, "AT3": AT3, "inf": LARGEST, "l2": SQUARED}


@inner
def by_ears(s, q, near):
    """Interpolate at a point of the gathered polygon, in the first ear that contains it; also returns that ear.

    ``near``, the ear of a nearby point, is tried first: if the point lies inside, no other ear contains it.
    """
    ear, ring = s.tri.ear, s.tri.ring
    a, b, c = np.int64(ring[ear[near, 0]]), np.int64(ring[ear[near, 1]]), np.int64(ring[ear[near, 2]])
    u, v, w = orientation(s.tri, b, c, q), orientation(s.tri, c, a, q), orientation(s.tri, a, b, q)
    if u > 0 and v > 0 and w > 0:
        return (u * s.value[a] + v * s.value[b] + w * s.value[c]) / (u + v + w), near
    for e in range(s.tri.reg.ears):
        found = interpolated(
            s, np.int64(ring[ear[e, 0]]), np.int64(ring[ear[e, 1]]), np.int64(ring[ear[e, 2]]), q
        )
        if not np.isnan(found):
            return found, np.int64(e)
    return np.nan, near


@inner
def largest_without(s, v, most):
    """Largest error in the star of a vertex without it, in the gathered and filled polygon.

    Stops at the first error that exceeds ``most``.
    """
    found, near = by_ears(s, v, np.int64(0))
    out = abs(found - s.target[v]) * s.weight[v]
    for i in range(s.tri.reg.cavity):
        p = np.int64(s.first[s.tri.cavity[i]])
        while p >= 0:
            if out > most:
                return out
            found, near = by_ears(s, p, near)
            out = max(out, abs(found - s.target[p]) * s.weight[p])
            p = np.int64(s.next[p])
    return out


@inner
def _more_squared(s, v):
    """Growth of the sum of squared errors without a vertex."""
    found, near = by_ears(s, v, np.int64(0))
    missed = found - s.target[v]
    out = missed * missed - s.error[v] * s.error[v]
    for i in range(s.tri.reg.cavity):
        p = np.int64(s.first[s.tri.cavity[i]])
        while p >= 0:
            found, near = by_ears(s, p, near)
            missed = found - s.target[p]
            out += missed * missed - s.error[p] * s.error[p]
            p = np.int64(s.next[p])
    return out


@inner
def _directional(s, v):
    """Largest error at a vertex in triangles that contain it, one from each neighbour to the opposite side."""
    tri = s.tri
    ring, count = tri.ring, tri.reg.ring
    out = 0.0
    for i in range(count):
        z = np.int64(ring[i])
        for step in range(1, count - 1):
            a, b = np.int64(ring[(i + step) % count]), np.int64(ring[(i + step + 1) % count])
            # seen from z, the polygon goes to the right of the line through the vertex first
            if orientation(tri, z, v, b) >= 0:
                out = max(out, abs(interpolated(s, z, a, b, v) - s.target[v]))
                break
    return out


@inner
def _along_hull(s, v):
    """Error at a vertex on the hull, interpolated from its neighbours there."""
    tri = s.tri
    a, b = np.int64(tri.ring[0]), np.int64(tri.ring[tri.reg.ring - 1])
    x, y = tri.x, tri.y
    # on a line, lengths go by the longer of the two axes
    if abs(x[b] - x[a]) >= abs(y[b] - y[a]):
        u, whole = abs(x[v] - x[a]), abs(x[b] - x[a])
    else:
        u, whole = abs(y[v] - y[a]), abs(y[b] - y[a])
    return abs((u * s.value[b] + (whole - u) * s.value[a]) / whole - s.target[v])


@inlined
def apart(tri, a, b):
    """Squared distance of two points."""
    dx, dy = tri.x[a] - tri.x[b], tri.y[a] - tri.y[b]
    return np.float64(dx * dx + dy * dy)


@inner
def _nearest_two(s, v):
    """Squared distances from a vertex to its two nearest neighbours."""
    one = two = np.inf
    for i in range(s.tri.reg.ring):
        d = apart(s.tri, v, np.int64(s.tri.ring[i]))
        if d < one:
            one, two = d, one
        elif d < two:
            two = d
    return one, two


@inner
def keys(s, criterion, v, most):
    """Anticipated error of a vertex and a tie breaker; infinite for vertices that stay.

    These are corners of the hull and vertices of negative weight. For AT1, errors above ``most`` are lower bounds.
    """
    if s.weight[v] < 0:
        return np.inf, 0.0
    gather(s.tri, v)
    if s.tri.reg.open and not straight(s.tri, v):
        return np.inf, 0.0
    if criterion == NAT:
        return _nearest_two(s, v)
    if criterion == AT3:
        return (_along_hull(s, v) if s.tri.reg.open else _directional(s, v)), 0.0
    fill(s.tri)
    if criterion == AT2:
        return abs(by_ears(s, v, np.int64(0))[0] - s.target[v]), 0.0
    if criterion == SQUARED:
        return _more_squared(s, v), 0.0
    return largest_without(s, v, most if criterion == AT1 else np.inf), 0.0


@inner
def largest_outside(s, v, stack):
    """Largest error in triangles outside the star of a vertex."""
    gather(s.tri, v)
    for i in range(s.tri.reg.cavity):
        s.tri.mark[s.tri.cavity[i]] = 1
    out = 0.0
    depth = 1
    stack[0] = 0
    while depth > 0:
        depth -= 1
        at = np.int64(stack[depth])
        if at >= s.worst.size[0]:
            continue
        t = np.int64(s.worst.item[at])
        if not s.tri.mark[t]:
            out = max(out, -s.worst.key[t])
        elif -s.worst.key[t] > out:
            stack[depth] = 2 * at + 1
            stack[depth + 1] = 2 * at + 2
            depth += 2
    for i in range(s.tri.reg.cavity):
        s.tri.mark[s.tri.cavity[i]] = 0
    return out
