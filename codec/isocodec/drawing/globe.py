"""Longitudes and latitudes as maps take them (RFC 7946, clause 3.1.9): cut at 180 degrees, closed over poles.

A straight line of a projection is in general not straight in longitude and latitude: points are added where it bends.
Lines are ragged arrays: points (P, 2 or 3) of all lines, and where each line starts, with P at the end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..deferred import dataclass
from ..errors import OptionError
from ..field.reference_system import DEGREES, Transform, epsg_of, is_named, to_degrees
from .areas import oriented, polygons

if TYPE_CHECKING:
    from ..field.placement import Placement

Points = NDArray[np.float64]
Starts = NDArray[np.int64]
HALF, TURN, POLE = 180.0, 360.0, 90.0
_BENT = 0.01
"""Largest distance, in cells, between a straight line of the projection and one in longitude and latitude."""
_ROUNDS = 14
_SLIVER = 2.0
"""Twice the area, in square degrees, of rings whose direction may be due to rounding."""
_BESIDE = 1e-6
"""Latitude, in degrees, beyond a pole that is due to rounding."""


@dataclass(frozen=True)
class Globe:
    """The way from the coordinates of a placement to longitude and latitude.

    Attributes
    ----------
    move : callable
        From coordinates (P, 2 or 3) to degrees, the third as it is.
    cell : float
        Size of a cell, in coordinates of the placement.
    straight : bool
        Whether coordinates are longitudes and latitudes already, which go on beyond 180 degrees.
    """

    move: Transform
    cell: float
    straight: bool

    @classmethod
    def of(cls, placement: Placement | None, points: Points, cells: NDArray[np.int64]) -> Globe | None:
        """The way from the coordinates of a placement; None if these have no reference system.

        Parameters
        ----------
        placement : Placement or None
        points : (P, 2 or 3) float64
            In coordinates of the placement.
        cells : (M, 2 or more) int64
            Lines or simplices between them, whose size is that of a cell.

        Raises
        ------
        OptionError, MissingExtraError
            As `to_degrees`.
        """
        if placement is None or not is_named(placement):
            return None
        length = np.linalg.norm(points[cells[:, 1]] - points[cells[:, 0]], axis=1)
        frame = placement.frame()
        if (length > 0).any() or frame is None:
            length = length[length > 0]
        else:
            length = np.linalg.norm(frame, axis=0)
        return cls(to_degrees(placement), float(np.median(length)), epsg_of(placement) == DEGREES)

    def unrolled(self, points: Points, starts: Starts) -> tuple[Points, Starts]:
        """Lines in degrees, with points where they bend; longitudes go on beyond 180 degrees."""
        if not len(points):
            return points, starts
        degrees = np.array(self.move(points), np.float64)
        for _ in range(0 if self.straight else _ROUNDS):
            half = (points[:-1] + points[1:]) / 2
            between = self.move(half)
            split = self._bends(points, degrees, between)
            split[starts[1:-1] - 1] = False
            at = np.flatnonzero(split)
            if not len(at):
                break
            points, degrees = (np.insert(all_, at + 1, new[at], axis=0) for all_, new in (
                (points, half), (degrees, between)))
            starts = starts + np.searchsorted(at, starts)
        if abs(degrees[:, 1]).max() > POLE + _BESIDE:
            raise OptionError("the coordinates are beyond a pole, and not longitudes and latitudes", code="crs",
                              remedy="is the placement right? --keep-crs writes the coordinates as they are")
        degrees[:, 1] = degrees[:, 1].clip(-POLE, POLE)
        return (degrees if self.straight else continued(degrees, starts)), starts

    def _bends(self, points: Points, degrees: Points, between: Points) -> NDArray[np.bool_]:
        """Find segments whose middle moves away from the middle of their ends, by distances on the ground."""
        step, off = np.diff(degrees[:, :2], axis=0), between[:, :2] - degrees[:-1, :2]
        step[:, 0], off[:, 0] = _turned(step[:, 0]), _turned(off[:, 0])
        off = off - step / 2
        off[:, 0] = _turned(off[:, 0])
        across = np.cos(np.radians(between[:, 1]))
        length, moved = np.hypot(step[:, 0] * across, step[:, 1]), np.hypot(off[:, 0] * across, off[:, 1])
        size = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
        return np.asarray(moved * size > _BENT * self.cell * np.maximum(length, 1e-12))

    def lines(self, points: Points, starts: Starts) -> tuple[Points, Starts]:
        """Lines in longitude and latitude within 180 degrees, cut there."""
        points, starts = self.unrolled(points, starts)
        if not len(points) or abs(points[:, 0]).max() <= HALF:
            return points, starts
        points, starts = _divided(points, starts)
        first = np.ones(len(points), np.bool_)
        first[starts[1:] - 1] = False
        at = np.flatnonzero(first)  # of segments
        turn = np.floor(((points[at, 0] + points[at + 1, 0]) / 2 + HALF) / TURN)
        begins = np.isin(at, starts)
        begins[1:] |= turn[1:] != turn[:-1]
        cuts = np.append(np.flatnonzero(begins), len(at))
        sizes = np.diff(cuts) + 1
        starts = np.concatenate([[0], np.cumsum(sizes)])
        number = np.arange(starts[-1]) - np.repeat(starts[:-1] - at[cuts[:-1]], sizes)
        points = points[number]
        points[:, 0] -= TURN * np.repeat(turn[cuts[:-1]], sizes)
        return points, starts

    def areas(self, parts: NDArray[Any]) -> NDArray[Any]:
        """Polygons in longitude and latitude within 180 degrees, cut there, and closed over the poles that they hold.

        Parameters
        ----------
        parts : (K,) array of shapely.Polygon
            In coordinates of the placement, outer rings counter-clockwise.

        Returns
        -------
        (K,) array of shapely.Polygon or shapely.MultiPolygon
            Outer rings counter-clockwise.
        """
        if not len(parts):
            return parts
        shapely = polygons()
        kind, points, (starts, outer) = shapely.to_ragged_array(parts)
        turned = self._mirrors(points[:1])
        points, starts = self.unrolled(points, starts)
        first = starts[:-1]
        around = abs(points[starts[1:] - 1, 0] - points[first, 0]) > HALF
        odd = around | (np.maximum.reduceat(abs(points[:, 0]), first) > HALF)
        x, y = (points[:, :2] - np.repeat(points[first, :2], np.diff(starts), axis=0)).T
        twice = np.add.reduceat(np.append(x[:-1] * y[1:] - x[1:] * y[:-1], 0), first) * (-1 if turned else 1)
        # around both poles, a ring goes round what it does not hold; but a sliver is no ring around half the globe
        outside = (twice < -_SLIVER)[outer[:-1]] & ~around[outer[:-1]]
        cut = np.logical_or.reduceat(odd, outer[:-1]) | outside
        out = shapely.from_ragged_array(kind, points, (starts, outer))
        for i in np.flatnonzero(cut):
            own = [points[starts[j] : starts[j + 1]] for j in range(outer[i], outer[i + 1])]
            out[i] = self._on_globe(own, turned, bool(outside[i]))
        return np.asarray(shapely.orient_polygons(out))

    def _mirrors(self, start: Points) -> bool:
        """Whether coordinates counter-clockwise are clockwise in longitude and latitude, at a point (1, 2 or 3)."""
        steps = self.move(start + np.eye(3, start.shape[1], -1) * (1e-3 * self.cell))
        steps = steps[1:, :2] - steps[0, :2]
        steps[:, 0] = _turned(steps[:, 0])
        return bool(np.linalg.det(steps) < 0)

    def _on_globe(self, rings: list[Points], turned: bool, outside: bool) -> Any:
        """Polygons of an outer ring, or of what is outside of it, without its holes."""
        shapely = polygons()
        areas = []
        for ring in (rings[0], *(ring[::-1] for ring in rings[1:])):  # holes as areas of their own
            around = round((ring[-1, 0] - ring[0, 0]) / TURN)
            if around:
                ring = _over(ring, around, POLE if (around > 0) != turned else -POLE)
            areas.append(_rolled(shapely.make_valid(shapely.Polygon(ring))))
        if outside:
            areas[0] = shapely.difference(shapely.box(-HALF, -POLE, HALF, POLE), areas[0])
        return oriented(shapely.difference(areas[0], shapely.union_all(areas[1:])))


def ragged(lines: list[Points]) -> tuple[Points, Starts]:
    """The points of all lines, and where each starts."""
    starts = np.cumsum([0, *map(len, lines)])
    return (np.concatenate(lines) if lines else np.zeros((0, 2))), starts


def continued(points: Points, starts: Starts) -> Points:
    """Longitudes that go on along lines instead of jumping by 360 degrees."""
    steps = np.diff(points[:, 0], prepend=0.0)
    turns = np.round((_turned(steps) - steps) / TURN)
    turns[starts[:-1]] = 0
    whole = np.cumsum(turns)
    whole -= np.repeat(whole[starts[:-1]], np.diff(starts))
    return np.column_stack([points[:, 0] + TURN * whole, points[:, 1:]])


def rounded(points: Points, starts: Starts, decimals: int) -> tuple[Points, Starts]:
    """Lines with so many decimals; points that fall on the one before them are left out, and lines of one point."""
    points = np.round(points, decimals) + 0.0
    keep = np.ones(len(points), np.bool_)
    keep[1:] = (points[1:] != points[:-1]).any(axis=1)
    keep[starts[:-1]] = True
    count = np.add.reduceat(keep, starts[:-1]) if len(starts) > 1 else np.zeros(0, np.int64)
    keep &= np.repeat(count > 1, np.diff(starts))
    return points[keep], np.concatenate([[0], np.cumsum(count[count > 1])]).astype(np.int64)


def rounded_areas(shapes: Any, decimals: int) -> Any:
    """Polygons with so many decimals, valid; those that fall together are empty."""
    shapely = polygons()
    snapped = shapely.set_precision(shapes, 10.0**-decimals)
    return shapely.orient_polygons(
        shapely.transform(snapped, lambda points: np.round(points, decimals) + 0.0, include_z=None))


def _turned(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences of longitudes, from -180 to 180."""
    return np.asarray(degrees - TURN * np.round(degrees / TURN))


