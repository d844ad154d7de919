"""Thinning: vertices of a triangulation are removed one by one, the least significant first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import inner, kernel, record
from ..kernel.types import FloatVector, Int32Vector, Registers
from .criteria import AT1, LARGEST, keys, largest_outside, largest_without
from .delaunay import delaunay
from .heap import Heap, new_heap, set_key, take_out
from .removed_points import Surface, counted, largest_error, loosen, settle, surface
from .triangulation import NONE, fill, gather, replace

_PIECE = 1 << 20
"""Removals between two looks at interrupts."""


class ThinningCounters(Registers):
    """Progress of a thinning.

    Attributes
    ----------
    criterion : int
    count : int
        Remaining vertices.
    removed : int
        Removed points, listed in ``Thinning.order``.
    """

    criterion: int
    count: int
    removed: int


@record
class Thinning(NamedTuple):
    """A surface, a heap of its vertices by anticipated error, and the removed points.

    ``order``, ``anticipated`` and ``largest`` have an entry per removal: the point, its anticipated error, and the
    largest error of the surface after it. ``around`` is scratch space for the vertices of a star.
    """

    surface: Surface
    queue: Heap
    order: Int32Vector
    anticipated: FloatVector
    largest: FloatVector
    around: Int32Vector
    reg: ThinningCounters


def thinning(
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    value: NDArray[np.float64],
    criterion: int,
    target: NDArray[np.float64] | None = None,
    weight: NDArray[np.float64] | None = None,
) -> Thinning:
    """Begin a thinning of points, as `delaunay.delaunay` takes them, by one of `criteria`: all points are vertices.

    ``target`` (N,) is what errors are measured against, by default the values; ``weight`` (N,) is the factor of the
    error of each point for the criterion ``AT1``, by default 1.
    """
    reg = ThinningCounters()
    reg.criterion, reg.count = criterion, len(x)
    count = len(x)
    out = Thinning(
        surface(delaunay(x, y)[0], value, target, weight), new_heap(count), np.zeros(count, np.int32), np.zeros(count),
        np.zeros(count), np.zeros(count, np.int32), reg,
    )
    refresh(out, np.inf)
    return out


@kernel
def refresh(th: Thinning, most: float) -> None:
    """Update all triangles and vertices in their heaps; for AT1, vertices with errors above ``most`` are dropped."""
    s = th.surface
    for t in range(len(s.tri.origin) // 3):
        if s.tri.origin[3 * t] < 0:
            continue
        size = 0.0
        for side in range(3):
            size = max(size, counted(s, s.tri.origin[3 * t + side]))
        p = np.int64(s.first[t])
        while p >= 0:
            size = max(size, counted(s, p))
            p = np.int64(s.next[p])
        set_key(s.worst, t, -size, 0.0)
    for v in range(len(s.value)):
        if s.tri.leaving[v] >= 0:
            _appraise(th, v, most)


@inner
def _appraise(th, v, most):
    """Update a vertex in the queue, which corners of the hull are not part of.

    For AT1, neither are vertices whose removal causes an error above ``most``: they return if their star changes.
    """
    key, next_key = keys(th.surface, th.reg.criterion, v, most)
    if key < np.inf and (key <= most or th.reg.criterion != AT1):
        set_key(th.queue, v, key, next_key)
    else:
        take_out(th.queue, v)


@inner
def _least(th):
    """Find the vertex to remove next, and its anticipated error; -1 if only corners of the hull are left."""
    if th.queue.size[0] == 0:
        return np.int64(NONE), np.inf
    v = np.int64(th.queue.item[0])
    key = th.queue.key[v]
    if th.reg.criterion != LARGEST:
        return v, key
    # The error over all points is that outside of the star or within: outside, it is the largest of all but for the
    # corners of the triangle that has it.
    s = th.surface
    worst = largest_error(s)
    out, best, own = v, max(worst, key), key
    corner = 3 * np.int64(s.worst.item[0])
    for i in range(3):
        u = np.int64(s.tri.origin[corner + i])
        if th.queue.place[u] < 0:
            continue
        key = th.queue.key[u]
        # it begins with the least within its star, too: of equal errors over all points, that is the first
        found = max(largest_outside(s, u, th.around), key)
        if found < best or (found == best and (key < own or (key == own and u < out))):
            out, best, own = u, found, key
    return out, best


@inner
def _take(th, v, most):
    """Remove the vertex of the gathered and filled polygon, and update the keys of its neighbours."""
    s = th.surface
    tri = s.tri
    count = tri.reg.ring
    for i in range(count):
        th.around[i] = tri.ring[i]
    s.next[v] = s.loose[0]
    s.loose[0] = v
    loosen(s)
    replace(tri)
    tri.leaving[v] = NONE
    tri.reg.last = int(tri.cavity[0])
    settle(s)
    take_out(th.queue, v)
    th.reg.count -= 1
    for i in range(count):
        _appraise(th, np.int64(th.around[i]), most)


@kernel
def thin_to(th: Thinning, least: int, error: float, most: int) -> bool:
    """Remove up to ``most`` vertices until ``least`` are left or no other can go within ``error``; whether it is done.
    """
    s, reg = th.surface, th.reg
    for _ in range(most):
        if reg.count <= least:
            return True
        v, key = _least(th)
        if v < 0:
            return True
        gather(s.tri, v)
        fill(s.tri)
        # by AT1, the key is the largest error without the vertex
        if key > error if reg.criterion == AT1 else error < np.inf and largest_without(s, v, np.inf) > error:
            # it returns if its star changes
            take_out(th.queue, v)
            continue
        _take(th, v, error)
        th.order[reg.removed] = v
        th.anticipated[reg.removed] = key
        th.largest[reg.removed] = largest_error(s)
        reg.removed += 1
    return False


def lessened(th: Thinning, count: int, error: float) -> None:
    """Update the keys, and remove vertices down to a count while no error exceeds a bound."""
    refresh(th, error)
    th.reg.removed = 0
    while not thin_to(th, count, error, _PIECE):
        pass
