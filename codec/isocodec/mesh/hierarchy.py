"""The multi-triangulation of a mesh: rounds in which vertices collapse into neighbours (spec clauses 10.8.1, 10.8.2).

A round collapses vertices that share no cell, each into the neighbour that keeps the shape of cells best. In reverse,
the rounds are the levels of a progressive file: a vertex returns to the ring that it left. Encoder and decoder compute
them from the mesh alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..kernel import SPENT
from .complex import Complex
from .half_edge_collapse import CollapseRegisters, Collapsing, collapse, find_stays, sew

MOST_EXTENT = 1 << 30
"""Upper bound of the extent of positions along each axis."""
MOST_STAR = {2: 16, 3: 64}
"""Most cells of a vertex that may collapse, by the dimension of cells."""
BORDER_TURNS = (97, 70)
"""Least cosines of the turn of a border, in hundredths: in the first and in later rounds."""
LATER = 16
"""Once a round removes less than this fraction (1 / LATER) of the vertices, borders may turn more."""
LEAST = 64
"""Rounds end once one removes less than 1 / LEAST of the vertices, or leaves at most LEAST."""
SHUFFLE = 2654435761
"""Vertices are visited in the order of their numbers times this, modulo 2**32."""
SLICE = 1 << 22
"""Cells visited between two reports to the caller."""


@dataclass(frozen=True)
class Round:
    """Nodes of a round: vertices that go, in order.

    Attributes
    ----------
    vertex, target : (R,) int64
    first : (R + 1,) int64
        ``face[first[i] : first[i + 1]]`` are the faces opposite vertex i of its cells, in the order of these.
    face : (F, n) int64
        The apex is the number of vertices.
    """

    vertex: NDArray[np.int64]
    target: NDArray[np.int64]
    first: NDArray[np.int64]
    face: NDArray[np.int64]


@dataclass(frozen=True)
class Hierarchy:
    """The rounds of a mesh, the first one first.

    Attributes
    ----------
    position : (V, 3) int64
        Counted from the lowest corner of their box; 0 along the third axis in the plane.
    cell : (T, n + 1) int64
        The cells of the mesh, those of the plane and of space with a positive determinant.
    rounds : list of Round
    """

    position: NDArray[np.int64]
    cell: NDArray[np.int64]
    rounds: list[Round]

    def cells(self, rounds: int) -> NDArray[np.int64]:
        """Find the cells that are left after some rounds, in the order of those that they came from."""
        return self.remaining(rounds)[0]

    def remaining(self, rounds: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find the cells that are left after some rounds, (T', n + 1), and the numbers of those that they came from."""
        stands = np.arange(len(self.position))
        for each in self.rounds[rounds - 1 :: -1] if rounds else ():
            stands[each.vertex] = stands[each.target]
        cell = stands[self.cell]
        ordered = np.sort(cell, axis=1)
        there = np.flatnonzero((ordered[:, 1:] != ordered[:, :-1]).all(axis=1))
        return cell[there], there

    @property
    def left(self) -> int:
        """Vertices that have a cell after the last round."""
        return len(np.unique(self.cells(len(self.rounds))))

    @property
    def digest(self) -> bytes:
        """SHA-256 of the nodes: of each round its number of nodes, and of each node vertex, target, number of faces
        and the faces, as 64-bit integers with the least significant byte first.
        """
        out = hashlib.sha256()
        for one in self.rounds:
            out.update(np.array([len(one.vertex)], "<i8").tobytes())
            for i, (v, u) in enumerate(zip(one.vertex, one.target, strict=True)):
                faces = one.face[one.first[i] : one.first[i + 1]]
                out.update(np.array([v, u, len(faces), *faces.ravel()], "<i8").tobytes())
        return out.digest()


def has_hierarchy(domain: Complex) -> bool:
    """Whether the extent of a mesh is small enough relative to its unit."""
    return int(np.ptp(domain.mesh.position, axis=0).max()) < MOST_EXTENT


