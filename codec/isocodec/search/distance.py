"""Certified distances between two curves or two surfaces (rows C2-distortion, S3-distortion).

A piece of one is proven to lie within a limit of the other if all its vertices lie within the limit of one segment or
triangle (distance to a convex set is convex), or if its centre does with the piece's radius to spare; otherwise it is
halved. What is not proven counts as too far: bounds err on the safe side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernel import inner, kernel
from ..kernel.types import BoolVector, FloatMatrix, FloatVector, IntVector, IntVolume
from .distortion import closest, near

SMALLEST = 1e-3
"""Radius, in cells, below which a piece is not halved again: distances are certain to twice that."""
SLACK = 1e-9
"""What rounding may take from a bound."""
_STACK = 64
MOST_BUCKETS, LEAST_BUCKETS = 8, 1 << 12
"""Buckets for each piece, and beside."""


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


@kernel
def _balls(pieces: FloatMatrix, ball: FloatMatrix) -> None:
    """Centre and radius of a ball around each piece."""
    for i in range(len(pieces)):
        o = pieces[i]
        radius = 0.0
        for axis in range(3):
            u, v, w = o[axis], o[3 + axis], o[6 + axis]
            low, high = min(u, v, w), max(u, v, w)
            ball[i, axis] = (low + high) / 2
        x, y, z = ball[i, 0], ball[i, 1], ball[i, 2]
        for corner in range(0, 9, 3):
            radius = max(radius, _apart(o, corner, x, y, z))
        ball[i, 3] = np.sqrt(radius)


@kernel
def _sort(pieces: FloatMatrix, low: FloatVector, size: float, reach: float, place: IntVolume, items: IntVector) -> None:
    """Move each bucket's ``place`` on by the pieces that come within ``reach`` of it.

    They are listed there, unless ``items`` is empty: then they are but counted.
    """
    for i in range(len(pieces)):
        x, y, z = (
            _span(pieces, i, 0, low, size, reach),
            _span(pieces, i, 1, low, size, reach),
            _span(pieces, i, 2, low, size, reach),
        )
        for p in range(max(x[0], 0), min(x[1], place.shape[0] - 1) + 1):
            for q in range(max(y[0], 0), min(y[1], place.shape[1] - 1) + 1):
                for r in range(max(z[0], 0), min(z[1], place.shape[2] - 1) + 1):
                    if len(items):
                        items[place[p, q, r]] = i
                    place[p, q, r] += 1


@inner
def _span(pieces, i, axis, low, size, reach):
    a, b, c = pieces[i, axis], pieces[i, 3 + axis], pieces[i, 6 + axis]
    return (
        int(np.floor((min(a, b, c) - reach - low[axis]) / size)),
        int(np.floor((max(a, b, c) + reach - low[axis]) / size)),
    )


@kernel
def _exceed(
    source: FloatMatrix, flat: FloatVector, ball: FloatMatrix, low: FloatVector, size: float, shape: IntVector,
    first: IntVector, items: IntVector, limit: float, stack: FloatMatrix, todo: IntVector, out: BoolVector,
    places: FloatMatrix,
) -> None:  # fmt: skip
    """Mark in ``out`` the pieces ``todo`` of the source that are not proven to lie within ``limit``."""
    squared = limit * limit
    last = np.int64(-1)
    for t in range(len(todo)):
        i = todo[t]
        depth = 1
        for k in range(9):
            stack[0, k] = source[i, k]
        while depth > 0:
            depth -= 1
            o = stack[depth]
            x, y, z = (o[0] + o[3] + o[6]) / 3.0, (o[1] + o[4] + o[7]) / 3.0, (o[2] + o[5] + o[8]) / 3.0
            p = int(np.floor((x - low[0]) / size))
            q = int(np.floor((y - low[1]) / size))
            r = int(np.floor((z - low[2]) / size))
            radius = np.sqrt(max(_apart(o, 0, x, y, z), _apart(o, 3, x, y, z), _apart(o, 6, x, y, z)))
            # what proved the piece before proves this one, too, more often than not
            found = proven = last >= 0 and _proves(flat, last, o, radius, near(flat, last, x, y, z), limit)
            if not proven and 0 <= p < shape[0] and 0 <= q < shape[1] and 0 <= r < shape[2]:
                bucket = (p * shape[1] + q) * shape[2] + r
                for k in range(first[bucket], first[bucket + 1]):
                    item = items[k]
                    if _beyond(ball, item, x, y, z, limit):
                        continue
                    if found and _useless(ball, item, o, x, y, z, radius, limit):
                        continue
                    d = near(flat, 9 * item, x, y, z)
                    found = found or d <= squared
                    if _proves(flat, 9 * item, o, radius, d, limit):
                        proven, last = True, 9 * item
                        break
            if proven:
                continue
            if not found or radius < SMALLEST or depth + 2 > len(stack):
                out[i] = True
                places[i, 0] = x
                places[i, 1] = y
                places[i, 2] = z
                break
            _halve(stack, depth)
            depth += 2


@inner
def _proves(flat, j, o, radius, d, limit):
    """Whether one of the target's pieces, at the squared distance ``d`` from the centre, proves a piece."""
    if np.sqrt(d) + radius <= limit:
        return True
    squared = limit * limit
    return (
        d <= squared
        and near(flat, j, o[0], o[1], o[2]) <= squared
        and near(flat, j, o[3], o[4], o[5]) <= squared
        and near(flat, j, o[6], o[7], o[8]) <= squared
    )


