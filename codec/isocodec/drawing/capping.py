"""Closed surfaces: the part on one side of an isosurface, bounded by the surface and by faces of the grid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError, TruncatedError
from .areas import areas_of, polygons
from .curve import Curve

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]


def capped_mesh(contour: Curve, above: bool, make: Callable[..., Curve]) -> Mesh:
    """Make the points and triangles of a closed surface; see `Contour.capped`. ``make`` is the class of the contour."""
    if contour.n != 3 or len(contour.shape) != 3:
        raise OptionError("only an isosurface of a grid (n = 3) can be capped", code="dimension")
    if contour.masked:
        raise OptionError("the surface cannot be closed where samples are missing", code="holes",
                          remedy="fill them when the field is encoded: --missing nearest")
    if contour.origin_above is None:
        raise TruncatedError("too little has been received to close the surface", code="truncated")
    # edges that belong to one triangle alone, in its direction
    edges = np.concatenate([contour.cells[:, ends] for ends in ([0, 1], [1, 2], [2, 0])])
    _, which, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    rim = edges[count[which.reshape(-1)] == 1]
    numbers = {tuple(point): number for number, point in enumerate(contour.points.tolist())}
    points = contour.points.tolist()
    added: list[NDArray[np.int64]] = []
    left = np.ones(len(rim), np.bool_)
    for axis in range(3):
        for last in (False, True):
            plane = float(contour.shape[axis] - 1) if last else 0.0
            on_face = (contour.points[rim][:, :, axis] == plane).all(axis=1)
            left &= ~on_face
            for corners in _face(contour, rim[on_face], axis, last, above, make):
                found = []
                for corner in corners:
                    key = tuple(corner)
                    if key not in numbers:
                        numbers[key] = len(points)
                        points.append(list(key))
                    found.append(numbers[key])
                added.append(np.array(found))
    if left.any():
        raise TruncatedError("too little has been received to close the surface: it ends inside the field",
                             code="truncated", remedy="draw whole layers only")
    cells = contour.cells if above else contour.cells[:, ::-1]
    whole = np.concatenate([cells, np.array(added, np.int64).reshape(-1, 3)])
    return np.array(points).reshape(-1, 3), whole


def _face(
    contour: Curve, rim: NDArray[np.int64], axis: int, last: bool, above: bool, make: Callable[..., Curve]
) -> NDArray[np.float64]:
    """Triangles (M, 3, 3) that cover the part in a face of the grid, counter-clockwise as seen from outside."""
    shapely = polygons()
    others = [a for a in range(3) if a != axis]
    plane = contour.shape[axis] - 1 if last else 0
    # right-handed as seen from outside, or not
    straight = last != (axis == 1)
    # the cap's border runs in the opposite direction to that of the surface
    walk = rim[:, ::-1] if straight else rim
    used, number = np.unique(walk, return_inverse=True)
    flat = make(
        contour.points[used][:, others], number.reshape(-1, 2), contour.isovalue,
        (contour.shape[others[0]], contour.shape[others[1]]), origin_above=_corner_above(contour, axis, last),
    )
    whole = areas_of(flat, above=above)
    pieces = [shapely.constrained_delaunay_triangles(part) for part in whole.geoms]
    rings = [shapely.get_coordinates(triangle)[:3] for piece in pieces for triangle in piece.geoms]
    if not rings:
        return np.zeros((0, 3, 3))
    # without a placement, x of an area runs along the second axis
    corners = np.array(rings)[:, :, ::-1]
    (a, b), (c, d) = (corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0)
    across = a * d - b * c
    turn = (across > 0) != straight
    corners[turn] = corners[turn][:, ::-1]
    out = np.empty((len(corners), 3, 3))
    out[:, :, others], out[:, :, axis] = corners, plane
    return out


def _corner_above(contour: Curve, axis: int, last: bool) -> bool:
    """Whether the first sample of a face lies above, from the first sample of all and the crossings in between."""
    first = bool(contour.origin_above)
    if not last:
        return first
    rest = [a for a in range(3) if a != axis]
    crossings = np.count_nonzero((contour.points[:, rest] == 0).all(axis=1))
    return first != bool(crossings % 2)
