"""Convert input from users to what encoders take: fields with their notes, samples at each isovalue."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isospec.container import MAX_ISOVALUES

from ..drawing.smoothing import SMOOTHING
from ..errors import InputError, OptionError
from ..field.decoded_samples import DecodedSamples, near_values
from ..field.isovalues import isovalues_of, range_of
from ..field.labelling import OCCUPANCY, PROBABILITY, having, noted
from ..field.meshed import Mesh
from ..field.missing import filled
from ..field.placement import COORDINATE_UNIT, CRS, DEFAULT_ERROR, PLACEMENT, Placement, closed, read_placement
from ..field.sampled import Field
from ..field.samples import Samples, check_field, isovalue_of, missing_of, without_holes
from ..search.original import original
from ..search.smoothing_rounds import rounds_for
from ..search.tolerance import radices
from .coordinate_coding import without_folds
from .options import COORDINATES_SHARE, INDEPENDENT, LEVELS, Options, Precision
from .promises import PROMISE


def taken(what: Any) -> Any:
    """Input as it is, unless it is no input.

    Raises
    ------
    InputError
        If it is a path, or an object that states more than an array: its place would be lost.
    """
    if isinstance(what, str | os.PathLike):
        raise InputError("the field is a path", code="field", remedy="read it first: isocodec.read(path)")
    if any(hasattr(what, name) for name in ("coords", "affine", "columns", "GetPointData")):
        raise InputError(f"a {type(what).__name__} states more than samples", code="field",
                         remedy="convert it first: isocodec.read(it)")
    return what


def field_of(what: Any) -> Field:
    """Convert samples to a `Field`.

    Raises
    ------
    InputError
        As `taken`; or if it is a mesh.
    """
    found = taken(what)
    if isinstance(found, Mesh):
        raise InputError("is a mesh, not a field", code="field")
    return found if isinstance(found, Field) else Field(found)


@dataclass(frozen=True)
class GivenField:
    """A field on a grid with everything that a file of it is made from, complete: `completed` makes it.

    Attributes
    ----------
    isovalues : list of float
        Also those of labels.
    options : Options
        With all notes, the defaults of the field, and distances in cells.
    placement : Placement or None
        Where the samples lie, unless a note states it.
    labels : tuple of float, or None
    missing : str
        As of `Field`.
    series : bool
        Whether the field is a frame of a series, whose frames need not all have every label.
    """

    isovalues: list[float]
    options: Options
    placement: Placement | None
    labels: tuple[float, ...] | None
    missing: str
    series: bool = False

    @property
    def periodic(self) -> tuple[int, ...]:
        """Periodic axes."""
        return () if self.placement is None else self.placement.periodic

    def samples(self, field: Field) -> Sequence[Samples]:
        """Samples of a frame at each isovalue, made when they are needed; see `sampler`."""
        sampler = self.sampler(field)
        return _Sampled(sampler, self.isovalues) if len(self.isovalues) > 1 else [sampler(self.isovalues[0])]

    def sampler(self, field: Field) -> Callable[[float], Samples]:
        """Make a function from an isovalue to samples: missing ones filled as asked for, periodic axes closed.

        Raises
        ------
        InputError, OptionError
            If they cannot be encoded; the function, too.
        """
        values, mask = field.values, field.mask
        if self.labels is None and self.missing != "hole":
            gone = missing_of(values, mask)
            if gone.any():
                values, mask = filled(np.asarray(values), gone, self.missing, self.isovalues), None
        bare, hole = without_holes(values, mask)
        if self.labels is None:
            if self.placement is not None:
                hole = without_folds(self.placement, bare.shape, hole)
                bare, hole = closed(bare, self.periodic), None if hole is None else closed(hole, self.periodic)
            return lambda isovalue: check_field(bare, isovalue, self.options.precision.step, hole)
        if bare.ndim not in (2, 3) or bare.dtype.kind not in "biuf":
            raise InputError(f"labels of shape {bare.shape} and type {bare.dtype}", code="labels",
                             remedy="give numbers on 2 or 3 axes")
        without = hole if self.missing == "below" else None
        return lambda label: _border(bare, label, hole, without, self.series)


def completed(
    field: Field, isovalue: object, options: Options, frames: Iterable[Any] | None = None, *, series: bool = False,
    most: int = MAX_ISOVALUES,
) -> tuple[GivenField, Sequence[Samples]]:
    """Complete all that a file of a field is made from, once and for all.

    Parameters
    ----------
    field : Field
        For a series, the first frame.
    isovalue : object
        As for `encode`.
    options : Options
    frames : iterable, optional
        All frames, if they are known and can be iterated over again.
    series : bool
    most : int
        Largest number of isovalues.

    Returns
    -------
    GivenField
    sequence of Samples
        The field at each isovalue, periodic axes closed.

    Raises
    ------
    InputError, OptionError
    """
    isovalues = levels_of(field, isovalue, options, frames, most)
    options = _options_of(field, isovalue, options)
    given = GivenField(isovalues, options, _placement_of(field, options), field.labels, field.missing, series)
    samples = given.samples(field)
    shape = samples[0].signs.shape
    options.check_data(samples[0].integer)
    options.check_placement_note(len(shape))
    radices(options.precision.offsets)  # refuses a tolerance out of range
    return replace(given, options=_as_smooth(options, samples, given.periodic)), samples


def _placement_of(field: Field, options: Options) -> Placement | None:
    """Placement of the samples of a file: the field's, unless a note states it.

    Axes that were taken to be periodic because of their coordinates are left open under a plan whose last mesh could
    differ at their ends; others cannot be.
    """
    placement = field.placement
    if placement is None or (placement.matrix is not None and PLACEMENT in options.metadata):
        return None
    if placement.periodic:
        shape = tuple(size + (axis in placement.periodic) for axis, size in enumerate(np.shape(field.values)))
        if options.layers.keeps_open(shape):
            if not placement.inferred:
                raise OptionError(
                    "periodic axes and this plan cannot be combined: its last mesh could differ at the two ends of the "
                    "axis", code="periodic", remedy="end the plan on the full grid, on a mesh by criteria, or on a "
                    f"uniform one of a level that is a multiple of {len(shape)}",
                )
            warnings.warn(
                f"axis {placement.periodic[0]} is not treated as periodic, because the last mesh of the plan could "
                "differ at its two ends",
                stacklevel=5,
            )
            placement = replace(placement, periodic=(), inferred=False)
    if options.precision.error and (placement.coordinates is not None or placement.periodic):
        return replace(placement, error=options.precision.error)
    return placement


def _options_of(field: Field, isovalue: object, options: Options) -> Options:
    """Complete the options for a field: its notes, defaults for its type, distances converted to cells."""
    precision = options.precision
    notes = {**field.metadata, **options.metadata}
    if precision.default and not options.layers.planned and (
        field.labels is not None or (isovalue is None and np.asarray(field.values).dtype.kind == "b")
    ):
        precision = Precision(signs=True)
    if precision.rounded:
        notes[PROMISE] = replace(precision, smooth=False).text
    if precision.world:
        gone = missing_of(field.values, field.mask)
        precision = in_cells(precision, field.placement, notes, options.metadata, field.shape, gone)
    if field.labels is not None:
        options = of_labels(field, replace(options, precision=precision))
        notes |= noted([*map(isovalue_of, field.labels)], np.asarray(field.values).dtype)
    return replace(options, precision=precision, metadata=notes)


def _as_smooth(options: Options, fields: Sequence[Samples], periodic: tuple[int, ...]) -> Options:
    """Options with the rounds of smoothing of a field at its isovalue, or without if it is too rough to be smoothed."""
    precision = options.precision
    if not precision.smooth:
        if SMOOTHING in options.metadata and precision.tolerance is not None:
            raise OptionError(f"the note {SMOOTHING} would break the promise of precision {precision.text!r}",
                              code="metadata", remedy=f'use precision "{precision.text} smooth"')
        return options
    if len(fields) > 1:
        raise OptionError("smooth applies to files of one isovalue: curves of several could cross", code="smooth",
                          remedy="leave it out")
    if periodic:
        raise OptionError("periodic axes and smooth cannot be combined", code="periodic", remedy="leave it out")
    rounds = rounds_for(original(fields[0]), math.prod(radices(precision.offsets)))
    if not rounds:
        return replace(options, precision=replace(precision, smooth=False))
    return replace(options, metadata={**options.metadata, SMOOTHING: str(rounds)})


def in_cells(
    precision: Precision, placement: Placement | None, notes: Mapping[str, str], own: Mapping[str, str],
    shape: tuple[int, ...], gone: NDArray[np.bool_] | None = None,
) -> Precision:
    """A precision with distances in cells; coordinates that go into the file take their share.

    Parameters
    ----------
    precision : Precision
    placement : Placement or None
        Of the field.
    notes, own : mapping of str to str
        Notes of the file, and those among them that the user gives beside the field's: a placement there counts.
    shape : tuple of int
    gone : (s0, .., sn-1) bool, optional
        Which samples are missing.

    Raises
    ------
    OptionError, MissingExtraError
        As `Placement.cells_of`.
    """
    found = read_placement(notes, len(shape)) if PLACEMENT in own or placement is None else placement
    found = found or Placement()
    found = replace(found, crs=notes.get(CRS, found.crs), unit=notes.get(COORDINATE_UNIT, found.unit))
    missing = gone if gone is not None and gone.any() else None
    distances: dict[str, float] = {}

    def cells_of(distance: str) -> float:
        if distance not in distances:
            distances[distance] = found.cells_of(distance, shape, missing)
        return distances[distance]

    error = 0.0
    if found.coordinates is not None or found.periodic:
        least = min(cells_of(part) for part in precision.world.split(",") if part != "exact")
        error = found.error or min(DEFAULT_ERROR, COORDINATES_SHARE * least)
    return precision.in_cells(cells_of, error)


def of_labels(field: Field, options: Options) -> Options:
    """Complete the options for a file of labels, which are coded independently."""
    if options.order == LEVELS:
        raise OptionError("order 'levels' does not apply to labels, which are coded independently", code="order",
                          remedy="leave it out")
    precision = options.precision
    if options.layers.planned:
        plans = [options.layers.plan, *(options.layers.plans or {}).values()]
        if any(entry and entry[0] == "values" for plan in plans for entry in plan or ()):
            raise OptionError("layers of values do not apply to labels",
                              code="plan", remedy="use offsets in the plan instead")
    elif not (precision.signs or precision.tolerance is not None):
        raise OptionError(f"precision {precision.text!r} does not apply to labels", code="labels",
                          remedy="use signs or a distance")
    if field.unit in (PROBABILITY, OCCUPANCY):
        raise OptionError(f"the values are a field of {field.unit}, not labels", code="labels",
                          remedy="give an isovalue, such as 0.5")
    if field.placement is not None and (field.placement.coordinates is not None or field.placement.periodic):
        raise OptionError("labels on a grid with coordinates cannot be encoded together", code="labels",
                          remedy="encode the mask of each label separately")
    return replace(options, order=INDEPENDENT)


def levels_of(
    first: Field | Mesh, isovalue: object, options: Options, all_of: Iterable[Any] | None = None,
    most: int = MAX_ISOVALUES,
) -> list[float]:
    """The isovalues of a file.

    Parameters
    ----------
    first : Field or Mesh
        What is encoded; for a series, the first frame.
    isovalue : object
        As for `encode`.
    options : Options
    all_of : iterable, optional
        All frames, if they are known and can be iterated over again.
    most : int
        Largest number of isovalues.

    Raises
    ------
    InputError, OptionError
        As `isovalues_of`; or if no isovalue is given.
    """
    if isinstance(first, Field) and first.labels is not None:
        if isovalue is not None:
            raise OptionError("a field with labels cannot have isovalues, too",
                              code="isovalue", remedy="leave them out")
        if not len(first.labels):
            raise OptionError("no labels", code="labels", remedy="give one")
        return isovalues_of(list(first.labels), most=most)
    if isovalue is None:
        if isinstance(first, Field) and np.asarray(first.values).dtype.kind == "b":
            return [0.5]
        raise OptionError("no isovalue",
                          code="isovalue", remedy="only a mask (bool) or labels can be encoded without one")
    ends = None if all_of is None else lambda: _ends(all_of)
    return isovalues_of(isovalue, ends, most)


def _ends(frames: Iterable[Any]) -> tuple[float, float]:
    """Find the least and the largest sample of all frames."""
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


class _Sampled(Sequence[Samples]):
    """Samples of a field at each isovalue; only those asked for last are in memory."""

    def __init__(self, sampler: Callable[[float], Samples], isovalues: Sequence[float]) -> None:
        self._sampler, self._isovalues = sampler, isovalues
        self._last = 0, sampler(isovalues[0])

    def __len__(self) -> int:
        return len(self._isovalues)

    def __getitem__(self, number: Any) -> Any:
        number = range(len(self))[number]
        if number != self._last[0]:
            self._last = number, self._sampler(self._isovalues[number])
        return self._last[1]


def _border(
    values: NDArray[Any], label: float, gone: NDArray[np.bool_] | None, without: NDArray[np.bool_] | None, series: bool
) -> DecodedSamples:
    """The field whose contour runs half-way around the samples with a label; ``without``: those that have none."""
    signs = having(values, label)
    if not series and not signs.any():
        there = np.unique(values)
        text = ", ".join(f"{value:g}" for value in there[:20]) + (" ..." if len(there) > 20 else "")
        raise InputError(f"no sample has the label {label:g}", code="label", remedy=f"the labels are {text}")
    if without is not None:
        signs, gone = signs & ~without, None
    nothing = np.zeros(0, np.int64)
    return DecodedSamples(near_values(signs, label, nothing, np.zeros(0)), label, signs, None, gone)
