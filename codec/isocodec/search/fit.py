"""Points of a coarse curve moved along their edges so that it lies on both sides of the original (spec annex G).

A curve whose points lie where the original crosses the edges is inscribed: where the original bends, all of it lies on
one side. Moving its points halves the distance, or allows a mesh of half as many leaves. Distances change nearly
linearly with the points: for each point of the original, with the piece that is nearest. The points are moved one by
one to where their surroundings like them best, over and over; then the nearest pieces are found anew.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..drawing.contour import Contour
from ..drawing.crossing import distinct_pairs, edge_points, edge_ratios
from ..drawing.leaves import Leaves
from ..drawing.simplices import crossed, rings
from .around import Around
from .proof import Target
from .pull import Follow, Pull, places_on, relax, slopes_of, sort_by_told

ROUNDS = (0.5, 0.5, 1.0, 1.0, 1.0)
"""Steps of the points in each round, in units of the parts that are stored."""
AGAIN = ROUNDS[-1:]
"""Steps where most points were fitted before."""
SWEEPS = 2
REACHES = (0.4, 1.0, 2.0)
"""Points of a curve farther than the last one of these, in tolerances, from the other pull at nothing; near ones are
found faster."""
NAMED = 2.0**20
"""Parts of a cell: points are the same if they are rounded to so many parts alike."""
MOSTLY = 0.5
"""Share of the curve from which on all of it is fitted anew, and held against the original."""
MARGIN = 0.95
"""Share of the tolerance from which on distances count as too large."""


class _Fit:
    """A drawing of leaves whose points on the edges that carry offsets can be moved."""

    def __init__(self, leaves: Leaves, told: NDArray[np.int64]) -> None:
        self.leaves = leaves
        self.edges, self.cells = crossed(leaves)
        vertices = len(leaves.position)
        self.told = np.searchsorted(self.edges @ (vertices, 1), told @ (vertices, 1))
        self.number = np.full(len(self.edges), -1)
        self.number[self.told] = np.arange(len(told))
        self.rings = list(rings(leaves, self.edges))
        self.stated, _ = edge_ratios(leaves, self.edges)
        self.way = np.diff(leaves.position[self.edges].astype(np.float64), axis=1)[:, 0]
        self.samples = _samples(self.cells, len(self.edges))

    def points(self, where: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the drawing with those of the coded edges at ``where``."""
        self.stated[self.told] = where
        for ring in self.rings:
            self.stated[ring.edge] = ring.ratio(self.stated)
        return edge_points(self.leaves, self.edges, self.stated)

    def linear(
        self, points: NDArray[np.float64], contour: Contour, targets: Sequence[Target], part: Part | None
    ) -> Pull:
        """Distances between the curves, from points of either, of a part if one is given, and how they fall."""
        sides = self._from_original(points, contour, targets, part), self._from_drawing(points, contour, targets, part)
        ends = np.cumsum([0] + [len(side.piece) for side in sides])
        gap, slope = np.empty(ends[-1]), np.empty((ends[-1], points.shape[1]))
        for side, first, last in zip(sides, ends[:-1], ends[1:], strict=True):
            gaps, slopes = gap[first:last], slope[first:last]
            slopes_of(points, self.way, side.cells, side.piece, side.weight, side.there, gaps, slopes)
        follow = self.follow()

        def enter(place: NDArray[np.int64], samples: NDArray[np.int64], slopes: NDArray[np.float64]) -> None:
            for side, first, last in zip(sides, ends[:-1], ends[1:], strict=True):
                sort_by_told(follow, side.cells, side.piece, slope[first:last], int(first), place, samples, slopes)

        start = np.zeros(len(self.told) + 1, np.int64)
        enter(start[1:], np.empty(0, np.int64), np.empty(0))
        start = np.cumsum(start)
        samples, slopes = np.empty(start[-1], np.int64), np.empty(start[-1])
        enter(start[:-1].copy(), samples, slopes)
        return Pull(start, samples, slopes, gap, np.concatenate([side.times for side in sides]))

    def _from_original(
        self, points: NDArray[np.float64], contour: Contour, targets: Sequence[Target], part: Part | None
    ) -> _Held:
        """Points of the original, and where they are nearest to the drawing."""
        there, cells = contour.points, self.cells
        if part:
            there, cells = there[part.near.holds(there)], cells[part.seen]
        piece, weight = _nearest(there, [Target(points, cells, target.limit) for target in targets])
        return _Held(cells, piece, weight, there.copy(), np.ones(len(piece)))

    def _from_drawing(
        self, points: NDArray[np.float64], contour: Contour, targets: Sequence[Target], part: Part | None
    ) -> _Held:
        """Points of the drawing, and the original's that are nearest to them."""
        some = np.arange(len(self.samples.corner))
        if part:
            some = np.flatnonzero((part.moving[self.samples.corner] & (self.samples.weight > 0)).any(axis=1))
        own = np.empty((len(some), points.shape[1]))
        places_on(points, self.samples.corner, some, self.samples.weight[some], own)
        found, weight = _nearest(own, targets)
        there = np.empty_like(own)
        places_on(contour.points, contour.cells, found, weight, there)
        return _Held(self.samples.corner, np.where(found >= 0, some, -1), self.samples.weight[some], there,
                     self.samples.times[some])

    def moving(self, free: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Edges whose points may move if those of some of the coded ones do."""
        follow = self.follow()
        free_of = np.concatenate([[0], np.cumsum(free[follow.told])])
        return np.asarray(np.diff(free_of[follow.start]) > 0)

    def follow(self) -> Follow:
        """Coded edges that the point of each edge follows, and by how much, edge by edge.

        Points of implied edges follow from those at their rings.
        """
        edge = via = np.arange(len(self.edges))
        share = np.ones(len(edge))
        row = np.empty(len(edge), np.int64)
        for ring in self.rings[::-1]:
            row[:] = -1
            row[ring.edge] = np.arange(len(ring.edge))
            some = np.flatnonzero(row[via] >= 0)
            at = row[via[some]]
            follows = share[some, None] * ring.slopes(self.stated)[at]
            edge = np.concatenate([edge, np.repeat(edge[some], follows.shape[1])])
            via = np.concatenate([via, ring.beside[at].ravel()])
            share = np.concatenate([share, follows.ravel()])
        some = np.flatnonzero(self.number[via] >= 0)
        some = some[np.argsort(edge[some], kind="stable")]
        start = np.searchsorted(edge[some], np.arange(len(self.edges) + 1))
        return Follow(start, self.number[via[some]], share[some])


@dataclass(frozen=True)
class _Held:
    """Places on ``cells[piece]`` by ``weight``, -1 for none; the nearest ones ``there`` on the other curve.

    Each counts so many ``times``.
    """

    cells: NDArray[np.int64]
    piece: NDArray[np.int64]
    weight: NDArray[np.float64]
    there: NDArray[np.float64]
    times: NDArray[np.float64]


@dataclass(frozen=True)
class _Samples:
    """Corners, sides' middles and centres of pieces.

    Attributes
    ----------
    corner : (K, n) int64
        Numbers of points,
    weight : (K, n) float64
        how much each counts,
    times : (K,) float64
        and of how many pieces it is a sample.
    """

    corner: NDArray[np.int64]
    weight: NDArray[np.float64]
    times: NDArray[np.float64]


def _samples(cells: NDArray[np.int64], points: int) -> _Samples:
    """Those of pieces between a number of points."""
    n = cells.shape[1]
    at = np.bincount(cells.ravel(), minlength=points)
    if n == 2:
        # each end is the side that lies opposite the other one, too
        parts, times = [np.arange(points)[:, None], cells], [2 * at, np.ones(len(cells))]
    else:
        sides, number = distinct_pairs(np.arange(points), cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2))
        parts = [np.arange(points)[:, None], sides, cells]
        times = [at, np.bincount(number, minlength=len(sides)), np.ones(len(cells))]
    corner = np.concatenate([np.pad(part, ((0, 0), (0, n - part.shape[1]))) for part in parts])
    weight = np.concatenate([np.tile((np.arange(n) < part.shape[1]) / part.shape[1], (len(part), 1)) for part in parts])
    return _Samples(corner, weight, np.concatenate(times).astype(np.float64))


def _nearest(samples: NDArray[np.float64], targets: Sequence[Target]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the nearest piece as `Target.nearest`, for targets of growing limits."""
    piece, weight = targets[0].nearest(samples)
    for target in targets[1:]:
        left = np.flatnonzero(piece < 0)
        piece[left], weight[left] = target.nearest(samples[left])
    return piece, weight


@dataclass(frozen=True)
class Part:
    """Part of the curve that a fit works on, where most of it stays as it was.

    Attributes
    ----------
    moving : (E,) bool
        Edges whose points may move.
    changed : (K,) int64
        Pieces of the drawing that may be others than before, and those that were too far away.
    near : Around
        What lies within the tolerance of these and of others that are gone.
    seen : (K,) int64
        Pieces that this has to be held against.
    """

    moving: NDArray[np.bool_]
    changed: NDArray[np.int64]
    near: Around
    seen: NDArray[np.int64]


@dataclass(frozen=True)
class Drawing:
    """Result of a fit: parts of edges that hold the points, and the curve through their middles.

    Attributes
    ----------
    number : (E,) int64
    points : (P, n) float64
    cells : (M, n) int64
    part : Part, optional
        Where it may differ from the drawing before; the whole domain if not given.
    """

    number: NDArray[np.int64]
    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    part: Part | None = None


@dataclass(frozen=True)
class Faults:
    """Places where a drawing is too far from the original: (K, n) on either, and numbers of the drawing's pieces."""

    drawing: Drawing
    places: NDArray[np.float64]
    pieces: NDArray[np.int64]


def fitted_offsets(
    contour: Contour, targets: Sequence[Target], leaves: Leaves, told: NDArray[np.int64], parts: NDArray[np.int64],
    where: NDArray[np.float64], tolerance: float, *, faults: Faults | None = None, around: Around | None = None,
    fixed: NDArray[np.bool_] | None = None,
) -> Drawing:
    """Parts of edges that hold the points of a curve near the original.

    Parameters
    ----------
    contour : Contour
        The original curve.
    targets : sequence of Target
        The same, to be held against within ``REACHES`` tolerances.
    leaves : Leaves
        Those of the coarse mesh.
    told : (E, 2) int64
        Their edges that carry offsets, as vertices of the leaves, the lower end first.
    parts : (E,) int64
        How finely a decoder knows the points on them.
    where : (E,) float64
        Where on them to begin, as fractions.
    tolerance : float
    faults : Faults, optional
        Faults of a drawing that shares most of its points.
    around : Around, optional
        What lies around these faults: points elsewhere stay.
    fixed : (E,) bool, optional
        So do points on these edges.
    """
    fit = _Fit(leaves, told)
    where = where.copy()
    step, part = 1.0 / parts, None
    if faults and around:
        where = _middles(where, parts)
        points = fit.points(where)
        step = np.where(around.holds(points[fit.told]), step, 0.0)
        part = _part(fit, points, fit.moving(step > 0.0), faults, around, tolerance)
    if fixed is not None:
        step = np.where(fixed, 0.0, step)
    for share in AGAIN if faults else ROUNDS:
        if share == 1.0:
            where = _middles(where, parts)
        pull = fit.linear(fit.points(where), contour, targets, part)
        relax(pull, where, share * step, 2, 1.0 / (MARGIN * tolerance), SWEEPS)
    number = np.minimum(np.floor(where * parts), parts - 1).astype(np.int64)
    return Drawing(number, fit.points((number + 0.5) / parts), fit.cells, part)


def _middles(where: NDArray[np.float64], parts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Middles of the parts that hold some places."""
    return np.asarray((np.minimum(np.floor(where * parts), parts - 1) + 0.5) / parts)


def _part(
    fit: _Fit, points: NDArray[np.float64], moving: NDArray[np.bool_], faults: Faults, around: Around, reach: float
) -> Part | None:
    """Part that differs from the drawing before, or may when some edges' points move; None if that is most of it."""
    before = faults.drawing
    now, then = names(points, fit.cells), names(before.points, before.cells)
    changed = moving[fit.cells].any(axis=1) | ~np.isin(now, then) | np.isin(now, then[faults.pieces])
    if changed.mean() > MOSTLY:
        return None
    gone = before.cells[~np.isin(then, now)]
    near = around.covering(points, fit.cells[changed], reach).covering(before.points, gone, reach)
    seen = near.wider(REACHES[-1] * reach).meets(points, fit.cells)
    return Part(moving, np.flatnonzero(changed), near, seen)


def names(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.uint64]:
    """A number for each piece that depends on where its corners are, and not on how they are numbered."""
    whole = np.rint(points * NAMED).astype(np.int64).astype(np.uint64)
    of_point = np.zeros(len(points), np.uint64)
    for axis in range(points.shape[1]):
        of_point = (of_point ^ whole[:, axis]) * np.uint64(0x9E3779B97F4A7C15)
        of_point ^= of_point >> np.uint64(29)
    return np.asarray(of_point[cells].sum(axis=1, dtype=np.uint64))
