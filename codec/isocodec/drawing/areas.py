"""Areas on one side of an isocontour: its lines, closed along the border of the grid, as polygons with holes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError, TruncatedError
from ..extras import optional
from ..field.placement import Placement
from .curve import Curve

Ring = NDArray[np.float64]


def polygons() -> Any:
    """Import the library for polygons.

    Raises
    ------
    MissingExtraError
    """
    return optional("shapely", extra="geo", purpose="making areas")


def areas_of(contour: Curve, *, above: bool = True, valid: NDArray[np.bool_] | None = None) -> dict[str, Any]:
    """Polygons of the part above or not above the isovalue; see `Contour.areas`. Of a plane in space in `flat`."""
    contour = contour.flat
    if len(contour.shape) != 2:
        raise OptionError("only an isocontour (n = 2) has areas", code="dimension")
    if contour.masked:
        raise OptionError(
            "areas are not closed where samples are missing", code="holes",
            remedy="to close them along holes, use contour(.., through_holes=True).areas(valid=..) (--along-holes)",
        )
    if valid is not None and np.shape(valid) != contour.shape:
        raise OptionError(f"valid has shape {np.shape(valid)}, but the field has {contour.shape}", code="valid")
    shapely = polygons()
    touching = _touching(contour)
    outer: list[Any] = []
    holes: list[Any] = []
    for ring in _rings(contour, above):
        size = _twice_area(ring)
        if size != 0:
            polygon = shapely.Polygon(ring)
            pieces = pieces_of(shapely.make_valid(polygon)) if touching and not polygon.is_valid else [polygon]
            (outer if size > 0 else holes).extend(pieces)
    # a hole belongs to the smallest ring around it; rings inside the hole do not cover it
    candidates = np.array(outer, object)
    around, hole = shapely.STRtree(holes).query(candidates, predicate="covers")
    by_size = np.argsort(-shapely.area(candidates)[around], kind="stable")
    within: list[list[Any]] = [[] for _ in outer]
    for j, i in dict(zip(hole[by_size].tolist(), around[by_size].tolist(), strict=True)).items():
        within[i].append(holes[j])
    parts = []
    for part, some in zip(outer, within, strict=True):
        parts += pieces_of(shapely.difference(part, shapely.union_all(some)) if some else part)
    area = shapely.MultiPolygon(parts)
    if touching and not area.is_valid:
        area = shapely.MultiPolygon(pieces_of(shapely.union_all(parts)))
    if valid is not None:
        whole = shapely.difference(area, shapely.union_all(_holes(np.asarray(valid, np.bool_), shapely)))
        area = shapely.MultiPolygon(pieces_of(whole))
    if contour.bent:
        # the border bends with the grid
        area = shapely.segmentize(area, 1.0)
    placed = shapely.MultiPolygon(pieces_of(shapely.transform(area, contour.place)))
    if contour.placement is not None and contour.placement.closes:
        placed = shapely.MultiPolygon(pieces_of(shapely.union_all(shapely.make_valid(pieces_of(placed)))))
    placed = shapely.MultiPolygon([shapely.geometry.polygon.orient(part) for part in placed.geoms])
    geometry: dict[str, Any] = shapely.geometry.mapping(placed)
    return geometry


def lifted(geometry: dict[str, Any], placement: Placement | None) -> dict[str, Any]:
    """Areas of a plane in space with three coordinates, from those within the plane; others as they are."""
    if placement is None or not placement.in_space:
        return geometry
    parts = [
        [list(map(tuple, placement.lifted(np.array(ring)).tolist())) for ring in part]
        for part in geometry["coordinates"]
    ]
    return {**geometry, "coordinates": parts}


def _holes(valid: NDArray[np.bool_], shapely: Any) -> Any:
    """Boxes that cover the unit cells with a missing corner: the runs of cells in each row."""
    missing = ~(valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:])
    ends = np.diff(missing.astype(np.int8), axis=1, prepend=0, append=0)
    row, first = np.nonzero(ends == 1)
    last = np.nonzero(ends == -1)[1]
    return shapely.box(row, first, row + 1, last)


def _touching(contour: Curve) -> bool:
    """Whether rings may touch: points coincide, or lie on the border although no line ends there."""
    points = contour.points
    on_border = np.count_nonzero(((points == 0) | (points == np.array(contour.shape) - 1)).any(axis=1))
    open_lines = sum(walk[0] != walk[-1] for walk in contour.walks)
    return bool(on_border > 2 * open_lines) or len(np.unique(points[:, 0] + 1j * points[:, 1])) < len(points)


def pieces_of(shape: Any) -> list[Any]:
    """The polygons of which a shape consists."""
    parts = getattr(shape, "geoms", [shape])
    return [p for part in parts for p in getattr(part, "geoms", [part]) if p.geom_type == "Polygon"]


def _twice_area(ring: Ring) -> float:
    """Twice the signed area of a closed ring: positive if counter-clockwise, with axis 0 as x and axis 1 as y."""
    x, y = (ring - ring[0]).T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


def _rings(contour: Curve, above: bool) -> list[Ring]:
    """Make closed rings with the part on their left, in index coordinates."""
    step = 1 if above else -1
    walks = [walk[::step] for walk in contour.walks]
    lines = [contour.points[walk] for walk in walks if walk[0] != walk[-1]]
    rings = [contour.points[walk] for walk in walks if walk[0] == walk[-1]]
    far = np.array(contour.shape, np.float64) - 1
    corners = np.array([(0, 0), (far[0], 0), far, (0, far[1])])
    if contour.origin_above is None:
        raise _unfinished()
    here = contour.origin_above == above
    if not lines:
        # the whole border lies on one side
        return [*rings, corners[[0, 1, 2, 3, 0]]] if here else rings

    starts = _along_border(np.array([line[0] for line in lines]), far)
    ends = _along_border(np.array([line[-1] for line in lines]), far)
    once = 2 * far.sum()
    # a line may reach the first sample from the other side
    (ends if here else starts)[(ends if here else starts) == 0] = once
    # with the part on the left, its border runs counter-clockwise from the end of each line to the next start
    first, last = np.argsort(starts), np.argsort(ends)
    until = np.append(starts[first], starts[first[0]] + once)[here:][: len(lines)]
    follower, length = np.empty_like(first), np.empty_like(ends)
    follower[last], length[last] = np.roll(first, -here), until - ends[last]
    around = _along_border(corners, far)
    done = np.zeros(len(lines), bool)
    for i in range(len(lines)):
        pieces: list[Ring] = []
        while not done[i]:
            done[i] = True
            way = (around - ends[i]) % once
            passed = np.argsort(way)[: np.count_nonzero(way < length[i])]
            pieces += [lines[i], corners[passed]]
            i = int(follower[i])
        if pieces:
            ring = np.concatenate(pieces)
            rings.append(np.concatenate([ring, ring[:1]]))
    return rings


def _along_border(points: Ring, far: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of points along the border, counter-clockwise from (0, 0), with axis 0 as x."""
    x, y = points.T
    on = [y == 0, x == far[0], y == far[1], x == 0]
    if not np.logical_or.reduce(on).all():
        raise _unfinished()
    return np.select(on, [x, far[0] + y, 2 * far[0] + far[1] - x, 2 * far.sum() - y])


def _unfinished() -> TruncatedError:
    return TruncatedError(
        "too little has been received to close the areas: the curve ends inside the field", code="truncated",
        remedy="draw whole layers only",
    )
