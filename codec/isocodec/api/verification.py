"""Check that a file keeps its promises for a field: compare signs and missing samples, and measure distances."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from isospec.container import DomainKind

from ..errors import InputError, OptionError, TruncatedError
from ..field.decoded_samples import DecodedSamples, values_of_steps
from ..field.framed import Frames
from ..field.labelling import having, is_of_labels
from ..field.meshed import valued
from ..field.placement import COORDINATE_UNIT, CRS, Placement, closed, read_placement
from ..field.sampled import UNIT, Field
from ..field.samples import Samples, check_field, interval_value, without_holes
from ..field.stretch import in_unit
from ..field.units import converted, distance_of, unit_of
from ..stream.file_info import FileInfo
from ..stream.given import field_of
from ..stream.promises import (
    EXACT,
    SIGNS,
    asked,
    cells_in_words,
    noted,
    noted_values,
    of_samples,
    of_tiles,
    of_values,
    on_mesh_in_words,
)
from ..verbs import Choice

if TYPE_CHECKING:
    from ..drawing.contour import Contour

CELLS = "cells"
ROUNDING = 1e-6
"""Rounding of points, in cells: a distance that exceeds a promise by less counts as the promise."""
MEASURED = 0.001
"""Largest difference, in cells, of the bounds between which a distance is known."""
SHARE = 0.02
"""Largest difference of these bounds as a share of what is promised."""


@dataclass(frozen=True)
class Verified:
    """Result of verifying one isovalue.

    Attributes
    ----------
    isovalue : float
        NaN for a surface.
    promised : float or None
        Largest distance between decoded and original curve that the file or the caller promises; 0 if all values beside
        the curve are promised.
    there, back : float
        Upper bounds of the largest distance, in cells (on a mesh in the unit of its points), from the decoded to the
        original curve, and from the original to the decoded one. They exceed ``promised`` only if the distance does.
        For a surface, both are the largest error of values.
    wrong : int or None
        Samples or vertices on the wrong side of the isovalue; None if the mesh of the file is coarser than the samples,
        or is another than the one that was encoded.
    kept : bool or None
        Whether no sample is wrong, and what is promised holds. None if no sample is wrong and nothing is promised.
    promise : str or None
        What is promised, in words, in the unit that was asked for; None if it is nothing.
    unit : str
        What ``promised``, ``there`` and ``back`` count: ``cells``, or a unit; empty if nobody states it.
    asked : str
        The distance as it was asked for, ``0.2mm``, if that is in another unit; or nothing.
    there_least, back_least : float
        Lower bounds of the same distances, at most 0.001 cells and a fiftieth of the promise below the upper ones. If
        one exceeds ``promised``, the promise is not kept.
    """

    isovalue: float
    promised: float | None
    there: float
    back: float
    wrong: int | None
    kept: bool | None
    promise: str | None = None
    unit: str = CELLS
    asked: str = ""
    there_least: float = 0.0
    back_least: float = 0.0

    def in_asked(self, distance: float) -> tuple[float, float, str] | None:
        """Return a distance and the promise as numbers of the unit that was asked for, and its name; None without one.
        """
        if not (self.asked and self.promised):
            return None
        number, unit = distance_of(self.asked)
        return number if distance == self.promised else distance * number / self.promised, number, unit


@dataclass(frozen=True)
class _Promise:
    """A promise about an isovalue: a distance in cells, or all signs or values beside the curve.

    Attributes
    ----------
    within : float or None
    text : str or None
        In words.
    asked : str
        As of `Verified`.
    step : float or None
        Values are promised to within half of it.
    """

    within: float | None = None
    text: str | None = None
    asked: str = ""
    step: float | None = None


def _known(field: Any) -> Field:
    """Read the field that a file is verified against."""
    if isinstance(field, str | os.PathLike):
        from ..io.opener import load

        field = load(field, Choice())
    if isinstance(field, Frames):
        raise InputError("holds no field but a series", code="field", remedy="choose a frame: frame=0")
    return field_of(field)


def _begun(
    file: Any, field: Any, frame: int | None
) -> tuple[NDArray[Any], NDArray[np.bool_] | None, list[Contour], Placement]:
    """The samples of a field, its mask of missing samples, the contours of a file, and the placement of both."""
    from ..stream.coordinate_coding import without_folds

    known = _known(field)
    values, gone = without_holes(known.values, known.mask)
    if known.placement is not None:
        gone = without_folds(known.placement, values.shape, gone)
    contours = [file.contour(one, frame=frame) for one in file.isovalues] if is_of_labels(file.info.metadata) else (
        file.contours(frame=frame))
    return values, gone, contours, _placement(known, contours[0].placement, file.info.metadata)


def verified_tiles(file: Any, field: Any, frame: int | None, within: float | str | None) -> list[Verified]:
    """Measure the joined curve of a tiled file, which does not state missing samples far from it, for a whole field."""
    values, gone, contours, placement = _begun(file, field, frame)
    _check_shape(values.shape, file.info.shape)
    promise = _of_note(file, within, placement)
    # in one piece the signs may take more memory than the field
    signs = promise.text in (SIGNS, EXACT)
    return [_of_grid(file, one, None, values, gone, promise, signs) for one in contours]


def verified_grid(file: Any, field: Any, frame: int | None, within: float | str | None) -> list[Verified]:
    """Verify each isovalue of a grid, or of a frame of a series."""
    values, gone, contours, placement = _begun(file, field, frame)
    info = file.info
    periodic = contours[0].placement.periodic if contours[0].placement is not None else ()
    if periodic:
        values, gone = closed(values, periodic), None if gone is None else closed(gone, periodic)
    _check_shape(values.shape, tuple(info.shape), file.kind == "series")
    valid = file.valid()
    if is_of_labels(info.metadata) and gone is not None and valid.all():
        # missing samples may have been encoded as ones without a label
        values, gone = np.where(gone, np.nan, values), None
    missing = np.zeros(values.shape, np.bool_) if gone is None else gone
    others = int((valid == missing).sum())
    if others:
        raise InputError(f"{others:,} samples are missing either in the field or in the file, but not in both",
                         code="missing")
    return [
        _of_grid(file, contour, frame, values, gone, _of_layers(info, placement, frame or 0, number)
                 if within is None else _given(within, placement, info.shape))
        for number, contour in enumerate(contours)
    ]


def _placement(known: Field, decoded: Placement | None, notes: Mapping[str, str]) -> Placement:
    """The placement that converts distances: of the file, else of the field; with units and system of either."""
    found = decoded if decoded is not None and decoded.placed else known.placement or Placement()
    given = known.placement or Placement()
    return replace(
        found, crs=found.crs or notes.get(CRS) or given.crs, unit=found.unit or notes.get(COORDINATE_UNIT) or given.unit
    )


def _given(within: float | str, placement: Placement, shape: Sequence[int]) -> _Promise:
    """The promise of a caller: a distance in cells, or with a unit."""
    number, unit = distance_of(str(within))
    if not unit:
        return _Promise(number, f"within {cells_in_words(number)}")
    text = str(within).replace(" ", "")
    found = placement.cells_of(text, tuple(shape))
    return _Promise(found, f"within {text} ({cells_in_words(found)})", text)


def _of_note(file: Any, within: float | str | None, placement: Placement) -> _Promise:
    """The promise of a file in tiles, whose note is about all of its stages."""
    parts, _ = noted(file.info.metadata)
    if within is None and (samples := of_tiles(file.info.metadata)):
        step = file.info.scale if samples not in (EXACT, SIGNS) else None
        return _Promise(0.0 if samples == EXACT else None, samples, step=step)
    distance = within if within is not None else parts[-1] if parts else None
    return _Promise() if distance is None else _given(distance, placement, file.info.shape)


def _of_layers(info: FileInfo, placement: Placement, frame: int, number: int) -> _Promise:
    """The promise of the last layer of an isovalue of a frame, or what all its layers state of samples."""
    own = [layer for layer in info.layers if (layer.frame, layer.isovalue) == (frame, number)]
    within = own[-1].within if own else None
    samples = of_samples(info)
    if within:
        text = asked(info, within, frame, number)
        # the chunk has whole thousandths; and coordinates in the file, which may be off, take a part of a distance
        exact = within if not text else min(within, placement.cells_of(text, tuple(info.shape)))
        words = cells_in_words(exact)
        unit = bool(text) and bool(distance_of(text)[1])
        return _Promise(exact, f"within {text} ({words})" if unit else f"within {words}", text * unit)
    step = info.scale if samples not in (None, EXACT, SIGNS) else None
    return _Promise(0.0 if within == 0 else None, samples, step=step)


def _check_shape(found: tuple[int, ...], shape: tuple[int, ...], series: bool = False) -> None:
    """Raise `InputError` if the shape of a field differs from that of a file, or of each frame of a series."""
    if found != shape:
        of, remedy = ("each frame", "choose a frame: frame=.. (--frame)") if series else ("the file", None)
        raise InputError(f"the field has shape {found}, but {of} has shape {shape}", code="shape", remedy=remedy)


def _of_grid(
    file: Any, contour: Contour, frame: int | None, values: NDArray[Any],
    gone: NDArray[np.bool_] | None, promise: _Promise, signs: bool = True,
) -> Verified:
    """Verify one isovalue of a grid, with its ``signs`` where the file has them all."""
    of_labels = is_of_labels(file.info.metadata)
    sampled = check_field(having(values, contour.isovalue) if of_labels else values,
                          0.5 if of_labels else contour.isovalue, gone=gone)
    wrong = None
    with suppress(OptionError):
        if signs:
            differ = file.above(contour.isovalue, frame=frame) != sampled.signs
            wrong = int((differ if gone is None else differ & ~gone).sum())
    return _measured(contour, sampled, promise, wrong)


def _measured(contour: Contour, sampled: Samples, promise: _Promise, wrong: int | None) -> Verified:
    """Measure how far a contour lies from that of the samples."""
    from ..search.original import original

    in_steps = None
    if promise.step is not None:
        steps = replace(sampled, scale=promise.step)
        some = np.indices(sampled.signs.shape).reshape(sampled.signs.ndim, -1).T
        numbers = steps.numbers(some, sampled.signs.ravel()).reshape(sampled.signs.shape)
        near = values_of_steps(sampled.signs, sampled.isovalue, promise.step, numbers)
        in_steps = original(DecodedSamples(near, sampled.isovalue, sampled.signs, promise.step, sampled.gone,
                                           number=numbers), measured=False)
    return _compared(contour, original(sampled, measured=False), promise, wrong, in_steps=in_steps)


def _compared(
    contour: Contour, first: Contour, promise: _Promise, wrong: int | None, size: float = 1.0, unit: str = CELLS,
    in_steps: Contour | None = None,
) -> Verified:
    """Measure how far two contours lie from each other, in cells of a ``size``; and from one of values in steps."""

    def far(other: Contour, promised: float | None) -> list[tuple[float, float]]:
        # segments in space as triangles without an area
        curves = [(one.points / size, one.cells[:, [0, 1, 1]] if one.points.shape[1] > one.n else one.cells)
                  for one in (contour, other)]
        return [_bounds(curves, promised), _bounds(curves[::-1], promised)]

    promised = None if promise.within is None else promise.within / size
    bounds = far(first, promised)
    broken = promised is not None and any(least > promised for least, _ in bounds)
    broken |= in_steps is not None and any(least > MEASURED for least, _ in far(in_steps, MEASURED))
    kept = None if promise.text is None and not wrong else not (wrong or broken)
    (there_least, there), (back_least, back) = [
        # as promised, not as that is rounded in cells
        [promise.within if bound == promised and promise.within is not None else bound * size for bound in each]
        for each in bounds
    ]
    return Verified(contour.isovalue, promise.within, there, back, wrong, kept, promise.text, unit, promise.asked,
                    there_least, back_least)


def _bounds(curves: Sequence[tuple[NDArray[Any], NDArray[Any]]], promised: float | None) -> tuple[float, float]:
    """Bound the largest distance of the first of two curves, each points and cells, from the second.

    The upper bound exceeds what is promised only if the lower one does.
    """
    from ..search.proof import SMALLEST, Target

    (ours, cells), (theirs, others) = curves
    if not len(cells):
        return 0.0, 0.0
    if not len(others):
        return math.inf, math.inf
    rounding = max(ROUNDING, *(float(np.spacing(np.abs(points).max())) for points in (ours, theirs)))
    finest = max(min(MEASURED, promised * SHARE) if promised else MEASURED, 4 * rounding)

    def beyond(limit: float, unsure: float, todo: NDArray[np.int64] | None) -> NDArray[np.int64]:
        """Pieces that are not proven to lie within a limit; they lie beyond the limit less ``unsure``."""
        # a proof ends at pieces of a fixed size, so that curves are enlarged for a finer one
        scale = SMALLEST / unsure
        return Target(theirs * scale, others, limit * scale).exceeded(ours * scale, cells, todo).cells

    low, high = 0.0, math.inf
    todo: NDArray[np.int64] | None = _not_among(ours[cells], theirs[others], rounding / 8)
    if todo is not None and not len(todo):
        same = not len(_not_among(ours[cells], theirs[others], 0.0))
        return 0.0, 0.0 if same else rounding if promised is None else promised
    if promised is not None:
        todo = beyond(promised + rounding, finest / 4, todo)
        todo = beyond(promised + rounding, rounding / 2, todo) if len(todo) else todo
        low, high = (promised + rounding / 2, math.inf) if len(todo) else (0.0, promised)
        todo = todo if len(todo) else None
    while high - low > finest:
        middle = max(2 * low, 0.25) if math.isinf(high) else (low + high) / 2
        left = beyond(middle, finest / 4, todo)
        if len(left):
            todo, low = left, max(low, middle - finest / 4)
        else:
            high = middle
    return low, high


def _not_among(pieces: NDArray[np.float64], others: NDArray[np.float64], rounding: float) -> NDArray[np.int64]:
    """Find the pieces, (M, n, d) points, that are not among others, all rounded: those are at no greater distance."""
    keys = []
    for each in (np.rint(each / rounding) if rounding else each for each in (pieces, others)):
        order = np.lexsort(each.transpose(2, 0, 1)[::-1], axis=-1)
        rows = np.ascontiguousarray(np.take_along_axis(each, order[..., None], axis=1).reshape(len(each), -1) + 0.0)
        keys.append(rows.view([("", rows.dtype)] * rows.shape[1]).ravel())
    mine, other = keys
    return np.flatnonzero(~np.isin(mine, other))


def verified_mesh(file: Any, field: Any, frame: int | None, within: float | str | None) -> list[Verified]:
    """Verify the isovalues of a file on a mesh, for values at its vertices."""
    points, cells, values = _mesh_of(file, field, frame)
    known = file.info.domain is not None and file.info.domain.kind == DomainKind.KNOWN
    if known and file.mesh_given is None and getattr(field, "cells", None) is not None:
        # the mesh that the values come with is that of the file, or decoding finds out that it is not
        file = type(file)(file.kind, file.data, file.limits, (points, cells))
    notes = {**getattr(field, "metadata", {}), **file.info.metadata}
    out = []
    for number, contour in enumerate(file.contours(frame=frame)):
        above = values > contour.isovalue
        original = _drawn(points, cells, values, contour.isovalue)
        wrong = None
        if known:  # a mesh in the file has its vertices in another order
            used = np.unique(cells)
            with suppress(OptionError, TruncatedError):  # on a cut or on levels there are no signs of all vertices
                wrong = int((file.above(contour.isovalue, frame=frame) != above)[used].sum())
        edges = points[cells[:, 1]] - points[cells[:, 0]]
        size = float(np.median(np.sqrt((edges**2).sum(axis=1))))
        promise = _of_points(file.info, within, points, notes, frame or 0, number)
        in_steps = None
        if promise.step is not None:
            sampled = Samples(values, contour.isovalue, above, promise.step)
            steps = sampled.numbers(np.arange(len(values))[:, None], above)
            in_steps = _drawn(points, cells, interval_value(contour.isovalue, promise.step, steps, above),
                              contour.isovalue)
        out.append(_compared(contour, original, promise, wrong, size, unit_of(notes.get(COORDINATE_UNIT)) or "",
                             in_steps))
    return out


def _of_points(
    info: FileInfo, within: float | str | None, points: NDArray[Any], notes: Mapping[str, str], frame: int, number: int
) -> _Promise:
    """The promise of the last layer of an isovalue of a file on a mesh, or of all signs or values; or a caller's."""
    own = [layer for layer in info.layers if (layer.frame, layer.isovalue) == (frame, number)][-1:]
    stated = own[0].within if own else None
    if within is None and not stated:
        samples = of_values(info.scale) if noted_values(info.metadata) else of_samples(info)
        last = [layer.kind for layer in own]
        step = info.scale if samples not in (None, EXACT, SIGNS) and last == ["values"] else None
        return _Promise(0.0 if samples == EXACT and last == ["values"] else None, samples, step=step)
    text = str(within if within is not None else asked(info, stated, frame, number) or f"{stated:.9g}").replace(" ", "")
    number_, given = distance_of(text)
    if not given:
        return _Promise(number_, on_mesh_in_words([text], notes))
    distance = in_unit(text, points, notes.get(COORDINATE_UNIT), notes.get(CRS))
    same = given == unit_of(notes.get(COORDINATE_UNIT))
    return _Promise(distance, f"within {text}" + ("" if same else f" ({distance:.4g})"), "" if same else text)


