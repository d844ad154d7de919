"""Contours of labels that meet where three or more labels do.

The contours of the masks of all labels, each drawn alone, leave a gap in unit cells with samples of three or more
labels, and in space they may divide the same polygon into other triangles. Here, the borders on a cell (n = 2), or on
the faces of one (n = 3), are drawn from the labels of all its corners, with a point in each gap; in space they are
joined to the middle of the cell. So all labels, and the samples without one, make up the grid.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .contour import Contour

Keys = NDArray[np.int64]
_CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
"""Corners of a cell of the plane, or of a face, counter-clockwise; side k goes from corner k to the next one."""
_SIDES = np.array([(0, 0, 0), (1, 0, 1), (0, 1, 0), (0, 0, 1)])
"""Lower end of each side, and its axis."""
_UNIT = 2.0**-20
"""Points in gaps lie at multiples of it, so that they are the same in a window of the field."""
_SLAB = 1 << 22
"""Samples that are looked through at a time."""


@dataclass(frozen=True)
class Partition:
    """The label of each sample.

    Attributes
    ----------
    number : (s0, .., sn-1) int16
        Number of the label in the file; -1 for none.
    valid : (s0, .., sn-1) bool, or None
        Which samples are not missing.
    """

    number: NDArray[np.int16]
    valid: NDArray[np.bool_] | None

    @classmethod
    def of(cls, masks: Iterable[NDArray[np.bool_]], valid: NDArray[np.bool_] | None = None) -> Partition | None:
        """Make it of the samples of each label; None if a sample that is not missing has several."""
        number: NDArray[np.int16] | None = None
        for label, inside in enumerate(masks):
            if number is None:
                number = np.full(inside.shape, -1, np.int16)
            again = inside & (number >= 0)
            if (again if valid is None else again & valid).any():
                return None
            number[inside] = label
        return None if number is None else cls(number, valid)


def meeting(contours: Sequence[Contour], partition: Partition) -> list[Contour]:
    """Draw the contours of the masks of labels, on the full grid, so that neighbours share their border.

    In cells with a missing corner contours stay as they are.
    """
    number = partition.number
    grid = _Grid.of(contours, number, partition.valid)
    given: list[list[Keys]] = [[] for _ in contours]
    out = []
    for label, contour in enumerate(contours):
        keys = grid.keys(contour.points)[contour.cells]
        at = np.floor(contour.points[contour.cells].mean(axis=1)).astype(np.int64)
        kept = ~np.isin(grid.flat(at), grid.flat(grid.cells))
        if number.ndim == 3:
            other = np.where(kept, grid.other(at, label), -1)
            for one in np.unique(other[other > label]):
                given[one].append(keys[other == one][:, ::-1])
            kept &= (other < 0) | (other > label)
        made, more, places = grid.borders(label)
        cells = np.concatenate([keys[kept], *given[label], made])
        given[label] = []
        used, cells = np.unique(cells, return_inverse=True)
        points = np.empty((len(used), number.ndim))
        fresh = used >= grid.first_new
        points[~fresh] = grid.place[np.searchsorted(grid.known, used[~fresh])]
        points[fresh] = np.rint(places[np.searchsorted(more, used[fresh])] / _UNIT) * _UNIT
        out.append(replace(contour, points=points, cells=cells.reshape(-1, number.ndim)))
    return out


@dataclass(frozen=True)
class _Grid:
    """Unit cells of three or more labels, and the points of all contours by their keys.

    Attributes
    ----------
    number : (s0, .., sn-1) int
    valid : (s0, .., sn-1) bool, or None
    cells : (C, n) int64
        Lowest corners of the cells of three or more labels.
    known : (K,) int64
        Keys of the points of contours, ascending: of a point on an edge its lower end and axis, of one in the middle
        of a cell its lowest corner.
    place : (K, n) float64
        The points; those of two contours on one edge lie at their mean.
    """

    number: NDArray[np.integer]
    valid: NDArray[np.bool_] | None
    cells: Keys
    known: Keys
    place: NDArray[np.float64]

    @classmethod
    def of(
        cls, contours: Sequence[Contour], number: NDArray[np.integer], valid: NDArray[np.bool_] | None
    ) -> _Grid:
        n = number.ndim
        bare = cls(number, valid, _of_many(number, valid), np.zeros(0, np.int64), np.zeros((0, n)))
        points = np.concatenate([contour.points for contour in contours])
        known, which = np.unique(bare.keys(points), return_inverse=True)
        count = np.bincount(which, minlength=len(known))
        place = [np.bincount(which, points[:, axis], len(known)) / count for axis in range(n)]
        return replace(bare, known=known, place=np.stack(place, axis=1))

    @property
    def first_new(self) -> int:
        """Least key of points that no contour had: those in gaps, by face and corner, then the middles of cells."""
        return self.number.size * (self.number.ndim + 1)

    def flat(self, at: Keys) -> Keys:
        """Numbers of samples (..., n)."""
        return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(at, -1, 0)), self.number.shape), np.int64)

    def keys(self, points: NDArray[np.float64]) -> Keys:
        """Keys of points (P, n) of contours."""
        low = np.floor(points)
        along = points > low
        n = self.number.ndim
        return self.flat(low.astype(np.int64)) * (n + 1) + np.where(along.sum(axis=1) == 1, along.argmax(axis=1), n)

    def other(self, at: Keys, label: int) -> Keys:
        """The second label of cells (M, n) of two, one of which is known; -1 for none, and where samples are missing.
        """
        corners = at[:, None] + np.array([*np.ndindex((2,) * self.number.ndim)])
        labels = self.number[tuple(np.moveaxis(corners, -1, 0))].astype(np.int64)
        found = labels.min(axis=1) + labels.max(axis=1) - label
        if self.valid is not None:
            found[~self.valid[tuple(np.moveaxis(corners, -1, 0))].all(axis=1)] = -1
        return found

    def borders(self, label: int) -> tuple[Keys, Keys, NDArray[np.float64]]:
        """Segments or triangles (M, n), by keys, of a label in cells of three or more; keys and places of new points.
        """
        n, corners = self.number.ndim, np.array([*np.ndindex((2,) * self.number.ndim)])
        has = (self.number[tuple(np.moveaxis(self.cells[:, None] + corners, -1, 0))] == label).any(axis=1)
        cells = self.cells[has]
        if n == 2:
            paths = self._paths(cells, (0, 1), label)
            return paths.pieces, *_sorted(paths.new, paths.places)
        following = np.tile(np.arange(12), (len(cells), 1))
        pieces, owners, begins, new, places = [], [], [], [], []
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for end in (0, 1):
                local = np.array([4 * u + 2 * end, 4 * v + end + 2, 4 * u + 1 + 2 * end, 4 * v + end])
                paths = self._paths(cells + end * (np.arange(3) == axis), (u, v), label)
                # seen from outside, with the label on the left
                ends = paths.ends if end else paths.ends[:, ::-1]
                following[paths.owner, local[ends[:, 0]]] = local[ends[:, 1]]
                pieces.append(paths.pieces if end else paths.pieces[:, ::-1])
                owners.append(paths.owner[paths.path])
                begins.append(local[ends[paths.path, 0]])
                new.append(paths.new)
                places.append(paths.places)
        loop = np.tile(np.arange(12), (len(cells), 1))
        for _ in range(4):
            loop = np.minimum(loop, np.take_along_axis(loop, following, axis=1))
            following = np.take_along_axis(following, following, axis=1)
        owner, begin = np.concatenate(owners), np.concatenate(begins)
        # each loop has a point in the middle for itself, so that the surface is a manifold
        middle = self.first_new + 15 * self.number.size + self.flat(cells[owner]) * 12 + loop[owner, begin]
        made = np.column_stack([np.concatenate(pieces)[:, ::-1], middle])
        return made, *_sorted(np.concatenate([*new, middle]), np.concatenate([*places, self._middles(cells)[owner]]))

    def _middles(self, cells: Keys) -> NDArray[np.float64]:
        """Means (C, 3) of the points on the edges of cells."""
        total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
        for axis in range(3):
            for low in np.ndindex(tuple(1 if a == axis else 2 for a in range(3))):
                point = self._crossings(cells + low, axis)
                there = np.isfinite(point[:, 0])
                total[there] += point[there]
                count += there
        return total / count[:, None]

    def _crossings(self, low: Keys, axis: int) -> NDArray[np.float64]:
        """Points (E, n) on edges from their lower ends along an axis; NaN where both ends have the same label."""
        at, n = self.flat(low), self.number.ndim
        step = int(np.prod(self.number.shape[axis + 1 :]))
        differ = self.number.reshape(-1)[at] != self.number.reshape(-1)[at + step]
        out = np.full((len(low), n), np.nan)
        out[differ] = self.place[np.searchsorted(self.known, at[differ] * (n + 1) + axis)]
        return out

    def _paths(self, low: Keys, axes: tuple[int, int], label: int) -> _Paths:
        """Borders of a label on cells or faces (F, n) by their lowest corners, which extend along two axes.

        The mesh divides each between the corners whose indices are both even and both odd, and connects these.
        """
        n = self.number.ndim
        unit: Keys = np.eye(n, dtype=np.int64)[[*axes]]
        labels = self.number[tuple(np.moveaxis(low[:, None] + _CORNERS @ unit, -1, 0))]
        own = labels == label
        face, m = np.nonzero(own & ~np.roll(own, -1, axis=1))
        b, c, d = (labels[face, (m + k) % 4] for k in (1, 2, 3))
        on = (m + low[face][:, axes[0]] + low[face][:, axes[1]]) % 2 == 0
        single, across = d != label, c == label
        three = np.where(single, ~across & ((b == c) != (c == d)), ~across & (b != c))
        four = single & np.where(across, ~on & (b != d), (b != c) & (c != d) & (on | (b != d)))
        end = (m + np.where(across & (~single | on), 1, np.where(single, 3, 2))) % 4
        # the point of a gap of three; of four, that of the corner, or both beside it if it is on the diagonal
        first = np.where(three, 0, np.where(four, 1 + np.where(on, (m + 1) % 4, m), -1))
        second = np.where(four & on, 1 + (m + 3) % 4, -1)
        starts = np.asarray(low[:, None] + _SIDES[:, :2] @ unit, np.int64)
        sides = self.flat(starts) * (n + 1) + np.array(axes)[_SIDES[:, 2]]
        vertical = 3 - sum(axes) if n == 3 else 0
        base = self.first_new + (self.flat(low[face]) * 3 + vertical) * 5
        vias = [np.where(one < 0, -1, base + one) for one in (first, second)]
        at, pieces, path = sides[face, m], [], []
        for via in vias:
            there = np.flatnonzero(via >= 0)
            pieces.append(np.stack([at[there], via[there]], axis=1))
            path.append(there)
            at = np.where(via >= 0, via, at)
        pieces.append(np.stack([at, sides[face, end]], axis=1))
        path.append(np.arange(len(face)))
        met = np.stack([self._crossings(low + side[:2] @ unit, axes[side[2]]) for side in _SIDES], axis=1)
        new, places = [], []
        for one, via in zip((first, second), vias, strict=True):
            there = np.flatnonzero(one >= 0)
            some, k = met[face[there]], one[there] - 1
            middle = np.nanmean(some, axis=1) if len(there) else np.zeros((0, n))
            row = np.arange(len(there))
            corner = (some[row, k] + some[row, k - 1] + middle) / 3
            new.append(via[there])
            places.append(np.where((k < 0)[:, None], middle, corner))
        return _Paths(face, np.stack([m, end], axis=1), np.concatenate(pieces), np.concatenate(path),
                      np.concatenate(new), np.concatenate(places))


@dataclass(frozen=True)
class _Paths:
    """Borders of a label on cells or faces, with the label on the left.

    Attributes
    ----------
    owner : (R,) int64
        Cell or face of each border.
    ends : (R, 2) int64
        Sides at which it begins and ends.
    pieces : (M, 2) int64
        Segments, by keys.
    path : (M,) int64
        The border of each segment.
    new : (N,) int64
        Keys of points in gaps.
    places : (N, n) float64
    """

    owner: Keys
    ends: Keys
    pieces: Keys
    path: Keys
    new: Keys
    places: NDArray[np.float64]


def _sorted(keys: Keys, places: NDArray[np.float64]) -> tuple[Keys, NDArray[np.float64]]:
    """Sort keys, and leave out those that repeat."""
    keys, at = np.unique(keys, return_index=True)
    return keys, places[at]


def _of_many(number: NDArray[np.integer], valid: NDArray[np.bool_] | None) -> Keys:
    """Find the unit cells of three or more labels without a missing corner, by their lowest corners (C, n)."""
    found = []
    rows = max(1, _SLAB // int(np.prod(number.shape[1:])))
    for start in range(0, number.shape[0] - 1, rows):
        slab = slice(start, start + rows + 1)
        corners = _corners(number[slab])
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        many = np.logical_or.reduce([(each != low) & (each != high) for each in corners])
        if valid is not None:
            many &= np.logical_and.reduce(_corners(valid[slab]))
        cells = np.argwhere(many)
        cells[:, 0] += start
        found.append(cells)
    return np.concatenate(found)


def _corners(samples: NDArray[np.generic]) -> list[NDArray[np.generic]]:
    """Views of the samples at each corner of all unit cells."""
    ends = (slice(None, -1), slice(1, None))
    return [samples[tuple(ends[bit] for bit in corner)] for corner in np.ndindex((2,) * samples.ndim)]
