"""Meshes in the plane for a tolerance that describe shared sides alike: of tiles, and of periodic axes (spec 12.7)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.depth import levels_of
from ..grid.lattice.tables import AXES, cube_exponent
from ..grid.lattice.vertex_set import Chosen
from .promise import Promise
from .repair import Course, repaired
from .strategy import BACK, LOOSE, SPACING, Plan, base_of, even_starts
from .tolerance import Slack, pitches, radices


class FaceSlack(Slack):
    """Slack with none in shared faces, where crossings must be the same from both sides.

    Parameters
    ----------
    tolerance : float
    size : sequence of int
    shared : (n, 2) bool
        Across each axis the low and the high face.
    """

    def __init__(self, tolerance: float, size: Sequence[int], shared: NDArray[np.bool_]) -> None:
        super().__init__(tolerance)
        last = np.array(size, np.int64) - 1
        self._low = np.where(shared[:, 0], 0, -1)
        self._high = np.where(shared[:, 1], last, -1)

    def __call__(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """Slack of crossings, as for ``Slack``, but 0 in shared faces."""
        return np.where(self.on_face(low, high), 0, super().__call__(low, high))

    def on_face(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Find edges that lie in a shared face."""
        return ((low == high) & ((low == self._low) | (low == self._high))).any(axis=1)


def face_vertices(signs: NDArray[np.bool_], shared: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Samples next to crossings of the shared sides of a tile, padded to three axes, and their levels.

    With these and their ancestors in the mesh each crossed edge in a shared side leads from one sample to the next.

    Parameters
    ----------
    signs : (s0, s1) bool
    shared : (2, 2) bool
        Across each axis the low and the high side.

    Returns
    -------
    (V, 3) int64, (V,) int64
    """
    k = cube_exponent(signs.shape)
    found = [np.zeros((0, 2), np.int64)]
    for axis, side in np.argwhere(shared).tolist():
        place = -side % signs.shape[axis]
        row = signs.take(place, axis)
        along = np.flatnonzero(row[1:] != row[:-1])
        along = np.union1d(along, along + 1)
        found.append(np.insert(along[:, None], axis, place, axis=1))
    position = np.unique(np.concatenate(found), axis=0)
    level = levels_of(position, k)
    # corners of the root cube are always there
    inner = level >= 0
    return np.pad(position[inner], ((0, 0), (0, AXES - 2))), level[inner]


def tile_plan(promise: Promise, tolerance: float, coarse: int, shared: NDArray[np.bool_], grid: Plan) -> Plan:
    """The plan with the fewest bytes, of those tried, whose curve is proven to keep to the tolerance.

    Parameters
    ----------
    promise : Promise
        Of the tile, or the field with its periodic axes closed; the points on shared sides stay where they are.
    tolerance : float
    coarse : int
        Level that all plans lead to first.
    shared : (2, 2) bool
    grid : plan
        On the full grid, if nothing else is kept.
    """
    vertices, levels = face_vertices(promise.field.signs, shared)
    best, size = grid, promise.trial(grid)[0]
    told = math.prod(radices(tolerance))
    tried = [(parts, unit) for parts, unit in pitches(tolerance, promise.n) if _on_unit_edge(parts, unit) == told]
    course = Course()
    evens = [(start, _end_of(lead)) for start, lead in even_starts(promise, tolerance)]
    starts = [each for each in evens if each[1] >= coarse]
    for start, level in [*starts, (_loose(promise, tolerance, coarse), coarse)]:
        lead = _lead(promise.n, coarse, level)
        for pitch in tried:
            reduction = promise.reduction(start)
            reduction.add(vertices, levels)
            kept = repaired(promise, reduction, tolerance, pitch, lead, most=size, course=course)
            course.done(kept is not None and kept.size < size)
            if kept is not None and kept.size < size:
                best, size = kept.plan, kept.size
    return best


def _loose(promise: Promise, tolerance: float, coarse: int) -> Chosen:
    """A mesh to begin with that is coarse where the curve is flat, no coarser than a level."""
    reduction = promise.reduction()
    original = promise.target(BACK * tolerance + SPACING)
    reduction.reduce(distortion=LOOSE * tolerance, original=original, coarsest=coarse)
    return reduction.chosen


def _on_unit_edge(parts: int, unit: int) -> int:
    """Parts of an edge from one sample to the next (spec clause 5.7.3(1))."""
    return math.ceil(parts / (1 << unit)) | 1


def _lead(n: int, coarse: int, level: int) -> Plan:
    """Layers that lead to a uniform mesh, by way of a coarse one."""
    base = base_of(n, coarse)
    return [("base", base), *([("refine", level - base)] if base < level else [])]


def _end_of(lead: Plan) -> int:
    """The level that a base and rounds lead to."""
    return int(lead[0][1]) + sum(int(entry[1]) for entry in lead[1:])  # type: ignore[call-overload]