def hierarchy_of(domain: Complex, watch: Callable[[int, int], None] | None = None) -> Hierarchy:
    """Collapse vertices round by round; raises `OptionError` if the mesh is too large for its unit.

    ``watch`` is called repeatedly with the cells visited since the last call and the bytes that all rounds hold so far;
    an error that it raises ends them.
    """
    if not has_hierarchy(domain):
        raise OptionError(
            "progressive coding needs a mesh that is not too large for its unit", code="progressive",
            remedy="leave progressive out",
        )
    w, real = _closed(domain)
    cell = w.cell[:real].copy()
    order = np.argsort(np.arange(len(w.position), dtype=np.int64) * SHUFFLE % (1 << 32), kind="stable")
    order = order[(w.degree[order] > 0) & ~w.stays[order]]
    rounds: list[Round] = []
    there, held = int((w.degree[:-1] > 0).sum()), 0
    while True:
        w.reg.at = w.reg.nodes = w.reg.faces = 0
        w.blocked[:] = False
        while collapse(w, order, SLICE) == SPENT:
            _heard(w, held, watch)
        _heard(w, held, watch)
        gone, faces = w.reg.nodes, w.reg.faces
        if gone:
            rounds.append(Round(
                w.vertex[:gone].copy(), w.target[:gone].copy(), w.first[: gone + 1].copy(), w.face[:faces].copy()
            ))
            held += 8 * (3 * gone + w.face.shape[1] * faces)
            order = order[w.degree[order] > 0]
        few = gone * LATER < there, gone * LEAST < there
        there -= gone
        if there <= LEAST or (w.reg.limit == BORDER_TURNS[1] and few[1]):
            return Hierarchy(w.position, cell, rounds)
        if few[0]:
            w.reg.limit = BORDER_TURNS[1]


def _heard(w: Collapsing, held: int, watch: Callable[[int, int], None] | None) -> None:
    """Report the work of a round so far."""
    work, w.reg.work = w.reg.work, 0
    if watch is not None:
        watch(work, held)


def _closed(domain: Complex) -> tuple[Collapsing, int]:
    """Close a copy of a mesh by the apex; also returns the number of cells without it."""
    mesh = domain.mesh
    vertices, d = mesh.position.shape
    real, corners = mesh.cell.shape
    position = np.zeros((vertices, 3), np.int64)
    position[:, :d] = mesh.position - mesh.position.min(axis=0)
    cell = mesh.cell.copy()
    if d == domain.n:
        cell[domain.mirrored, -2:] = cell[domain.mirrored, :-3:-1]
    border, side = np.nonzero(mesh.neighbour < 0)
    cone = np.empty((len(border), corners), np.int64)
    for i in range(corners):
        cone[side == i, :-1] = np.delete(mesh.cell, i, axis=1)[border[side == i]]
    cone[:, -1] = vertices
    cell = np.concatenate([cell, cone])

    def marks(size: int = vertices + 1) -> NDArray[np.int64]:
        return np.zeros(size, np.int64)

    w = Collapsing(
        position, cell, np.ones(len(cell), np.bool_), marks() - 1, marks() - 1, marks(cell.size), marks(),
        np.zeros(vertices + 1, np.bool_), np.zeros(vertices + 1, np.bool_), marks(), marks(),
        marks(MOST_STAR[domain.n]), marks(MOST_STAR[domain.n] * corners), marks(vertices), marks(vertices), marks(),
        np.empty((len(cell), corners - 1), np.int64), CollapseRegisters(),
    )
    reg = w.reg
    reg.real, reg.most, reg.limit = real, MOST_STAR[domain.n], BORDER_TURNS[0]
    reg.planar, reg.space = int(d == 2), int(d == 3 and domain.n == 2)
    sew(w)
    find_stays(w, marks())
    return w, real
