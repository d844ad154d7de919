"""Samples of arrays with labels: unpacked and masked by the attributes of netCDF.

Xarray makes floats of all packed and marked integers, and leaves out valid ranges.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError, one_line, plain
from ..field.missing import missing_samples
from .libraries import reading

_MARKERS = ("_FillValue", "missing_value", "nodata")
_DECODED = {*_MARKERS, "scale_factor", "add_offset", "_Unsigned"}
"""Attributes that xarray moves to the encoding when it applies them."""
_SIGNS = {"true": ("i", "u"), "false": ("u", "i")}
"""Kinds of integers that the attribute ``_Unsigned`` replaces, with their replacements."""


class MaskedSamples:
    """The samples of a DataArray by slices, masked where they are missing.

    ``nodata`` replaces the missing value that attributes of unpacked arrays state. Samples are integers if stored
    integers are scaled by whole numbers, else floats. `remarks` name the attributes that are left out, and why.
    """

    windowed = True

    def __init__(self, array: Any, nodata: float | None = None) -> None:
        self._array, self._nodata, self.remarks = array, nodata, list[str]()
        self.shape, self.ndim = tuple(array.shape), array.ndim
        self._given = np.dtype(np.uint8) if array.dtype.kind == "b" else array.dtype.newbyteorder("=")
        self._decoded = bool(_DECODED & (array.encoding.keys() - array.attrs.keys()))
        self._attributes = {**array.encoding, **array.attrs}
        stored = np.dtype(array.encoding.get("dtype", self._given)) if self._decoded else self._given
        signs = _SIGNS.get(str(self._attributes.get("_Unsigned")).lower(), ("", ""))
        self._stored = np.dtype(stored.str.replace(*signs))
        self._turned = self._stored != stored
        self._slope, self._offset = self._factor("scale_factor", 1), self._factor("add_offset", 0)
        self._packed = (self._slope, self._offset) != (1, 0)
        ends = self._numbers("valid_range") or [(*self._numbers(f"valid_{end}"), None)[0] for end in ("min", "max")]
        if len(ends) != 2:
            raise InputError(f"valid_range of {plain(str(array.name))} has {len(ends)} numbers instead of two",
                             code="range", remedy="correct the attribute, or delete it")
        outside = zip((np.less, np.greater), ends, strict=True)
        self._outside = [(is_outside, end) for is_outside, end in outside if end is not None]
        self._markers = [] if self._decoded else [number for name in _MARKERS for number in self._numbers(name)]
        whole = all(float(factor).is_integer() and abs(factor) < 2**31 for factor in (self._slope, self._offset))
        unpacked = np.int64 if whole and self._stored.kind in "iu" and self._stored.itemsize < 8 else np.float64
        self.dtype = self._given if self._decoded else np.dtype(unpacked) if self._packed else self._stored

    def __getitem__(self, window: Any) -> Any:
        with reading("array"):
            values = np.asarray(self._array[window].values).astype(self._given, copy=False)
            if self._decoded:
                numbers = (values - self._offset) / self._slope
                numbers = np.rint(numbers) if self._stored.kind in "iu" else numbers
            else:
                values = numbers = np.ascontiguousarray(values).view(self._stored)
        if self._packed and not self._decoded:
            values = numbers.astype(self.dtype) * self.dtype.type(self._slope) + self.dtype.type(self._offset)
        gone = np.zeros(values.shape, np.bool_)
        if self._nodata is None or self._packed:
            for marker in self._markers:
                gone |= numbers == marker
            # the range of packed integers is one of samples if it has fractions, as these do
            of_samples = self._stored.kind != "f" and any(isinstance(end, float) for _, end in self._outside)
            for is_outside, end in self._outside:
                gone |= is_outside(values if of_samples else numbers, end)
        if values is not numbers and values.dtype.kind == "f" and not self._decoded:
            values[gone] = np.nan
        if self._nodata is not None:
            gone |= missing_samples(values, self._nodata)
        return np.ma.masked_array(values, gone)

    def _factor(self, name: str, usual: int) -> Any:
        """The number to scale with or to add."""
        number = (*self._numbers(name), usual)[0]
        if np.isfinite(number) and (number or not usual):
            return number
        self.remarks.append(f"its {name} is ignored, as nothing can be scaled by it: {number}")
        return usual

    def _numbers(self, name: str) -> list[Any]:
        """Numbers of an attribute, which may be text."""
        found = np.ravel(self._attributes.get(name, ()))
        try:
            found = found if found.dtype.kind in "biuf" else found.astype(np.float64)
        except (TypeError, ValueError):
            self.remarks.append(f"its {name} is ignored, as it is no number: {one_line(str(found), 40)}")
            return []
        return list((found.astype(self._stored) if self._turned and found.dtype.kind in "iu" else found).tolist())
