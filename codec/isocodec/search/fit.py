"""Points of a coarse curve moved along their edges so that it lies on both sides of the original (spec annex G).

A curve whose points lie where the original crosses the edges is inscribed: where the original bends, all of it lies on
one side. Moving its points halves the distance, or allows a mesh of half as many leaves. Distances change nearly
linearly with the points: for each point of the original, with the piece that is nearest. The points are moved one by
one to where their surroundings like them best, over and over; then the nearest pieces are found anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..drawing.contour import Contour
from ..drawing.crossing import edge_points, edge_ratios
from ..drawing.leaves import Leaves
from ..drawing.simplices import crossed, rings
from ..kernel import inner, kernel, record
from ..kernel.types import FloatMatrix, FloatVector, IntMatrix, IntVector
from .around import Around
from .proof import Target

ROUNDS = (0.5, 0.5, 1.0, 1.0, 1.0)
"""Steps of the points in each round, in units of the parts that are told."""
AGAIN = ROUNDS[-1:]
"""The same where most points were fitted before."""
SWEEPS = 2
REACHES = (0.4, 2.0)
"""Points of a curve farther than the last one of these, in tolerances, from the other pull at nothing; near ones are
found faster."""
MARGIN = 0.95
"""Share of the tolerance from which on distances count as too large."""
_SLOPE = 1e-6
"""Slopes below this are left out."""
_TOUCH = 1e-9
"""Distance in cells below which curves touch: only normals say where a distance would grow."""


@inner
def _penalty(x):
    """Of a distance as a share of the tolerance: small ones hardly count, those beyond nearly exclude all else."""
    y = x * x
    z = y * y
    return 0.02 * y + z * z


@record
class Pull(NamedTuple):
    """How distances of points of either curve change as the points on edges move.

    Attributes
    ----------
    first : (E + 1,) int64
        ``samples[first[e] : first[e + 1]]`` are the points that notice edge e.
    samples : int64 vector
    slopes : float64 vector
        How much the distance of each of these falls as the point on the edge moves up.
    gap : (S,) float64
        The distance of each point.
    """

    first: IntVector
    samples: IntVector
    slopes: FloatVector
    gap: FloatVector


@kernel
def relax(pull: Pull, where: FloatVector, step: FloatVector, most: int, scale: float, sweeps: int) -> None:
    """Move each edge's point by up to ``most`` steps to where the penalty is least; ``pull.gap`` is kept up to date.

    Where the step is 0 it stays.
    """
    first, samples, slopes, gap = pull.first, pull.samples, pull.slopes, pull.gap
    for _ in range(sweeps):
        for e in range(len(where)):
            if first[e] == first[e + 1] or step[e] == 0.0:
                continue
            best, least = 0, np.inf
            for turn in range(2 * most + 1):
                move = turn - most
                if not 0.0 < where[e] + move * step[e] < 1.0:
                    continue
                total = 0.0
                for j in range(first[e], first[e + 1]):
                    total += _penalty((gap[samples[j]] - slopes[j] * move * step[e]) * scale)
                if total < least:
                    best, least = move, total
            if best != 0:
                where[e] += best * step[e]
                for j in range(first[e], first[e + 1]):
                    gap[samples[j]] -= slopes[j] * best * step[e]


@kernel
def _slopes(
    points: FloatMatrix, way: FloatMatrix, corners: IntMatrix, weight: FloatMatrix, apart: FloatMatrix,
    gap: FloatVector, slope: FloatMatrix,
) -> None:  # fmt: skip
    """Lengths of ``apart``, and how they fall as the corners' points move along their edges."""
    n = points.shape[1]
    for i in range(len(corners)):
        far = 0.0
        for axis in range(n):
            far += apart[i, axis] * apart[i, axis]
        far = np.sqrt(far)
        gap[i] = far
        if far > _TOUCH:
            for axis in range(n):
                apart[i, axis] /= far
        else:
            _normal(points, corners[i], apart[i])
        for k in range(n):
            along = 0.0
            for axis in range(n):
                along += way[corners[i, k], axis] * apart[i, axis]
            slope[i, k] = weight[i, k] * along


