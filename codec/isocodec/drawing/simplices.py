"""One piece of contour per mixed simplex (Lewiner et al. 2004), the same for every dimension."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.implied import Implied, implied_edges, implied_ratio, near_ends
from ..mesh.complex import volumes
from .crossing import Drawn, Edge, PatternTable, distinct_pairs, edge_ratios, linear_ratio, rank_of
from .leaves import Leaves


def simplex_pieces(n: int, pattern: int) -> list[list[Edge]]:
    """Cut an n-simplex between its signs; bit i of the pattern is set if local vertex i is above.

    The cut is the product of the simplex of the vertices above and that of the vertices below: its points are the
    pairs of both, its cells the monotone staircases through them. In 2-D that is one segment, in 3-D one triangle or
    one quadrangle cut along a diagonal, which lies inside the tetrahedron and so cannot conflict with a neighbour.
    Cells, of n edges each, are oriented as in `Contour` if det(x1 - x0, ..., xn - x0) > 0.
    """
    above = [i for i in range(n + 1) if pattern >> i & 1]
    below = [i for i in range(n + 1) if not pattern >> i & 1]
    if not above or not below:
        return []
    corners = np.vstack([np.zeros(n), np.eye(n)])
    pieces = []
    for ups in itertools.combinations(range(n - 1), len(above) - 1):
        i = j = 0
        piece = [(above[0], below[0])]
        for step in range(n - 1):
            i, j = (i + 1, j) if step in ups else (i, j + 1)
            piece.append((above[i], below[j]))
        middle = np.array([(corners[a] + corners[b]) / 2 for a, b in piece])
        # left of a segment det(direction, offset) > 0; on the back of a triangle det(side, side, offset) < 0
        side = np.linalg.det(np.vstack([middle[1:], corners[piece[0][0]]]) - middle[0])
        if side * (-1) ** n < 0:
            piece[:2] = piece[1::-1]
        pieces.append(piece)
    return pieces


@cache
def simplex_table(n: int) -> PatternTable:
    """`simplex_pieces` of all sign patterns."""
    return PatternTable.build([simplex_pieces(n, pattern) for pattern in range(2 ** (n + 1))], n)


def _pieces(leaves: Leaves) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the cells, as the ends (M, n, 2) of the edges of their points, and their leaves (M,)."""
    n = len(leaves.shape)
    mirrored = volumes(leaves.position.astype(np.int64)[leaves.simplices]) < 0
    pattern = leaves.above[leaves.simplices] @ (1 << np.arange(n + 1))
    return simplex_table(n).lookup(pattern, leaves.simplices, mirrored)


def draw_simplices(leaves: Leaves, chosen: NDArray[np.bool_] | None = None) -> Drawn:
    """Draw all leaves, or those ``chosen`` (bool each), of any level, with one point per crossed edge.

    Positions of points follow from all leaves in either case.
    """
    ends, owner = _pieces(leaves)
    edges, cells = distinct_pairs(rank_of(leaves), ends)
    ratio, part = edge_ratios(leaves, edges)
    for ring in rings(leaves, edges):
        at = np.isnan(linear_ratio(leaves, edges[ring.edge]))
        ratio[ring.edge[at]] = ring.ratio(ratio)[at]
        known = part[ring.beside[at]]
        free = ((known[..., 0] == 0) & (known[..., 1] == 1)).any(axis=1)
        part[ring.edge[at]] = np.where(free[:, None], (0.0, 1.0), ratio[ring.edge[at], None])
    no_centres = np.zeros((0, len(leaves.shape)))
    if chosen is None:
        return Drawn(no_centres, cells, edges.astype(np.int32), ratio, part)
    cells = cells[chosen[owner]]
    used = np.zeros(len(edges), np.bool_)
    used[cells] = True
    edges, ratio, cells = edges[used], ratio[used], (np.cumsum(used) - 1)[cells]
    return Drawn(no_centres, cells, edges.astype(np.int32), ratio, part[used])


@dataclass(frozen=True)
class Rings:
    """Implied edges among those of a drawing, and the edges that determine where they are crossed.

    Attributes
    ----------
    edge : (I,) int64
        Numbers of the implied edges.
    beside : (I, m) int64
        Numbers of the edges between an end of each and the corners of its ring.
    """

    edge: NDArray[np.int64]
    beside: NDArray[np.int64]
    _swap: NDArray[np.bool_]
    _implied: Implied
    _above: NDArray[np.bool_]

    def ratio(self, stated: NDArray[np.float64]) -> NDArray[np.float64]:
        """Crossings of the implied edges, as fractions from their first ends, from the crossings of all edges."""
        s = stated[self.beside]
        return implied_ratio(self._implied, self._above, np.where(self._swap, 1.0 - s, s))


def rings(leaves: Leaves, edges: NDArray[np.int64]) -> Iterator[Rings]:
    """Find the implied edges of a drawing among its sorted edges, in order of dependence (spec clause 9.5)."""
    vertices = len(leaves.position)
    keys = edges[:, 0] * vertices + edges[:, 1]
    rank = rank_of(leaves)
    for some in implied_edges(rank, leaves.position.astype(np.int64), leaves.above, leaves.simplices, leaves.levels):
        near = near_ends(some, leaves.above)
        swap = rank[near] > rank[some.ring]
        low, high = np.where(swap, some.ring, near), np.where(swap, near, some.ring)
        edge = np.searchsorted(keys, some.edges[:, 0] * vertices + some.edges[:, 1])
        yield Rings(edge, np.searchsorted(keys, low * vertices + high), swap, some, leaves.above)
