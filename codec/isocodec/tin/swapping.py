"""Exchange vertices of a thinned triangulation: reinsert points with the largest gain, and remove others."""

from __future__ import annotations

import numpy as np

from ..kernel import inner, kernel
from ..kernel.types import FloatVector, Int32Vector, UInt8Vector
from .delaunay import carve_at, fan
from .fitting import fit
from .removed_points import Surface, farthest_in, interpolated, loosen, settle
from .thinning import Thinning, lessened

_SHARES = (0.3, 0.25, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.08, 0.06)
"""Largest share of the vertices exchanged in each round."""
ROUNDS = len(_SHARES)


@inner
def _fanned(s, p, q):
    """Interpolate at a point of the cavity fanned from ``p``; NaN outside of it."""
    for i in range(s.tri.reg.ring):
        found = interpolated(s, np.int64(s.tri.ring[i]), np.int64(s.tri.far[i]), p, q)
        if not np.isnan(found):
            return found
    return np.nan


@inner
def _gain(s, p, t):
    """Decrease of the sum of squared errors if a point of triangle ``t`` becomes a vertex."""
    tri = s.tri
    carve_at(tri, p, t)
    s.value[p] = s.target[p]
    out = s.error[p] * s.error[p]
    for i in range(tri.reg.cavity):
        c = np.int64(tri.cavity[i])
        tri.mark[c] = 0
        q = np.int64(s.first[c])
        while q >= 0:
            if q != p:
                missed = _fanned(s, p, q) - s.target[q]
                out += s.error[q] * s.error[q] - missed * missed
            q = np.int64(s.next[q])
    return out


@kernel
def gains(s: Surface, point: Int32Vector, gain: FloatVector) -> None:
    """Find for each triangle the point with the largest error, or -1, and its gain as a vertex."""
    for t in range(len(point)):
        point[t] = -1
        gain[t] = 0.0
        if s.tri.origin[3 * t] < 0:
            continue
        point[t], _ = farthest_in(s, t)
        if point[t] >= 0:
            gain[t] = _gain(s, np.int64(point[t]), t)


@inner
def put_in(s, p, t):
    """Make a point of triangle ``t`` a vertex with its target value."""
    tri = s.tri
    carve_at(tri, p, t)
    s.value[p] = s.target[p]
    s.error[p] = 0.0
    # it is a vertex now
    tri.leaving[p] = 3 * t
    loosen(s)
    fan(tri, p)
    settle(s)


@kernel
def put_back(th: Thinning, order: Int32Vector, point: Int32Vector, most: int, touched: UInt8Vector) -> int:
    """Insert one point each of triangles in a given order, except where an earlier one changed the triangle.

    Returns their number; the keys of the queue are then out of date.
    """
    s = th.surface
    done = 0
    for i in range(len(order)):
        t = np.int64(order[i])
        if done == most:
            break
        if touched[t] or point[t] < 0:
            continue
        put_in(s, np.int64(point[t]), t)
        for k in range(s.tri.reg.cavity):
            touched[s.tri.cavity[k]] = 1
        # numbers of removed triangles are reused, since a cavity grows by two
        touched[t] = 1
        done += 1
    th.reg.count += done
    return done


def exchange(
    th: Thinning, count: int, low: float, high: float, rounds: int, fitted: bool
) -> None:
    """Thin by squared errors to ``count`` vertices, and exchange points for better ones in at most ``rounds`` rounds.

    If ``fitted``, values are fitted between ``low`` and ``high``; otherwise vertices keep the given ones.
    """
    _down(th, count, low, high, fitted)
    triangles = len(th.surface.first)
    point, gain = np.zeros(triangles, np.int32), np.zeros(triangles)
    for share in _SHARES[:rounds]:
        gains(th.surface, point, gain)
        some = np.flatnonzero(gain > 0)
        order = some[np.lexsort((some, -gain[some]))].astype(np.int32)
        put_back(th, order, point, int(share * count), np.zeros(triangles, np.uint8))
        if fitted:
            fit(th.surface, low, high)
        _down(th, (th.reg.count + count) // 2, low, high, fitted)
        _down(th, count, low, high, fitted)


def _down(th: Thinning, count: int, low: float, high: float, fitted: bool) -> None:
    """Thin to ``count`` vertices and, if ``fitted``, fit their values."""
    lessened(th, count, np.inf)
    if fitted:
        fit(th.surface, low, high)
