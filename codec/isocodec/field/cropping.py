"""The part of a field within a box of coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import OptionError
from .missing import missing_samples
from .placement import Placement, matrix_of
from .sampled import Field

Box = Sequence[float]
"""Least x, y (, z), then largest x, y (, z)."""
_EVEN = 1e-6
"""Steps that samples may lie outside of a box, since coordinates are rounded."""


def spans_within(placement: Placement | None, shape: Sequence[int], box: Box) -> tuple[slice, ...]:
    """Find the samples within a box: the first and the last along each axis of the field.

    Raises `OptionError` if the field has no placement, the box another number of axes, or no sample is within it.
    """
    n = len(shape)
    if placement is None or not placement.placed:
        raise OptionError("a box of coordinates needs a field with a placement in the world", code="bbox",
                          remedy="give a placement")
    if len(box) != 2 * n or not all(low <= high for low, high in zip(box[:n], box[n:], strict=True)):
        raise OptionError(f"the box {box} of coordinates has other axes than the field, or no inside", code="bbox",
                          remedy=f"give {'XMIN,YMIN,XMAX,YMAX' if n == 2 else 'XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX'}")
    if placement.matrix is not None:
        matrix = matrix_of(placement.matrix, n)
        ends = np.indices((2,) * n).reshape(n, -1).T
        corners = np.where(ends, box[n:], box[:n]) - matrix[:, n]
        index = np.linalg.solve(matrix[:, :n], corners.T)
        low, high = np.ceil(index.min(axis=1) - _EVEN), np.floor(index.max(axis=1) + _EVEN) + 1
        found = [(max(int(a), 0), min(int(b), size)) for a, b, size in zip(low, high, shape, strict=True)]
    else:
        inside = np.ones(shape, np.bool_)
        for c, array in enumerate(placement.nodes()):
            inside &= (array >= box[c]) & (array <= box[n + c])
        along = [np.flatnonzero(inside.any(axis=tuple(a for a in range(n) if a != axis))) for axis in range(n)]
        found = [(int(each[0]), int(each[-1]) + 1) if len(each) else (0, 0) for each in along]
    if any(a >= b for a, b in found):
        raise OptionError(f"no samples lie within the box {', '.join(f'{number:g}' for number in box)}", code="bbox",
                          remedy="its numbers are coordinates of the field, x before y")
    return tuple(slice(a, b) for a, b in found)


def part_of(placement: Placement, spans: Sequence[slice], shape: Sequence[int]) -> Placement:
    """Place a part of a field by the placement of the whole; an axis that is cut is no longer periodic."""
    n = len(shape)
    whole = [(span.start, span.stop) == (0, size) for span, size in zip(spans, shape, strict=True)]
    periodic = tuple(axis for axis in placement.periodic if whole[axis])
    if placement.matrix is not None:
        matrix = matrix_of(placement.matrix, n).copy()
        matrix[:, n] += matrix[:, :n] @ [span.start for span in spans]
        return replace(placement, matrix=matrix, periodic=periodic, periods=placement.periods if periodic else ())
    arrays: Any = placement.coordinates
    if all(np.ndim(array) == 1 for array in arrays):
        parts = [array[span] for array, span in zip(arrays, spans, strict=True)]
    else:
        parts = [
            array[tuple(span if size > 1 else slice(None) for span, size in zip(spans, array.shape, strict=True))]
            for array in arrays
        ]
    return replace(placement, coordinates=parts, periodic=periodic)


def cropped(field: Field, box: Box) -> Field:
    """Take the part of a field within a box; raises `OptionError` as `spans_within` does."""
    spans = spans_within(field.placement, field.shape, box)
    assert field.placement is not None
    return replace(
        field, values=field.values[spans], mask=None if field.mask is None else field.mask[spans],
        placement=part_of(field.placement, spans, field.shape),
    )


class PartWindows:
    """A part of some samples by slices, as `isocodec.read` gives them, with those masked that equal a marker.

    Truth values become uint8, bytes are in native order, and `windowed` makes a `Field` keep it as it is.
    """

    windowed = True

    def __init__(self, whole: Any, spans: Sequence[slice] | None = None, nodata: float | None = None) -> None:
        self._whole, self._nodata = whole, nodata
        self.dtype = np.dtype(np.uint8) if whole.dtype.kind == "b" else whole.dtype.newbyteorder("=")
        self._spans = [range(size)[span] for size, span in zip(
            whole.shape, spans or [slice(None)] * len(whole.shape), strict=True)]
        self.shape = tuple(map(len, self._spans))
        self.ndim = len(self.shape)

    def __getitem__(self, window: tuple[slice, ...]) -> Any:
        parts = [span[part] for span, part in zip(self._spans, window, strict=True)]
        found = self._whole[tuple(slice(part.start, part.stop) for part in parts)].astype(self.dtype, copy=False)
        if self._nodata is None:
            return found
        return np.ma.masked_array(found, np.ma.getmaskarray(found) | missing_samples(np.asarray(found), self._nodata))
