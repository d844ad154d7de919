"""Sources of the box around windows of one grid, from those of the windows: the inverse of `cropped_source`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..field.coordinates import whole_cells
from ..field.decoded_samples import DecodedSamples, near_values, values_of_steps
from ..format.kinds import LayerKind
from .recoder import Source, beside_crossings

_PARTS_APART = 2
"""Parts of an edge that two files of one field may have between their crossings, since these may be off."""


@dataclass(frozen=True)
class Window:
    """A window of a grid.

    Attributes
    ----------
    start : tuple of int
        Its first sample within the box.
    valid : (s0, .., sn-1) bool
    """

    start: tuple[int, ...]
    valid: NDArray[np.bool_]

    @property
    def box(self) -> tuple[slice, ...]:
        """Its samples within the box."""
        return tuple(slice(a, a + s) for a, s in zip(self.start, self.valid.shape, strict=True))


class Mosaic:
    """A box of samples, put together from windows that share rows of samples.

    Where no window lies, samples are missing. Raises `InputError` if windows differ in missing samples, if their
    diagonals differ, or if two of them touch without sharing samples: no file has the curve between.
    """

    def __init__(self, windows: Sequence[Window]) -> None:
        self.windows = windows
        self.shape = tuple(np.max([[one.stop for one in window.box] for window in windows], axis=0).tolist())
        for number, window in enumerate(windows, start=1):
            if len({start % 2 for start in window.start}) > 1:
                raise InputError(
                    f"file {number} begins at sample {window.start} of all files together, an odd number along one "
                    "axis and an even one along another: its grid has other diagonals", code="merge",
                    remedy="use windows that begin at even samples",
                )
        covered, known = np.zeros(self.shape, np.bool_), np.zeros([size - 1 for size in self.shape], np.bool_)
        self.valid = np.zeros(self.shape, np.bool_)
        for number, window in enumerate(windows, start=1):
            box = window.box
            self._check(covered[box] & (self.valid[box] != window.valid), number, "missing samples")
            covered[box], self.valid[box] = True, window.valid
            known[tuple(slice(each.start, each.stop - 1) for each in box)] = True
        between = np.argwhere(whole_cells(~covered) & ~known)
        if len(between):
            raise InputError(
                f"files touch at sample {tuple(between[0].tolist())} of all files together without sharing samples: "
                "none of them has the curve between", code="merge",
                remedy="encode windows that share a row of samples with their neighbours",
            )

    def _check(self, differ: NDArray[np.bool_], number: int, what: str) -> None:
        """Refuse a window that differs from earlier ones at some of its samples."""
        at = np.argwhere(differ)
        if len(at):
            place = tuple((at[0] + self.windows[number - 1].start).tolist())
            raise InputError(f"file {number} differs from an earlier one in {what} at sample {place} of all files "
                             f"together, and at {len(at) - 1} others", code="merge",
                             remedy="merge windows of the same field")

    def labels(self, windows: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Join the labels of windows; raises `InputError` if these differ."""
        joined, covered = np.zeros(self.shape, np.result_type(*windows)), np.zeros(self.shape, np.bool_)
        for number, (window, labels) in enumerate(zip(self.windows, windows, strict=True), start=1):
            box = window.box
            self._check(covered[box] & window.valid & (joined[box] != labels), number, "labels")
            joined[box], covered[box] = labels, True
        return joined

    def source(self, sources: Sequence[Source]) -> tuple[Source, float]:
        """Join the sources of an isovalue, one for each window.

        Returns the joined one, and the largest distance in cells between crossings of two windows on one edge, where
        the first window's is taken.

        Raises `InputError` if signs, values or crossings of windows differ, or are stored in different precisions.
        """
        n, first = len(self.shape), sources[0].field
        signs, number = np.zeros(self.shape, np.bool_), np.full(self.shape, -1, np.int64)
        covered = np.zeros(self.shape, np.bool_)
        edges, places, farthest = np.zeros(0, np.int64), np.zeros(0), 0.0
        geometry, curved = sources[0].geometry, False
        for i, (window, source) in enumerate(zip(self.windows, sources, strict=True), start=1):
            field, box = source.field, window.box
            self._check(covered[box] & window.valid & (signs[box] != field.signs), i, f"signs at {field.isovalue:g}")
            signs[box] = np.where(covered[box], signs[box], field.signs)
            covered[box] = True
            if beside_crossings(field.signs, field.gone).any():
                if source.geometry != geometry and curved:
                    raise InputError(f"file {i} stores its curves in another precision than those before",
                                     code="merge", remedy="reduce them to one precision first")
                geometry, curved = source.geometry, True
            if field.number is not None:
                both = (number[box] >= 0) & (field.number >= 0)
                self._check(both & (number[box] != field.number), i, f"values at {field.isovalue:g}")
                number[box] = np.maximum(number[box], field.number)
            low = np.stack(np.unravel_index(field.edges // n, field.signs.shape), axis=1) + window.start
            keys = np.ravel_multi_index(tuple(low.T), self.shape) * n + field.edges % n
            edges, index = np.unique(np.concatenate([edges, keys]), return_index=True)
            joined = np.concatenate([places, field.places])
            off = np.abs(joined[index][np.searchsorted(edges, keys)] - field.places)
            far = np.zeros(window.valid.shape, np.bool_)
            parts = math.prod(int(str(entry[1])) for entry in source.geometry if entry[0] == LayerKind.OFFSETS)
            far[tuple((low - window.start)[off > (_PARTS_APART + 0.5) / parts].T)] = True
            self._check(far, i, f"crossings at {field.isovalue:g}")
            places, farthest = joined[index], max(farthest, float(off.max(initial=0)))
        gone = None if self.valid.all() else ~self.valid
        if any(source.field.number is not None for source in sources):
            made = DecodedSamples(values_of_steps(signs, first.isovalue, first.scale, number), first.isovalue, signs,
                                  first.scale, gone, number=number)
        else:
            made = DecodedSamples(near_values(signs, first.isovalue, edges, places), first.isovalue, signs,
                                  first.scale, gone, edges=edges, places=places)
        return Source(made, geometry), farthest