@inner
def _normal(points, corners, out):
    """Unit normal of a piece, 0 where there is none."""
    a, b = points[corners[0]], points[corners[1]]
    if len(corners) == 2:
        out[0], out[1] = a[1] - b[1], b[0] - a[0]
        length = np.sqrt(out[0] * out[0] + out[1] * out[1])
    else:
        c = points[corners[2]]
        u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        out[0], out[1], out[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for axis in range(len(corners)):
        out[axis] /= max(length, 1e-12)


@kernel
def _sorted_by_told(
    corners: IntMatrix, slope: FloatMatrix, start: IntVector, told: IntVector, share: FloatVector, place: IntVector,
    samples: IntVector, slopes: FloatVector,
) -> None:  # fmt: skip
    """Move each told edge's ``place`` on by the samples that notice it; list them there unless ``samples`` is empty.

    The point of edge e follows those of ``told[start[e] : start[e + 1]]``, each by its share.
    """
    for i in range(len(corners)):
        for k in range(corners.shape[1]):
            e = corners[i, k]
            for j in range(start[e], start[e + 1]):
                s = slope[i, k] * share[j]
                if abs(s) > _SLOPE:
                    at = place[told[j]]
                    if len(samples):
                        samples[at] = i
                        slopes[at] = s
                    place[told[j]] = at + 1


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
        self.samples, self.of_cell = _samples(self.cells, len(self.edges))

    def points(self, where: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the drawing with those of the told edges at ``where``."""
        self.stated[self.told] = where
        for ring in self.rings:
            self.stated[ring.edge] = ring.ratio(self.stated)
        return edge_points(self.leaves, self.edges, self.stated)

    def linear(
        self, points: NDArray[np.float64], contour: Contour, targets: Sequence[Target], part: Around | None
    ) -> Pull:
        """Distances between the curves, from points of either, of ``part`` if it is given, and how they fall."""
        samples, cells = contour.points, self.cells
        some = np.arange(len(self.of_cell))
        own = _at(self.samples.weight, points[self.samples.corner])
        if part:
            samples, cells = samples[part.holds(samples)], cells[part.touches(points, cells)]
            some = some[part.holds(own)[self.of_cell]]
        piece, weight = _nearest(samples, [Target(points, cells, t.limit) for t in targets])
        near = np.flatnonzero(piece >= 0)
        corners, weight = cells[piece[near]], weight[near]
        apart = samples[near] - _at(weight, points[corners])
        wanted = np.unique(self.of_cell[some]) if part else np.arange(len(own))
        back, there = np.full(len(own), -1), np.zeros((len(own), points.shape[1]))
        back[wanted], there[wanted] = _nearest(own[wanted], targets)
        close = self.of_cell[some]
        close = close[back[close] >= 0]
        away = _at(there[close], contour.points[contour.cells[back[close]]]) - own[close]
        corners = np.concatenate([corners, self.samples.corner[close]])
        weight = np.concatenate([weight, self.samples.weight[close]])
        gap, slope = np.empty(len(corners)), np.empty(corners.shape)
        _slopes(points, self.way, corners, weight, np.concatenate([apart, away]), gap, slope)
        follow = self._follow()
        first = np.zeros(len(self.told) + 1, np.int64)
        none = np.zeros(0, np.int64)
        _sorted_by_told(corners, slope, *follow, first[1:], none, none.astype(np.float64))
        first = np.cumsum(first)
        found, slopes = np.empty(first[-1], np.int64), np.empty(first[-1])
        _sorted_by_told(corners, slope, *follow, first[:-1].copy(), found, slopes)
        return Pull(first, found, slopes, gap)

    def longest(self, part: Around, points: NDArray[np.float64]) -> float:
        """Longest of the edges with a point in a part of the domain."""
        return float(np.linalg.norm(self.way[part.holds(points)], axis=1).max(initial=1.0))

    def _follow(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Told edges that the point of each edge follows, and by how much, edge by edge.

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
        return start, self.number[via[some]], share[some]


@dataclass(frozen=True)
class _Samples:
    """Points of pieces: ``corner`` (K, n) numbers of points, ``weight`` (K, n) how much each counts."""

    corner: NDArray[np.int64]
    weight: NDArray[np.float64]


def _samples(cells: NDArray[np.int64], points: int) -> tuple[_Samples, NDArray[np.int64]]:
    """Corners, sides' middles and centres of pieces, and, for each piece in turn, the numbers of its own."""
    n = cells.shape[1]
    # what lies opposite each corner: a side, in two dimensions the other corner
    rest = np.sort(np.stack([np.delete(cells, k, axis=1) for k in range(n)], axis=1), axis=2)
    keys, opposite = np.unique(rest @ [points**k for k in range(n - 1)], return_inverse=True)
    sides = np.stack([keys // points**k % points for k in range(n - 1)], axis=1)
    parts = [np.arange(points)[:, None], sides, cells]
    corner = np.concatenate([np.pad(part, ((0, 0), (0, n - part.shape[1]))) for part in parts])
    weight = np.concatenate([np.tile((np.arange(n) < part.shape[1]) / part.shape[1], (len(part), 1)) for part in parts])
    own = [cells, points + opposite.reshape(cells.shape), points + len(sides) + np.arange(len(cells))[:, None]]
    return _Samples(corner, weight), np.concatenate(own, axis=1).ravel()


def _nearest(samples: NDArray[np.float64], targets: Sequence[Target]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """As `Target.nearest`, for targets of growing limits."""
    piece, weight = targets[0].nearest(samples)
    for target in targets[1:]:
        left = np.flatnonzero(piece < 0)
        piece[left], weight[left] = target.nearest(samples[left])
    return piece, weight


def _at(weight: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of pieces by the weights of their corners."""
    return np.einsum("pk,pkc->pc", weight, corners)


@dataclass(frozen=True)
class Drawing:
    """What comes of a fit: parts of edges that hold the points, and the curve through their middles.

    Attributes
    ----------
    number : (E,) int64
    points : (P, n) float64
    cells : (M, n) int64
    changed, seen : Around, optional
        Where pieces may have moved, and what lies near enough to be held against these; the whole domain if not given.
    """

    number: NDArray[np.int64]
    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    changed: Around | None = None
    seen: Around | None = None


def fitted_offsets(
    contour: Contour, targets: Sequence[Target], leaves: Leaves, told: NDArray[np.int64], parts: NDArray[np.int64],
    where: NDArray[np.float64], tolerance: float, *, rounds: Sequence[float] = ROUNDS, around: Around | None = None,
) -> Drawing:  # fmt: skip
    """Parts of edges that hold the points of a curve near the original.

    Parameters
    ----------
    contour : Contour
        The original curve.
    targets : sequence of Target
        The same, to be held against within ``REACHES`` tolerances.
    leaves : Leaves
        Of the coarse mesh.
    told : (E, 2) int64
        Their edges that carry offsets, as vertices of the leaves, the lower end first.
    parts : (E,) int64
        How finely a decoder knows the points on them.
    where : (E,) float64
        Where on them to begin, as fractions.
    tolerance : float
    rounds : sequence of float
    around : Around, optional
        Points of other parts of the domain stay.
    """
    fit = _Fit(leaves, told)
    where = where.copy()
    points = fit.points(where)
    step, changed, seen = 1.0 / parts, None, None
    if around:
        step = np.where(around.holds(points[fit.told]), step, 0.0)
        longest = fit.longest(around, points)
        changed = around.wider(longest + tolerance)
        seen = changed.wider(longest + REACHES[-1] * tolerance)
    for share in rounds:
        if share == 1.0:
            where = (np.minimum(np.floor(where * parts), parts - 1) + 0.5) / parts
        pull = fit.linear(fit.points(where), contour, targets, changed)
        relax(pull, where, share * step, 2, 1.0 / (MARGIN * tolerance), SWEEPS)
    number = np.minimum(np.floor(where * parts), parts - 1).astype(np.int64)
    return Drawing(number, fit.points((number + 0.5) / parts), fit.cells, changed, seen)
