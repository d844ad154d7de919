"""Curves of neighbouring isovalues, which a curve of the plane must not cross (docs/encoders.md, 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from .piece import TOUCH
from .proof import Target


class Fences:
    """The curves next to that of an isovalue of a map: of the isovalue below it and of that above.

    Parameters
    ----------
    isovalue : float
    coded : sequence of Contour
        What decoders draw of those that are coded already.
    waiting : sequence of Contour
        Original curves of the others. To cross them is no fault as such, but leaves no room for what is coded later.
    """

    def __init__(self, isovalue: float, coded: Sequence[Contour], waiting: Sequence[Contour]) -> None:
        self._isovalue = isovalue
        self._coded, self._waiting = ([_Curve(one.points, one.cells, one.isovalue) for one in some]
                                      for some in (coded, waiting))

    def coded_crossed(self, contour: Contour) -> NDArray[np.float64]:
        """Places where a curve crosses those that are coded, (K, 2)."""
        return self._places(contour, self._coded)

    def waiting_crossed(self, contour: Contour) -> NDArray[np.float64]:
        """Places where a curve crosses the original curves of the others, (K, 2)."""
        return self._places(contour, self._waiting)

    def _places(self, contour: Contour, fences: Sequence[_Curve]) -> NDArray[np.float64]:
        curve = _Curve(contour.points, contour.cells, self._isovalue)
        found = [each for fence in fences if len(fence.cells) and len(curve.cells) for each in _crossed(curve, fence)]
        return np.concatenate([np.zeros((0, 2)), *found])


class _Curve:
    """Segments of the plane with higher values on their left, and which way they go from each point.

    ``ahead`` and ``back`` (P, 2) lead from the points to the next ones; NaN where the curve begins or ends.
    """

    def __init__(self, points: NDArray[np.float64], cells: NDArray[np.int64], isovalue: float) -> None:
        self.points, self.cells, self.isovalue = points, cells, isovalue
        self.target = Target(points, cells, TOUCH)
        self.ahead, self.back = np.full(points.shape, np.nan), np.full(points.shape, np.nan)
        way = points[cells[:, 1]] - points[cells[:, 0]]
        self.ahead[cells[:, 0]], self.back[cells[:, 1]] = way, -way

    def ways_at(self, piece: NDArray[np.int64], second: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The ways ahead and back from places on pieces, by the weight of the second end."""
        begin, end = self.cells[piece].T
        way = self.points[end] - self.points[begin]
        length = np.hypot(*way.T)
        at_begin, at_end = (second * length <= TOUCH)[:, None], ((1 - second) * length <= TOUCH)[:, None]
        ahead = np.where(at_begin, self.ahead[begin], np.where(at_end, self.ahead[end], way))
        return ahead, np.where(at_begin, self.back[begin], np.where(at_end, self.back[end], -way))


def _crossed(curve: _Curve, fence: _Curve) -> list[NDArray[np.float64]]:
    """Find where a curve crosses another one: inside segments of both, or at points of either that lie on the other."""
    found = [fence.target.crossed(curve.points, curve.cells).places]
    for one, other in ((curve, fence), (fence, curve)):
        piece, weight = other.target.nearest(one.points)
        there = np.flatnonzero((piece >= 0) & ~np.isnan(one.ahead + one.back).any(axis=1))
        ways = other.ways_at(piece[there], weight[there, 1])
        # what is higher lies on the left
        left = [_left(way[there], *ways) for way in (one.ahead, one.back)]
        wrong = np.minimum(*left) < 0 if one.isovalue > other.isovalue else np.maximum(*left) > 0
        found.append(one.points[there[wrong]])
    return found


def _left(way: NDArray[np.float64], ahead: NDArray[np.float64], back: NDArray[np.float64]) -> NDArray[np.int64]:
    """1 where a way leads to the left of a curve, -1 to the right, 0 along it, or where the curve ends, (K,)."""
    turn = [_turn(ahead, each) for each in (way, back)]
    along = np.minimum(_apart(way, ahead), _apart(way, back)) <= TOUCH
    out = np.where(turn[0] < turn[1], 1, -1)
    return np.where(along | np.isnan(turn[0]) | np.isnan(turn[1]), 0, out)


def _turn(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle from one way to another, from 0 to a whole turn."""
    return np.asarray((np.arctan2(b[:, 1], b[:, 0]) - np.arctan2(a[:, 1], a[:, 0])) % (2 * np.pi))


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle between two ways."""
    turn = _turn(a, b)
    return np.minimum(turn, 2 * np.pi - turn)
