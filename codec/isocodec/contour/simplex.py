"""One piece of contour per mixed simplex (Lewiner et al. 2004), the same for every dimension."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .crossing import Edge, PatternTable, distinct_edges, edge_points, edge_ratios, rank_of
from .implied import implied_edges, implied_ratio
from .leaves import Leaves


def simplex_pieces(n: int, pattern: int) -> list[list[Edge]]:
    """Cut one n-simplex between its signs.

    The cut is the product of the simplex of the vertices above and that of the vertices below: its points are the
    pairs of both, its cells the monotone staircases through them. In 2-D that is one segment, in 3-D one triangle or
    one quadrangle cut along a diagonal, which lies inside the tetrahedron and so cannot clash with a neighbour.

    Parameters
    ----------
    n : int
    pattern : int
        Bit i is set if local vertex i is above.

    Returns
    -------
    list of list of Edge
        Cells of n edges each, oriented as `Contour` says for a simplex with det(x1 - x0, ..., xn - x0) > 0.
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
        # Left of a segment is where det(direction, offset) > 0; behind a triangle det(side, side, offset) < 0.
        side = np.linalg.det(np.vstack([middle[1:], corners[piece[0][0]]]) - middle[0])
        if side * (-1) ** n < 0:
            piece[:2] = piece[1::-1]
        pieces.append(piece)
    return pieces


@cache
def simplex_table(n: int) -> PatternTable:
    """`simplex_pieces` of all sign patterns."""
    return PatternTable.build([simplex_pieces(n, pattern) for pattern in range(2 ** (n + 1))], n)


def draw_simplices(leaves: Leaves) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (P, n) float64 and cells (M, n) int64 of leaves of any level, one point per crossing edge."""
    n = len(leaves.shape)
    mirrored = _determinant([(x[:, 1:] - x[:, :1]).T for x in (c[leaves.simplices] for c in leaves.position.T)]) < 0
    pattern = leaves.above[leaves.simplices] @ (1 << np.arange(n + 1))
    ends, _ = simplex_table(n).lookup(pattern, leaves.simplices, mirrored)
    edges, cells = distinct_edges(leaves, ends)
    ratio = edge_ratios(leaves, edges)
    if leaves.value is None:
        _place_implied(leaves, edges, ratio)
    return edge_points(leaves, edges, ratio), cells


def _place_implied(leaves: Leaves, edges: NDArray[np.int64], ratio: NDArray[np.float64]) -> None:
    """Where subdivision edges of whole diamonds are crossed follows from the rest, in place."""
    vertices = len(leaves.position)
    keys = edges[:, 0] * vertices + edges[:, 1]
    rank = rank_of(leaves)
    stated = ratio.copy()

    def ratio_of(p: NDArray[np.int64], q: NDArray[np.int64]) -> NDArray[np.float64]:
        swap = rank[p] > rank[q]
        found = stated[np.searchsorted(keys, np.where(swap, q, p) * vertices + np.where(swap, p, q))]
        return np.where(swap, 1.0 - found, found)

    for some in implied_edges(rank, leaves.position, leaves.above, leaves.simplices, leaves.levels):
        place = np.searchsorted(keys, some.edges[:, 0] * vertices + some.edges[:, 1])
        ratio[place] = implied_ratio(some, leaves.above, ratio_of)


def _determinant(rows: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Determinants of many small matrices; ``rows[i][j]`` is the array of the entries (i, j)."""
    if len(rows) == 1:
        return rows[0][0]
    total = np.zeros_like(rows[0][0])
    for j, entry in enumerate(rows[0]):
        minor = _determinant([np.delete(row, j, axis=0) for row in rows[1:]])
        total += (-1) ** j * entry * minor
    return total
