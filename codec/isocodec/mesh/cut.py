"""Cuts of the hierarchy of a mesh: which of its cells are there when some vertices have come back (spec clause 10.8.7).

Each cell that there is at any time came from the collapse of a node, its breaker, or from the mesh, and goes with that
of another, its maker, or stays to the end. A cut has nodes with, for each, the makers of the cells of its patch.
"""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from .hierarchy import Hierarchy


@dataclass(frozen=True, eq=False)
class CellHistory:
    """Cells that there are at any time, C of them, the apex being the number of vertices; N nodes, the first one first.

    Attributes
    ----------
    cell : (C, n + 1) int64
    source : (C,) int64
        The cell of the closed mesh that each came from: below T, one of the mesh; otherwise one at its border.
    maker, breaker : (C,) int64
        Number of the node that has the cell in its star, and of the one that has it in its patch; -1 for none.
    first, patch : (N + 1,), (P,) int64
        ``patch[first[i] : first[i + 1]]`` are the cells of the patch of node i.
    star_first, star : (N + 1,), (S,) int64
        Likewise of its star.
    vertex, target : (N,) int64
    around : (S, n + 1) int64
        Cells of the stars: ``cell[star]``.
    position : (V, 3) int64
        As of the hierarchy.
    """

    cell: NDArray[np.int64]
    source: NDArray[np.int64]
    maker: NDArray[np.int64]
    breaker: NDArray[np.int64]
    first: NDArray[np.int64]
    patch: NDArray[np.int64]
    star_first: NDArray[np.int64]
    star: NDArray[np.int64]
    vertex: NDArray[np.int64]
    target: NDArray[np.int64]
    around: NDArray[np.int64]
    position: NDArray[np.int64]

    @property
    def bytes(self) -> int:
        """Memory that it holds."""
        return sum(part.nbytes for part in vars(self).values())

    def closure(self, wanted: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The least cut that has all of some nodes, (N,)."""
        inside = wanted.copy()
        # what a node needs went later than it did
        for i in range(len(inside)):
            if inside[i]:
                makers = self.maker[self.patch[self.first[i] : self.first[i + 1]]]
                inside[makers[makers >= 0]] = True
        return inside

    def there(self, inside: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Numbers of the cells of a cut."""
        return np.flatnonzero(np.append(inside, True)[self.maker] & ~np.append(inside, False)[self.breaker])


def history_of(hierarchy: Hierarchy) -> CellHistory:
    """Follow each cell of the closed mesh through all collapses."""
    apex = len(hierarchy.position)
    vertex = np.concatenate([each.vertex for each in hierarchy.rounds] or [np.zeros(0, np.int64)])
    target = np.concatenate([each.target for each in hierarchy.rounds] or [np.zeros(0, np.int64)])
    nodes = len(vertex)
    gone = np.full(apex + 1, nodes, np.int64)
    gone[vertex] = np.arange(nodes)
    now = np.concatenate([hierarchy.cell, _cone(hierarchy.cell, apex)])
    source, broken = np.arange(len(now)), np.full(len(now), -1)
    cells, sources, makers, breakers = [], [], [], []
    while len(now):
        node = reduce(np.minimum, gone[now].T)
        stays = node == nodes
        cells.append(now)
        sources.append(source)
        breakers.append(broken)
        makers.append(np.where(stays, -1, node))
        now, source, node = now[~stays], source[~stays], node[~stays]
        into = target[node]
        left = ~reduce(np.logical_or, (now == into[:, None]).T)
        now, source, broken, into = now[left], source[left], node[left], into[left]
        now = np.where(now == vertex[broken][:, None], into[:, None], now)
    maker, breaker = np.concatenate(makers), np.concatenate(breakers)
    cell, (first, star) = np.concatenate(cells), _groups(maker, nodes)
    return CellHistory(
        cell, np.concatenate(sources), maker, breaker, *_groups(breaker, nodes), first, star, vertex, target,
        cell[star], hierarchy.position,
    )


def _cone(cell: NDArray[np.int64], apex: int) -> NDArray[np.int64]:
    """Cells of the border with the apex."""
    corners = cell.shape[1]
    faces = np.concatenate([np.delete(cell, i, axis=1) for i in range(corners)])
    _, at, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    border = faces[np.sort(at[count == 1])]
    return np.concatenate([border, np.full((len(border), 1), apex)], axis=1)


def _groups(node: NDArray[np.int64], nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of cells by their node: where each node's begin, and all of them."""
    order = np.argsort(node, kind="stable")
    return np.searchsorted(node[order], np.arange(nodes + 1)) - (node < 0).sum(), order[(node < 0).sum() :]
