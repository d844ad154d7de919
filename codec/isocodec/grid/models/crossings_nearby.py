"""Crossings beside an edge, for the main profile (spec clause 7.14)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import inlined, kernel, record
from ...kernel.types import Int32Matrix, IntMatrix, IntVector
from ..tube.ranks import Ranks, number_at
from ..tube.state import State
from .crossing_candidates import NEXT, SEEN, SPAN_SHIFT, TURNS, UNIT, place_of, seen_of

HOPS = 4
"""Edges without offsets that the chain of crossings may pass on the way to one that carries them."""


@record
class Beside(NamedTuple):
    """Tables around an edge.

    Attributes
    ----------
    around : (E, 2 n) int32
        For each edge, where it is crossed as far as that is known (`crossing_candidates.seen_of`): the pass keeps it up
        to date. Then how the curve turns in the squares beside the edge, two bits each (0 straight on, 1 at the lower
        end, 2 at the upper one), and along how many axes its ends differ, 0 on the full grid. Then the edges that it
        goes on to, or -1.
    near : (V, 2) int64
        For each vertex, how far the crossings known on its edges lie from it, and their number; without rows on the
        full grid.
    chain : (E, 4) int64
        For curves off the full grid the next two edges on either side, the nearer first, or -1; else without rows.
    """

    around: Int32Matrix
    near: IntMatrix
    chain: IntMatrix


def nothing_beside(n: int) -> Beside:
    """Tables without edges."""
    near, chain = (np.zeros((0, columns), np.int64) for columns in (2, 4))
    return Beside(np.zeros((0, 2 * n), np.int32), near, chain)


def beside_grid(
    edges: NDArray[np.int64], links: NDArray[np.int32], offset: NDArray[np.int64], parts: NDArray[np.int64], n: int
) -> Beside:
    """Make the tables around the crossed edges of the full grid.

    ``links`` (V, 2 n) are those of `carriers.linked`; they change.
    """
    around = _begun(offset, parts, n)
    _join_grid(edges, links, around)
    return nothing_beside(n)._replace(around=around)


def beside_leaves(
    st: State, numbers: Ranks, rows: NDArray[np.int64], edges: NDArray[np.int64], offset: NDArray[np.int64],
    parts: NDArray[np.int64], length: NDArray[np.int64], n: int,
) -> Beside:
    """Make the tables around the edges of leaves; ``rows`` are the crossed edges of all leaves as they come."""
    count = int(st.counters.vertices)
    near = np.zeros((count, 2), np.int64)
    told, place = np.flatnonzero(parts > 1), place_of(offset, parts)
    for end, way in ((0, place[told]), (1, UNIT - place[told])):
        np.add.at(near, edges[told, end], np.stack([way * length[told], np.ones_like(told)], axis=1))
    around = _begun(offset, parts, n)
    # curves have the chain instead of the squares
    leaving = np.full((count if n == 3 else 0, n), -1, np.int32)
    _join_leaves(st, numbers, edges, length, leaving, around)
    chain = np.zeros((0, 4), np.int64) if n == 3 else _chain(rows @ (count, 1), edges @ (count, 1))
    return Beside(around, near, chain)


def _begun(offset: NDArray[np.int64], parts: NDArray[np.int64], n: int) -> NDArray[np.int32]:
    """Make ``Beside.around``, but for what the squares are known by."""
    around = np.full((len(parts), 2 * n), -1, np.int32)
    around[:, SEEN] = seen_of(offset, parts)
    return around


@inlined
def _axis_of(links, u, v):
    """Axis along which vertex v is the next one from u."""
    row = links[np.uint64(u)]
    axis = np.int64(0)
    for other in range(1, links.shape[1] >> 1):
        axis += other * (row[2 * other] >> 1 == v + 1)
    return axis


@kernel
def _join_grid(edges: IntMatrix, links: Int32Matrix, around: Int32Matrix) -> None:
    """Enter the edges that the curve goes on to from each edge of the full grid, and how it turns.

    In ``links`` the numbers of edges, as ``-1 - number``, take the places of the entries at their upper ends.
    """
    n = links.shape[1] >> 1
    for i in range(len(edges)):
        u = edges[i, 0]
        axis = _axis_of(links, u, edges[i, 1])
        row = links[np.uint64(u)]
        # until the turns are known
        around[i, TURNS] = 2 * axis + (row[np.uint64(2 * axis)] & 1)
        row[np.uint64(2 * axis)] = -1 - i
    for i in range(len(edges)):
        u, v = edges[i, 0], edges[i, 1]
        lower, upper, row = links[np.uint64(u)], links[np.uint64(v)], around[i]
        axis, above, turns = np.int64(row[TURNS]) >> 1, np.int64(row[TURNS]) & 1, np.int64(0)
        for plane in range(n - 1):
            other = axis + 1 + plane
            other = other if other < n else other - n
            for down in range(2):
                # turns are hard to foresee: no branch depends on them
                low, high = np.int64(lower[np.uint64(2 * other + down)]), np.int64(upper[np.uint64(2 * other + down)])
                at_low, at_high = (low < 0) | (1 - above) ^ (low & 1), (high < 0) | above ^ (high & 1)
                on_low, on_high = (low >> 1) - 1, (high >> 1) - 1
                # the lower end of the edge reached
                end = (on_high if down else v) if at_high else u if at_low > down else on_low
                found = links[np.uint64(max(end, 0)), np.uint64(2 * (other if at_low | at_high else axis))]
                there = low != 0 and high != 0 and at_low + at_high < 2 and found < 0
                row[np.uint64(NEXT + 2 * plane + down)] = -1 - found if there else -1
                turns |= (at_low + 2 * at_high) << 4 * plane + 2 * down
        row[TURNS] = turns


@inlined
def _beyond(st, numbers, e, axis, way):
    """The vertex so far along an axis from another one, both as ``2 * (number + 1) + sign``; 0 if it is not known."""
    row = st.vertex[np.uint64((e >> 1) - 1)]
    x, y, z = row[0] + way * (axis == 0), row[1] + way * (axis == 1), row[2] + way * (axis == 2)
    if min(x, y, z) < 0 or x > st.grid.last0 or y > st.grid.last1 or z > st.grid.last2:
        return np.int64(0)
    v = number_at(numbers, x, y, z)
    return 2 * (v + 1) + np.int64(st.vertex[v, 3]) if v >= 0 else np.int64(0)


@inlined
def _direction(st, u, v):
    """Along how many axes two vertices differ, and the last of these axes."""
    span, along = np.int64(0), np.int64(0)
    lower, upper = st.vertex[np.uint64(u)], st.vertex[np.uint64(v)]
    for axis in range(3):
        if lower[axis] != upper[axis]:
            span, along = span + 1, np.int64(axis)
    return span, along


@kernel
def _join_leaves(
    st: State, numbers: Ranks, edges: IntMatrix, length: IntVector, leaving: Int32Matrix, around: Int32Matrix
) -> None:
    """Enter the same off the full grid, where edges along axes make up squares.

    ``leaving`` gets the edge that leaves each vertex upwards along each axis; without rows there are no squares.
    """
    n = leaving.shape[1]
    for i in range(len(edges)):
        span, axis = _direction(st, edges[i, 0], edges[i, 1])
        around[i, TURNS] = span << SPAN_SHIFT
        if span == 1 and len(leaving) > 0:
            leaving[np.uint64(edges[i, 0]), np.uint64(axis)] = i
    if len(leaving) == 0:
        return
    for i in range(len(edges)):
        u, v = edges[i, 0], edges[i, 1]
        span, axis = _direction(st, u, v)
        if span > 1:
            continue
        low, high = 2 * (u + 1) + np.int64(st.vertex[u, 3]), 2 * (v + 1) + np.int64(st.vertex[v, 3])
        for side in range(2 * n - 2):
            other = axis + 1 + (side >> 1)
            other = other if other < n else other - n
            way = -length[i] if side & 1 else length[i]
            low_there, high_there = _beyond(st, numbers, low, other, way), _beyond(st, numbers, high, other, way)
            turn = ((low ^ low_there) & 1) + 2 * ((high ^ high_there) & 1)
            if low_there == 0 or high_there == 0 or turn == 3:
                continue
            # the lower end of the edge reached
            end, end_there = (high, high_there) if turn == 2 else (low, low_there)
            end = end if turn > 0 and way > 0 else end_there
            found = np.int64(leaving[np.uint64((end >> 1) - 1), np.uint64(other if turn > 0 else axis)])
            if found >= 0 and length[np.uint64(found)] == length[i]:
                around[i, NEXT + side] = found
                around[i, TURNS] |= turn << 2 * side


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
