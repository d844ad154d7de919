"""Moves of rounded points by a step or two, for the triangles of the given ones: for encoders (docs/encoders.md, 5)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tin.rank import ranks

TURNS, MORE_TURNS = 1.25, 100
"""Number of moves tried, relative to the number of broken conditions, and in addition."""
_UNSURE = 1e-15
"""Determinants that are smaller, relative to their terms, are recomputed exactly."""
_SMALL = 1 << 14
"""Points closer than this have determinants of 64 bits."""
_ALONG = (-8, -4, -2, -1, 0, 1, 2, 4, 8)
_STEPS = np.array([(i, j) for i in _ALONG for j in _ALONG])
"""Places that a point may move to."""


class Conditions(NamedTuple):
    """Conditions for triangles to be those of a Delaunay triangulation.

    Attributes
    ----------
    turn : (A, 3) int64
        Anticlockwise triples of points.
    border : (B, 3) int64
        Triples of points along the border, which must not turn clockwise.
    circle : (C, 4) int64
        Anticlockwise triples, and a point that must not lie in their circle (spec clause 10.5.3).
    """

    turn: NDArray[np.int64]
    border: NDArray[np.int64]
    circle: NDArray[np.int64]


def conditions_of(
    cells: NDArray[np.int64], neighbour: NDArray[np.int64], needed: NDArray[np.bool_]
) -> Conditions:
    """Make the conditions that keep the ``needed`` (T,) of some anticlockwise triangles (T, 3) with their neighbours.
    """
    mate = np.where(neighbour >= 0, neighbour, 0)
    # each edge once, from the side of a needed triangle
    here = np.arange(len(cells))[:, None]
    asked = (neighbour >= 0) & needed[:, None] & (~needed[mate] | (here < neighbour))
    cell, face = np.nonzero(asked)
    other = cells[neighbour[cell, face]]
    ends = cells[cell[:, None], (face[:, None] + [1, 2]) % 3]
    apex = other[(other != ends[:, :1]) & (other != ends[:, 1:])]
    circle = np.column_stack([cells[cell], apex])
    cell, face = np.nonzero(neighbour < 0)
    begin, end = cells[cell, (face + 1) % 3], cells[cell, (face + 2) % 3]
    order = np.argsort(begin, kind="stable")
    at = order[np.minimum(np.searchsorted(begin[order], end), len(order) - 1)]
    border = np.column_stack([begin, end, end[at]])
    return Conditions(cells[needed], border[begin[at] == end], circle)


def broken_share(position: NDArray[np.int64], conditions: Conditions) -> float:
    """Share of the conditions that do not hold for points in these positions, (V, 2)."""
    rows = _Rows(position, conditions)
    return float(rows.broken(np.arange(len(rows.corner))).sum()) / max(len(rows.corner), 1)


def nudged(
    target: NDArray[np.float64], position: NDArray[np.int64], extent: Sequence[int], radius: float,
    conditions: Conditions,
) -> NDArray[np.int64] | None:
    """Move rounded points (V, 2), from 0 to below ``extent``, until all conditions hold; None if that is not reached.

    Points stay within ``radius`` of where they really lie, ``target`` (V, 2), both in units of positions.
    """
    rows = _Rows(position.copy(), conditions)
    reach = _Reach(target, np.array(extent), radius)
    broken = np.flatnonzero(rows.broken(np.arange(len(rows.corner)))).tolist()
    turns, waiting = int(TURNS * len(broken)) + MORE_TURNS, deque(broken)
    while waiting and turns:
        turns -= 1
        row = waiting.popleft()
        if not rows.broken(np.array([row]))[0]:
            continue
        move = _best_move(rows, reach, row)
        if move is None:
            # it weighs more from now on, against others that keep it from holding
            rows.weight[row] += 1
            waiting.append(row)
            continue
        v, rows.position[move[0]] = move
        around = rows.around(v)
        waiting.extend(around[rows.broken(around)].tolist())
    return None if waiting else rows.position


def _best_move(rows: _Rows, reach: _Reach, row: int) -> tuple[int, NDArray[np.int64]] | None:
    """Find the point of a broken condition, and its new place, that gain most; None if no place is a gain."""
    best: tuple[int, float] = (0, 0.0)
    found = None
    for v in rows.corner[row, : rows.count[row]].tolist():
        places, far = reach.around(v, rows.position[v])
        if not len(places):
            continue
        gained = rows.gained(v, places)
        k = int(np.lexsort((far, -gained))[0])
        if gained[k] > 0 and (int(gained[k]), -float(far[k])) > best:
            best, found = (int(gained[k]), -float(far[k])), (v, places[k])
    return found


class _Reach(NamedTuple):
    """Targets of points, bounds of positions, and how near these stay to the targets."""

    target: NDArray[np.float64]
    extent: NDArray[np.int64]
    radius: float

    def around(self, v: int, place: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Positions for a point other than its place, (K, 2), and how far they lie from it."""
        near = np.rint(self.target[v]).astype(np.int64) + _STEPS
        far = np.hypot(*(near - self.target[v]).T)
        inside = (far <= self.radius) & (near != place).any(axis=1)
        inside &= ((near >= 0) & (near < self.extent)).all(axis=1)
        return near[inside], far[inside]


