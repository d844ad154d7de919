"""The multi-triangulation of a mesh in the plane: rounds of removed vertices, and their stars (spec clause 10.8).

A round removes vertices that share no triangle, each with the triangles around it; the hole is cut into triangles
again. The rounds reversed are levels of a progressive file: a removed vertex comes back into the ring that it left.
Both sides compute the same from the mesh alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..errors import OptionError
from ..kernel import inlined, inner, kernel, record
from ..kernel.types import BoolVector, IntMatrix, IntVector
from .complex import Complex

MOST_EXTENT = 1 << 30
"""Positions lie closer to one another than this along each axis."""
MOST_RING = 8
"""Vertices with more triangles around them stay in this round."""
SHUFFLE = 2654435761
"""Vertices are visited in the order of their numbers times this, modulo 2**32."""


@record
class Working(NamedTuple):
    """A triangulation that vertices are removed from.

    Attributes
    ----------
    position : (V, 2) int64
    cell, beside : (T, 3) int64
        Vertices counterclockwise, and the triangle across the side opposite each, or -1; a triangle that is no more
        has -1 as its vertices.
    at, degree : (V,) int64
        A triangle of each vertex, -1 if none is left; and how many there are.
    ring, star, outer : (MOST_RING,) int64
        The vertices around the one that is looked at, its triangles, and those behind.
    ear : (MOST_RING, 3) int64
        How the hole is cut: places in the ring.
    """

    position: IntMatrix
    cell: IntMatrix
    beside: IntMatrix
    at: IntVector
    degree: IntVector
    ring: IntVector
    star: IntVector
    outer: IntVector
    ear: IntMatrix


@inlined
def _turn(w, a, b, c):
    """Twice the area of a triangle, positive if it is counterclockwise."""
    p = w.position
    return (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) - (p[b, 1] - p[a, 1]) * (p[c, 0] - p[a, 0])


@inner
def _lowest_first(w, v):
    """The triangle of a vertex in which its lowest neighbour follows it; -1 if it lies on the outline."""
    t = w.at[v]
    first, least = t, np.int64(-1)
    best = t
    count = np.int64(0)
    while count < MOST_RING:
        i = np.int64(0)
        while w.cell[t, i] != v:
            i += 1
        j = i + 1 if i < 2 else 0
        if least < 0 or w.cell[t, j] < least:
            least = w.cell[t, j]
            best = t
        count += 1
        t = w.beside[t, j]
        if t < 0:
            return np.int64(-1)
        if t == first:
            return best
    return np.int64(-1)


@inner
def _around(w, v):
    """Note what lies around a vertex; returns how many triangles, 0 if it lies on the outline or has too many."""
    t = _lowest_first(w, v)
    if t < 0:
        return np.int64(0)
    first = t
    count = np.int64(0)
    while count < MOST_RING:
        i = np.int64(0)
        while w.cell[t, i] != v:
            i += 1
        j = i + 1 if i < 2 else 0
        w.star[count] = t
        w.ring[count] = w.cell[t, j]
        w.outer[count] = w.beside[t, i]
        count += 1
        t = w.beside[t, j]
        if t == first:
            return count if count == w.degree[v] else np.int64(0)
    return np.int64(0)


@inner
def _is_ear(w, left, count, i):
    """Whether a corner of what is left of the hole can be cut off: it turns left and no other corner lies in it."""
    a = w.ring[left[i - 1 if i > 0 else count - 1]]
    b = w.ring[left[i]]
    c = w.ring[left[i + 1 if i + 1 < count else 0]]
    if _turn(w, a, b, c) <= 0:
        return False
    for j in range(count):
        p = w.ring[left[j]]
        if p in (a, b, c):
            continue
        if _turn(w, a, b, p) >= 0 and _turn(w, b, c, p) >= 0 and _turn(w, c, a, p) >= 0:
            return False
    return True


@inner
def _cut(w, count, left):
    """Cut the hole into triangles, each time along the shortest line; returns whether that can be done."""
    for i in range(count):
        left[i] = i
    made = np.int64(0)
    p = w.position
    while count > 3:
        best = np.int64(-1)
        least = np.int64(0)
        for i in range(count):
            if not _is_ear(w, left, count, i):
                continue
            a = w.ring[left[i - 1 if i > 0 else count - 1]]
            c = w.ring[left[i + 1 if i + 1 < count else 0]]
            x, y = p[a, 0] - p[c, 0], p[a, 1] - p[c, 1]
            length = x * x + y * y
            if best < 0 or length < least:
                best = np.int64(i)
                least = length
        if best < 0:
            return False
        w.ear[made, 0] = left[best - 1 if best > 0 else count - 1]
        w.ear[made, 1] = left[best]
        w.ear[made, 2] = left[best + 1 if best + 1 < count else 0]
        made += 1
        for i in range(best, count - 1):
            left[i] = left[i + 1]
        count -= 1
    for i in range(3):
        w.ear[made, i] = left[i]
    return _turn(w, w.ring[left[0]], w.ring[left[1]], w.ring[left[2]]) > 0


@inner
def _meet(w, t, u, a, b):
    """Triangles t and u (or the outline, -1) lie on either side of the line from a to b, which t has as well."""
    for side in range(2):
        here, there = (t, u) if side == 0 else (u, t)
        if here < 0:
            continue
        for i in range(3):
            v = w.cell[here, i]
            if v != a and v != b:
                w.beside[here, i] = there


@inner
def _close(w, v, count):
    """Take a vertex out, and put the triangles that the hole is cut into in the place of those around it."""
    for i in range(count):
        w.degree[w.ring[i]] -= 2
    # outer[i] is what lies behind the line from place i of the ring to the next one that is left
    for m in range(count - 2):
        t = w.star[m]
        i, j, k = w.ear[m, 0], w.ear[m, 1], w.ear[m, 2]
        a, b, c = w.ring[i], w.ring[j], w.ring[k]
        w.cell[t, 0], w.cell[t, 1], w.cell[t, 2] = a, b, c
        w.at[a], w.at[b], w.at[c] = t, t, t
        w.degree[a] += 1
        w.degree[b] += 1
        w.degree[c] += 1
        _meet(w, t, w.outer[i], a, b)
        _meet(w, t, w.outer[j], b, c)
        if m == count - 3:
            _meet(w, t, w.outer[k], c, a)
        w.outer[i] = t
    for m in range(count - 2, count):
        for i in range(3):
            w.cell[w.star[m], i] = -1
    w.at[v] = -1


@kernel
def remove_round(
    w: Working, order: IntVector, blocked: BoolVector, left: IntVector, removed: IntVector, first: IntVector,
    ring: IntVector,
) -> int:
    """Remove vertices that share no triangle; returns how many.

    ``removed`` (V,) takes them in their order, ``ring`` the vertices around each, from ``first[i]`` to
    ``first[i + 1]``. ``blocked`` (V,) is all False at first.
    """
    done = 0
    for v in order:
        if blocked[v] or w.at[v] < 0:
            continue
        count = _around(w, v)
        if count < 3 or not _cut(w, count, left):
            continue
        start = first[done]
        for i in range(count):
            ring[start + i] = w.ring[i]
            blocked[w.ring[i]] = True
        removed[done] = v
        done += 1
        first[done] = start + count
        _close(w, v, count)
    return done


@dataclass(frozen=True)
class Round:
    """Vertices that a round removes.

    Attributes
    ----------
    vertex : (R,) int64
    first : (R + 1,) int64
        ``ring[first[i] : first[i + 1]]`` are the vertices around vertex i, counterclockwise.
    ring : int64 vector
    """

    vertex: NDArray[np.int64]
    first: NDArray[np.int64]
    ring: NDArray[np.int64]


@dataclass(frozen=True)
class History:
    """The rounds of a mesh, the first one first, and what is left after each.

    Attributes
    ----------
    position : (V, 2) int64
        Counted from the lowest corner of their box.
    rounds : list of Round
    cells : list of (T, 3) int64 arrays
        Triangles before the first round, and after each.
    """

    position: NDArray[np.int64]
    rounds: list[Round]
    cells: list[NDArray[np.int64]]

    @property
    def left(self) -> int:
        """Vertices after the last round, those without a triangle not counted."""
        return len(np.unique(self.cells[-1]))


def has_levels(domain: Complex) -> bool:
    """Whether there is a history: of triangles in the plane whose extent is not too large for their unit."""
    position = domain.mesh.position
    return domain.n == position.shape[1] == 2 and int(np.ptp(position, axis=0).max()) < MOST_EXTENT


def history_of(domain: Complex, watch: Callable[[int], None] | None = None) -> History:
    """Remove vertices round by round, until no more can go; the outline stays.

    Parameters
    ----------
    domain : Complex
    watch : callable, optional
        Called after each round with the bytes that all of them hold so far; what it raises ends them.

    Raises
    ------
    OptionError
        If there are no levels.
    """
    if not has_levels(domain):
        raise OptionError(
            "progressive coding needs a planar triangle mesh that is not too large for its unit", code="progressive",
            remedy="leave progressive out",
        )
    w = _working(domain)
    vertices = len(w.position)
    order = np.argsort(np.arange(vertices, dtype=np.int64) * SHUFFLE % (1 << 32), kind="stable")
    rounds: list[Round] = []
    cells = [w.cell.copy()]
    held = cells[0].nbytes
    while True:
        removed, first = np.empty(vertices, np.int64), np.zeros(vertices + 1, np.int64)
        ring = np.empty(6 * vertices + MOST_RING, np.int64)
        blocked, left = np.zeros(vertices, np.bool_), np.empty(MOST_RING, np.int64)
        count = remove_round(w, order, blocked, left, removed, first, ring)
        if count == 0:
            return History(w.position, rounds, cells)
        rounds.append(Round(removed[:count].copy(), first[: count + 1].copy(), ring[: first[count]].copy()))
        cells.append(w.cell[w.cell[:, 0] >= 0])
        held += cells[-1].nbytes + 8 * (2 * count + int(first[count]))
        if watch is not None:
            watch(held)


def _working(domain: Complex) -> Working:
    """A copy of a mesh with all triangles counterclockwise."""
    mesh = domain.mesh
    cell, beside = mesh.cell.copy(), mesh.neighbour.copy()
    turned = domain.mirrored
    cell[turned, 1:], beside[turned, 1:] = cell[turned, :0:-1], beside[turned, :0:-1]
    at = np.full(len(mesh.position), -1, np.int64)
    at[cell.ravel()] = np.repeat(np.arange(len(cell)), 3)
    some = np.empty(MOST_RING, np.int64)
    position = np.ascontiguousarray(mesh.position - mesh.position.min(axis=0))
    degree = np.bincount(cell.ravel(), minlength=len(at))
    return Working(
        position, cell, beside, at, degree, some, some.copy(), some.copy(), np.empty((MOST_RING, 3), np.int64)
    )
