"""Input from users, as encoders take it: fields with their notes, samples at each isovalue."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError
from ..field.decoded_samples import LABELS, DecodedSamples, near_values
from ..field.framed import Frames
from ..field.meshed import Mesh
from ..field.missing import filled
from ..field.placement import PLACEMENT, Placement
from ..field.sampled import Field
from ..field.samples import Samples, isovalue_of, missing_of, without_holes
from .grid_encoder import sampled
from .isovalues import isovalues_of, range_of
from .options import Options, Precision


def taken(what: Any) -> Any:
    """Input as it is, or what `isocodec.read` makes of an object of another library that states more than an array."""
    if isinstance(what, str | os.PathLike):
        raise InputError("the field is a path", code="field", remedy="read it first: isocodec.read(path)")
    if isinstance(what, np.ndarray | Field | Mesh):
        return what
    from ..io.readers.load import is_described, read

    return read(what) if is_described(what) else what


def field_of(what: Any) -> Field:
    """Samples as a `Field`: an array, or what another library has in memory with all that it states.

    Raises
    ------
    InputError
        As `isocodec.read`.
    """
    found = taken(what)
    if isinstance(found, Mesh):
        raise InputError("is a mesh, not a field", code="field")
    return found if isinstance(found, Field) else Field(found)


def placement_of_file(field: Field, options: Options) -> Placement | None:
    """Placement of the samples of a file: as the field states, unless a note states it.

    Axes that are periodic because their coordinates go round are left open where a mesh is searched for.
    """
    placement = field.placement
    if placement is None or (placement.matrix is not None and PLACEMENT in options.metadata):
        return None
    if placement.inferred and placement.periodic and options.chooses_mesh:
        warnings.warn(
            f"ends along axis {placement.periodic[0]} are not joined, as {options.chooses_mesh} chooses a mesh",
            stacklevel=5,
        )
        return replace(placement, periodic=(), inferred=False)
    return placement


def options_of(field: Field, isovalue: object, options: Options) -> Options:
    """The options of a file of a field: with its notes, with defaults of its kind, distances in cells."""
    precision = options.precision
    notes = {**field.metadata, **options.metadata}
    if precision.default and not options.layers.planned and (
        field.labels is not None or (isovalue is None and np.asarray(field.values).dtype.kind == "b")
    ):
        precision = Precision(signs=True)
    if precision.world:
        gone = missing_of(field.values, field.mask)
        placement = field.placement or Placement()
        distance = placement.cells_of(precision.world, field.shape, gone if gone.any() else None)
        precision = Precision(tolerance=distance)
    if field.labels is not None:
        options = _of_labels(field, replace(options, precision=precision))
        notes[LABELS] = " ".join(f"{isovalue_of(label):.17g}" for label in field.labels)
    return replace(options, precision=precision, metadata=notes)


def _of_labels(field: Field, options: Options) -> Options:
    """Options of a file of labels, whose isovalues do not lean on one another."""
    precision = options.precision
    if options.layers.planned:
        plans = [options.layers.plan, *(options.layers.plans or {}).values()]
        if any(entry and entry[0] == "values" for plan in plans for entry in plan or ()):
            raise OptionError("layers of values do not apply to labels", code="plan", remedy="plan offsets instead")
    elif not (precision.signs or precision.tolerance is not None):
        raise OptionError(f"precision {precision.text!r} does not apply to labels", code="labels",
                          remedy="use signs or a distance")
    if field.placement is not None and (field.placement.coordinates is not None or field.placement.periodic):
        raise OptionError("labels on a grid with coordinates cannot be encoded together", code="labels",
                          remedy="encode each label's mask by itself")
    return replace(options, independent=True)


def levels_of(
    first: Field | Mesh, isovalue: object, options: Options, all_of: Iterable[Any] | None = None
) -> list[float]:
    """The isovalues of a file.

    Parameters
    ----------
    first : Field or Mesh
        What is encoded, of a series the first frame.
    isovalue : object
        As of `encode`.
    options : Options
    all_of : iterable, optional
        All frames, if they are known and can be taken again.

    Raises
    ------
    InputError, OptionError
        As `isovalues_of`; or if no isovalue is given.
    """
    plans = options.layers.plans
    if isinstance(first, Field) and first.labels is not None:
        if isovalue is not None:
            raise OptionError("a field with labels has no other isovalues", code="isovalue", remedy="leave them out")
        return isovalues_of(list(first.labels)) if len(first.labels) else _none()
    if isovalue is None:
        if options.layers.written and plans is not None:
            return isovalues_of(list(plans))
        if isinstance(first, Field) and np.asarray(first.values).dtype.kind == "b":
            return [0.5]
        if options.layers.written and options.layers.planned:
            raise OptionError("the plan names no isovalue", code="plan",
                              remedy="begin with a line such as: isovalue 500.5")
        raise OptionError("no isovalue", code="isovalue", remedy="only a mask (bool) or labels need none")
    ends = None if all_of is None else lambda: _ends(all_of)
    found = isovalues_of(isovalue, ends)
    if options.layers.written and plans is not None and set(found) != set(plans):
        raise OptionError(
            f"the isovalues given, {', '.join(f'{v:g}' for v in found)}, are not those of the plan, "
            f"{', '.join(f'{v:g}' for v in plans)}", code="plan", remedy="leave them out",
        )
    return found


def _none() -> list[float]:
    raise OptionError("no labels", code="labels", remedy="give one")


def _ends(frames: Iterable[Any]) -> tuple[float, float]:
    """The least and the largest sample of all frames."""
    found = []
    for each in frames:
        values: Any = each.values if isinstance(each, Field | Mesh) else each
        mask = each.mask if isinstance(each, Field) else None
        gone = missing_of(values, mask)
        there = np.asarray(values)[~gone]
        if there.size:
            found.append(range_of(there))
    if not found:
        raise InputError("all samples are missing", code="missing")
    return min(low for low, _ in found), max(high for _, high in found)


def samples_of(
    field: Field, isovalues: Sequence[float], options: Options, placement: Placement | None, series: bool = False
) -> list[Samples]:
    """The samples of a field at each isovalue, missing ones filled as it asks for, periodic axes closed.

    Parameters
    ----------
    field : Field
    isovalues : sequence of float
    options : Options
    placement : Placement or None
    series : bool
        Whether it is one of several frames, which need not all have every label.

    Raises
    ------
    InputError, OptionError
        If it cannot be encoded.
    """
    values, mask = field.values, field.mask
    if field.labels is None and field.missing != "hole":
        gone = missing_of(values, mask)
        if gone.any():
            values, mask = filled(np.asarray(values), gone, field.missing, isovalues), None
    bare, hole = without_holes(values, mask)
    if field.labels is None:
        periodic = () if placement is None else placement.periodic
        return sampled(bare, hole, isovalues, options.precision.step, periodic)
    if bare.ndim not in (2, 3) or bare.dtype.kind not in "biuf":
        raise InputError(f"labels of shape {bare.shape} and type {bare.dtype}", code="labels",
                         remedy="give numbers on 2 or 3 axes")
    without = hole if field.missing == "below" else None
    return [_border(bare, label, hole, without, series) for label in isovalues]


def _border(
    values: NDArray[Any], label: float, gone: NDArray[np.bool_] | None, without: NDArray[np.bool_] | None, series: bool
) -> DecodedSamples:
    """The field whose contour runs half-way around the samples with a label; ``without``: those that have none."""
    signs = np.ascontiguousarray(values == label) if series else labelled(values, label)
    if without is not None:
        signs, gone = signs & ~without, None
    nothing = np.zeros(0, np.int64)
    return DecodedSamples(near_values(signs, label, nothing, np.zeros(0)), label, signs, None, gone)


def labelled(values: NDArray[Any], label: float) -> NDArray[np.bool_]:
    """Find the samples that have a label.

    Raises
    ------
    InputError
        If none has.
    """
    inside = np.ascontiguousarray(values == label)
    if not inside.any():
        there = np.unique(values)
        text = ", ".join(f"{value:g}" for value in there[:20]) + (" ..." if len(there) > 20 else "")
        raise InputError(f"no sample has the label {label:g}", code="label", remedy=f"the labels are {text}")
    return inside


def frames_of(frames: Frames) -> Iterable[Any] | None:
    """The frames of a series, to be looked at before they are encoded; None if they can be taken only once."""
    return frames if frames.repeatable else None
