"""Check that a file keeps its promises for a field: signs, missing samples, and distances measured anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from isospec.container import DomainKind

from ..errors import InputError, OptionError
from ..field.decoded_samples import LABELS
from ..field.meshed import valued
from ..field.placement import closed
from ..field.samples import check_field, without_holes
from .files import TileFile, Viewed, WholeFile

if TYPE_CHECKING:
    from ..drawing.contour import Contour
    from ..field.samples import Samples

ROUNDING = 1e-6
"""Cells that the measured distance, which is an upper bound, and points in double precision may be off."""
MEASURED = 0.001
"""Cells by which the distance is measured too large at most."""


@dataclass(frozen=True)
class Verified:
    """Result of verifying one isovalue.

    Attributes
    ----------
    isovalue : float
        NaN of a surface.
    promised : float or None
        Largest distance between decoded and original curve that the file or the caller promises.
    there, back : float
        Largest distance, in cells (on a mesh in the unit of its points), from the decoded to the original curve, and
        back; at most 0.001 cells too large. Of a surface the largest distance of values, twice.
    wrong : int or None
        Samples or vertices on the wrong side of the isovalue; None if the mesh of the file is coarser than the samples,
        or is another than the one that was encoded.
    kept : bool
        Whether no sample is wrong, and neither distance is larger than promised.
    """

    isovalue: float
    promised: float | None
    there: float
    back: float
    wrong: int | None
    kept: bool


def verified(held: WholeFile | TileFile, field: Any, frame: int | None, within: float | None) -> list[Verified]:
    """Verify each isovalue of a file; see `IsoFile.verify`.

    For a file in tiles the joined curve is measured against that of the whole field. Such a file states no promises,
    nor which samples far from the curve are missing.
    """
    if held.kind == "mesh":
        assert isinstance(held, WholeFile)
        return _on_mesh(held, field, frame, within)
    from ..io.readers.load import read_field

    known = read_field(field)
    if held.kind == "surface":
        return [_surface(held, np.asarray(known.values), within)]
    values, gone = without_holes(known.values, known.mask)
    contours = held.contours(Viewed(frame=frame))
    if isinstance(held, TileFile):
        _check_shape(values.shape, held.info.shape)
        return [_measured(one, check_field(values, one.isovalue, gone=gone), within, None) for one in contours]
    info = held.info
    periodic = contours[0].placement.periodic if contours[0].placement is not None else ()
    if periodic:
        values, gone = closed(values, periodic), None if gone is None else closed(gone, periodic)
    _check_shape(values.shape, tuple(info.shape), held.kind == "series")
    missing = np.zeros(values.shape, np.bool_) if gone is None else gone
    others = int((held.valid() == missing).sum())
    if others:
        raise InputError(f"{others:,} samples are missing in the field or in the file, but not in both", code="missing")
    out = []
    for number, contour in enumerate(contours):
        promised = within if within is not None else _promised(info.layers, frame or 0, number)
        out.append(_of_grid(held, contour, frame, values, gone, promised))
    return out


def _check_shape(found: tuple[int, ...], shape: tuple[int, ...], series: bool = False) -> None:
    """Raise `InputError` if a field has another shape than a file, or each frame of a series."""
    if found != shape:
        of, remedy = ("each frame", "choose a frame") if series else ("the file", None)
        raise InputError(f"the field has shape {found}, that of {of} {shape}", code="shape", remedy=remedy)


def _of_grid(
    held: WholeFile, contour: Contour, frame: int | None, values: NDArray[Any], gone: NDArray[np.bool_] | None,
    promised: float | None,
) -> Verified:
    """Verify one isovalue of a grid."""
    if LABELS in held.info.metadata:
        sampled = check_field(values == contour.isovalue, 0.5, gone=gone)
    else:
        sampled = check_field(values, contour.isovalue, gone=gone)
    wrong: int | None
    try:
        differ = held.above(contour.isovalue, Viewed(frame=frame)) != sampled.signs
        wrong = int((differ if gone is None else differ & ~gone).sum())
    except OptionError:
        wrong = None
    return _measured(contour, sampled, promised, wrong)


def _measured(contour: Contour, sampled: Samples, promised: float | None, wrong: int | None) -> Verified:
    """Measure how far a contour lies from that of the samples."""
    from ..search.original import original

    return _compared(contour, original(sampled), promised, wrong)


def _compared(
    contour: Contour, first: Contour, promised: float | None, wrong: int | None, unit: float = 1.0
) -> Verified:
    """Measure how far two contours lie from each other, in cells of size ``unit``."""
    from ..search.proof import hausdorff

    # segments in space as triangles without an area
    cells, others = (one.cells[:, [0, 1, 1]] if one.points.shape[1] > one.n else one.cells for one in (contour, first))
    there, back = hausdorff(contour.points / unit, cells, first.points / unit, others, MEASURED)
    far = promised is not None and max(there, back) > promised / unit + MEASURED + ROUNDING
    return Verified(contour.isovalue, promised, there * unit, back * unit, wrong, not (wrong or far))


def _on_mesh(held: WholeFile, field: Any, frame: int | None, within: float | None) -> list[Verified]:
    """Verify the isovalues of a file on a mesh, for values at its vertices."""
    points, cells, values = _mesh_of(held, field, frame)
    out = []
    for contour in held.contours(Viewed(frame=frame)):
        above = values > contour.isovalue
        original = _drawn(points, cells, values, contour.isovalue)
        wrong = None
        if held.info.domain is not None and held.info.domain.kind == DomainKind.KNOWN:
            # a mesh in the file has its vertices in another order
            used = np.unique(cells)
            wrong = int((held.above(contour.isovalue, Viewed(frame=frame)) != above)[used].sum())
        edges = points[cells[:, 1]] - points[cells[:, 0]]
        unit = float(np.median(np.sqrt((edges**2).sum(axis=1))))
        out.append(_compared(contour, original, within, wrong, unit))
    return out


def _mesh_of(held: WholeFile, field: Any, frame: int | None) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Points, cells and the values of a frame of a `Mesh`, or of values on the mesh that was given to `open`."""
    points, cells, values = (getattr(field, name, None) for name in ("points", "cells", "values"))
    if points is None:
        if held.mesh_given is None:
            raise InputError("values on a mesh need their mesh", code="mesh", remedy="give a Mesh, or open(.., mesh=)")
        points, cells = held.mesh_given
        values = field
    if values is None:
        raise InputError("the mesh has several values at its points, or none", code="values",
                         remedy="name them: --key NAME (key= in Python)")
    values = np.asarray(values)
    if values.ndim == 2:
        values = values[frame or 0]
    points = np.asarray(points, np.float64)
    if cells is None:
        from ..mesh.coded_points import triangulated

        there = valued(points, values)
        points, values = (points, values) if there is None else (points[there], values[there])
        points, cells, values = triangulated(points, values)
    if values.shape != (len(points),):
        raise InputError(f"{values.shape} values for {len(points)} points", code="values")
    return points, np.asarray(cells, np.int64), values


