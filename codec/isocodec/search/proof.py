"""Certified distances between two curves or two surfaces (rows C2-distortion, S3-distortion)."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .buckets import SMALLEST, STACK, Buckets, balls, cross, exceed, nearest, sort

MOST_BUCKETS, LEAST_BUCKETS = 8, 1 << 12
"""Buckets for each piece, and beside."""
LEAST_PART = 2000
"""Fewer pieces or points than this are not worth a thread."""


@dataclass(frozen=True)
class Excess:
    """Pieces that are not proven to lie within a limit.

    Attributes
    ----------
    cells : (K,) int64
        Their numbers.
    places : (K, n) float64
        A point of each where that shows.
    """

    cells: NDArray[np.int64]
    places: NDArray[np.float64]


class Target:
    """A curve or surface that others are held against, sorted into buckets for one limit.

    Parameters
    ----------
    points : (P, n) float64
    cells : (M, n) int64
    limit : float
        In the points' units, cells of the grid.
    """

    def __init__(self, points: NDArray[np.float64], cells: NDArray[np.int64], limit: float) -> None:
        pieces = pieces_of(points, cells)
        self.limit = limit
        self.empty, self._corners = not len(pieces), cells.shape[1]
        self.buckets = _sorted(pieces, float(limit))

    def exceeded(
        self, points: NDArray[np.float64], cells: NDArray[np.int64], todo: NDArray[np.int64] | None = None
    ) -> Excess:
        """Pieces of another curve or surface (or those of ``todo``) that are not proven to lie within the limit."""
        n = points.shape[1]
        todo = np.arange(len(cells)) if todo is None else todo
        if self.empty:
            return Excess(todo, points[cells[todo, 0]])
        out, places = np.zeros(len(todo), np.bool_), np.zeros((len(todo), 3))
        pieces = pieces_of(points, cells[todo])

        def prove(some: slice) -> None:
            exceed(pieces[some], self.buckets, np.zeros((STACK, 9)), out[some], places[some])

        in_parts(len(todo), prove)
        return Excess(todo[out], places[out, :n])

    def crossed(self, points: NDArray[np.float64], cells: NDArray[np.int64]) -> Excess:
        """Pieces of another curve of the plane that cross this one; those that touch it do not."""
        out, places = np.zeros(len(cells), np.bool_), np.zeros((len(cells), 3))
        if not self.empty:
            cross(pieces_of(points, cells), self.buckets, out, places)
        return Excess(np.flatnonzero(out), places[out, :2])

    def nearest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The piece next to each point, and where on it: weights of its n corners.

        Parameters
        ----------
        points : (P, n) float64

        Returns
        -------
        piece : (P,) int64
            -1 where none is within the limit.
        weight : (P, n) float64
        """
        n = points.shape[1]
        padded = np.zeros((len(points), 3))
        padded[:, :n] = points
        piece, two = np.full(len(points), -1), np.zeros((len(points), 2))
        if not self.empty:
            in_parts(len(points), lambda some: nearest(padded[some], self.buckets, piece[some], two[some]))
        first = 1.0 - two.sum(axis=1, keepdims=True)
        return piece, np.hstack([first, two if self._corners == 3 else two.sum(axis=1, keepdims=True)])


def in_parts(count: int, work: Callable[[slice], object]) -> None:
    """Do work on ``count`` things, part by part, on all processors: each is settled by itself.

    Kernels let other threads run beside them.
    """
    parts = min(processors(), count // LEAST_PART)
    if parts < 2:
        work(slice(0, count))
        return
    ends = [count * i // parts for i in range(parts + 1)]
    list(_threads().map(lambda i: work(slice(ends[i], ends[i + 1])), range(parts)))


@cache
def _threads() -> ThreadPoolExecutor:
    """Threads for parts, kept: a search needs them hundreds of times."""
    return ThreadPoolExecutor(processors())


if hasattr(os, "register_at_fork"):
    # a process that is forked off has none
    os.register_at_fork(after_in_child=_threads.cache_clear)


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _sorted(pieces: NDArray[np.float64], limit: float) -> Buckets:
    """Pieces (M, 9) in buckets of twice the limit or more."""
    ball = np.empty((len(pieces), 4))
    balls(pieces, ball)
    size = max(2.0 * limit, 2.0)
    corners = pieces.reshape(-1, 3)
    reach = limit * (1 + 1e-9) + 1e-9
    low = corners.min(axis=0, initial=0.0) - reach
    high = corners.max(axis=0, initial=0.0) + reach
    while True:
        shape = np.maximum(np.floor((high - low) / size).astype(np.int64) + 1, 1)
        if shape.prod(dtype=np.float64) <= MOST_BUCKETS * len(pieces) + LEAST_BUCKETS:
            break
        # of a small curve in a large domain: the cost follows the curve
        size *= 2
    counts = np.zeros(tuple(shape), np.int64)
    sort(pieces, low, size, reach, counts, np.empty(0, np.int32))
    first = np.concatenate([[0], np.cumsum(counts.ravel())])
    items = np.empty(first[-1], np.int32)
    sort(pieces, low, size, reach, first[:-1].reshape(counts.shape).copy(), items)
    return Buckets(pieces.ravel(), ball, low, shape, first, items, size, limit)


def pieces_of(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Corners of all pieces, (M, 9): those of a segment, also in space, with its second point twice."""
    padded = np.zeros((len(points), 3))
    padded[:, : points.shape[1]] = points
    corners = cells if cells.shape[1] == 3 else cells[:, [0, 1, 1]]
    return np.ascontiguousarray(padded[corners].reshape(-1, 9))


def one_sided(
    points: NDArray[np.float64], cells: NDArray[np.int64], target_points: NDArray[np.float64],
    target_cells: NDArray[np.int64], tolerance: float = 0.01,
) -> float:
    """Upper bound of how far points of the first lie from the second, at most ``tolerance`` above the truth.

    Infinite if only the second is empty, 0 if the first is.
    """
    if not len(cells):
        return 0.0
    if not len(target_cells):
        return float("inf")
    low, high = 0.0, 0.25
    todo = np.arange(len(cells))
    while len(left := Target(target_points, target_cells, high).exceeded(points, cells, todo).cells):
        todo, low, high = left, high, 2 * high
    while high - low > max(tolerance - 2 * SMALLEST, SMALLEST):
        middle = (low + high) / 2
        left = Target(target_points, target_cells, middle).exceeded(points, cells, todo).cells
        if len(left):
            todo, low = left, middle
        else:
            high = middle
    return high


def hausdorff(
    a_points: NDArray[np.float64], a_cells: NDArray[np.int64], b_points: NDArray[np.float64],
    b_cells: NDArray[np.int64], tolerance: float = 0.01,
) -> tuple[float, float]:
    """Upper bounds of both one-sided distances, from a to b and from b to a."""
    return (
        one_sided(a_points, a_cells, b_points, b_cells, tolerance),
        one_sided(b_points, b_cells, a_points, a_cells, tolerance),
    )
