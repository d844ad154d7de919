"""Whether a file keeps what it promises of a field: signs, missing samples, and distances measured anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, OptionError
from ..field.sampled import Field
from ..field.samples import check_field, without_holes
from ..field.told import LABELS
from ..io.readers.described import SpatialImage
from ..limits import Limits
from ..storage.content import Readable, content
from ..tiles.structure import is_tiled

if TYPE_CHECKING:
    from ..drawing.contour import Contour
    from ..field.samples import Field as Samples

ROUNDING = 1e-6
"""Cells that the measured distance, which is an upper bound, and points in double precision may be off."""
MEASURED = 0.001
"""Cells by which the distance is measured too large at most."""


@dataclass(frozen=True)
class Kept:
    """What was found of one isovalue.

    Attributes
    ----------
    isovalue : float
    promised : float or None
        Cells that decoded and original curve lie from each other at most, as the file or the caller says.
    there, back : float
        Largest distance, in cells, from the decoded to the original curve, and the other way; at most 0.001 too large.
    wrong : int or None
        Samples on the wrong side of the isovalue; None if the mesh of the file is coarser than the samples.
    kept : bool
        Whether no sample is wrong, and neither distance is larger than promised.
    """

    isovalue: float
    promised: float | None
    there: float
    back: float
    wrong: int | None
    kept: bool


def verify(
    data: Readable, field: ArrayLike | Field | SpatialImage, *, frame: int | None = None,
    within: float | None = None, limits: Limits | None = None,
) -> list[Kept]:
    """Hold a file against the field that it was made from.

    Of a file in tiles the joined curve is held against that of the whole field. It does not say what it promises, nor
    which samples far from it are missing.

    Parameters
    ----------
    data : bytes, path, URL or file object
        The whole file.
    field : array_like, Field, DataArray or image
        As of `encode`.
    frame : int, optional
        Of a series the frame that the field is, counted from 0; the first if not given.
    within : float, optional
        Distance in cells that is to be kept, instead of the one that the file promises.
    limits : Limits, optional

    Returns
    -------
    list of Kept
        One for each isovalue, in the order of the file.

    Raises
    ------
    InputError
        If the field has another shape than that of the file, or misses other samples.
    FormatError, TruncatedError, LimitError
        As `decode`.
    """
    from ..io.readers.anything import read
    from ..stream.inspect import inspect
    from ..stream.placing import closed
    from .whole import decode_all, decode_valid

    whole = bytes(content(data, limits))
    if is_tiled(whole):
        return _in_tiles(whole, field, within, limits)
    info = inspect(whole)
    contours = decode_all(whole, frame=frame, limits=limits)
    known = read(field)
    values, gone = without_holes(known.values, known.mask)
    label = info.metadata.get("label")
    if label is not None:
        values = _labelled(values, label)
    axes = contours[0].mapped.periodic if contours[0].mapped is not None else ()
    values, gone = closed(values, axes), None if gone is None else closed(gone, axes)
    _check_shape(values.shape, tuple(info.shape), bool(info.frames))
    missing = np.zeros(values.shape, np.bool_) if gone is None else gone
    others = int((decode_valid(whole, limits=limits) == missing).sum())
    if others:
        raise InputError(f"{others:,} samples are missing in the field or in the file, but not in both", code="missing")
    return [
        _kept(whole, contour, frame, values, gone, limits, LABELS in info.metadata,
              within if within is not None else _promised(info.layers, frame or 0, number))
        for number, contour in enumerate(contours)
    ]


def _check_shape(found: tuple[int, ...], shape: tuple[int, ...], series: bool = False) -> None:
    """Raise `InputError` if a field has another shape than a file, or each frame of a series."""
    if found != shape:
        of, remedy = ("each frame", "choose a frame") if series else ("the file", None)
        raise InputError(f"the field has shape {found}, that of {of} {shape}", code="shape", remedy=remedy)


def _in_tiles(
    whole: bytes, field: ArrayLike | Field | SpatialImage, within: float | None, limits: Limits | None
) -> list[Kept]:
    """What is found of the isovalues of a file in tiles."""
    from ..io.readers.anything import read
    from .whole import decode_all

    known = read(field)
    values, gone = without_holes(known.values, known.mask)
    contours = decode_all(whole, limits=limits)
    _check_shape(values.shape, contours[0].shape)
    return [_held(contour, check_field(values, contour.isovalue, gone=gone), within, None) for contour in contours]


def _kept(
    whole: bytes, contour: Contour, frame: int | None, values: Any, gone: Any, limits: Limits | None, labelled: bool,
    promised: float | None,
) -> Kept:
    """What is found of one isovalue."""
    from .whole import decode_mask

    if labelled:
        sampled = check_field(values == contour.isovalue, 0.5, gone=gone)
    else:
        sampled = check_field(values, contour.isovalue, gone=gone)
    wrong: int | None
    try:
        above = decode_mask(whole, isovalue=contour.isovalue, frame=frame, limits=limits)
        differ = above != sampled.signs
        wrong = int((differ if gone is None else differ & ~gone).sum())
    except OptionError:
        wrong = None
    return _held(contour, sampled, promised, wrong)


def _held(contour: Contour, sampled: Samples, promised: float | None, wrong: int | None) -> Kept:
    """How far a contour lies from that of the samples."""
    from ..search.original import original
    from ..search.proof import hausdorff

    first = original(sampled)
    there, back = hausdorff(contour.points, contour.cells, first.points, first.cells, MEASURED)
    far = promised is not None and max(there, back) > promised + MEASURED + ROUNDING
    return Kept(contour.isovalue, promised, there, back, wrong, not (wrong or far))


def _promised(layers: Any, frame: int, number: int) -> float | None:
    """What the last layer of an isovalue of a frame promises, if it does."""
    own = [layer for layer in layers if (layer.frame, layer.isovalue) == (frame, number)]
    return own[-1].within if own else None


def _labelled(values: Any, label: str) -> Any:
    try:
        return values == float(label)
    except ValueError:
        raise InputError(f"the note label of the file, {label!r}, is no number", code="label") from None
