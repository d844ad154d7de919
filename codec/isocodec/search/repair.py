"""Putting vertices back into a mesh until a promise is kept (row S3-distortion; spec annex G.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..deferred import dataclass
from ..grid.lattice.vertex_set import Chosen
from ..grid.layers.plan import Entry
from .fit import Faults
from .promise import Fitted, Promise, onto
from .reduction import Reduction, distinct

Plan = list[Entry]
MOST_REPAIRS = 64
"""Number of times that vertices are put back."""
BEHIND, NOISE, SURE = 1.03, 12, 3
"""A mesh is given up that takes so many times the bytes, and so many more, that the best one took at as many places,
after some turns."""
CLEAR = 1.01
"""One that would take so many times the bytes allowed is lost clearly: meshes that come near it end near it, too."""
LEAF = 0.25
"""Bytes that a leaf costs at least, with all that comes of it, where the curve is too far away."""
SHARES = {2: 1.0, 3: 0.5}
"""Share of the leaves there that are bisected before points are fitted again: for surfaces that helps the others."""


class Course:
    """Bytes of meshes so far by the number of places too far away on their ways.

    Those of the best one are what the others aim at. One that takes no fewer than another one that was lost clearly is
    lost, too: they become the same mesh nearly.

    Parameters
    ----------
    aims : bool
        Whether the others have to keep up with the best one.
    """

    def __init__(self, aims: bool = True) -> None:
        self.aims = aims
        self.best: dict[int, int] = {}
        self.lost: dict[int, int] = {}
        self.now: dict[int, int] = {}
        self._clear = False

    def behind(self, places: int, size: int) -> bool:
        """Whether a mesh takes clearly more bytes than the best one did, or no fewer than a lost one; notes them."""
        self.now[places] = size
        if len(self.now) <= SURE:
            return False
        follows = places >= min(self.lost, default=0) and size >= _at(self.lost, places)
        return follows or (self.aims and size > BEHIND * _at(self.best, places) + NOISE)

    def lose(self, least: float, most: float) -> None:
        """Note that a mesh is given up that would take at least so many bytes, where at most so many are allowed."""
        self._clear = least > CLEAR * most

    def done(self, better: bool) -> None:
        """The end of a way."""
        if better:
            self.best = self.now
        elif self._clear:
            self.lost = self.now
        self.now, self._clear = {}, False


def _at(way: dict[int, int], places: int) -> float:
    """Bytes of a way at a number of places; infinite before it."""
    known = sorted(way)
    if not known or places > known[-1]:
        return math.inf
    return float(np.interp(places, known, [way[k] for k in known]))


@dataclass(frozen=True)
class Kept:
    """A mesh and a layer of offsets that keep a promise, with the plan that leads there and the bytes of its runs."""

    size: int
    plan: Plan
    mesh: Chosen


def repaired(
    promise: Promise, reduction: Reduction, tolerance: float, pitch: tuple[int, int], lead: Sequence[Entry] = (), *,
    most: float = math.inf, course: Course | None = None,
) -> Kept | None:
    """A mesh as reduced, with vertices put back and points fitted until the promise is kept; None if it cannot be.

    Parameters
    ----------
    promise : Promise
    reduction : Reduction
        The mesh to begin with.
    tolerance : float
    pitch : (parts, unit)
        Those of the offsets.
    lead : plan
        Leads to a part of the mesh; without one it is a base.
    most : float
        Plans of more bytes are given up,
    course : Course, optional
        and those that are behind on this.
    """
    fitted: Fitted | None = None
    faults: Faults | None = None
    course, stuck = course or Course(), False
    for _ in range(MOST_REPAIRS):
        mesh = reduction.chosen
        fitted = promise.placed(mesh, *pitch, tolerance, fitted, lead=lead, faults=faults)
        faults, size = promise.faults(fitted.drawing, tolerance), fitted.size
        places = faults.places
        if stuck or not len(places):
            # so it seems: now with all that the file stores
            plan = [*lead, onto(mesh, lead), ("offsets", *pitch, fitted.place)]
            size, contour = promise.trial(plan)
            places = promise.excess(contour, tolerance)
            if not len(places) and size <= most:
                return Kept(size, plan, mesh)
            faults = Faults(fitted.drawing, places, faults.pieces)
        leaves = reduction.leaves_at(places)
        least = size + LEAF * len(distinct(promise.n, leaves)[0])
        if least > most:
            course.lose(least, most)
        if least > most or stuck or course.behind(len(places), size):
            return None
        # where no more can be put back the curve may still keep its promise, but for curves that are not coded yet
        stuck = not reduction.restore(places, share=SHARES[promise.n], leaves=leaves)
        if stuck and not promise.fences:
            return None
    return None
