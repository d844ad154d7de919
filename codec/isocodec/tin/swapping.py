"""Points put back into a thinned triangulation where they gain most, and others taken out for them."""

from __future__ import annotations

import numpy as np

from ..kernel import inner, kernel
from ..kernel.types import FloatVector, Int32Vector, UInt8Vector
from .delaunay import carve_at, fan
from .fitting import fit
from .removed_points import Surface, farthest_in, interpolated, loosen, settle
from .thinning import Thinning, refresh, thin_to

_SHARES = (0.3, 0.25, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.08, 0.06)
"""Points that are exchanged in each round, of all vertices at most."""
ROUNDS = len(_SHARES)
_PIECE = 1 << 20


@inner
def _fanned(s, p, q):
    """The value at a point of the cavity with the apex ``p``; not a number outside of it."""
    for i in range(s.tri.reg.ring):
        found = interpolated(s, np.int64(s.tri.ring[i]), np.int64(s.tri.far[i]), p, q)
        if not np.isnan(found):
            return found
    return np.nan


@inner
def _gain(s, p, t):
    """Fall of the sum of squared errors if a point of triangle ``t`` becomes a vertex."""
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
    """Find for each triangle the point with the largest error, -1 without one, and what it gains as a vertex."""
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
    """Make a point of triangle ``t`` a vertex that has what it should."""
    tri = s.tri
    carve_at(tri, p, t)
    s.value[p] = s.target[p]
    s.error[p] = 0.0
    # no longer one beside the vertices
    tri.leaving[p] = 3 * t
    loosen(s)
    fan(tri, p)
    settle(s)


@kernel
def put_back(th: Thinning, order: Int32Vector, point: Int32Vector, most: int, touched: UInt8Vector) -> int:
    """Make points of triangles vertices, in an order of triangles, none where another one has changed the triangles.

    Returns how many; the keys of the queue are out of date then.
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
        # those that went are numbers of new triangles, but for none: a cavity grows by two
        touched[t] = 1
        done += 1
    th.reg.count += done
    return done


def exchange(
    th: Thinning, count: int, low: float, high: float, rounds: int, fitted: bool
) -> None:
    """Bring a thinning by squared errors to ``count`` vertices with fitted values, and exchange points for better ones.

    Parameters
    ----------
    th : Thinning
        With more vertices than ``count``, or as many.
    low, high : float
        Least and greatest value.
    rounds : int
        Rounds of exchange at most.
    fitted : bool
        Whether values are fitted; vertices have what was given otherwise.
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
    """Thin to so many vertices and, if asked for, fit the values of those."""
    refresh(th, np.inf)
    th.reg.removed = 0
    while not thin_to(th, count, np.inf, _PIECE):
        pass
    if fitted:
        fit(th.surface, low, high)
