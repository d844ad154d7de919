"""Crossed edges: those that a table of sign patterns selects, and the position of the point on each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, kernel
from ..kernel.types import BoolVector, FloatMatrix, FloatVector, Int32Matrix, IntMatrix, IntVector, IntVolume
from .leaves import Leaves

Edge = tuple[int, int]
"""Two local vertices, of a simplex or of a cube, with a point between them."""


class Drawn(NamedTuple):
    """A drawing: cells (M, n) between points, and where these are.

    ``edges`` (E, 2) are the edges of the first E points, unordered, by the vertices at their ends, ``ratio`` (E,) the
    positions of the points on them, ``part`` (E, 2) the range in which each is known to lie, without rows unless asked
    for; ``centres`` (C, n), points in the middles of cells, follow.
    """

    centres: NDArray[np.float64]
    cells: NDArray[np.int64]
    edges: NDArray[np.int32]
    ratio: NDArray[np.float64]
    part: NDArray[np.float64]


@dataclass(frozen=True)
class PatternTable:
    """Rows of edges for each sign pattern of a simplex or cube.

    Attributes
    ----------
    edges : (T, k, 2) int64
        Local vertices at both ends of the edges; the rows of pattern p are ``first[p]`` to ``first[p + 1]``.
    first : (patterns + 1,) int64
    count : (patterns,) uint8
        Number of rows of each pattern.
    """

    edges: NDArray[np.int64]
    first: NDArray[np.int64]
    count: NDArray[np.uint8]

    @classmethod
    def build(cls, rows: Sequence[Sequence[Sequence[Edge]]], k: int) -> PatternTable:
        """Pack lists of rows, one list per pattern, each row with k edges."""
        edges = np.array([row for pattern in rows for row in pattern], dtype=np.int64).reshape(-1, k, 2)
        count = [len(pattern) for pattern in rows]
        return cls(edges, np.cumsum([0, *count], dtype=np.int64), np.array(count, np.uint8))

    def lookup(
        self, pattern: NDArray[np.int64], vertices: NDArray[np.int64], mirrored: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Look up the rows of simplices or cubes by their patterns (C,), as vertices of the mesh.

        ``vertices`` (C, local vertices) are those of each; where it is ``mirrored`` (C,), the first two edges of a row
        are exchanged. Returns the ends of the edges (R, k, 2), and the simplex or cube of each row (R,), ascending.
        """
        owner = np.repeat(np.arange(len(pattern)), self.count[pattern])
        ends = np.empty((len(owner), *self.edges.shape[1:]), np.int64)
        _look_up(self.edges, self.first, pattern, vertices, mirrored, ends)
        return ends, owner


@kernel
def _look_up(
    edges: IntVolume, first: IntVector, pattern: IntVector, vertices: IntMatrix, mirrored: BoolVector, out: IntVolume,
) -> None:
    """Write the rows of all simplices or cubes as vertices of the mesh."""
    row = 0
    for i in range(len(pattern)):
        for k in range(first[pattern[i]], first[pattern[i] + 1]):
            for j in range(edges.shape[1]):
                place = 1 - j if mirrored[i] and j < 2 else j
                out[row, place, 0] = vertices[i, edges[k, j, 0]]
                out[row, place, 1] = vertices[i, edges[k, j, 1]]
            row += 1


def rank_of(leaves: Leaves) -> NDArray[np.int64]:
    """Number the vertices in the lexicographic order of their positions, with gaps, (V,) int64."""
    return np.ravel_multi_index(tuple(leaves.position.T), leaves.shape)


