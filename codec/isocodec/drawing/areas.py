"""Areas on one side of an isocontour: its lines, closed along the border of the grid, as polygons with holes."""

from __future__ import annotations

from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError, OptionError, TruncatedError
from ..extras import optional
from ..field.placement import Placement
from .curve import Curve

Points = NDArray[np.float64]
Numbers = NDArray[np.int64]
_DIGITS = 44
"""Binary digits of coordinates of areas on planes in space whose rings touch."""


def polygons() -> Any:
    """Import the library for polygons; raises `MissingExtraError` if it is missing, or older than version 2.1."""
    shapely = optional("shapely", extra="vector", purpose="making areas")
    if not hasattr(shapely, "orient_polygons"):
        raise MissingExtraError(f"making areas needs shapely 2.1 or later, this is {shapely.__version__}",
                                code="missing-extra", remedy="pip install --upgrade shapely")
    return shapely


def areas_of(contour: Curve, *, above: bool = True, valid: NDArray[np.bool_] | None = None) -> Any:
    """``MultiPolygon`` of the part above or not above the isovalue, as `Contour.areas`; of a plane in space in `flat`.
    """
    contour = contour.flat
    if len(contour.shape) != 2:
        raise OptionError("only an isocontour (n = 2) has areas", code="dimension")
    if contour.masked:
        raise OptionError(
            "areas are not closed where samples are missing", code="holes",
            remedy="draw curves through them: contour(through_holes=True).areas(valid=file.valid())",
        )
    if valid is not None and np.shape(valid) != contour.shape:
        raise OptionError(f"valid has shape {np.shape(valid)}, but the field has {contour.shape}", code="valid")
    shapely = polygons()
    area = _nested(*_rings(contour, above), shapely)
    if valid is not None:
        area = shapely.difference(area, shapely.union_all(_holes(np.asarray(valid, np.bool_), shapely)))
    if contour.bent:
        # the border bends with the grid
        area = shapely.segmentize(area, 1.0)
    area = shapely.transform(area, contour.place)
    closes = contour.placement is not None and contour.placement.closes
    if closes or not area.is_valid:  # where rounding has made rings touch, before a plane is placed in space
        area = shapely.union_all(shapely.make_valid(shapely.get_parts(area)))
    return oriented(area)


def oriented(shape: Any) -> Any:
    """``MultiPolygon`` of the polygons of a shape, with exterior rings counter-clockwise, holes clockwise."""
    shapely = polygons()
    if shape.geom_type != "MultiPolygon":
        parts = shapely.get_parts(shapely.get_parts(shape))
        shape = shapely.multipolygons(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])
    return shapely.orient_polygons(shape)


def lifted(area: Any, placement: Placement | None) -> Any:
    """Areas of a plane in space with three coordinates, valid as seen from above; others as they are."""
    if placement is None or not placement.in_space:
        return area
    shapely = polygons()
    for _ in range(2):
        kind, points, offsets = shapely.to_ragged_array([area])
        placed = placement.lifted(points)
        found = shapely.from_ragged_array(kind, placed, offsets)[0]
        if found.is_valid:
            break
        # rounding has made rings touch, or the plane is upright: rings are kept apart by more than rounding
        area = oriented(shapely.set_precision(area, np.exp2(np.ceil(np.log2(abs(placed).max())) - _DIGITS)))
    return found


def geometry_of(area: Any) -> dict[str, Any]:
    """GeoJSON geometry of a ``MultiPolygon``, as tuples."""
    parts: list[Any] = []
    if not area.is_empty:
        _, points, (rings, shells, _) = polygons().to_ragged_array([area])
        places = list(zip(*points.T.tolist(), strict=True))
        closed = [tuple(places[a:b]) for a, b in pairwise(rings.tolist())]
        parts = [tuple(closed[a:b]) for a, b in pairwise(shells.tolist())]
    return {"type": "MultiPolygon", "coordinates": parts}


def _holes(valid: NDArray[np.bool_], shapely: Any) -> Any:
    """Boxes that cover the unit cells with a missing corner: the runs of cells in each row."""
    missing = ~(valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:])
    ends = np.diff(missing.astype(np.int8), axis=1, prepend=0, append=0)
    row, first = np.nonzero(ends == 1)
    last = np.nonzero(ends == -1)[1]
    return shapely.box(row, first, row + 1, last)


def _nested(points: Points, first: Numbers, shapely: Any) -> Any:
    """Make a ``MultiPolygon`` of rings with their inside on the left, none of which touches another.

    ``points`` (P, 2) are those of one ring after the other, the first of each repeated at its end; ``first`` (R + 1,)
    is where each ring begins, and the number of points.
    """
    if not len(points):
        return shapely.MultiPolygon()
    begin, length = first[:-1], np.diff(first)
    x, y = (points - np.repeat(points[begin], length, axis=0)).T
    twice_area = np.append(x[:-1] * y[1:] - x[1:] * y[:-1], 0)
    inner = np.add.reduceat(twice_area, begin) < 0
    shell = _shells(points, first, inner)
    # the rings of each polygon one after the other, the shell before its holes
    order = np.lexsort((inner, shell))
    ends = np.cumsum(length[order])
    moved = np.repeat(begin[order] - ends + length[order], length[order])
    shells = np.append(np.flatnonzero(~inner[order]), len(order))
    offsets = (np.append(0, ends), shells, np.array([0, len(shells) - 1]))
    kind = shapely.GeometryType.MULTIPOLYGON
    return shapely.from_ragged_array(kind, points[np.arange(len(points)) + moved], offsets)[0]


