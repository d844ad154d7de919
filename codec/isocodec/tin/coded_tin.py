"""Coding of points and values, in layers that each add points (spec clause 10.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..entropy.range_coder import UNLIMITED
from ..entropy.run import Account, Run, WritingRun, whole_run
from ..errors import FormatError
from ..kernel import DONE, NEED
from .delaunay import hull_alone, insert_all, insertion_order
from .models import new_coder
from .point_tree import code_positions
from .point_values import SEEN, Values, code_corners, code_inner
from .rank import by_rank
from .triangulation import Triangulation

_ROUND, _FACTOR = 64, 4
"""Points of lowest rank in the first round, and the growth of their number in each later round."""
STEPS = 16
"""Triangles visited per unit of work."""
_ROOM = 32
"""Most symbols of a run per point."""
_REASONS = {0: ("a value out of range", "10.9.4")}


@dataclass(frozen=True)
class SurfaceLayers:
    """Points of all layers.

    Attributes
    ----------
    points : (N, 2) int64
        Distinct positions from 0 on.
    numbers : (N,) int64
    ends : tuple of int
        Number of points after each layer; the last layer may be partial.
    complete : bool
        Whether all layers of the run have been decoded.
    places : tuple of int
        Bytes of the run after which each layer is complete, if it was decoded.
    """

    points: NDArray[np.int64]
    numbers: NDArray[np.int64]
    ends: tuple[int, ...]
    complete: bool = True
    places: tuple[int, ...] = ()

    def first(self, layers: int | None) -> SurfaceLayers:
        """Take the first ``layers`` layers, or all if there are fewer or no number is given."""
        if layers is None or layers >= len(self.ends):
            return self
        end = self.ends[layers - 1]
        return SurfaceLayers(self.points[:end], self.numbers[:end], self.ends[:layers], False, self.places[:layers])


def rounds(count: int) -> NDArray[np.int64]:
    """Round of each of ``count`` points, by rank."""
    out = np.zeros(count, np.int64)
    end, number = _ROUND, 0
    while end < count:
        number += 1
        out[end:] = number
        end *= _FACTOR
    return out


class _Surface:
    """Points and numbers of the layers so far, of an encoder or decoder."""

    def __init__(self, run: Run, extent: tuple[int, int], most: int) -> None:
        self.run, self.extent, self.most = run, extent, most
        self.points = np.zeros((0, 2), np.int64)
        self.numbers = np.zeros(0, np.int64)
        self.corners = np.zeros((0, 2), np.int64)
        self.ends: list[int] = []

    def layer(
        self, count: int, largest: int, points: NDArray[np.int64] | None, numbers: NDArray[np.int64] | None
    ) -> int:
        """Code the next layer; returns a status."""
        coder = self.run.coder
        status, found = code_positions(self.run, self.extent, count, points, self.most)
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
            status = code_corners(coder, values, hull)
            if status == DONE:
                told[hull] = True
                queue = queue[~told[queue]]
        done = 0
        if status == DONE:
            status, done = code_inner(coder, tri, values, queue, self.run.left(STEPS))
            told[queue[:done]] = True
            # where it has stopped, this exceeds what was left
            self.run.spend(tri.reg.work, STEPS)
        if status == DONE or told.sum() > known:
            self.points, self.numbers = union[told[place]], number[place][told[place]]
            self.ends.append(len(self.points))
        return status

    def _triangulation(
        self, x: NDArray[np.int64], y: NDArray[np.int64], known: NDArray[np.int64]
    ) -> tuple[Triangulation, NDArray[np.int32]]:
        """Triangulate the known points, or only the hull; also returns its corners, from the lowest rank on."""
        tri, hull = hull_alone(x, y)
        if len(hull) < 3:
            raise FormatError("all points lie on a line", code="points", clause="10.9.3")
        hull = np.roll(hull, -int(hull.argmin()))
        if len(known) and not np.isin(hull, known).all():
            raise FormatError("points outside of those of the first layer", code="points", clause="10.9.3")
        if len(known):
            early = np.sort(known)
            insert_all(tri, early[insertion_order(x[early], y[early])].astype(np.int32), UNLIMITED)
        return tri, hull


def encoded(layers: SurfaceLayers, extent: tuple[int, int], largest: int) -> bytes:
    """Encode layers of points from 0 to below ``extent``, and numbers from 0 to ``largest``, to a run.
    """
    run = WritingRun(new_coder())
    run.room(_ROOM * len(layers.points) + 2048)
    surface = _Surface(run, extent, len(layers.points))
    begin = 0
    for end in layers.ends:
        run.check(surface.layer(end - begin, largest, layers.points[begin:end], layers.numbers[begin:end]))
        begin = end
    return run.end()


def decoded(
    data: bytes, counts: Sequence[int], extent: tuple[int, int], largest: int, most: int, account: Account,
    at: int = 0, whole: bool = True,
) -> SurfaceLayers:
    """Decode a run, which lies at ``at`` in the file; inverse of ``encoded``.

    ``counts`` are the approximate numbers of points of the layers. Unless ``whole``, the run is truncated, and what it
    holds is decoded. Raises `FormatError` if the run is malformed, `LimitError` if it has more than ``most`` points or
    takes more than the account allows.
    """
    run = whole_run(new_coder(), data, account, at, last=whole)
    surface = _Surface(run, extent, most)
    places: list[int] = []
    for count in counts:
        status = surface.layer(count, largest, None, None)
        if status == NEED and not whole:
            run.count()
            return SurfaceLayers(surface.points, surface.numbers, tuple(surface.ends), False, tuple(places))
        run.check(status, _REASONS, code="value")
        places.append(min(run.passed + 4, run.read))
    if whole:
        run.end()
    return SurfaceLayers(surface.points, surface.numbers, tuple(surface.ends), places=tuple(places))