def _mesh_of(file: Any, field: Any, frame: int | None) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Points, cells and values of a frame of a `Mesh`, or of an array of values on the mesh given to `open`."""
    points, cells, values = (getattr(field, name, None) for name in ("points", "cells", "values"))
    if points is None:
        if file.mesh_given is None:
            raise InputError("the file is of values on a mesh, and the field is not", code="mesh",
                             remedy="give the mesh with its values")
        points, cells = file.mesh_given
        values = field if values is None else values
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
        points, cells, values = triangulated(points, values)[:3]
    if values.shape != (len(points),):
        raise InputError(f"{values.shape} values for {len(points)} points", code="values")
    return points, np.asarray(cells, np.int64), values


def _drawn(points: NDArray[Any], cells: NDArray[Any], values: NDArray[Any], isovalue: float) -> Contour:
    """Draw the contour of values that are linear on each cell."""
    from ..drawing.contour import Contour
    from ..drawing.explicit import crossed_edges, draw_cells
    from ..drawing.separation import apart

    above = values > isovalue
    some = cells[above[cells].any(axis=1) & ~above[cells].all(axis=1)]
    if some.shape[1] == points.shape[1] + 1:
        # all the same way round, as decoders have them: that decides along which diagonal a quadrangle is cut
        turned = np.linalg.det(points[some[:, 1:]] - points[some[:, :1]]) < 0
        some[turned, -2:] = some[turned, :-3:-1]
    edges = crossed_edges(some, above)
    low, high = (values[edges[:, i]].astype(np.float64) for i in (0, 1))
    with np.errstate(all="ignore"):
        ratio = apart((isovalue - low) / (high - low))
    drawn, pieces = draw_cells(points, some, np.zeros(len(some), np.bool_), above, edges, ratio)
    return Contour(drawn, pieces, isovalue, ())


def verified_surface(file: Any, field: Any, frame: int | None, within: float | str | None) -> list[Verified]:
    """Measure how far a triangulated surface lies from the values of a field, or its contours from those of the field.
    """
    tin, known = file.surface(), _known(field)
    values = np.asarray(known.values)
    if tin.shape is None:
        raise InputError("the surface was made from scattered points, not from a field", code="shape")
    _check_shape(values.shape, tin.shape)
    notes = {**known.metadata, **file.info.metadata}
    parts, contours = noted(file.info.metadata)
    if contours:
        placement = _placement(known, read_placement(notes, 2), notes)
        promise = _given(within if within is not None else parts[-1], placement, values.shape)
        return [_measured(file.contour(one), check_field(values, one), promise, None) for one in contours]
    there = float(np.nanmax(np.abs(tin.raster() - values.astype(np.float64))))
    unit = unit_of(notes.get(UNIT)) or notes.get(UNIT) or ""
    distance = within if within is not None else parts[-1] if parts else None
    if distance is None:
        return [Verified(float("nan"), None, there, there, None, None, unit=unit, there_least=there, back_least=there)]
    promised = converted(str(distance), unit_of(notes.get(UNIT)), "its values")
    text = f"values within {distance}" + (f" {unit}".rstrip() if not distance_of(str(distance))[1] else "")
    kept = there <= promised * (1 + ROUNDING)
    there = min(there, promised) if kept else there
    return [Verified(float("nan"), promised, there, there, None, kept, text, unit, "", there, there)]


BY_KIND = {
    "grid": verified_grid, "series": verified_grid, "tiles": verified_tiles, "mesh": verified_mesh,
    "surface": verified_surface,
}
"""Functions that verify files, by kind."""
