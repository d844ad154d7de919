"""Crossings beside an edge, for the main profile (spec clause 7.14)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import kernel, record
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..tube.state import State
from .crossing_candidates import UNIT

HOPS = 4
"""Edges without offsets that the chain of crossings may pass on the way to one that carries them."""


@record
class Beside(NamedTuple):
    """Tables around an edge.

    Attributes
    ----------
    grid : (V, n) int32
        Number of the edge that leaves a vertex upwards along an axis, or -1; without rows for curves off the full grid.
    near : (V, 2) int64
        For each vertex, how far the crossings known on its edges lie from it, and their number; without rows on the
        full grid.
    chain : (E, 4) int64
        For curves off the full grid the next two edges on either side, the nearer first, or -1; else without rows.
    links : (V, 2 n) int32
        On the full grid the store entries of the next samples along each axis, upwards and downwards; else no rows.
    place : (E,) int64
        Where each edge is crossed as far as that is known, from its lower end, in parts of `along.UNIT`; the main
        profile keeps it up to date.
    """

    grid: Int32Matrix
    near: IntMatrix
    chain: IntMatrix
    links: Int32Matrix
    place: IntVector


def nothing_beside(n: int) -> Beside:
    """Tables without edges."""
    near, chain = (np.zeros((0, columns), np.int64) for columns in (2, 4))
    return Beside(np.zeros((0, n), np.int32), near, chain, _no_links(n), np.zeros(0, np.int64))


def _no_links(n: int) -> NDArray[np.int32]:
    return np.zeros((0, 2 * n), np.int32)


def beside_grid(
    st: State, edges: NDArray[np.int64], links: NDArray[np.int32], place: NDArray[np.int64], n: int,
) -> Beside:
    """Make the tables around the crossed edges of the full grid."""
    return Beside(_leaving(st, edges, n), np.zeros((0, 2), np.int64), np.zeros((0, 4), np.int64), links, place)


def beside_leaves(
    st: State, rows: NDArray[np.int64], edges: NDArray[np.int64], place: NDArray[np.int64], parts: NDArray[np.int64],
    length: NDArray[np.int64], n: int,
) -> Beside:
    """Make the tables around the edges of leaves; ``rows`` are the crossed edges of all leaves as they come."""
    count = int(st.counters.vertices)
    near = np.zeros((count, 2), np.int64)
    told = np.flatnonzero(parts > 1)
    for end, way in ((0, place[told]), (1, UNIT - place[told])):
        np.add.at(near, edges[told, end], np.stack([way * length[told], np.ones_like(told)], axis=1))
    if n == 3:
        return Beside(_leaving(st, edges, n), near, np.zeros((0, 4), np.int64), _no_links(n), place)
    chain = _chain(rows @ (count, 1), edges @ (count, 1))
    return Beside(np.zeros((0, n), np.int32), near, chain, _no_links(n), place)


def _leaving(st: State, edges: NDArray[np.int64], n: int) -> NDArray[np.int32]:
    """Find the edge that leaves a vertex upwards along an axis."""
    index = np.full((int(st.counters.vertices), n), -1, np.int32)
    _enter_straight(st, edges, index)
    return index


@kernel
def _enter_straight(st: State, edges: IntMatrix, index: Int32Matrix) -> None:
    """Enter the edges that run along an axis."""
    for i in range(len(edges)):
        axes, along = 0, 0
        for axis in range(index.shape[1]):
            if st.vertex[edges[i, 0], axis] != st.vertex[edges[i, 1], axis]:
                axes, along = axes + 1, axis
        if axes == 1:
            index[edges[i, 0], along] = i


def _chain(rows: NDArray[np.int64], keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """The next two of ``keys`` on either side of each, where ``rows`` names the two edges of every leaf."""
    names, row = np.unique(rows, return_inverse=True)
    # of each edge its two rows, in the order of the leaves; -1 where there is one leaf only
    order = np.argsort(row, kind="stable")
    first = np.searchsorted(row[order], np.arange(len(names) + 1))
    place = np.full((len(names), 2), -1)
    place[:, 0] = order[first[:-1]]
    both = np.diff(first) > 1
    place[both, 1] = order[first[:-1][both] + 1]
    told = np.full(len(names), -1)
    told[np.searchsorted(names, keys)] = np.arange(len(keys))
    chain = np.full((len(keys), 4), -1, np.int64)
    for side in (0, 1):
        at = place[np.searchsorted(names, keys), side]
        for step in (0, 1):
            resume = np.full(len(keys), -1)
            for _ in range(HOPS):
                # through the leaf, and on from there unless the edge carries offsets
                there = np.where(at >= 0, row[at ^ 1], -1)
                found = np.where(there >= 0, told[there], -1)
                onward = np.where(place[there, 0] == (at ^ 1), place[there, 1], place[there, 0])
                chain[:, 2 * side + step] = np.where(found >= 0, found, chain[:, 2 * side + step])
                resume = np.where(found >= 0, onward, resume)
                at = np.where((there >= 0) & (found < 0), onward, -1)
            at = resume
    return chain