class _Rows:
    """Conditions in one list, indexed by point."""

    def __init__(self, position: NDArray[np.int64], conditions: Conditions) -> None:
        self.position = position
        flat = np.concatenate([conditions.turn, conditions.border])
        self.corner = np.concatenate([np.column_stack([flat, flat[:, :1]]), conditions.circle])
        self.turns, self.count = len(conditions.turn), np.full(len(self.corner), 4)
        self.count[: len(flat)] = 3
        self.circles = len(flat)
        self.weight = np.ones(len(self.corner), np.int64)
        row = np.repeat(np.arange(len(self.corner)), self.count)
        owner = np.concatenate([flat.ravel(), conditions.circle.ravel()])
        order = np.argsort(owner, kind="stable")
        self._row = row[order]
        self._first = np.searchsorted(owner[order], np.arange(len(position) + 1))

    def around(self, v: int) -> NDArray[np.int64]:
        """Conditions on a point."""
        return self._row[self._first[v]: self._first[v + 1]]

    def broken(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Find which conditions do not hold."""
        return self._broken(rows, self.position[self.corner[rows]])

    def gained(self, v: int, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Compute by how much the weight of broken conditions falls if a point moves to each of some places (K, 2)."""
        rows = self.around(v)
        corner, weight = self.corner[rows], self.weight[rows]
        now = self.position[corner]
        moved = np.where((corner == v)[None, :, :, None], places[:, None, None, :], now[None])
        found = self._broken(np.tile(rows, len(places)), moved.reshape(-1, 4, 2))
        return self._broken(rows, now) @ weight - found.reshape(len(places), -1) @ weight

    def _broken(self, rows: NDArray[np.int64], at: NDArray[np.int64]) -> NDArray[np.bool_]:
        out = np.zeros(len(rows), np.bool_)
        circles = rows >= self.circles
        if circles.any():
            out[circles] = in_circle(at[circles])
        if not circles.all():
            a, b, c = at[~circles, :3].transpose(1, 0, 2)
            area = _cross(b - a, c - a)
            out[~circles] = area < (rows[~circles] < self.turns)
        return out


def _cross(u: NDArray[np.int64], v: NDArray[np.int64]) -> NDArray[np.int64]:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def in_circle(at: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Find whether the last of four positions lies in the circle of the others (spec 10.5.3), by rows (R, 4, 2).

    A triangulation has the same test for points that stay, numbered by their ranks; these move, and so do their ranks.
    """
    side = at[:, :3] - at[:, 3:]
    weight = np.stack([_cross(side[:, i], side[:, j]) for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    square = (side**2).sum(axis=2)
    terms = square.astype(np.float64) * weight
    found = terms.sum(axis=1)
    unsure = np.flatnonzero(np.abs(found) <= _UNSURE * np.abs(terms).sum(axis=1))
    if len(unsure):
        small = np.abs(side[unsure]).max(axis=(1, 2)) < _SMALL
        exact = np.zeros(len(unsure))
        few = unsure[small]
        exact[small] = np.sign((square[few] * weight[few]).sum(axis=1))
        for k in np.flatnonzero(~small).tolist():
            pairs = zip(square[unsure[k]].tolist(), weight[unsure[k]].tolist(), strict=True)
            total = sum(a * b for a, b in pairs)
            exact[k] = (total > 0) - (total < 0)
        found[unsure] = exact
        ties = unsure[exact == 0]
        # on a circle the weight of the position of lowest rank decides, of those that are not 0
        weights = np.column_stack([weight[ties], -weight[ties].sum(axis=1)])
        x, y = at[ties].transpose(2, 0, 1)
        order = np.lexsort((y, x, ranks(x, y), weights == 0), axis=1)
        found[ties] = np.take_along_axis(weights, order[:, :1], axis=1)[:, 0]
    return found > 0
