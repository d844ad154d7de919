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

from ..contour import Contour, Leaves
from ..contour.crossing import edge_points, edge_ratios
from ..contour.simplex import crossed, rings
from ..jit import inner, kernel
from .distance import Target

ROUNDS = (0.5, 0.5, 1.0, 1.0, 1.0)
"""Steps of the points in each round, in units of the parts that are told."""
AGAIN = ROUNDS[-2:]
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


@kernel
def relax(first, samples, slopes, gap, where, step, most, scale, sweeps):
    """Move each edge's point by up to ``most`` steps to where the penalty is least.

    ``samples[first[e] : first[e + 1]]`` are the points of the original that notice edge e, ``slopes`` how much their
    distances ``gap`` fall as ``where[e]`` grows; both arrays are kept up to date.
    """
    for _ in range(sweeps):
        for e in range(len(where)):
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
        self.stated = edge_ratios(leaves, self.edges)
        self.way = np.diff(leaves.position[self.edges].astype(np.float64), axis=1)[:, 0]

    def points(self, where: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the drawing with those of the told edges at ``where``."""
        self.stated[self.told] = where
        for ring in self.rings:
            self.stated[ring.edge] = ring.ratio(self.stated)
        return edge_points(self.leaves, self.edges, self.stated)

    def linear(
        self, points: NDArray[np.float64], contour: Contour, targets: list[Target]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Distances between the curves, from points of either, and how they fall: entries sorted by told edge."""
        samples = contour.points
        piece, weight = _nearest(samples, [Target(points, self.cells, t.limit) for t in targets])
        near = np.flatnonzero(piece >= 0)
        corners = self.cells[piece[near]]
        apart, weight = samples[near] - _at(weight[near], points[corners]), weight[near]
        gap, slope = self._slopes(points, corners, weight, apart)
        # points of this curve: corners, middles of sides, centres of the pieces
        n = self.cells.shape[1]
        shares = np.concatenate([np.eye(n), (1.0 - np.eye(n)) / (n - 1), np.full((1, n), 1.0 / n)])
        cells = np.repeat(self.cells, len(shares), axis=0)
        shares = np.tile(shares, (len(self.cells), 1))
        own = _at(shares, points[cells])
        piece, weight = _nearest(own, targets)
        near = np.flatnonzero(piece >= 0)
        apart = _at(weight[near], contour.points[contour.cells[piece[near]]]) - own[near]
        own_gap, own_slope = self._slopes(points, cells[near], shares[near], apart)
        corners = np.concatenate([corners, cells[near]])
        gap, slope = np.concatenate([gap, own_gap]), np.concatenate([slope, own_slope])
        sample, edge, flat = self._by_told(np.repeat(np.arange(len(gap)), n), corners.ravel(), slope.ravel())
        order = np.argsort(edge, kind="stable")
        first = np.searchsorted(edge[order], np.arange(len(self.told) + 1))
        return gap, first, sample[order], flat[order]

    def _slopes(
        self, points: NDArray[np.float64], corners: NDArray[np.int64], weight: NDArray[np.float64],
        apart: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
        """Lengths of ``apart``, and how they fall as the corners' points move along their edges."""
        gap = np.linalg.norm(apart, axis=1)
        away = np.where(gap[:, None] > _TOUCH, apart / np.maximum(gap, _TOUCH)[:, None], _normals(points[corners]))
        return gap, weight * np.einsum("pkc,pc->pk", self.way[corners], away)

    def _by_told(
        self, sample: NDArray[np.int64], edge: NDArray[np.int64], slope: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """The same in terms of told edges alone: points of implied edges follow from those at their rings."""
        row = np.full(len(self.edges), -1)
        for ring in self.rings[::-1]:
            row[:] = -1
            row[ring.edge] = np.arange(len(ring.edge))
            some = np.flatnonzero(row[edge] >= 0)
            at = row[edge[some]]
            follows = slope[some, None] * ring.slopes(self.stated)[at]
            m = follows.shape[1]
            sample = np.concatenate([sample, np.repeat(sample[some], m)])
            edge = np.concatenate([edge, ring.beside[at].ravel()])
            slope = np.concatenate([slope, follows.ravel()])
        number = self.number[edge]
        some = np.flatnonzero((number >= 0) & (np.abs(slope) > _SLOPE))
        return sample[some], number[some], slope[some]


def _nearest(samples: NDArray[np.float64], targets: list[Target]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """As `Target.nearest`, for targets of growing limits."""
    piece, weight = targets[0].nearest(samples)
    for target in targets[1:]:
        left = np.flatnonzero(piece < 0)
        piece[left], weight[left] = target.nearest(samples[left])
    return piece, weight


def _at(weight: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of pieces by the weights of their corners."""
    return np.einsum("pk,pkc->pc", weight, corners)


def _normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals of pieces, (M, n) float64, 0 where there is none."""
    sides = corners[:, 1:] - corners[:, :1]
    if corners.shape[1] == 2:
        normal = np.stack([-sides[:, 0, 1], sides[:, 0, 0]], axis=1)
    else:
        normal = np.cross(sides[:, 0], sides[:, 1])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def fitted_offsets(
    contour: Contour, leaves: Leaves, told: NDArray[np.int64], parts: NDArray[np.int64], where: NDArray[np.float64],
    tolerance: float, rounds: Sequence[float] = ROUNDS,
) -> NDArray[np.int64]:  # fmt: skip
    """Parts of edges that hold the points of a curve near the original.

    Parameters
    ----------
    contour : Contour
        The original curve.
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

    Returns
    -------
    (E,) int64
        Numbers of parts.
    """
    fit = _Fit(leaves, told)
    where = where.copy()
    targets = [Target(contour.points, contour.cells, reach * tolerance) for reach in REACHES]
    for share in rounds:
        if share == 1.0:
            where = (np.minimum(np.floor(where * parts), parts - 1) + 0.5) / parts
        gap, first, samples, slopes = fit.linear(fit.points(where), contour, targets)
        relax(
            first,
            samples,
            slopes,
            gap,
            where,
            share / parts,
            2,
            1.0 / (MARGIN * tolerance),
            SWEEPS,
        )
    return np.minimum(np.floor(where * parts), parts - 1).astype(np.int64)