def distinct_pairs(rank: NDArray[np.int64], ends: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the distinct edges between vertices of ranks (V,), so that each edge has a single point.

    ``ends`` (.., 2) are in any order, with repetitions. Returns the edges (P, 2), sorted, each with its end of lower
    rank first, and the number of the edge of each given pair, (..).
    """
    flat = ends.reshape(-1, 2)
    low, high, number = (np.empty(len(flat), np.int64) for _ in range(3))
    count = np.zeros(len(rank) + 1, np.int64)
    _tell_apart(rank, flat, low, high, count)
    edges = np.empty((len(flat), 2), np.int64)
    seconds = np.full(len(flat), -1, np.int64)
    used = _number(low, high, np.cumsum(count), seconds, count, edges, number)
    return edges[:used], number.reshape(ends.shape[:-1])


@kernel
def _tell_apart(rank: IntVector, ends: IntMatrix, low: IntVector, high: IntVector, count: IntVector) -> None:
    """Order the ends of each edge, and count how often each vertex comes first, in the entry after its own."""
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        low[i], high[i] = (a, b) if rank[a] <= rank[b] else (b, a)
        count[low[i] + 1] += 1


@kernel
def _number(
    low: IntVector, high: IntVector, place: IntVector, seconds: IntVector, before: IntVector, edges: IntMatrix,
    number: IntVector,
) -> int:
    """Number the edges in the order of their ends; returns their count.

    ``seconds`` has room for the second ends of each vertex, which are few, from its ``place`` on, initially -1.
    ``before`` becomes the number of each vertex's first edge.
    """
    for i in range(len(low)):
        j = place[low[i]]
        while seconds[j] >= 0 and seconds[j] < high[i]:
            j += 1
        moved = high[i] if seconds[j] != high[i] else -1
        while moved >= 0:
            seconds[j], moved = moved, seconds[j]
            j += 1
    used = 0
    for a in range(len(place) - 1):
        before[a] = used
        for j in range(place[a], place[a + 1]):
            if seconds[j] >= 0:
                edges[used] = a, seconds[j]
                used += 1
    for i in range(len(low)):
        j = place[low[i]]
        while seconds[j] != high[i]:
            j += 1
        number[i] = before[low[i]] + j - place[low[i]]
    return used


def edge_ratios(leaves: Leaves, edges: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`ratios_at` of edges that are sorted, as those of `distinct_pairs`."""
    keys, stated = (some @ (len(leaves.position), 1) for some in (edges, leaves.edges))
    number = np.minimum(np.searchsorted(keys, stated), len(keys) - 1)
    return ratios_at(leaves, edges, np.where(keys[number] == stated, number, -1) if len(keys) else number)


def ratios_at(
    leaves: Leaves, edges: NDArray[np.integer], number: NDArray[np.int64], parts: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute crossings as fractions from the first ends of the edges, (P,), and the ranges that contain them, (P, 2).

    They come from the offset of an edge, or linear interpolation, or else lie in the middle. Where estimates of values
    lie on the wrong side of the isovalue, the point is the nearer end of the edge. ``number`` is the edge of each
    offset, or -1. Without ``parts``, the ranges have no rows.
    """
    ratio = np.full(len(edges), 0.5)
    part = np.tile((0.0, 1.0), (len(edges) if parts else 0, 1))
    linear = linear_ratio(leaves, edges)
    known = np.isfinite(linear)
    ratio[known] = np.clip(linear[known], 0.0, 1.0)
    if parts:
        part[known] = ratio[known, None]
    there = number >= 0
    ratio[number[there]] = leaves.edge_offset[there]
    if parts:
        part[number[there]] = leaves.edge_offset[there, None] + (0.5 / leaves.edge_parts[there, None]) * (-1, 1)
    return ratio, part


def linear_ratio(leaves: Leaves, edges: NDArray[np.integer]) -> NDArray[np.float64]:
    """Interpolate crossings linearly, as fractions from the first ends, (P,) float64; NaN where that is undefined.

    Equal estimates at both ends, and differences that overflow, do not determine a crossing.
    """
    if leaves.value is None:
        return np.full(len(edges), np.nan)
    f_low, f_high = leaves.value[edges[:, 0]], leaves.value[edges[:, 1]]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        linear = (leaves.isovalue - f_low) / (f_high - f_low)
    return np.where(np.isfinite(f_low) & np.isfinite(f_high) & np.isfinite(linear), linear, np.nan)


@inlined
def place_on(vertex, edges, ratio, i, axis):
    """Coordinate of a point on an edge, at its ratio from the first end."""
    low, high = np.int64(vertex[edges[i, 0], axis]), np.int64(vertex[edges[i, 1], axis])
    return low + ratio[i] * (high - low)


@kernel
def enter_points(vertex: Int32Matrix, edges: Int32Matrix, ratio: FloatVector, out: FloatMatrix) -> None:
    """Enter the points (P, n) on edges, at their ratios from the first ends."""
    for i in range(len(edges)):
        for axis in range(out.shape[1]):
            out[i, axis] = place_on(vertex, edges, ratio, i, axis)
