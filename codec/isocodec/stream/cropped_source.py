"""Source of a file of a window: samples, crossings and notes of a decoded file within it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..drawing.window import bounds_of
from ..errors import LimitError, OptionError
from ..field.decoded_samples import DecodedSamples
from ..field.placement import PLACEMENT, read_placement, unplaced, write_placement
from ..limits import Limits
from .recoder import Source


def box_of(
    shape: Sequence[int], box: Sequence[Sequence[float]] | None, limits: Limits
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """First sample of a box, and its number of samples along each axis, enlarged to whole samples with an even start.

    With an even start, the full grid has the same diagonals.

    Raises
    ------
    OptionError
        If the box is not valid.
    LimitError
        If it has more samples than the limits allow.
    """
    extent = np.array(shape)
    if extent.min() < 2:
        raise OptionError("a window must have at least 2 samples along each axis", code="extract")
    first, last = bounds_of(shape, box)
    low = np.minimum(np.floor(first).astype(np.int64), extent - 2) // 2 * 2
    size = np.maximum(np.ceil(last).astype(np.int64), low + 1) - low + 1
    if math.prod(size.tolist()) > limits.samples:
        raise LimitError(
            f"the window has {math.prod(size.tolist()):,} samples, more than the limit of {limits.samples:,}",
            code="limit-samples", clause="11.2", remedy="ask for a smaller window, or raise Limits.samples",
        )
    return tuple(low.tolist()), tuple(size.tolist())


def moved_notes(metadata: Mapping[str, str], low: Sequence[int]) -> dict[str, str]:
    """Shift the placement in a file's notes so that the samples of a box starting at ``low`` keep their positions."""
    notes = dict(metadata)
    placement = read_placement(notes, len(low))
    if placement is None and not any(low):
        return notes
    matrix = unplaced(len(low)) if placement is None or placement.matrix is None else placement.matrix
    moved = np.column_stack([matrix[:, :-1], matrix[:, -1] + matrix[:, :-1] @ low])
    notes[PLACEMENT] = write_placement(moved)
    return notes


def cropped(source: Source, low: Sequence[int], size: Sequence[int]) -> Source:
    """Crop a source to the box of ``size`` samples starting at ``low``."""
    field, n = source.field, len(low)
    box = tuple(slice(a, a + s) for a, s in zip(low, size, strict=True))
    gone = None if field.gone is None or not field.gone[box].any() else np.ascontiguousarray(field.gone[box])
    number = None if field.number is None else np.ascontiguousarray(field.number[box])
    start = np.stack(np.unravel_index(field.edges // n, field.signs.shape), axis=1) - np.array(low)
    axis = field.edges % n
    end = start + np.eye(n, dtype=np.int64)[axis]
    inside = ((start >= 0) & (end < np.array(size))).all(axis=1)
    edges = np.ravel_multi_index(tuple(start[inside].T), tuple(size)) * n + axis[inside]
    return Source(
        DecodedSamples(
            np.ascontiguousarray(field.values[box]), field.isovalue, np.ascontiguousarray(field.signs[box]),
            field.scale, gone, number=number, edges=edges.astype(np.int64), places=field.places[inside],
        ),
        source.geometry,
    )
