"""Collapses of half edges: a vertex goes, and a neighbour takes its place in its cells (spec clause 10.8.2).

The complex is closed by one more vertex, the apex, which has a cell with each face of one cell. With it a border needs
no rule but how far it may turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import DONE, SPENT, inlined, inner, kernel, record
from ..kernel.types import BoolVector, IntMatrix, IntVector, Registers
from .complex import holds
from .shape import tetrahedron_quality, triangle_quality, turned

SURFACE_TURN = 70
"""Least cosine, in hundredths, of the angle that triangles of a surface may turn."""
TARGETS = 4
"""Most cells of a target, relative to the most of a vertex that goes."""
NEVER = np.int64(1 << 60)
"""Quality above that of any cell."""


class CollapseRegisters(Registers):
    """Progress of a round.

    Attributes
    ----------
    real : int
        Cells that do not have the apex.
    planar, space : int
        1 for triangles of the plane, and where triangles lie in space; else 0.
    limit : int
        Cosine of the angle that borders may turn, in hundredths.
    most : int
        Cells of a vertex that may go.
    at : int
        Place in the order of vertices.
    nodes, faces : int
        Vertices that went in this round, and their faces.
    clock, around : int
        Number of marks so far, and the mark of the current vertex's link.
    work : int
        Cells visited.
    """

    real: int
    planar: int
    space: int
    limit: int
    most: int
    at: int
    nodes: int
    faces: int
    clock: int
    around: int
    work: int


@record
class Collapsing(NamedTuple):
    """A closed complex of V vertices, the apex V and T cells, in which vertices are collapsed.

    ``position`` (V, 3); ``cell`` (T, n + 1); ``alive`` (T,): cells that have not gone; ``head``, ``tail`` (V + 1,) and
    ``following`` (T (n + 1),): lists of the places of each vertex in ``cell``, -1 at their ends; ``degree`` (V + 1,):
    cells of each; ``stays`` (V + 1,): vertices that never collapse; ``blocked`` (V + 1,): neighbours of one that
    collapsed in this round; ``linked``, ``edge`` (V + 1,): marks; ``star``, ``beside``: cells and vertices around the
    current one. The round: ``vertex``, ``target`` (V,), ``first`` (V + 1,), ``face`` (T, n).
    """

    position: IntMatrix
    cell: IntMatrix
    alive: BoolVector
    head: IntVector
    tail: IntVector
    following: IntVector
    degree: IntVector
    stays: BoolVector
    blocked: BoolVector
    linked: IntVector
    edge: IntVector
    star: IntVector
    beside: IntVector
    vertex: IntVector
    target: IntVector
    first: IntVector
    face: IntMatrix
    reg: CollapseRegisters


@inlined
def _append(w, v, place):
    """Append a place to the list of a vertex."""
    if w.head[v] < 0:
        w.head[v] = place
    else:
        w.following[w.tail[v]] = place
    w.tail[v] = place
    w.following[place] = -1


@inlined
def _unlink(w, v, before, place):
    """Remove the place after ``before`` from the list of a vertex."""
    after = w.following[place]
    if before < 0:
        w.head[v] = after
    else:
        w.following[before] = after
    if after < 0:
        w.tail[v] = before


@kernel
def sew(w: Collapsing) -> None:
    """Fill the lists of places and the degrees."""
    corners = w.cell.shape[1]
    for t in range(len(w.cell)):
        for j in range(corners):
            _append(w, w.cell[t, j], np.int64(t * corners + j))
            w.degree[w.cell[t, j]] += 1


@kernel
def find_stays(w: Collapsing, union: IntVector) -> None:
    """Mark vertices whose link is not a circle or sphere: not connected, or of another Euler characteristic.

    ``union`` (V + 1,) is scratch space.
    """
    corners = w.cell.shape[1]
    for v in range(len(w.position)):
        w.reg.clock += 1
        vertices = np.int64(0)
        parts = np.int64(0)
        place = w.head[v]
        while place >= 0:
            t = place // corners
            root = np.int64(-1)
            for j in range(corners):
                u = w.cell[t, j]
                if u == v:
                    continue
                if w.linked[u] != w.reg.clock:
                    w.linked[u] = w.reg.clock
                    union[u] = u
                    vertices += 1
                    parts += 1
                while union[u] != u:
                    union[u] = union[union[u]]
                    u = union[u]
                if root < 0:
                    root = u
                elif u != root:
                    union[u] = root
                    parts -= 1
            place = w.following[place]
        closed = vertices == w.degree[v] if corners == 3 else 2 * vertices == w.degree[v] + 4
        w.stays[v] = parts != 1 or not closed


@inner
def _look_around(w, v):
    """List the cells of a vertex, ascending, and the vertices of its link except the apex; returns their number."""
    corners = w.cell.shape[1]
    w.reg.clock += 1
    mark = w.reg.clock
    w.reg.around = mark
    apex = len(w.position)
    count = np.int64(0)
    around = np.int64(0)
    before = np.int64(-1)
    place = w.head[v]
    while place >= 0:
        t = place // corners
        after = w.following[place]
        w.reg.work += 1
        if not w.alive[t]:
            _unlink(w, v, before, place)
        else:
            before = place
            at = count
            while at > 0 and w.star[at - 1] > t:
                w.star[at] = w.star[at - 1]
                at -= 1
            w.star[at] = t
            count += 1
            for j in range(corners):
                u = w.cell[t, j]
                if u != v and w.linked[u] != mark:
                    w.linked[u] = mark
                    if u != apex:
                        w.beside[around] = u
                        around += 1
        place = after
    return around


@inner
def _moved_quality(w, v, u, t):
    """Quality of a cell of ``v`` with ``u`` in its place."""
    c = w.cell
    a = u if c[t, 0] == v else c[t, 0]
    b = u if c[t, 1] == v else c[t, 1]
    d = u if c[t, 2] == v else c[t, 2]
    if c.shape[1] == 3:
        return triangle_quality(w.position, a, b, d, w.reg.planar == 1)
    return tetrahedron_quality(w.position, a, b, d, u if c[t, 3] == v else c[t, 3])


@inner
def _moved_turns(w, v, u, t, limit):
    """Whether the face of a cell opposite the apex, or the triangle itself, turns with ``u`` in the place of ``v``."""
    apex = len(w.position)
    x = np.int64(-1)
    y = np.int64(-1)
    for j in range(w.cell.shape[1]):
        one = w.cell[t, j]
        if one not in (v, apex):
            y = x if x >= 0 else one
            x = one
    return turned(w.position, v, u, x, y, limit)


@inner
def _patch_quality(w, v, u, best, least):
    """Least quality of the cells that ``u`` takes over; -1 if it may not, or they are worse than ``best`` with the
    target ``least``.
    """
    worst = NEVER
    for i in range(w.degree[v]):
        t = w.star[i]
        if holds(w.cell, t, u):
            continue
        w.reg.work += 1
        if t >= w.reg.real:
            if _moved_turns(w, v, u, t, w.reg.limit):
                return np.int64(-1)
            continue
        found = _moved_quality(w, v, u, t)
        if found == 0 or found < best or (found == best and u > least):
            return np.int64(-1)
        if w.reg.space and _moved_turns(w, v, u, t, np.int64(SURFACE_TURN)):
            return np.int64(-1)
        worst = min(worst, found)
    return worst if worst < NEVER else np.int64(-1)


@inner
def _shares_apex(w, v, u):
    """Whether some cell has ``v``, ``u`` and the apex."""
    apex = len(w.position)
    for i in range(w.degree[v]):  # noqa: SIM110 - compiled
        if holds(w.cell, w.star[i], u) and holds(w.cell, w.star[i], apex):
            return True
    return False


@inner
def _has(w, v, a, b, c):
    """Whether some cell of ``v`` has three vertices."""
    for i in range(w.degree[v]):
        w.reg.work += 1
        t = w.star[i]
        if holds(w.cell, t, a) and holds(w.cell, t, b) and holds(w.cell, t, c):
            return True
    return False


@inner
def _faces_meet(w, v, u, t):
    """Whether the sides that a cell of ``u`` shares with the link of ``v`` are those of the link of their edge."""
    corners = w.cell.shape[1]
    mark = w.reg.around
    for i in range(corners):
        a = w.cell[t, i]
        if a == u or w.linked[a] != mark:
            continue
        for j in range(i + 1, corners):
            b = w.cell[t, j]
            if b == u or w.linked[b] != mark:
                continue
            if _has(w, v, a, b, b) and (corners == 3 or not _has(w, v, u, a, b)):
                return False
            for k in range(j + 1, corners):
                c = w.cell[t, k]
                if c != u and w.linked[c] == mark and _has(w, v, a, b, c):
                    return False
    return True


@inner
def _links_meet(w, v, u):
    """Whether what the links of ``v`` and ``u`` share is the link of their edge."""
    corners = w.cell.shape[1]
    w.reg.clock += 1
    mark = w.reg.clock
    for i in range(w.degree[v]):
        t = w.star[i]
        if holds(w.cell, t, u):
            for j in range(corners):
                w.edge[w.cell[t, j]] = mark
    before = np.int64(-1)
    place = w.head[u]
    while place >= 0:
        t = place // corners
        after = w.following[place]
        w.reg.work += 1
        if not w.alive[t]:
            _unlink(w, u, before, place)
        else:
            before = place
            if not holds(w.cell, t, v):
                shared = np.int64(0)
                for j in range(corners):
                    x = w.cell[t, j]
                    if x != u and w.linked[x] == w.reg.around:
                        if w.edge[x] != mark:
                            return False
                        shared += 1
                if shared > 1 and not _faces_meet(w, v, u, t):
                    return False
        place = after
    return True


@inner
def _best_target(w, v):
    """Allowed target of a vertex whose patch has the best least quality, or -1."""
    count = _look_around(w, v)
    border = w.linked[len(w.position)] == w.reg.around
    best = np.int64(0)
    target = np.int64(-1)
    for i in range(count):
        u = w.beside[i]
        if w.degree[u] > TARGETS * w.reg.most or (border and not _shares_apex(w, v, u)):
            continue
        quality = _patch_quality(w, v, u, best, target)
        if quality > 0 and _links_meet(w, v, u):
            best = quality
            target = u
    return target


@inner
def _collapse(w, v, u):
    """Collapse a vertex into its target, and record the node."""
    corners = w.cell.shape[1]
    count = w.degree[v]
    for i in range(count):
        t = w.star[i]
        goes = holds(w.cell, t, u)
        column = np.int64(0)
        for j in range(corners):
            x = w.cell[t, j]
            if x != v:
                w.face[w.reg.faces, column] = x
                column += 1
                w.blocked[x] = True
                if goes:
                    w.degree[x] -= 1
            elif not goes:
                w.cell[t, j] = u
                _append(w, u, np.int64(t * corners + j))
                w.degree[u] += 1
        if goes:
            w.alive[t] = False
        w.reg.faces += 1
    w.blocked[len(w.position)] = False
    w.degree[v] = 0
    w.head[v] = -1
    w.vertex[w.reg.nodes] = v
    w.target[w.reg.nodes] = u
    w.reg.nodes += 1
    w.first[w.reg.nodes] = w.reg.faces


@kernel
def collapse(w: Collapsing, order: IntVector, most: int) -> int:
    """Continue a round from ``reg.at``; returns SPENT once more than ``most`` cells have been visited."""
    while w.reg.at < len(order):
        v = order[w.reg.at]
        if w.reg.work > most:
            return SPENT
        w.reg.at += 1
        if w.stays[v] or w.blocked[v] or w.degree[v] == 0 or w.degree[v] > w.reg.most:
            continue
        target = _best_target(w, v)
        if target >= 0:
            _collapse(w, v, target)
    return DONE
