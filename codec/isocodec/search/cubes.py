"""Even squares and cubes that are coarse against a tolerance, finer where that will not do (spec annex G.3(5)).

First the mesh: with each crossing in the middle of the part of its edge where it is, leaves are bisected until the
curve keeps to the tolerance. Then crossings get slack, which is taken back where the tolerance is not kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from isospec.container import MAX_RADIX

from ..drawing.contour import Contour
from ..grid.layers.plan import Entry
from .mesh_slack import MeshSlack
from .promise import Promise, onto
from .reduction import Reduction, distinct
from .repair import MOST_REPAIRS, Course, Kept, Plan
from .tolerance import EDGE

LARGEST = 8.0
"""Edge of the largest squares and cubes that are tried, in tolerances."""
MOST_TIGHTENED = 8
"""Number of times that slack is taken back."""
SHARE = {2: 1.0, 3: 0.7}
"""Share of the leaves where the curve is too far away that are bisected at once."""
LEAF = 0.5
"""Bytes that it takes at least to bisect a leaf, and what comes of it."""
SAVED = 0.7
"""Share of the bytes of offsets and mesh that slack leaves at least."""


def exponents(tolerance: float, most: int) -> Iterator[int]:
    """Exponents of the edges that squares and cubes may have, at most a given one, the smallest first."""
    for exponent in range(1, most + 1):
        if 1 << exponent <= LARGEST * tolerance and parts_of(tolerance, exponent) <= MAX_RADIX:
            yield exponent


def parts_of(tolerance: float, exponent: int) -> int:
    """The fewest parts of an edge of a cube whose middles are within a tolerance of all of it."""
    return max(math.ceil((1 << exponent) / (2 * tolerance) * (1 - EDGE)), 1) | 1


def cubed(
    promise: Promise, reduction: Reduction, tolerance: float, exponent: int, lead: Plan, most: float = math.inf,
    course: Course | None = None,
) -> Kept | None:
    """A mesh of squares or cubes that keeps a promise; None if none does, or if it takes more than ``most`` bytes.

    Parameters
    ----------
    promise : Promise
    reduction : Reduction
        The uniform mesh.
    tolerance : float
    exponent : int
        Of the edge of the squares or cubes.
    lead : plan
        Layers that lead to the uniform mesh.
    most : float
    course : Course, optional
        Meshes that are behind on this are given up.
    """
    parts, course = parts_of(tolerance, exponent), course or Course(aims=False)
    # a single part needs no symbols
    offsets: Entry | None = ("offsets", parts, exponent) if parts > 1 else None
    loose = promise.free and offsets is not None
    plan = lead, [] if offsets is None else [offsets]
    bare = _bisected(promise, reduction, tolerance, 2 << exponent, plan, most / SAVED if loose else most, course)
    if bare is None:
        return None
    kept = _slackened(promise, tolerance, bare, most, course) if loose else bare
    return kept if kept.size <= most else None


def _bisected(
    promise: Promise, reduction: Reduction, tolerance: float, reach: int, layers: tuple[Plan, Plan], most: float,
    course: Course,
) -> Kept | None:
    """The mesh, leaves of which are bisected where the curve is too far away; ``layers`` are those around it."""
    lead, behind = layers
    places: NDArray[np.float64] | None = None
    for _ in range(MOST_REPAIRS):
        plan = [*lead, onto(reduction.chosen, lead), *behind]
        size, contour = promise.trial(plan)
        if size > most:
            course.lose(size, most)
            return None
        if places is None or not len(places := promise.excess_near(contour, tolerance, places, reach)):
            places = _faults(promise, contour, tolerance)
        if not len(places):
            return Kept(size, plan, reduction.chosen)
        if course.behind(len(places), size):
            return None
        leaves = reduction.leaves_at(places)
        least = size + LEAF * len(distinct(promise.n, leaves)[0])
        if least > most:
            course.lose(least, most)
            return None
        if not reduction.restore(places, share=SHARE[promise.n], leaves=leaves):
            # curves that are not coded yet may still be crossed
            proven = not len(promise.excess(contour, tolerance))
            return Kept(size, plan, reduction.chosen) if proven else None
    return None


def _slackened(promise: Promise, tolerance: float, bare: Kept, most: float, course: Course) -> Kept:
    """Give the mesh as much slack as the promise allows; it is left without if it takes more than ``most`` bytes so."""
    slack = MeshSlack(promise.phi, tolerance, promise.fixed)
    for _ in range(MOST_TIGHTENED):
        plan: Plan = [*bare.plan[:-1], (*bare.plan[-1], None, slack)]
        size, contour = promise.trial(plan)
        if size > most:
            course.lose(size, most)
            break
        if size >= bare.size:
            break
        places = _faults(promise, contour, tolerance)
        if not len(places):
            return Kept(size, plan, bare.mesh)
        if not slack.tighten(places):
            break
    return bare


def _faults(promise: Promise, contour: Contour, tolerance: float) -> NDArray[np.float64]:
    """Places where a promise is not proven, or where the curve crosses one that is not coded yet."""
    places = promise.excess(contour, tolerance)
    if promise.fences:
        places = np.concatenate([places, promise.fences.crossed(contour.points, contour.cells).places])
    return places
