"""Lines of a whole map with fewer points: each stays within a distance of what it was, and none crosses another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.labelling import is_of_labels
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

    Lines that would cross or jump over another one, or themselves, are simplified less. Ends of open lines stay, and so
    do points where borders of labels meet, which neighbours share.

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
    name = np.split(np.arange(sum(len(contour.points) for contour in whole)),
                    np.cumsum([len(contour.points) for contour in whole])[:-1])
    if is_of_labels(whole[0].metadata):
        points = np.concatenate([contour.points for contour in whole])
        _, at, which = np.unique(points, axis=0, return_index=True, return_inverse=True)
        name = [at[which.ravel()[each]] for each in name]
        walks, uses = _shared(whole, name)
    else:
        walks = [(contour, walk) for contour, each in enumerate(whole) for walk in each.walks]
        uses = [[(line, False) for line, (owner, _) in enumerate(walks) if owner == i] for i in range(len(whole))]
    if not walks:
        return Simplified([*contours], 0.0, unit, 0, 0)
    length = [len(walk) for _, walk in walks]
    first = np.cumsum([0, *length])[:-1]
    places = np.concatenate([whole[owner].along(walk) for owner, walk in walks])
    if unit:
        ground, number = _on_ground(whole[0], places, first, str(distance)), number * METRES.get(unit, 1.0)
    else:
        ground = np.concatenate([whole[owner].points[walk] for owner, walk in walks])
    lines = _Lines(places, ground, first)
    kept = _kept(lines, number)
    farthest = float(_Pieces(lines, lines.owner, kept).distances().max()) / METRES.get(unit, 1.0)
    named = np.concatenate([name[owner][walk] for owner, walk in walks])[kept]
    parts = np.split(named, np.searchsorted(kept, first[1:]))
    out = []
    for own, contour, each, given in zip(uses, whole, name, contours, strict=True):
        cells = [np.stack([parts[line][:-1], parts[line][1:]], axis=1)[:, :: -1 if back else 1] for line, back in own]
        used, number_of = np.unique(np.concatenate([np.zeros((0, 2), np.int64), *cells]), return_inverse=True)
        order = np.argsort(each)
        part = contour.part(order[np.searchsorted(each, used, sorter=order)], number_of.reshape(-1, 2).astype(np.int64))
        out.append(replace(part, placement=given.placement))
    return Simplified(out, farthest, unit, len(places), len(kept))


def _shared(
    whole: Sequence[Contour], name: Sequence[Numbers]
) -> tuple[list[tuple[int, list[int]]], list[list[tuple[int, bool]]]]:
    """Cut the borders of labels where they meet; ``name`` numbers the points of each contour, shared ones alike.

    Returns each line once, as a contour and its points, and the lines of each contour, and whether it has them in the
    opposite direction.
    """
    ends = np.concatenate([np.sort(each[contour.cells], axis=1) for contour, each in zip(whole, name, strict=True)])
    meet = np.bincount(np.unique(ends, axis=0).ravel(), minlength=sum(map(len, name))) != 2
    known: dict[tuple[int, ...], int] = {}
    walks: list[tuple[int, list[int]]] = []
    uses: list[list[tuple[int, bool]]] = [[] for _ in whole]
    for owner, (contour, each) in enumerate(zip(whole, name, strict=True)):
        for walk in contour.walks:
            if walk[0] == walk[-1]:
                nodes = np.flatnonzero(meet[each[walk]])
                start = nodes[0] if len(nodes) else each[walk].argmin()
                walk = [*walk[start:-1], *walk[: start + 1]]
            for low, high in pairwise(sorted({0, *np.flatnonzero(meet[each[walk]]).tolist(), len(walk) - 1})):
                way = walk[low : high + 1]
                names = tuple(each[way].tolist())
                back = names[::-1] < names
                names = names[::-1] if back else names
                if names not in known:
                    known[names] = len(walks)
                    walks.append((owner, way[:: -1 if back else 1]))
                uses[owner].append((known[names], back))
    return walks, uses


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
        owner = self._owner[self._kept[at]]
        wrong |= (meet[0] & meet[3] | meet[1] & meet[2]) & (owner[these] != owner[those])
        shared = np.flatnonzero(~wrong & (these != those))
        wrong[shared] = shapely.overlaps(made[these[shared]], made[those[shared]])
        return self._flags(at[np.append(these[wrong], those[wrong])])

    def jumping(self, shapely: Any, fresh: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Find fresh pieces that would leave an end of a line, and so the whole line, on their other side."""
        at = np.flatnonzero(self.shorter & fresh)
        if not len(at):
            return self._flags(at)
        begin, length = self._ends[at, 0], np.diff(self._ends[at]).ravel() + 2
        part = np.repeat(np.arange(len(at)), length)
        step = np.arange(len(part)) - np.repeat(np.cumsum(length) - length, length)
        # along the line, and back along the piece
        ring = begin[part] + np.where(step == length[part] - 1, 0, step)
        areas = shapely.polygons(shapely.linearrings(self._lines.places[ring], indices=part))
        ends = np.append(self._lines.first, self._lines.first - 1)
        starts = shapely.STRtree(shapely.points(self._lines.places[ends]))
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
