"""Points and values in a run, in layers that add points to those before (spec clause 10.9)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..entropy.range_coder import UNLIMITED
from ..entropy.run import Account, Run, WritingRun, whole_run
from ..errors import FormatError
from ..kernel import DONE, NEED
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
_ROOM = 32
"""Symbols of a run for each point at most, and some more."""
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
        How many points there are after each layer; the last one may not be whole.
    complete : bool
        Whether all layers of the run are there.
    places : tuple of int
        Bytes of the run after which each whole layer is there, if it was decoded.
    """

    points: NDArray[np.int64]
    numbers: NDArray[np.int64]
    ends: tuple[int, ...]
    complete: bool = True
    places: tuple[int, ...] = ()

    def first(self, layers: int | None) -> SurfaceLayers:
        """The first layers, as far as they are there; all if no number is given."""
        if layers is None or layers >= len(self.ends):
            return self
        end = self.ends[layers - 1]
        return SurfaceLayers(self.points[:end], self.numbers[:end], self.ends[:layers], False, self.places[:layers])


def rounds(count: int) -> NDArray[np.int64]:
    """The round in which each of so many points comes, by rank."""
    out = np.zeros(count, np.int64)
    end, number = _ROUND, 0
    while end < count:
        number += 1
        out[end:] = number
        end *= _FACTOR
    return out


class _Surface:
    """Points and numbers of the layers so far, in either direction."""

    def __init__(self, run: Run, extent: tuple[int, int], most: int) -> None:
        self.run, self.extent, self.most = run, extent, most
        self.points = np.zeros((0, 2), np.int64)
        self.numbers = np.zeros(0, np.int64)
        self.corners = np.zeros((0, 2), np.int64)
        self.ends: list[int] = []

    def layer(
        self, count: int, largest: int, points: NDArray[np.int64] | None, numbers: NDArray[np.int64] | None
    ) -> int:
        """Code the next layer; a status."""
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


def encoded(layers: SurfaceLayers, extent: tuple[int, int], largest: int) -> bytes:
    """The run of layers.

    Parameters
    ----------
    layers : SurfaceLayers
    extent : (int, int)
        Positions are below these.
    largest : int
        Numbers are from 0 to this.
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
    """Inverse of ``encoded``.

    Parameters
    ----------
    data : bytes
        The run.
    counts : sequence of int
        About how many points each layer has.
    extent, largest
        As of ``encoded``.
    most : int
        Points at most.
    account : Account
        The file's.
    at : int
        Where the run lies in the file.
    whole : bool
        Whether these are all bytes of the run; if not, what they hold is decoded.

    Raises
    ------
    FormatError
        If the run is not one of points and values.
    LimitError
        If it takes more than the account allows.
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
