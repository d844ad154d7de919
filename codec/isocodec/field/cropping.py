"""The part of a field within a box of coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import OptionError
from .missing import missing_samples
from .placement import Array, Placement, matrix_of
from .sampled import Field

Box = Sequence[float]
"""Least x, y (, z), then largest x, y (, z)."""
_EVEN = 1e-6
"""Steps that samples may lie outside of a box, since coordinates are rounded."""
_ROUNDED = 1e-12
"""Share of coordinates that is below their rounding."""


def check_box(box: Box, n: int) -> tuple[Array, Array]:
    """Split a box into least and largest x, y (, z); raises `OptionError` if it is none of n axes."""
    least, most = np.array(box, np.float64)[:n], np.array(box, np.float64)[n:]
    if len(box) != 2 * n or not (least <= most).all() or not np.isfinite([least, most]).all():
        raise OptionError(f"the box {tuple(box)} of coordinates has other axes than the field, or no inside",
                          code="bbox",
                          remedy=f"give {'XMIN,YMIN,XMAX,YMAX' if n == 2 else 'XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX'}")
    return least, most


def window_around(placement: Placement | None, shape: Sequence[int], box: Box) -> Array:
    """Find the window of index coordinates that a box reaches into: its ends along each axis of the field, (n, 2).

    It may be larger than the field, and holds all of a box that is turned to the field's axes. On a grid with
    coordinates it ends with whole cells.

    Raises `OptionError` if the field has no placement, the box another number of axes, or lies outside of the field.
    """
    n = len(shape)
    if placement is None or not placement.placed:
        raise OptionError("a box of coordinates needs a field with a placement in the world", code="bbox",
                          remedy="give a placement")
    if placement.in_space:
        raise OptionError("a box of coordinates does not apply to a plane in space", code="bbox",
                          remedy="give a window of samples")
    least, most = check_box(box, n)
    ends = np.indices((2,) * n).reshape(n, -1)
    if placement.matrix is not None:
        matrix = matrix_of(placement.matrix, n)
        index = placement.index(np.where(ends.T, most, least)).T
        index = np.where(np.abs(index - np.rint(index)) < _EVEN, np.rint(index), index)
        window = np.stack([index.min(axis=1), index.max(axis=1)], axis=1)
        nodes = [*(matrix[:, :n] @ (ends * (np.array(shape) - 1)[:, None]) + matrix[:, n:])]
    else:
        nodes = [np.broadcast_to(array, shape) for array in placement.nodes()]
        inside = np.ones([size - 1 for size in shape], np.bool_)
        for node, low, high in zip(nodes, least, most, strict=True):
            corners = [node[tuple(slice(c, c + size - 1) for c, size in zip(corner, shape, strict=True))]
                       for corner in ends.T]
            inside &= (np.min(corners, axis=0) <= high) & (np.max(corners, axis=0) >= low)
        window = np.array([[each.min(), each.max() + 1] if len(each) else [-1, -1] for each in inside.nonzero()])
    extent = np.array([[np.nanmin(node), np.nanmax(node)] for node in nodes])
    away = np.abs(extent).max(axis=1) * _ROUNDED
    beside = (window[:, 1] < 0) | (window[:, 0] > np.array(shape) - 1)
    if (beside | (most < extent[:, 0] - away) | (least > extent[:, 1] + away)).any():
        raise _outside(box, extent)
    return np.asarray(window, np.float64)


def _outside(box: Box, extent: Array) -> OptionError:
    low, high = (", ".join(f"{number:.10g}" for number in side) for side in extent.T)
    return OptionError(f"no samples lie within the box {', '.join(f'{number:.10g}' for number in box)}", code="bbox",
                       remedy=f"the field extends from {low} to {high}, x before y")


def spans_within(placement: Placement | None, shape: Sequence[int], box: Box) -> tuple[slice, ...]:
    """Find the samples within a box: the first and the last along each axis of the field.

    Raises `OptionError` as `window_around` does, or if no sample is within the box.
    """
    n = len(shape)
    window = window_around(placement, shape, box)
    assert placement is not None
    if placement.matrix is not None:
        low, high = np.ceil(window[:, 0]), np.floor(window[:, 1]) + 1
        found = [(max(int(a), 0), min(int(b), size)) for a, b, size in zip(low, high, shape, strict=True)]
    else:
        inside = np.ones(shape, np.bool_)
        for c, array in enumerate(placement.nodes()):
            inside &= (array >= box[c]) & (array <= box[n + c])
        along = [np.flatnonzero(inside.any(axis=tuple(a for a in range(n) if a != axis))) for axis in range(n)]
        found = [(int(each[0]), int(each[-1]) + 1) if len(each) else (0, 0) for each in along]
    if any(a >= b for a, b in found):
        raise OptionError(f"the box {', '.join(f'{number:.10g}' for number in box)} lies between samples", code="bbox",
                          remedy="give a larger box")
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
