"""Stored numbers and the samples that they become, by the attributes of netCDF: markers, valid ranges, scales.

Xarray makes floats of all packed and marked integers, and leaves out valid ranges.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import one_line

_MARKERS = ("_FillValue", "missing_value", "nodata")
_DECODED = {*_MARKERS, "scale_factor", "add_offset", "_Unsigned"}
"""Attributes that xarray moves to the encoding when it applies them."""
_KINDS = {"true": "u", "false": "i"}
"""Kinds of integers by the attribute ``_Unsigned``."""


class Packing:
    """Rule by which the numbers of an array with labels become samples.

    Attributes
    ----------
    dtype : dtype
        Of samples: integers if stored integers are scaled by whole numbers, else floats.
    plain : bool
        Whether samples are the numbers as they are given.
    remarks : list of str
        Attributes that are left out, and why.
    """

    def __init__(self, array: Any) -> None:
        self._attributes, self.remarks = {**array.encoding, **array.attrs}, list[str]()
        self._decoded = bool(_DECODED & (array.encoding.keys() - array.attrs.keys()))
        self._given = np.dtype(np.uint8) if array.dtype.kind == "b" else array.dtype.newbyteorder("=")
        self._stored = np.dtype(array.encoding.get("dtype", self._given)) if self._decoded else self._given
        kind = _KINDS.get(str(self._attributes.get("_Unsigned")).lower(), self._stored.kind)
        self._turned = self._stored.kind in "iu" and kind != self._stored.kind
        if self._turned:
            self._stored = np.dtype(f"{kind}{self._stored.itemsize}")
        self._slope, self._offset = self._number("scale_factor", 1), self._number("add_offset", 0)
        ends = self._numbers("valid_range")
        ends = ends if len(ends) == 2 else [self._number("valid_min", None), self._number("valid_max", None)]
        self._outside = [(is_outside, end) for is_outside, end in zip((np.less, np.greater), ends, strict=True)
                         if end is not None]
        self._markers = [] if self._decoded else [number for name in _MARKERS for number in self._numbers(name)]
        self.plain = self._decoded or (self._slope == 1 and self._offset == 0)
        self.dtype = self._given if self._decoded else self._stored if self.plain else self._scaled()

    def samples(self, given: NDArray[Any], marked: bool = True) -> Any:
        """Unpack numbers to samples; markers and numbers out of range are masked if they are ``marked``."""
        values = numbers = given.astype(self._given, copy=False)
        if self._decoded:
            numbers = (values - self._offset) / self._slope
            numbers = numbers if self._stored.kind == "f" else np.rint(numbers)
        else:
            values = numbers = numbers.view(self._stored)
        if not self.plain:
            values = numbers.astype(self.dtype) * self.dtype.type(self._slope) + self.dtype.type(self._offset)
        gone = np.zeros(values.shape, np.bool_)
        if marked:
            for marker in self._markers:
                gone |= numbers == marker
            # the range of packed integers is one of samples if it has fractions, as these do
            of_samples = self._stored.kind != "f" and any(isinstance(end, float) for _, end in self._outside)
            for is_outside, end in self._outside:
                gone |= is_outside(values if of_samples else numbers, end)
        if not self.plain and values.dtype.kind == "f":
            values[gone] = np.nan
        return np.ma.masked_array(values, gone)

    def _number(self, name: str, usual: Any) -> Any:
        return next(iter(self._numbers(name)), usual)

    def _numbers(self, name: str) -> list[Any]:
        """Numbers of an attribute, which may be text."""
        found = np.ravel(self._attributes.get(name, ()))
        try:
            found = found if found.dtype.kind in "biuf" else found.astype(np.float64)
        except (TypeError, ValueError):
            self.remarks.append(f"its {name} is ignored, as it is no number: {one_line(str(found), 40)}")
            return []
        return list((found.astype(self._stored) if self._turned and found.dtype.kind in "iu" else found).tolist())

    def _scaled(self) -> np.dtype[Any]:
        """Find a type of integers that holds all samples if these are whole, or else float64."""
        factors = self._slope, self._offset
        if self._stored.kind in "iu" and all(float(factor).is_integer() for factor in factors):
            slope, offset = map(int, factors)
            ends = [slope * int(end) + offset for end in (np.iinfo(self._stored).min, np.iinfo(self._stored).max)]
            for kind in (np.dtype(np.int32), np.dtype(np.int64)):
                if np.iinfo(kind).min <= min(ends) <= max(ends) <= np.iinfo(kind).max:
                    return kind
        return np.dtype(np.float64)
