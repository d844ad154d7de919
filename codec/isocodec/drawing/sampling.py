"""Values of another field, or of a mesh, at the points of a contour."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, OptionError
from ..extras import optional
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.placement import Placement, closed
from ..field.sampled import Field
from ..field.samples import missing_of
from .curve import Curve

_NEAR = 1e-9
"""Distance in cells within which a point lies on an edge of the grid, or in the grid; and a weight that counts as 0."""
_SAME = 1e-3
"""Distance in cells within which samples of two fields lie in the same place."""
_REACH = 0.25
"""Distance within which a point lies on a mesh, as a part of the longest edge of the nearest cell."""
Values = NDArray[Any]
Numbers = NDArray[np.float64]


def sampled(contour: Curve, field: ArrayLike | Field | Mesh) -> Numbers:
    """Interpolate a field at the points of a contour; see `Contour.sample`."""
    if isinstance(field, Frames):
        raise InputError("a series cannot be sampled", code="frames", remedy="choose one of its frames")
    if isinstance(field, Mesh):
        return _on_mesh(field, contour.placed)
    if not contour.shape:
        raise InputError("the contour lies on a mesh, the values on a grid", code="mesh",
                         remedy="give Mesh(points, cells, values)")
    given = field if isinstance(field, Field) else Field(field)
    values, there, n = _known(given.values, given.mask), contour.placement, len(contour.shape)
    ends = [] if there is None else [a for a in there.periodic if values.shape[a : a + 1] == (contour.shape[a] - 1,)]
    whole, points = closed(values, ends), contour.points
    elsewhere = _in_cells(given.placement, contour)
    if elsewhere is not None and not (abs(elsewhere - points) < _SAME).all():
        return _multilinear(values, elsewhere)
    if whole.shape[:n] != contour.shape or whole.ndim > n + 1:
        raise InputError(f"the values have shape {values.shape}, the grid of the contour {contour.shape}", code="shape",
                         remedy="give values of that grid, or a Field with a matrix, if the contour has a placement")
    return _along_edges(whole, points)


def _known(given: ArrayLike, mask: Values | None = None) -> Values:
    """Check values of the types of real numbers; missing ones become NaN."""
    values = np.asarray(given)
    if values.dtype.kind not in "biuf":
        raise InputError(f"values of type {values.dtype} cannot be interpolated", code="dtype",
                         remedy="convert them to integers or floats")
    gone = missing_of(given, mask)
    return np.where(gone, np.nan, values) if gone.any() else values


def _in_cells(place: Placement | None, contour: Curve) -> Numbers | None:
    """Index coordinates (P, n) of points in a field, NaN off its plane; None unless both have a place."""
    there, places = contour.placement, contour.placed
    if place is None or there is None or not (place.placed and there.placed):
        return None
    if place.crs and there.crs and place.crs != there.crs:
        raise InputError("the values and the contour have different reference systems", code="crs",
                         remedy="convert the values to that of the contour")
    if place.matrix is None:
        return None
    if len(place.matrix) != places.shape[1]:
        raise InputError(f"the values have {len(place.matrix)} coordinates, the contour {places.shape[1]}",
                         code="placement")
    points, step = place.index(places), np.linalg.norm(place.matrix[:, :-1], axis=0).min()
    off = np.linalg.norm(place.place(points) - places, axis=1) > _SAME * step
    return np.where(off[:, None], np.nan, points)


def _along_edges(values: Values, points: Numbers) -> Numbers:
    """Interpolate linearly along the edge of the full grid's mesh on which a point lies, else multilinearly.

    An edge runs from even to odd numbers, or back, along each axis along which it runs at all.
    """
    whole, even = np.rint(points), 2 * np.rint(points / 2)
    share, runs = abs(points - even), abs(points - whole) > _NEAR
    low = np.where(runs, even, whole).astype(np.int64)
    high = np.where(runs, even + np.sign(points - even), whole).astype(np.int64)
    along = np.max(share, axis=1, where=runs, initial=0.0)
    on_edge = along - np.min(share, axis=1, where=runs, initial=1.0) < _NEAR
    out = _mixed(values, [(low[on_edge], 1 - along[on_edge]), (high[on_edge], along[on_edge])])
    return _merged(on_edge, out, _multilinear(values, points[~on_edge]))


def _multilinear(values: Values, points: Numbers) -> Numbers:
    """Interpolate within cells, NaN outside the field."""
    last = np.array(values.shape[: points.shape[1]]) - 1
    inside = np.all((points > -_NEAR) & (points < last + _NEAR), axis=1)
    within = points[inside].clip(0, last)
    cell = np.minimum(np.floor(within), last - 1).clip(0).astype(np.int64)
    steps = np.array([*product((0, 1), repeat=len(last))])
    weights = [np.where(step, within - cell, 1 - within + cell).prod(axis=1) for step in steps]
    out = _mixed(values, zip([np.minimum(cell + step, last) for step in steps], weights, strict=True))
    return _merged(inside, out, np.full((int((~inside).sum()), *out.shape[1:]), np.nan))


def _mixed(values: Values, ends: Iterable[tuple[Values, Numbers]]) -> Numbers:
    """Sum values at samples (P, n) by weights (P,); samples without weight may be missing."""
    out: Any = 0.0
    with np.errstate(invalid="ignore"):
        for sample, weight in ends:
            found = values[tuple(sample.T)]
            weight = weight.reshape(-1, *[1] * (found.ndim - 1))
            out = out + np.where(weight > _NEAR, weight * found, 0.0)
    return np.asarray(out)


def _merged(first: NDArray[np.bool_], some: Numbers, others: Numbers) -> Numbers:
    """Put rows of two arrays together: the first where that is marked, the others elsewhere."""
    out = np.empty((len(first), *some.shape[1:]))
    out[first], out[~first] = some, others
    return out


def mean_along(places: Numbers, values: Numbers) -> float:
    """Mean of values (K,) along a line of places (K, 2 or 3) where they are known; NaN if they are known nowhere.

    Raises `OptionError` for vectors.
    """
    if values.ndim > 1:
        raise OptionError("a table holds one number for each line, not vectors", code="sample",
                          remedy="sample a component or the magnitude")
    length, between = np.linalg.norm(np.diff(places, axis=0), axis=1), (values[1:] + values[:-1]) / 2
    known = ~np.isnan(between)
    total = length[known].sum()
    return float((length * between)[known].sum() / total) if total > 0 else float("nan")


def _on_mesh(mesh: Mesh, places: Numbers) -> Numbers:
    """Interpolate linearly in the nearest cell of a mesh; NaN where that is far away."""
    if mesh.cells is None or mesh.values is None:
        raise InputError("sampling on a mesh needs its cells and values", code="mesh",
                         remedy="give Mesh(points, cells, values)")
    pyvista = optional("pyvista", extra="vtk", purpose="sampling on a mesh")
    values, cells = _known(mesh.values).T, np.asarray(mesh.cells)
    points = np.asarray(mesh.points, np.float64)
    corners, places = (np.pad(each, ((0, 0), (0, 3 - each.shape[1]))) for each in (points, places))
    if len(values) != len(corners):
        raise InputError(f"{len(values)} values on {len(corners)} points", code="shape")
    kind = pyvista.CellType.TRIANGLE if cells.shape[1] == 3 else pyvista.CellType.TETRA
    found, nearest = pyvista.UnstructuredGrid({kind: cells}, corners).find_closest_cell(
        places, return_closest_point=True)
    used = cells[found]
    first, edges = corners[used[:, :1]], corners[used[:, 1:]] - corners[used[:, :1]]
    weights = (np.linalg.pinv(edges.transpose(0, 2, 1)) @ (nearest[:, None] - first).transpose(0, 2, 1))[..., 0]
    weights = np.column_stack([1 - weights.sum(axis=1), weights])
    out = _mixed(values, zip(used[..., None].transpose(1, 0, 2), weights.T, strict=True))
    far = np.linalg.norm(nearest - places, axis=1) > _REACH * np.linalg.norm(edges, axis=2).max(axis=1)
    return np.where(far.reshape(-1, *[1] * (out.ndim - 1)), np.nan, out)