def _shells(points: Points, first: Numbers, inner: NDArray[np.bool_]) -> Numbers:
    """The ring that bounds the same polygon from outside, for each ring (R,), by number; ``inner`` (R,) are holes.

    Straight lines run through all holes. On its line, what lies before the first point of a hole bounds the same
    polygon: the shell, or another hole, which begins nearer to the border; and so on until the shell is reached.
    """
    ring = np.arange(len(inner))
    begin = first[:-1]
    low, high = np.minimum.reduceat(points[:, 0], begin), np.maximum.reduceat(points[:, 0], begin)
    line = np.floor(low) + 1
    lines = np.unique(np.where(line < high, line, (low + high) / 2)[inner])
    # pieces, and the lines that they cross
    start, way = points[:-1], np.diff(points, axis=0)
    of = np.repeat(ring, np.diff(first))[:-1]
    met, after = (np.searchsorted(lines, end(start[:, 0], points[1:, 0])) for end in (np.minimum, np.maximum))
    count = np.where(of == np.repeat(ring, np.diff(first))[1:], after - met, 0)
    piece = np.repeat(np.arange(len(of)), count)
    line = met[piece] + np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    slope = way[piece, 1] / way[piece, 0]
    place = start[piece, 1] + (lines[line] - start[piece, 0]) * slope
    order = np.lexsort((slope, place, line))
    ring_at, forwards, place = of[piece[order]], way[piece[order], 0] > 0, place[order]
    # where a hole begins, the inside lies before; of all its lines, take the one where that is nearest to the border
    enters = np.flatnonzero(inner[ring_at] & ~forwards)
    enters = enters[np.argsort(place[enters], kind="stable")]
    holes, at = np.unique(ring_at[enters], return_index=True)
    ring[holes] = ring_at[enters[at] - 1]
    for _ in range(len(ring).bit_length()):
        ring = ring[ring]
    return ring


def _rings(contour: Curve, above: bool) -> tuple[Points, Numbers]:
    """Make closed rings with the part on their left, in index coordinates, one after the other; see `_nested`."""
    if contour.origin_above is None:
        raise _unfinished()
    step = 1 if above else -1
    rings = [walk for walk in contour.walks if walk[0] == walk[-1]]
    closed = contour.points[np.fromiter(chain.from_iterable(rings), np.int64)][::step]
    lines = [contour.points[walk[::step]] for walk in contour.walks if walk[0] != walk[-1]]
    bounding = _along(lines, np.array(contour.shape, np.float64) - 1, contour.origin_above == above)
    length = [*map(len, rings[::step]), *map(len, bounding)]
    return np.concatenate([closed, *bounding]), np.cumsum([0, *length])


def _along(lines: list[Points], far: Points, here: bool) -> list[Points]:
    """Close lines that end at the border into rings; ``here``: the first sample lies in the part on their left."""
    corners = np.array([(0, 0), (far[0], 0), far, (0, far[1])])
    if not lines:
        # the whole border lies on one side
        return [corners[[0, 1, 2, 3, 0]]] if here else []
    starts = _along_border(np.array([line[0] for line in lines]), far)
    ends = _along_border(np.array([line[-1] for line in lines]), far)
    once = 2 * far.sum()
    # with the part on the left, its border runs counter-clockwise from the end of each line to the next start
    first, last = np.argsort(starts), np.argsort(ends)
    until = np.append(starts[first], starts[first[0]] + once)[here:][: len(lines)]
    follower, length = np.empty_like(first), np.empty_like(ends)
    follower[last], length[last] = np.roll(first, -here), until - ends[last]
    around = _along_border(corners, far)
    done = np.zeros(len(lines), bool)
    rings = []
    for i in range(len(lines)):
        pieces: list[Points] = []
        while not done[i]:
            done[i] = True
            way = (around - ends[i]) % once
            passed = np.argsort(way)[: np.count_nonzero(way < length[i])]
            pieces += [lines[i], corners[passed]]
            i = int(follower[i])
        if pieces:
            rings.append(np.concatenate([*pieces, pieces[0][:1]]))
    return rings


def _along_border(points: Points, far: Points) -> Points:
    """Distances of points along the border, counter-clockwise from (0, 0), with axis 0 as x."""
    x, y = points.T
    on = [y == 0, x == far[0], y == far[1], x == 0]
    if not np.logical_or.reduce(on).all():
        raise _unfinished()
    return np.select(on, [x, far[0] + y, 2 * far[0] + far[1] - x, 2 * far.sum() - y])


def _unfinished() -> TruncatedError:
    return TruncatedError(
        "too little has been received to close the areas: the curve ends inside the field", code="truncated",
        remedy="draw whole layers of the whole field; for a window, crop the file (isocodec edit)",
    )
