"""Places for scattered points in a file, where they have the triangles of the given ones (docs/encoders.md, 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..format.domain import MOST_OF_BYTE
from ..tin.rank import by_rank
from .coded_points import delaunay_complex, encoded_points
from .complex import Complex, neighbours
from .nudging import Conditions, broken_share, conditions_of, nudged
from .quantised import EXTENT, Quantised, rounded_points

CLOSER = 2**0.5
"""Factor between the first lattices; it grows by itself with every second one."""
MARGIN = 8
"""Steps that points may move beyond the box."""
TRIALS = 10
"""Number of lattices that are tried."""
MOST_BROKEN = 0.06
"""Share of broken conditions above which points are not moved: a finer lattice comes next."""
HARDLY = 0.9
"""Once points are distinct, finer lattices are given up unless that share falls below this factor of the last."""
Crossed = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
"""Finds which cells (T, 3) of given points a contour crosses; all cells, if the file stores all points."""


class Placed(NamedTuple):
    """Points as a file stores them.

    Attributes
    ----------
    places : Quantised
    off : float
        Largest distance of points from the given ones.
    run : bytes
        Their positions, coded.
    domain : Complex
        Their triangulation, with points in the order of decoding.
    source : (W,) int64
        For each of its vertices the given point.
    """

    places: Quantised
    off: float
    run: bytes
    domain: Complex
    source: NDArray[np.int64]


class WantedTriangles(NamedTuple):
    """Points to be placed, and the triangles that they must have.

    Attributes
    ----------
    points : (V, 2) float64
    position : (V, 2) int64
        The points as they were triangulated.
    cells : (T, 3) int64
        Triangles of all points.
    kept : (W,) int64
        The points to be placed.
    crossed : Crossed
    """

    points: NDArray[np.float64]
    position: NDArray[np.int64]
    cells: NDArray[np.int64]
    kept: NDArray[np.int64]
    crossed: Crossed

    def conditions(self) -> Conditions:
        """Conditions for the points that are placed, by their numbers among these."""
        cells = self.cells
        if len(self.kept) < len(self.points):
            # away from the contour, the kept points have other triangles than all points have
            order = by_rank(*self.position[self.kept].T)
            domain = delaunay_complex(np.ascontiguousarray(self.position[self.kept[order]]), 1.0)
            few = self.kept[order][domain.mesh.cell]
            cells = few if np.array_equal(self._crossed_of(few), self._crossed_of(cells)) else cells
        place = np.full(len(self.points), -1)
        place[self.kept] = np.arange(len(self.kept))
        needed = self.crossed(cells)
        # without a contour, any triangle will do
        needed[0] |= not needed.any()
        found = conditions_of(cells, neighbours(cells), needed)
        found = found._replace(border=found.border[self.crossed(found.border)])
        return Conditions(*(place[rows][(place[rows] >= 0).all(axis=1)] for rows in found))

    def kept_by(self, places: Quantised) -> bool:
        """Check that contours cross the same triangles, and no others, when points lie in these places."""
        order = by_rank(*places.position.T)
        if not _apart(places.position):
            return False
        domain = delaunay_complex(np.ascontiguousarray(places.position[order]), places.unit)
        return np.array_equal(self._crossed_of(self.kept[order][domain.mesh.cell]), self._crossed_of(self.cells))

    def _crossed_of(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Find the crossed cells, in canonical order."""
        found = np.sort(cells[self.crossed(cells)], axis=1)
        return found[np.lexsort(found.T)]


def _apart(position: NDArray[np.int64]) -> bool:
    """Whether positions (W, 2) are distinct."""
    return len(np.unique(position, axis=0)) == len(position)


def placements(wanted: WantedTriangles, error: float, reach: float) -> Iterator[Placed | None]:
    """Place points on finer and finer lattices; None where triangles are not those of the given points.

    Points are rounded to within ``error``; those that are moved, because triangles would change, stay within ``reach``.
    Origin and extent are those of all points, so that ties are decided as among all points (docs/encoders.md, 5).

    Raises
    ------
    InputError
        If positions on the first lattice take too many bits.
    """
    conditions = wanted.conditions()
    lattice, before = error, 1.0
    for trial in range(TRIALS):
        try:
            places, off = rounded_points(wanted.points, lattice, wanted.kept, exact=trial == 0)
        except InputError:
            if trial:
                return
            raise
        broken = broken_share(places.position, conditions)
        found = None
        if broken <= MOST_BROKEN:
            found = _placed(wanted, places, off, reach, conditions if broken else None)
        yield found
        if MOST_BROKEN < broken > HARDLY * before and _apart(places.position):
            return
        before = broken
        lattice /= CLOSER ** (1 + trial // 2)


def _placed(
    wanted: WantedTriangles, places: Quantised, off: float, reach: float, conditions: Conditions | None
) -> Placed | None:
    """Move points until all conditions hold, if there are any, and code them, if they have the triangles then."""
    if conditions is not None:
        places = places.widened(MARGIN)
        target = wanted.points[wanted.kept] / places.unit - places.origin
        moved = nudged(target, places.position, places.extent, reach / places.unit, conditions)
        if moved is None:
            return None
        places = places._replace(position=moved)
        off = max(off, float(np.hypot(*(moved - target).T).max()) * places.unit)
    if not wanted.kept_by(places):
        return None
    while True:
        run, domain, order = encoded_points(places.position, places.extent, places.unit)
        if len(domain.mesh.position) + len(domain.mesh.cell) <= MOST_OF_BYTE * len(run):
            return Placed(places, off, run, domain, wanted.kept[order])
        # points that fill a lattice take so few bytes that readers would not believe their number
        if max(places.extent) >= EXTENT:
            return None
        places = places._replace(extent=tuple(min(2 * size, EXTENT) for size in places.extent))
