"""Segmentations: the borders of several labels in one file, and the labels again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, OptionError
from ..field.sampled import Field
from ..field.samples import isovalue_of, without_holes
from ..field.told import LABELS, Told, near_values
from ..io.readers.described import SpatialImage, described
from ..limits import Limits
from ..storage.content import Readable, content
from ..stream.names import ProfileName
from ..stream.recoder import Recoder, Source


def encode_labels(
    field: ArrayLike | Field | SpatialImage,
    labels: Sequence[float],
    *,
    tolerance: float | None = None,
    preserve_topology: bool = False,
    profile: ProfileName = "main",
    mask: ArrayLike | None = None,
    metadata: Mapping[str, str] | None = None,
    placement: ArrayLike | None = None,
) -> bytes:
    """Encode where a field of labels has each of some: a curve or surface around each, in one file.

    The isovalues of the file are the labels, and above means that a sample has the label; a note, ``labels``, says so.

    Parameters
    ----------
    field : (s0, s1) or (s0, s1, s2) array_like of numbers; or a Field, a DataArray, an image
        A label for each sample, as `encode` takes fields.
    labels : sequence of numbers
        Labels that the field has.
    tolerance : float, optional
        Largest distance, in cells, from the borders half-way between samples, from 0.1 on. Without it, the file holds
        which samples have each label.
    preserve_topology, profile, mask, metadata, placement
        As in `encode`.

    Returns
    -------
    bytes
        An ``.iso`` file.

    Raises
    ------
    InputError
        If the field does not have one of the labels, or cannot be encoded.
    OptionError
        If options are out of range, or a label is given twice.

    Examples
    --------
    >>> import numpy as np
    >>> organs = np.repeat([0, 1, 3], [4, 4, 8])[None, :] * np.ones((8, 1), int)
    >>> data = encode_labels(organs, [1, 3])
    >>> bool((decode_labels(data) == organs).all())
    True
    """
    options: dict[str, Any] = {"mask": mask, "placement": placement, "metadata": metadata}
    values: Any = field
    if not isinstance(field, np.ndarray):
        values, options = described(field, **options, coordinates=None, period=None)
    if options.pop("coordinates", None) is not None or options.pop("period", None) is not None:
        raise OptionError("labels on a mapped grid", code="labels", remedy="encode each label's mask by itself")
    values, gone = without_holes(values, options.pop("mask"))
    if values.ndim not in (2, 3) or values.dtype.kind not in "biuf":
        raise InputError(f"labels of shape {values.shape} and type {values.dtype}", code="labels",
                         remedy="give numbers on 2 or 3 axes")
    sources = [Source(_border(values, isovalue_of(label), gone), []) for label in labels]
    if not sources:
        raise OptionError("no labels", code="labels", remedy="give one")
    notes = {**(options.pop("metadata") or {}), LABELS: " ".join(f"{source.field.isovalue:.17g}" for source in sources)}
    return b"".join(
        Recoder(sources, False, leaning=False, signs_only=tolerance is None, tolerance=tolerance,
                preserve_topology=preserve_topology, profile=profile, metadata=notes, **options)
    )


def _border(values: NDArray[Any], label: float, gone: NDArray[np.bool_] | None) -> Told:
    """The field whose contour runs half-way around the samples with a label."""
    signs = labelled(values, label)
    nothing = np.zeros(0, np.int64)
    return Told(near_values(signs, label, nothing, np.zeros(0)), label, signs, None, gone)


def labelled(values: NDArray[Any], label: float) -> NDArray[np.bool_]:
    """Which samples have a label.

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


def decode_labels(data: Readable, *, limits: Limits | None = None) -> NDArray[Any]:
    """Decode a file of `encode_labels` to the labels of all samples.

    Parameters
    ----------
    data : bytes, path, URL or file object
        A file without a tolerance.
    limits : Limits, optional
        What the file may need at most.

    Returns
    -------
    NDArray
        Of the shape of the field that was encoded, and the smallest type that holds them: the labels, and 0 where
        samples have none of those in the file.

    Raises
    ------
    OptionError
        If the isovalues of the file are no labels, or its mesh is coarser than the samples.
    FormatError, LimitError
        As `decode`; ``limits.samples`` bounds the result.
    """
    from .whole import received

    decoder = received(content(data, limits), None, limits=limits)
    if LABELS not in decoder.metadata:
        raise OptionError("the isovalues of the file are no labels", code="labels", remedy="use decode_mask")
    labels = [int(value) if value.is_integer() else value for value in map(float, decoder.isovalues)]
    out: NDArray[Any] | None = None
    for number, label in enumerate(labels):
        above = decoder.mask(number)
        if out is None:
            out = np.zeros(above.shape, np.result_type(*map(np.min_scalar_type, [0, *labels])))
        out[above] = label
    assert out is not None
    return out