def _drawn(points: NDArray[Any], cells: NDArray[Any], values: NDArray[Any], isovalue: float) -> Contour:
    """The contour of values that are linear on each cell."""
    from ..drawing.contour import Contour
    from ..drawing.explicit import crossed_edges, draw_cells

    above = values > isovalue
    some = cells[above[cells].any(axis=1) & ~above[cells].all(axis=1)]
    edges = crossed_edges(some, above)
    low, high = (values[edges[:, i]].astype(np.float64) for i in (0, 1))
    with np.errstate(all="ignore"):
        ratio = np.clip(np.nan_to_num((isovalue - low) / (high - low), nan=0.5), 0.0, 1.0)
    drawn, pieces = draw_cells(points, some, np.zeros(len(some), np.bool_), above, edges, ratio)
    return Contour(drawn, pieces, isovalue, ())


def _surface(held: WholeFile | TileFile, values: NDArray[Any], within: float | None) -> Verified:
    """Measure how far a triangulated surface lies from the values of a field."""
    tin = held.surface(None)
    if tin.shape is None:
        raise InputError("the surface is of scattered points, not of a field", code="shape")
    _check_shape(values.shape, tin.shape)
    there = float(np.nanmax(np.abs(tin.raster() - values.astype(np.float64))))
    return Verified(float("nan"), within, there, there, None, within is None or there <= within * (1 + ROUNDING))


def _promised(layers: Any, frame: int, number: int) -> float | None:
    """Promise of the last layer of an isovalue of a frame; None without one."""
    own = [layer for layer in layers if (layer.frame, layer.isovalue) == (frame, number)]
    return own[-1].within if own else None
