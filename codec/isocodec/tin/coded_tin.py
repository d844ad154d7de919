"""Points and values in a run, in layers that add points to those before (spec clause 10.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..entropy.range_coder import DECODE, ENCODE, Coder, finish, start
from ..errors import FormatError, LimitError
from ..kernel import BAD, DONE, GROW, NEED
from .delaunay import build_hull, hull_of, insert_all, insertion_order
from .models import new_coder
from .point_tree import code_positions
from .point_values import SEEN, Values, code_corners, code_inner
from .rank import by_rank
from .triangulation import Triangulation, empty

_ROUND, _FACTOR = 64, 4
"""Points of lowest rank that come first, and how many times as many have come after each later round."""
STEPS = 16
"""Triangles that are looked at for a unit of work."""
UNLIMITED = 1 << 62
_ROOM = 64
"""Bytes of a run for each point at most, and some more."""


@dataclass(frozen=True)
class Layers:
    """Points of all layers.

    Attributes
    ----------
    points : (N, 2) int64
        Distinct positions from 0 on.
    numbers : (N,) int64
    ends : tuple of int
        How many points there are after each layer.
    complete : bool
        Whether all layers of the run are there.
    """

    points: NDArray[np.int64]
    numbers: NDArray[np.int64]
    ends: tuple[int, ...]
    complete: bool = True


def rounds(count: int) -> NDArray[np.int64]:
    """The round in which each of so many points comes, by rank."""
    out = np.zeros(count, np.int64)
    end, number = _ROUND, 0
    while end < count:
        number += 1
        out[end:] = number
        end *= _FACTOR
    return out


class _Run:
    """One pass over a run, in either direction."""

    def __init__(self, coder: Coder, extent: tuple[int, int], most: int, work: int) -> None:
        self.coder, self.extent, self.most, self.work = coder, extent, most, work
        self.points = np.zeros((0, 2), np.int64)
        self.numbers = np.zeros(0, np.int64)
        self.corners = np.zeros((0, 2), np.int64)
        self.ends: list[int] = []

    def layer(
        self, count: int, largest: int, points: NDArray[np.int64] | None, numbers: NDArray[np.int64] | None
    ) -> int:
        """Code the next layer; a status."""
        status, found, self.work = code_positions(self.coder, self.extent, count, points, self.most, self.work)
        if status != DONE:
            return status
        known = len(self.points)
        union = np.concatenate([self.points, found])
        order = by_rank(union[:, 0], union[:, 1])
        x, y = np.ascontiguousarray(union[order].T)
        if np.any((x[1:] == x[:-1]) & (y[1:] == y[:-1])):
            raise FormatError("points come twice", code="points", clause="10.9.3")
        place = np.empty(len(union), np.int64)
        place[order] = np.arange(len(union))
        new = place[known:]
        number = np.zeros(len(union), np.int64)
        number[place[:known]] = self.numbers
        if numbers is not None:
            assert points is not None
            # by position: the tree has its own order
            number[new[np.lexsort(found.T)]] = numbers[np.lexsort(points.T)]
        values = Values(number, np.zeros(len(union), np.int64), np.zeros(SEEN, np.int64), np.array([largest], np.int64))
        ranked = np.argsort(new, kind="stable")
        turn = np.empty(len(new), np.int64)
        turn[ranked] = rounds(len(new))
        queue = new[np.argsort(turn, kind="stable")].astype(np.int32)
        tri, hull = self._triangulation(x, y, place[:known])
        told = np.zeros(len(union), np.bool_)
        told[place[:known]] = True
        if known == 0:
            status = code_corners(self.coder, values, hull)
            if status == DONE:
                told[hull] = True
                queue = queue[~told[queue]]
        done = 0
        if status == DONE:
            status, done = code_inner(self.coder, tri, values, queue, min(STEPS * self.work, UNLIMITED))
            told[queue[:done]] = True
            self.work -= tri.reg.work // STEPS
        if status == DONE or told.sum() > known:
            self.points, self.numbers = union[told[place]], number[place][told[place]]
            self.ends.append(len(self.points))
        return status

    def _triangulation(
        self, x: NDArray[np.int64], y: NDArray[np.int64], known: NDArray[np.int64]
    ) -> tuple[Triangulation, NDArray[np.int32]]:
        """The triangulation of the points known before, or of the hull; its corners from the lowest rank on."""
        tri = empty(x, y)
        hull = np.zeros(2 * len(x) + 2, np.int32)
        count = hull_of(tri, np.lexsort((y, x)), hull) if len(x) > 2 else 0
        if count < 3:
            raise FormatError("all points lie on a line", code="points", clause="10.9.3")
        hull = np.roll(hull[:count], -int(hull[:count].argmin()))
        if len(known) and not np.isin(hull, known).all():
            raise FormatError("points outside of those of the first layer", code="points", clause="10.9.3")
        build_hull(tri, hull, np.sort(hull), np.zeros(len(x), np.int32), np.zeros(len(x), np.int32))
        if len(known):
            early = np.sort(known)
            insert_all(tri, early[insertion_order(x[early], y[early])].astype(np.int32), UNLIMITED)
        return tri, hull


def encoded(layers: Layers, extent: tuple[int, int], largest: int) -> bytes:
    """The run of layers.

    Parameters
    ----------
    layers : Layers
    extent : (int, int)
        Positions are below these.
    largest : int
        Numbers are from 0 to this.
    """
    coder = new_coder()._replace(buf=np.zeros(_ROOM * len(layers.points) + 4096, np.uint8))
    start(coder.reg, ENCODE)
    run = _Run(coder, extent, len(layers.points), UNLIMITED)
    begin = 0
    for end in layers.ends:
        status = run.layer(end - begin, largest, layers.points[begin:end], layers.numbers[begin:end])
        assert status == DONE
        begin = end
    return finish(coder)


def decoded(
    data: bytes, counts: Sequence[int], extent: tuple[int, int], largest: int, most: int, work: int, whole: bool = True
) -> Layers:
    """Inverse of ``encoded``.

    Parameters
    ----------
    counts : sequence of int
        About how many points each layer has.
    most : int
        Points at most.
    work : int
        Units of work at most (`Limits.work`).
    whole : bool
        Whether these are all bytes of the run; if not, what they say is taken.

    Raises
    ------
    FormatError
        If the run is not one of points and values.
    LimitError
        If it takes more than allowed.
    """
    coder = new_coder()._replace(buf=np.frombuffer(data, np.uint8).copy())
    start(coder.reg, DECODE)
    coder.reg.end, coder.reg.final = len(data), int(whole)
    run = _Run(coder, extent, most, work)
    for count in counts:
        status = run.layer(count, largest, None, None)
        if status == GROW:
            raise LimitError("a triangulation takes more than allowed", code="limit-work", clause="11.2")
        if status == BAD:
            raise FormatError("a value out of range", code="value", clause="10.9.4")
        if status == NEED and not whole:
            return Layers(run.points, run.numbers, tuple(run.ends), False)
        if status == NEED:
            raise FormatError("a run is too short", code="overrun", clause="6.3")
    if whole and coder.reg.pos - 4 + coder.reg.unknown // 8 + 4 < len(data):
        raise FormatError("bytes left over in a run", code="leftover", clause="6.3")
    return Layers(run.points, run.numbers, tuple(run.ends))