def _divided(points: Points, starts: Starts) -> tuple[Points, Starts]:
    """Lines with a point wherever they cross 180 degrees, of any turn."""
    low, high = np.minimum(points[:-1, 0], points[1:, 0]), np.maximum(points[:-1, 0], points[1:, 0])
    first = np.floor((low + HALF) / TURN) + 1
    count = (np.ceil((high + HALF) / TURN) - first).astype(np.int64).clip(0)
    count[starts[1:-1] - 1] = 0
    at = np.repeat(np.arange(len(count)), count)
    if not len(at):
        return points, starts
    number = np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count)
    backwards = points[at, 0] > points[at + 1, 0]
    place = TURN * (first[at] + np.where(backwards, count[at] - 1 - number, number)) - HALF
    part = (place - points[at, 0]) / (points[at + 1, 0] - points[at, 0])
    new = points[at] + part[:, None] * (points[at + 1] - points[at])
    new[:, 0] = place
    return np.insert(points, at + 1, new, axis=0), starts + np.searchsorted(at, starts)


def _over(ring: Points, around: int, pole: float) -> Points:
    """A ring around the globe, closed over a pole from where it meets 180 degrees nearest to it."""
    ring, _ = _divided(ring, np.array([0, len(ring)]))
    met = np.flatnonzero((ring[:, 0] + HALF) % TURN == 0)
    first = met[np.argmin(abs(pole - ring[met, 1]))]
    again = ring[1 : first + 1] + np.eye(1, ring.shape[1]) * (TURN * around)
    ring = np.concatenate([ring[first:], again])
    ends = ring[[-1, 0]].copy()
    ends[:, 1] = pole
    return np.concatenate([ring, ends])


def _rolled(shape: Any) -> Any:
    """A shape of longitudes that go on, within 180 degrees."""
    shapely = polygons()
    low, _, high, _ = shape.bounds
    parts = []
    for turn in range(int(np.floor((low + HALF) / TURN)), int(np.ceil((high + HALF) / TURN))):
        box = shapely.box(TURN * turn - HALF, -POLE, TURN * turn + HALF, POLE)
        part = oriented(shapely.intersection(shape, box))
        parts.append(shapely.transform(
            part, lambda points, turn=turn: _within(points, turn), include_z=bool(part.has_z)))
    return shapely.union_all(parts)


def _within(points: Points, turn: int) -> Points:
    points = points - np.eye(1, points.shape[1]) * (TURN * turn)
    points[:, 0] = points[:, 0].clip(-HALF, HALF)
    return points
