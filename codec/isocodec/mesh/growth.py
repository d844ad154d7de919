"""A mesh that grows cell by cell: its faces, and what lies around the next one (spec clause 10.10.2)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import inlined, inner, record
from ..kernel.types import IntMatrix, IntVector, Registers

OPEN, BORDER = -1, -2
"""Markers in place of the cell across a face: not coded yet, and no cell."""
CANDIDATES = 4
"""Most known vertices that are candidates for the next cell."""
NEAR = 12
"""Classes of the distance of a vertex from the prediction."""


class GrowthRegisters(Registers):
    """Progress of the growth.

    Attributes
    ----------
    vertices, cells : int
        Counts so far.
    all_vertices, all_cells : int
        Counts of the whole mesh.
    first, last : int
        Range of the queue with the waiting faces.
    past : int
        Whether the last faces were on the border, as bits, the latest lowest.
    work : int
        Cells visited.
    most, granted : int
        Limit on cells visited plus symbols decoded, and ``left`` of the coder at the start.
    chosen : int
        Which row of ``aim`` is followed.
    error : int
        One of ``coded_mesh.REASONS``, where a kernel returned BAD.
    """

    vertices: int
    cells: int
    all_vertices: int
    all_cells: int
    first: int
    last: int
    past: int
    work: int
    most: int
    granted: int
    chosen: int
    error: int


@record
class Growth(NamedTuple):
    """A partial mesh in d dimensions of cells of n + 1 vertices, with room for V vertices and T cells.

    ``position`` (V, d), from 0 to below ``extent`` (d,); ``cell`` (T, n + 1); ``neighbour`` (T, n + 1): the cell across
    the face opposite each vertex, ``OPEN`` or ``BORDER``; ``head`` (V,): the last corner (cell times (n + 1) plus
    place) of each vertex, ``link`` (T (n + 1),): the corner of the same vertex before each; ``queue``: faces that wait;
    ``candidate`` (2 CANDIDATES,): vertices, and how far they lie; ``spread`` (2 d,): how far positions have been from
    where they were expected; ``aim`` (2, d): where the next one is, by reflection and evenly; ``missed`` (2,): how far
    both have been from positions; ``bells`` (4,): as of `near_guess`.
    """

    position: IntMatrix
    extent: IntVector
    cell: IntMatrix
    neighbour: IntMatrix
    head: IntVector
    link: IntVector
    queue: IntVector
    candidate: IntVector
    spread: IntVector
    aim: IntMatrix
    missed: IntVector
    bells: IntVector
    reg: GrowthRegisters


@inlined
def _has(g, t, skipped, v):
    """Whether v is a vertex of face ``skipped`` of cell t."""
    found = False
    for j in range(g.cell.shape[1]):
        if j != skipped and g.cell[t, j] == v:
            found = True
    return found


@inner
def _common(g, t, i, other, f):
    """Number of vertices that face i of cell t and face f of another share, and a vertex of the latter not shared."""
    shared = 0
    lone = np.int64(-1)
    for j in range(g.cell.shape[1]):
        if j == f:
            continue
        v = g.cell[other, j]
        if _has(g, t, i, v):
            shared += 1
        else:
            lone = v
    return shared, lone


@inner
def _join(g, t, i):
    """Find the cell across face i of cell t among the earlier ones; False if the mesh is then not a complex."""
    corners = g.cell.shape[1]
    pivot = 1 if i == 0 else 0
    k = g.link[t * corners + pivot]
    while k >= 0:
        other = k // corners
        g.reg.work += 1
        for f in range(corners):
            if _common(g, t, i, other, f)[0] == corners - 1:
                # the face has another cell already, or both cells have the same vertices
                if g.neighbour[other, f] != OPEN or g.cell[other, f] == g.cell[t, i]:
                    return False
                g.neighbour[other, f] = t
                g.neighbour[t, i] = other
                return True
        k = g.link[k]
    g.queue[g.reg.last] = t * corners + i
    g.reg.last += 1
    return True


@inner
def attach(g):
    """Attach the cell that was written after the others; False if the mesh is then not a complex."""
    t = np.int64(g.reg.cells)
    corners = g.cell.shape[1]
    for i in range(corners):
        v = g.cell[t, i]
        if _has(g, t, i, v):
            return False
        g.link[t * corners + i] = g.head[v]
        g.head[v] = t * corners + i
        g.neighbour[t, i] = OPEN
    g.reg.cells += 1
    fits = True
    for i in range(corners):
        fits = fits and _join(g, t, i)
    return fits


@inlined
def squared(g, v, w):
    """Squared distance of two vertices."""
    total = np.int64(0)
    for k in range(g.position.shape[1]):
        far = g.position[v, k] - g.position[w, k]
        total += far * far
    return total


@inner
def face_size(g, t, o):
    """Mean squared length of the sides of face o of cell t, and 1."""
    corners = g.cell.shape[1]
    total = np.int64(0)
    for i in range(corners):
        for j in range(i):
            if i != o and j != o:
                total += squared(g, g.cell[t, i], g.cell[t, j])
    return (total // 3 if corners == 4 else total) + 1


@inlined
def near_class(far):
    """Class of a distance."""
    c = 0
    while c < NEAR - 1 and far >= 1 << c:
        c += 1
    return c


@inner
def _offer(g, count, v, far):
    """List a candidate, the nearest first; returns how many there are."""
    for m in range(count):
        if g.candidate[m] == v:
            return count
    place = count
    while place > 0 and g.candidate[CANDIDATES + place - 1] > far:
        place -= 1
    if place == CANDIDATES:
        return count
    for m in range(min(count, CANDIDATES - 1), place, -1):
        g.candidate[m] = g.candidate[m - 1]
        g.candidate[CANDIDATES + m] = g.candidate[CANDIDATES + m - 1]
    g.candidate[place] = v
    g.candidate[CANDIDATES + place] = far
    return min(count + 1, CANDIDATES)


@inner
def list_candidates(g, t, o, size):
    """List vertices of open faces that share all vertices but one with face o of cell t; returns how many."""
    corners = g.cell.shape[1]
    count = 0
    for i in range(corners):
        if i == o:
            continue
        k = g.head[g.cell[t, i]]
        while k >= 0:
            other = k // corners
            g.reg.work += 1
            for f in range(corners):
                if g.neighbour[other, f] != OPEN:
                    continue
                shared, lone = _common(g, t, o, other, f)
                if shared == corners - 2 and lone != g.cell[t, o]:
                    far = np.int64(0)
                    for m in range(g.position.shape[1]):
                        step = g.position[lone, m] - g.aim[g.reg.chosen, m]
                        far += step * step
                    count = _offer(g, count, lone, far * 8 // size)
            k = g.link[k]
    return count


@inlined
def borders(g, t):
    """Number of faces of a cell on the border."""
    found = 0
    for i in range(g.cell.shape[1]):
        if g.neighbour[t, i] == BORDER:
            found += 1
    return found