@inner
def _useless(ball, item, o, x, y, z, radius, limit):
    """Whether one of the target's pieces certainly does not prove a piece, by the ball around it."""
    return (radius > limit or _beyond(ball, item, x, y, z, limit - radius)) and (
        _beyond(ball, item, o[0], o[1], o[2], limit)
        or _beyond(ball, item, o[3], o[4], o[5], limit)
        or _beyond(ball, item, o[6], o[7], o[8], limit)
    )


@inner
def _beyond(ball, item, x, y, z, limit):
    """Whether a piece is certainly farther from a point than the limit, by the ball around it."""
    u, v, w = ball[item, 0] - x, ball[item, 1] - y, ball[item, 2] - z
    far = limit + ball[item, 3] + SLACK
    return u * u + v * v + w * w > far * far


@kernel
def _nearest(
    points: FloatMatrix, flat: FloatVector, ball: FloatMatrix, low: FloatVector, size: float, shape: IntVector,
    first: IntVector, items: IntVector, limit: float, piece: IntVector, weight: FloatMatrix,
) -> None:  # fmt: skip
    """The piece next to each point, -1 if none is within ``limit``, and the weights of its corners 1 and 2."""
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        p = int(np.floor((x - low[0]) / size))
        q = int(np.floor((y - low[1]) / size))
        r = int(np.floor((z - low[2]) / size))
        piece[i] = -1
        if not (0 <= p < shape[0] and 0 <= q < shape[1] and 0 <= r < shape[2]):
            continue
        bucket = (p * shape[1] + q) * shape[2] + r
        best, root = limit * limit, limit
        if i > 0 and piece[i - 1] >= 0:
            # the piece next to the point before is near this one, too: fewer others need a look
            d, s, t = closest(flat, 9 * piece[i - 1], x, y, z)
            if d < best:
                best, root = d, np.sqrt(d)
        for k in range(first[bucket], first[bucket + 1]):
            if _beyond(ball, items[k], x, y, z, root):
                continue
            d, s, t = closest(flat, 9 * items[k], x, y, z)
            if d <= best:
                best, root = d, np.sqrt(d)
                piece[i] = items[k]
                weight[i, 0] = s
                weight[i, 1] = t


@inner
def _apart(o, i, x, y, z):
    # squares as products: plain Python's powers are rounded otherwise
    u, v, w = o[i] - x, o[i + 1] - y, o[i + 2] - z
    return u * u + v * v + w * w


