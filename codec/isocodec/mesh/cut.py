"""Cuts of the hierarchy of a mesh: its cells after some vertices have come back (spec clause 10.8.7).

Every cell comes from the mesh or from the collapse of a node, its breaker, and vanishes with the collapse of another,
its maker, unless it stays to the end. A cut contains, with each node, the makers of the cells of its patch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from .cut_signs import Cut
from .hierarchy import Hierarchy


@dataclass(frozen=True, eq=False)
class CellHistory:
    """All C cells that exist at some time, with the number of vertices as the apex, and N nodes in order of collapse.

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
        The same for its star.
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
        """Memory in bytes."""
        return sum(part.nbytes for part in vars(self).values())

    def closure(self, wanted: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Find the smallest cut that contains some nodes, (N,)."""
        inside = wanted.copy()
        # a node needs only nodes that collapsed after it
        for i in range(len(inside)):
            if inside[i]:
                makers = self.maker[self.patch[self.first[i] : self.first[i + 1]]]
                inside[makers[makers >= 0]] = True
        return inside

    def there(self, inside: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Numbers of the cells of a cut."""
        return np.flatnonzero(np.append(inside, True)[self.maker] & ~np.append(inside, False)[self.breaker])

    def real(self, inside: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find the cells of a cut without those at the apex, (T', n + 1), and the original cells that they came from.

        They are in the order of the original cells.
        """
        there = self.there(inside)
        there = there[(self.cell[there] < len(self.position)).all(axis=1)]
        there = there[np.argsort(self.source[there])]
        return self.cell[there], self.source[there]


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
    ordered = np.sort(faces, axis=1)
    order = np.lexsort(ordered.T)
    alike = np.concatenate([[False], (ordered[order[1:]] == ordered[order[:-1]]).all(axis=1), [False]])
    border = faces[np.sort(order[~(alike[1:] | alike[:-1])])]
    return np.concatenate([border, np.full((len(border), 1), apex)], axis=1)


def _groups(node: NDArray[np.int64], nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Group cells by node: where each node's cells begin, and all cells in that order."""
    order = np.argsort(node, kind="stable")
    return np.searchsorted(node[order], np.arange(nodes + 1)) - (node < 0).sum(), order[(node < 0).sum() :]


def cut_of(history: CellHistory) -> Cut:
    """Make the empty cut."""
    nodes = len(history.vertex)
    none = np.zeros(nodes, np.bool_)
    return Cut(
        history.cell, history.maker, history.first, history.patch, history.star_first, history.around, history.vertex,
        history.target, none, none.copy(), none.copy(), np.zeros(nodes, np.int64), np.zeros(nodes + 1, np.int64),
        np.zeros(nodes + 128, np.int64),
    )


def wanted_by(history: CellHistory, c: Cut, wanted: NDArray[np.bool_], above: NDArray[np.bool_]) -> None:
    """Set the nodes (N,) that an encoder wants in the cut, from the signs of all vertices (V,).

    Vertices with the sign of their whole ring change nothing, and are added only if others need them.
    """
    inside = c.inside | wanted
    c.wanted[:] = history.closure(inside)
    mixed = np.zeros(len(history.cell), np.bool_)
    real = history.cell < len(above)
    signs = np.append(above, False)[history.cell]
    whole = real.all(axis=1)
    mixed[whole] = signs[whole].any(axis=1) & ~signs[whole].all(axis=1)
    # a vertex of both signs around has a mixed cell
    node = np.arange(len(c.vertex))
    crossed = np.zeros(len(node), np.bool_)
    crossed[np.repeat(node, np.diff(history.star_first))[mixed[history.star]]] = True
    reached = np.zeros(len(node), np.bool_)
    reached[np.repeat(node, np.diff(history.first))[mixed[history.patch]]] = True
    c.unasked[:] = c.wanted & ~c.inside & crossed & ~reached
