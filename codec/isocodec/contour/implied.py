"""Points that follow from others: where the subdivision edge of a whole diamond is crossed (spec clause 5.7.2).

All members of such a diamond are leaves, so that its boundary edges have points of their own. Opposite corners of its
ring lie symmetrically about the subdivision edge: in the plane of each pair the contour is taken to be straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Implied:
    """Crossed subdivision edges of whole diamonds of one size.

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
    """Find them among leaves.

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
    tag = n - phase
    rows = np.arange(len(simplices))
    first, second = simplices[:, 0], simplices[rows, tag]
    crossed = above[first] != above[second]
    found = []
    for r in range(n):
        members = 2 if n == 2 else (6, 4, 8)[r]
        chosen = np.flatnonzero(crossed & (phase == r))
        if not len(chosen):
            continue
        a, b = first[chosen], second[chosen]
        swap = rank[a] > rank[b]
        low, high = np.where(swap, b, a), np.where(swap, a, b)
        key = low * len(rank) + high
        order = np.argsort(key, kind="stable")
        starts = np.flatnonzero(np.diff(key[order], prepend=-1))
        counts = np.diff(starts, append=len(order))
        whole = np.flatnonzero(counts == members)
        member = order[starts[whole][:, None] + np.arange(members)]
        others = [i for i in range(1, n + 1) if i != n - r]
        ring = simplices[chosen[member]][:, :, others].reshape(len(whole), members * (n - 1))
        # each corner of the ring belongs to two members when n = 3, to one when n = 2
        sort = np.argsort(rank[ring], axis=1)
        ring = np.take_along_axis(ring, sort, axis=1)[:, :: n - 1]
        edges = np.stack([low[member[:, 0]], high[member[:, 0]]], axis=1)
        total = position[edges[:, 0]] + position[edges[:, 1]]
        symmetric = (position[ring] + position[ring[:, ::-1]] == total[:, None]).all(axis=(1, 2))
        found.append(Implied(edges[symmetric], ring[symmetric]))
    return found


def near_ends(implied: Implied, above: NDArray[np.bool_]) -> NDArray[np.int64]:
    """For each corner of the ring the end of the edge from which the contour parts it, (I, m) int64."""
    a, b = implied.edges[:, :1], implied.edges[:, 1:]
    return np.where(above[implied.ring] != above[a], a, b)


def implied_ratio(implied: Implied, above: NDArray[np.bool_], s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the edges are crossed, as fractions of the way from their first to their second end, (I,) float64.

    ``s`` (I, m) says the same of the edges from `near_ends` to the corners of the ring.
    """
    at_a = above[implied.ring] != above[implied.edges[:, :1]]
    half = implied.ring.shape[1] // 2
    # in the plane of a pair with a as the origin, b - a and c - a as axes
    one, two = s[:, :half], s[:, ::-1][:, :half]
    x_one = np.where(at_a[:, :half], 0.0, 1.0 - one)
    x_two = np.where(at_a[:, ::-1][:, :half], two, 1.0)
    return ((x_one * two + x_two * one) / (one + two)).mean(axis=1)
