"""Stored numbers and the samples that they become, by the attributes of netCDF: markers, valid ranges, scales.

Xarray makes floats of all packed and marked integers, leaves out valid ranges, and takes zeros of Zarr 2 for markers.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import one_line
from .places import as_integers

_MARKERS, _RANGE = ("_FillValue", "missing_value", "nodata"), ("valid_min", "valid_max")
_FACTORS = {"scale_factor": 1.0, "add_offset": 0.0}
_UNWRITTEN = {"f4": 9.969209968386869e36, "f8": 9.969209968386869e36, "i2": -32767, "u2": 65535, "i4": -2147483647,
              "u4": 4294967295, "i8": -9223372036854775806, "u8": 18446744073709551614}
"""Numbers of netCDF where nothing was written and no marker is stated; bytes may have any value."""
Array = NDArray[Any]
Gone = NDArray[np.bool_] | None


class Packing(NamedTuple):
    """Rule by which stored numbers become samples.

    Attributes
    ----------
    stored, dtype : dtype
        Types of stored numbers, with or without a sign, and of samples: integers if they are scaled by whole numbers.
    factors : tuple of float
        What stored numbers are multiplied by, and what is added.
    markers : tuple of numbers
        Stored numbers of missing samples.
    ends : tuple of number or None
        Range of valid numbers.
    of_samples : bool
        Whether that is a range of samples, not of stored numbers.
    remarks : tuple of str
        Attributes that are left out, and why.
    """

    stored: np.dtype[Any]
    dtype: np.dtype[Any]
    factors: tuple[float, float] = (1.0, 0.0)
    markers: tuple[Any, ...] = ()
    ends: tuple[Any, Any] = (None, None)
    of_samples: bool = False
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, dtype: np.dtype[Any], attributes: Mapping[str, Any], netcdf: bool = False) -> Packing:
        """Packing of an array of that type; in netCDF files numbers that were never written are known."""
        native = dtype.newbyteorder("=")
        if dtype.kind not in "iuf":
            return cls(native, native)
        remarks: list[str] = []
        turned = {"true": "i", "false": "u"}.get(str(attributes.get("_Unsigned", "")).lower()) == dtype.kind
        stored = np.dtype(native.str.replace(*("iu" if dtype.kind == "i" else "ui"))) if turned else native
        markers = [n for name in _MARKERS for n in _numbers(name, attributes, stored, remarks, turned)]
        if netcdf and not markers and stored.str[1:] in _UNWRITTEN:
            markers = [stored.type(_UNWRITTEN[stored.str[1:]])]
        slope, offset = (_factor(attributes, name, usual, remarks) for name, usual in _FACTORS.items())
        plain = (slope, offset) == (1, 0)
        pair = np.ravel(attributes.get("valid_range", ()))
        ends = dict(zip(_RANGE, pair, strict=True)) if len(pair) == 2 else attributes
        # the range of packed integers is one of samples if it has fractions, as these do
        floats = any(np.asarray(ends[name]).dtype.kind == "f" for name in _RANGE if name in ends)
        of_samples = stored.kind != "f" and floats and not plain
        tested = np.dtype(np.float64) if of_samples else stored
        low, high = (next(iter(_numbers(name, ends, tested, remarks, turned)), None) for name in _RANGE)
        kind = stored if plain else _whole(stored, slope, offset)
        return cls(stored, kind, (slope, offset), tuple(markers), (low, high), of_samples, tuple(remarks))

    @property
    def plain(self) -> bool:
        """Whether samples are the stored numbers."""
        return self.factors == (1, 0)

    def samples(self, raw: Array, marked: bool = True) -> tuple[Array, Gone]:
        """Unpack stored numbers: samples, and which of them are missing; None if none is.

        Markers and numbers outside of the valid range are missing if they are ``marked``.
        """
        raw = raw.astype(raw.dtype.newbyteorder("="), copy=False)
        if raw.dtype.kind not in "iuf":
            return raw.astype(np.uint8) if raw.dtype.kind == "b" else raw, None
        raw = raw.view(self.stored) if raw.dtype != self.stored else raw
        slope, offset = map(self.dtype.type, self.factors)
        values = raw if self.plain else raw.astype(self.dtype) * slope + offset
        gone = np.zeros(raw.shape, np.bool_)
        for marker in self.markers if marked else ():
            gone |= raw == marker
        if marked:
            gone |= beyond(values if self.of_samples else raw, self.ends)
        if values.dtype.kind == "f" and not self.plain:
            values[gone] = np.nan
        return values, gone if gone.any() else None


def restored(values: Array, attributes: Mapping[str, Any], before: Mapping[str, Any]) -> tuple[Array, Gone]:
    """Samples that xarray has unpacked: integers if they were, without those outside of the valid range.

    Parameters
    ----------
    values : array of float
    attributes : mapping
        Of the array, the valid range among them, which may be one of packed numbers.
    before : mapping
        Attributes and type of the packed array: the encoding.
    """
    found = Packing.of(np.dtype(before["dtype"]), {**attributes, **before})
    ends: Any = found.ends
    if not (found.of_samples or found.plain):
        slope, offset = found.factors
        wider = zip(ends, (-0.5, 0.5), strict=True)  # by half a step: samples are rounded
        ends = [None if end is None else (float(end) + half) * slope + offset for end, half in wider]
        ends = ends if slope > 0 else ends[::-1]
    out = beyond(values, ends)
    made, gone = as_integers(values, found.dtype)
    gone = out if gone is None else out | gone
    return made, gone if gone.any() else None


def beyond(values: Array, ends: Any) -> NDArray[np.bool_]:
    """Find the values below or above a range, whose ends may be None."""
    gone = np.zeros(values.shape, np.bool_)
    for end, compared in zip(ends, (np.less, np.greater), strict=True):
        if end is not None:
            gone |= compared(values, end)
    return gone


def number_of(one: Any) -> int | float | None:
    """A number of an attribute; text may hold one, or, of Zarr, its eight bytes. None if it is none."""
    if isinstance(one, str | bytes):
        text = one.decode("ascii", "replace") if isinstance(one, bytes) else str(one)
        with suppress(ValueError):
            return int(text) if text.strip().lstrip("+-").isdigit() else float(text)
        with suppress(ValueError):
            return float(np.frombuffer(base64.b64decode(text, validate=True), "<f8")[0]) if len(text) == 12 else None
        return None
    kind = np.asarray(one).dtype.kind
    return int(one) if kind in "iub" else float(one) if kind == "f" else None


def _whole(stored: np.dtype[Any], slope: float, offset: float) -> np.dtype[Any]:
    """The type of samples: one of integers that holds all of them if the factors are whole, else float64."""
    if stored.kind in "iu" and slope.is_integer() and offset.is_integer():
        ends = sorted(int(slope) * int(end) + int(offset) for end in (np.iinfo(stored).min, np.iinfo(stored).max))
        for kind in (stored, np.dtype(np.int32), np.dtype(np.int64)):
            if np.iinfo(kind).min <= ends[0] and ends[1] <= np.iinfo(kind).max:
                return kind
    return np.dtype(np.float64)


def _factor(attributes: Mapping[str, Any], name: str, usual: float, remarks: list[str]) -> float:
    given = np.ravel(attributes.get(name, usual))
    number = number_of(given[0]) if given.size else None
    if number is None or not math.isfinite(number) or (name == "scale_factor" and number == 0):
        remarks.append(f"its {name} is ignored, as it is no number to scale with: {one_line(str(given), 40)}")
        return usual
    return float(number)


def _numbers(
    name: str, attributes: Mapping[str, Any], dtype: np.dtype[Any], remarks: list[str], turned: bool
) -> list[Any]:
    """Numbers of an attribute in the type of stored ones: exactly, or rounded to floats of it."""
    out: list[Any] = []
    for one in np.ravel(attributes.get(name, ())):
        number = number_of(one)
        if number is None:
            remarks.append(f"its {name} is ignored, as it is no number: {one_line(str(one), 40)}")
        elif dtype.kind == "f":
            with np.errstate(over="ignore"):
                rounded = dtype.type(number)
            out += [rounded] if np.isfinite(rounded) or np.isinf(number) else []
        elif isinstance(number, int) or number.is_integer():
            info, whole = np.iinfo(dtype), int(number)
            if turned and not info.min <= whole <= info.max:
                whole += (1 << info.bits) * (1 if whole < 0 else -1)
            out += [dtype.type(whole)] if info.min <= whole <= info.max else []
    return out
