"""Points that follow from others: on subdivision edges of whole diamonds, diagonals of squares (clause 5.7.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Implied:
    """Crossed subdivision edges of whole diamonds of one phase, or diagonals of squares.

    Attributes
    ----------
    edges : (I, 2) int64
        Vertices at the ends, the lexicographically smaller position first.
    ring : (I, m) int64
        Vertices of the ring in lexicographic order: the first and the last are opposite, and so on.
    """

    edges: NDArray[np.int64]
    ring: NDArray[np.int64]


def implied_edges(
    rank: NDArray[np.int64],
    position: NDArray[np.int64],
    above: NDArray[np.bool_],
    simplices: NDArray[np.int64],
    levels: NDArray[np.int64],
) -> list[Implied]:
    """Find them among leaves; what some follow from comes before them.

    Parameters
    ----------
    rank : (V,) int64
        Place of each vertex in the lexicographic order of positions.
    position : (V, n) int64
    above : (V,) bool
    simplices : (M, n + 1) int64
        Vertices x0 .. xn of the leaves.
    levels : (M,) int64
    """
    n = simplices.shape[1] - 1
    phase = levels % n
    found = [_squares(rank, above, simplices, phase)] if n == 3 else []
    for r, members in ((0, 2), (1, 2)) if n == 2 else ((0, 6), (2, 8)):
        chosen = simplices[phase == r]
        chosen = chosen[above[chosen[:, 0]] != above[chosen[:, n - r]]]
        edges = _ends(rank, chosen[:, 0], chosen[:, n - r])
        key = edges @ (len(rank), 1)
        order = np.argsort(key, kind="stable")
        starts = np.flatnonzero(np.diff(key[order], prepend=-1))
        counts = np.diff(starts, append=len(order))
        member = order[starts[counts == members][:, None] + np.arange(members)]
        others = [i for i in range(1, n + 1) if i != n - r]
        ring = chosen[member][:, :, others].reshape(len(member), members * (n - 1))
        # each corner of the ring belongs to two members when n = 3, to one when n = 2
        sort = np.argsort(rank[ring], axis=1)
        found.append(Implied(edges[member[:, 0]], np.take_along_axis(ring, sort, axis=1)[:, :: n - 1]))
    out = []
    for some in found:
        total = position[some.edges].sum(axis=1)
        symmetric = (position[some.ring] + position[some.ring[:, ::-1]] == total[:, None]).all(axis=(1, 2))
        out.append(Implied(some.edges[symmetric], some.ring[symmetric]))
    return out


def _squares(
    rank: NDArray[np.int64], above: NDArray[np.bool_], simplices: NDArray[np.int64], phase: NDArray[np.int64]
) -> Implied:
    """Crossed diagonals of squares of which both halves are sides of leaves (n = 3)."""
    cube, rest = simplices[phase == 0], simplices[phase == 1]
    half = np.concatenate([cube[:, [0, 2, 1]], cube[:, [1, 3, 2]], rest[:, [0, 2, 1]]])
    half = half[above[half[:, 0]] != above[half[:, 1]]]
    edges = _ends(rank, half[:, 0], half[:, 1])
    order = np.lexsort((rank[half[:, 2]], edges[:, 1], edges[:, 0]))
    edges, corner = edges[order], half[order, 2]
    # a half may be a side of two leaves
    again = np.zeros(len(order), np.bool_)
    again[1:] = (edges[1:] == edges[:-1]).all(axis=1) & (corner[1:] == corner[:-1])
    edges, corner = edges[~again], corner[~again]
    starts = np.flatnonzero((np.diff(edges, axis=0, prepend=-1) != 0).any(axis=1))
    both = starts[np.diff(starts, append=len(edges)) == 2]
    return Implied(edges[both], np.stack([corner[both], corner[both + 1]], axis=1))


def _ends(rank: NDArray[np.int64], a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges between vertices, the lexicographically smaller position first."""
    return np.where((rank[a] > rank[b])[:, None], np.stack([b, a], axis=1), np.stack([a, b], axis=1))


def near_ends(implied: Implied, above: NDArray[np.bool_]) -> NDArray[np.int64]:
    """For each corner of the ring the end of the edge from which the contour parts it, (I, m) int64."""
    a, b = implied.edges[:, :1], implied.edges[:, 1:]
    return np.where(above[implied.ring] != above[a], a, b)


def implied_ratio(implied: Implied, above: NDArray[np.bool_], s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Crossings of the edges, as fractions of the way from their first to their second end, (I,) (clause 9.5(5)).

    ``s`` (I, m) holds the same for the edges from `near_ends` to the corners of the ring.
    """
    at_a = above[implied.ring] != above[implied.edges[:, :1]]
    half = implied.ring.shape[1] // 2
    # in the plane of a pair with a as the origin, b - a and c - a as axes
    one, two = s[:, :half], s[:, ::-1][:, :half]
    x_one = np.where(at_a[:, :half], 0.0, 1.0 - one)
    x_two = np.where(at_a[:, ::-1][:, :half], two, 1.0)
    with np.errstate(invalid="ignore"):
        ratio: NDArray[np.float64] = ((x_one * two + x_two * one) / (one + two)).mean(axis=1)
    # where both crossings are at an end, as they may be if samples equal the isovalue
    return np.where(np.isfinite(ratio), ratio, 0.5)
