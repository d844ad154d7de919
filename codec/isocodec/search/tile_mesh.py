"""Meshes of tiles in the plane for a tolerance: as those of whole files, but the same where tiles meet (spec 12.7)."""

from __future__ import annotations

import math

from ..grid.lattice.vertex_set import Chosen
from .promise import Promise
from .repair import Course, repaired
from .shared_sides import SharedSides
from .strategy import BACK, LOOSE, SPACING, Plan, base_of, even_starts
from .tolerance import pitches, radices


def tile_plan(promise: Promise, tolerance: float, coarse: int, sides: SharedSides, grid: Plan) -> Plan:
    """The plan with the fewest bytes, of those tried, whose curve is proven to keep to the tolerance.

    Parameters
    ----------
    promise : Promise
        Of the tile; the points on its shared sides stay where they are.
    tolerance : float
    coarse : int
        Level that all plans lead to first.
    sides : SharedSides
    grid : plan
        On the full grid, if nothing else is kept.
    """
    vertices, levels = sides.vertices(promise.field.signs)
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
