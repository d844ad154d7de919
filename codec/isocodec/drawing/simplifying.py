"""Lines of a whole map with fewer points: each stays within a distance of what it was, and none crosses another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.placement import COORDINATE_UNIT, CRS, Placement
from ..field.stretch import ground_of
from ..field.units import METRES, distance_of
from .areas import polygons
from .contour import Contour

Points = NDArray[np.float64]
Numbers = NDArray[np.int64]


class Simplified(NamedTuple):
    """Contours with fewer points.

    Attributes
    ----------
    contours : list of Contour
    farthest : float
        Largest distance between a point that was left out and its line, in the unit that was asked for.
    unit : str
        Of the distance; empty for cells, or the unit of the points of a mesh.
    before, after : int
        Points of all lines.
    """

    contours: list[Contour]
    farthest: float
    unit: str
    before: int
    after: int


@dataclass(frozen=True, eq=False)
class _Lines:
    """Lines one after the other.

    Attributes
    ----------
    places : (P, 2) float64
        Points in the coordinates in which they are written, where lines must not cross.
    ground : (P, 2) float64
        The same points where distances are measured.
    first : (L,) int64
        First point of each line.
    """

    places: Points
    ground: Points
    first: Numbers

    @property
    def owner(self) -> Numbers:
        """The line of each point, by number."""
        return np.repeat(np.arange(len(self.first)), np.diff(self.first, append=len(self.places)))


def simplified(contours: Sequence[Contour], distance: float | str) -> Simplified:
    """Simplify the isocontours of a map together.

    Lines that would cross or jump over another one, or themselves, are simplified less. Ends of open lines stay.

    Parameters
    ----------
    contours : sequence of Contour
        Isocontours of one field.
    distance : float or str
        Largest distance from the lines as they are, both ways: in cells (on a mesh, in the unit of its points), or with
        a unit, ``"30m"``, on the ground.

    Raises
    ------
    OptionError
        For isosurfaces; if the distance is not one, or the unit of the coordinates is unknown.
    MissingExtraError
        If shapely is not installed.
    """
    number, unit = distance_of(str(distance))
    if not number > 0 or not np.isfinite(number):
        raise OptionError(f"the distance {distance!r} is not a positive number", code="simplify")
    if any(contour.n != 2 for contour in contours):
        raise OptionError("only lines can be simplified, not surfaces", code="simplify",
                          remedy="use --precision, which surfaces have, too")
    whole = [contour.flat.joined for contour in contours]
    walks = [walk for contour in whole for walk in contour.walks]
    if not walks:
        return Simplified([*contours], 0.0, unit, 0, 0)
    first = np.cumsum([0, *map(len, walks)])[:-1]
    places = np.concatenate([contour.along(walk) for contour in whole for walk in contour.walks])
    if unit:
        ground, number = _on_ground(whole[0], places, first, str(distance)), number * METRES.get(unit, 1.0)
    else:
        ground = np.concatenate([contour.points[np.concatenate(contour.walks)] for contour in whole if contour.walks])
    lines = _Lines(places, ground, first)
    kept = _kept(lines, number)
    farthest = float(_Pieces(lines, lines.owner, kept).distances().max()) / METRES.get(unit, 1.0)
    out, begin = [], 0
    for contour, given in zip(whole, contours, strict=True):
        flat = np.concatenate([np.zeros(0, np.int64), *map(np.asarray, contour.walks)]).astype(np.int64)
        part = kept[(kept >= begin) & (kept < begin + len(flat))]
        used, number_of = np.unique(flat[part - begin], return_inverse=True)
        line = lines.owner[part]
        cells = np.stack([number_of[:-1], number_of[1:]], axis=1)[line[:-1] == line[1:]]
        out.append(replace(given, points=contour.points[used], cells=cells.astype(np.int64)))
        begin += len(flat)
    return Simplified(out, farthest, unit, len(places), len(kept))


def _on_ground(contour: Contour, places: Points, first: Numbers, distance: str) -> Points:
    """Points in metres on the ground, or in degrees if the distance is in these."""
    if contour.shape:
        scale = (contour.placement or Placement()).ground(distance, contour.shape)
    else:
        notes = contour.metadata
        scale = ground_of(notes.get(COORDINATE_UNIT), notes.get(CRS), False, 2, lambda: places, distance)
    return scale.of_lines(places, first)


def _kept(lines: _Lines, distance: float) -> Numbers:
    """Find the points that stay: those that each line keeps by itself, and more where lines would cross or jump."""
    shapely = polygons()
    owner = lines.owner
    numbered = np.column_stack([lines.ground, np.arange(len(owner))])
    alone = shapely.simplify(shapely.linestrings(numbered, indices=owner), distance)
    # the third coordinate of each point that is left is its number
    kept = shapely.get_coordinates(alone, include_z=True)[:, 2].astype(np.int64)
    fresh = np.ones(len(kept), np.bool_)
    while True:
        pieces = _Pieces(lines, owner, kept)
        away = pieces.distances()
        wrong = pieces.crossing(shapely, fresh) | pieces.jumping(shapely, fresh) | pieces.beyond(away, distance)
        wrong &= pieces.shorter
        if not wrong.any():
            return kept
        more = pieces.farthest(away, np.flatnonzero(wrong))
        joined = np.union1d(kept, more)
        fresh = np.zeros(len(joined), np.bool_)
        at = np.searchsorted(joined, more)
        fresh[at] = fresh[at - 1] = True
        kept = joined


class _Pieces:
    """Straight pieces from each kept point (K,) to the next one of its line, numbered by the first.

    ``owner`` (P,) is the line of each point.
    """

    def __init__(self, lines: _Lines, owner: Numbers, kept: Numbers) -> None:
        self._lines, self._owner, self._kept = lines, owner, kept
        after = np.append(kept[1:], kept[-1])
        self._there = owner[after] == owner[kept]
        self._there[-1] = False
        self._ends = np.stack([kept, after], axis=1)
        self.shorter = self._there & (after - kept > 1)
        """Pieces that replace several pieces of the line."""

    def _flags(self, numbers: Any) -> NDArray[np.bool_]:
        flags = np.zeros(len(self._kept), np.bool_)
        flags[numbers] = True
        return flags

    def crossing(self, shapely: Any, fresh: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Find pieces that cross or touch another one, but for the ends that they share; of each pair one is fresh."""
        at = np.flatnonzero(self._there)
        ends = self._lines.places[self._ends[at]]
        made = shapely.linestrings(ends)
        new = np.flatnonzero(fresh[at])
        those, these = shapely.STRtree(made[new]).query(made, predicate="intersects")
        these = new[these]
        meet = [(ends[these, a] == ends[those, b]).all(axis=1) for a in (0, 1) for b in (0, 1)]
        wrong = ~np.logical_or.reduce(meet)
        shared = np.flatnonzero(~wrong & (these != those))
        wrong[shared] = shapely.overlaps(made[these[shared]], made[those[shared]])
        return self._flags(at[np.append(these[wrong], those[wrong])])

    def jumping(self, shapely: Any, fresh: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Find fresh pieces that would leave the first point of a line, and so the whole line, on their other side."""
        at = np.flatnonzero(self.shorter & fresh)
        if not len(at):
            return self._flags(at)
        begin, length = self._ends[at, 0], np.diff(self._ends[at]).ravel() + 2
        part = np.repeat(np.arange(len(at)), length)
        step = np.arange(len(part)) - np.repeat(np.cumsum(length) - length, length)
        # along the line, and back along the piece
        ring = begin[part] + np.where(step == length[part] - 1, 0, step)
        areas = shapely.polygons(shapely.linearrings(self._lines.places[ring], indices=part))
        starts = shapely.STRtree(shapely.points(self._lines.places[self._lines.first]))
        return self._flags(at[starts.query(areas, predicate="contains")[0]])

    def distances(self) -> Points:
        """Distance of each point of the lines from the piece that replaces the line around it."""
        ground, piece = self._lines.ground, self._piece()
        left, right = (ground[end] for end in self._ends[piece].T)
        way, off = right - left, ground - left
        size = np.einsum("ij,ij->i", way, way)
        share = np.clip(np.einsum("ij,ij->i", off, way) / np.where(size > 0, size, 1), 0, 1)
        return np.asarray(np.hypot(*(off - share[:, None] * way).T))

    def _piece(self) -> Numbers:
        return np.searchsorted(self._kept, np.arange(len(self._owner)), side="right") - 1

    def beyond(self, away: Points, distance: float) -> NDArray[np.bool_]:
        """Find pieces that points are farther from than a distance, but for rounding."""
        return self._flags(self._piece()[away > distance * (1 + 1e-9)])

    def farthest(self, away: Points, pieces: Numbers) -> Numbers:
        """Number of the point left out that is farthest from each of these pieces."""
        begin, end = self._ends[pieces].T
        length = end - begin - 1
        part = np.repeat(np.arange(len(pieces)), length)
        inner = begin[part] + 1 + np.arange(len(part)) - np.repeat(np.cumsum(length) - length, length)
        order = np.lexsort((-away[inner], part))
        return np.asarray(inner[order[np.cumsum(length) - length]])