@inner
def _halve(stack, depth):
    """Replace the piece at ``depth`` by its two halves across its longest side."""
    o = stack[depth]
    longest, a, b, c = -1.0, 0, 3, 6
    for i in range(3):
        p, q = 3 * i, 3 * ((i + 1) % 3)
        d = _apart(o, p, o[q], o[q + 1], o[q + 2])
        if d > longest:
            longest, a, b, c = d, p, q, 3 * ((i + 2) % 3)
    segment = _apart(o, c, o[b], o[b + 1], o[b + 2]) == 0.0 or _apart(o, c, o[a], o[a + 1], o[a + 2]) == 0.0
    for axis in range(3):
        u, v, w = o[a + axis], o[b + axis], o[c + axis]
        m = 0.5 * (u + v)
        stack[depth, axis], stack[depth, 3 + axis], stack[depth, 6 + axis] = u, m, m if segment else w
        stack[depth + 1, axis], stack[depth + 1, 3 + axis], stack[depth + 1, 6 + axis] = v, m, m if segment else w


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
        pieces = _pieces(points, cells)
        self.limit = limit
        self.flat = pieces.ravel()
        self.ball = np.empty((len(pieces), 4))
        _balls(pieces, self.ball)
        self.empty = not len(pieces)
        self.size = max(2.0 * limit, 2.0)
        corners = pieces.reshape(-1, 3)
        reach = limit * (1 + 1e-9) + 1e-9
        self.low = corners.min(axis=0, initial=0.0) - reach
        high = corners.max(axis=0, initial=0.0) + reach
        while True:
            self.shape = np.maximum(np.floor((high - self.low) / self.size).astype(np.int64) + 1, 1)
            if self.shape.prod() <= MOST_BUCKETS * len(pieces) + LEAST_BUCKETS:
                break
            # of a small curve in a large domain: the cost follows the curve
            self.size *= 2
        counts = np.zeros(tuple(self.shape), np.int64)
        _sort(pieces, self.low, self.size, reach, counts, np.empty(0, np.int64))
        self.first = np.concatenate([[0], np.cumsum(counts.ravel())])
        self.items = np.empty(self.first[-1], np.int64)
        _sort(pieces, self.low, self.size, reach, self.first[:-1].reshape(counts.shape).copy(), self.items)

    def exceeded(
        self, points: NDArray[np.float64], cells: NDArray[np.int64], todo: NDArray[np.int64] | None = None
    ) -> Excess:
        """Pieces of another curve or surface (or those of ``todo``) that are not proven to lie within the limit."""
        n = points.shape[1]
        todo = np.arange(len(cells)) if todo is None else todo
        if self.empty:
            return Excess(todo, points[cells[todo, 0]])
        source = _pieces(points, cells)
        out, places = np.zeros(len(cells), np.bool_), np.zeros((len(cells), 3))
        _exceed(source, self.flat, self.ball, self.low, self.size, self.shape, self.first, self.items,
                float(self.limit), np.zeros((_STACK, 9)), todo, out, places)  # fmt: skip
        found = np.flatnonzero(out)
        return Excess(found, places[found, :n])

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
            _nearest(padded, self.flat, self.ball, self.low, self.size, self.shape, self.first, self.items,
                     float(self.limit), piece, two)  # fmt: skip
        first = 1.0 - two.sum(axis=1, keepdims=True)
        return piece, np.hstack([first, two if n == 3 else two.sum(axis=1, keepdims=True)])


def _pieces(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Corners of all pieces, (M, 9): those of a segment with its second point twice."""
    n = points.shape[1]
    padded = np.zeros((len(points), 3))
    padded[:, :n] = points
    corners = cells if n == 3 else cells[:, [0, 1, 1]]
    return np.ascontiguousarray(padded[corners].reshape(-1, 9))


def one_sided(
    points: NDArray[np.float64], cells: NDArray[np.int64], target_points: NDArray[np.float64],
    target_cells: NDArray[np.int64], tolerance: float = 0.01,
) -> float:  # fmt: skip
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
) -> tuple[float, float]:  # fmt: skip
    """Upper bounds of both one-sided distances, from a to b and from b to a."""
    return (
        one_sided(a_points, a_cells, b_points, b_cells, tolerance),
        one_sided(b_points, b_cells, a_points, a_cells, tolerance),
    )
