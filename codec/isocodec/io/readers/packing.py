"""Stored numbers and the samples that they become, by the attributes of NetCDF: markers, valid ranges, scales."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...deferred import dataclass
from ...errors import one_line

Array = NDArray[Any]

_MARKERS = ("_FillValue", "missing_value", "nodata")
_RANGE = ("valid_min", "valid_max")
_UNWRITTEN = {"f4": 9.969209968386869e36, "f8": 9.969209968386869e36, "i2": -32767, "u2": 65535, "i4": -2147483647,
              "u4": 4294967295, "i8": -9223372036854775806, "u8": 18446744073709551614}
"""Numbers of NetCDF where nothing was written and no marker is stated; bytes may have any value."""


@dataclass(frozen=True, eq=False)
class Packing:
    """Rule by which stored numbers become samples.

    Attributes
    ----------
    stored, dtype : dtype
        Types of stored numbers, with or without a sign, and of samples: integers if they are scaled by whole numbers.
    markers : tuple of numbers
        Stored numbers of missing samples.
    least, most : number or None
        Range of valid numbers.
    of_samples : bool
        Whether that is a range of samples, not of stored numbers.
    slope, offset : float
    remarks : tuple of str
        Attributes that are left out, and why.
    """

    stored: np.dtype[Any]
    dtype: np.dtype[Any]
    markers: tuple[Any, ...] = ()
    least: Any = None
    most: Any = None
    of_samples: bool = False
    slope: float = 1.0
    offset: float = 0.0
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, dtype: np.dtype[Any], attributes: Mapping[str, Any], before: Mapping[str, Any] | None = None,
        netcdf: bool = False,
    ) -> Packing:
        """Packing of an array of that type.

        Attributes ``before`` are those by which another library has unpacked it: a valid range may be that of packed
        numbers. In NetCDF files numbers that were never written are known.
        """
        if dtype.kind not in "iuf":
            return cls(dtype, dtype)
        remarks: list[str] = []
        said = str(attributes.get("_Unsigned", "")).lower()
        turned = {"true": "i", "false": "u"}.get(said) == dtype.kind
        stored = np.dtype(dtype.str.replace(*("iu" if dtype.kind == "i" else "ui"))) if turned else dtype
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
        as_type = np.dtype(np.float64) if of_samples else stored
        least, most = (next(iter(_numbers(name, ends, as_type, remarks, turned)), None) for name in _RANGE)
        if before and np.dtype(before.get("dtype", dtype)).kind in "iu" and dtype.kind == "f":
            packed = cls.of(np.dtype(before["dtype"]), {**before, **{n: ends[n] for n in _RANGE if n in ends}})
            least, most = packed._range_of_samples()
        kind = stored if plain else _whole(stored, slope, offset)
        return cls(
            stored, kind.newbyteorder("="), tuple(markers), least, most, of_samples, slope, offset, tuple(remarks)
        )

    def _range_of_samples(self) -> list[Any]:
        """The valid range, of packed numbers half a step wider: samples are rounded."""
        if self.of_samples or self.plain:
            return [self.least, self.most]
        steps = [(self.least, -0.5), (self.most, 0.5)]
        ends = [None if end is None else (float(end) + half) * self.slope + self.offset for end, half in steps]
        return ends if self.slope > 0 else ends[::-1]

    @property
    def plain(self) -> bool:
        """Whether samples are the stored numbers."""
        return (self.slope, self.offset) == (1, 0)

    def samples(self, raw: Array, marked: bool = True) -> tuple[Array, NDArray[np.bool_] | None]:
        """Unpack stored numbers: samples, those of unpacked floats NaN where missing, and which others are missing.

        Markers and numbers outside of the valid range are missing if they are ``marked``.
        """
        if raw.dtype.kind not in "iuf":
            return raw, None
        raw = raw.view(self.stored) if raw.dtype != self.stored and raw.itemsize == self.stored.itemsize else raw
        kind = self.dtype.type
        values = raw if self.plain else raw.astype(self.dtype) * kind(self.slope) + kind(self.offset)
        if not marked:
            return values, None
        gone, tested = np.zeros(raw.shape, np.bool_), values if self.of_samples else raw
        for marker in self.markers:
            gone |= raw == marker
        if self.least is not None:
            gone |= tested < self.least
        if self.most is not None:
            gone |= tested > self.most
        if not gone.any():
            return values, None
        if values.dtype.kind != "f" or self.plain:
            return values, gone
        return np.where(gone, values.dtype.type(np.nan), values), None


_FACTORS = {"scale_factor": 1.0, "add_offset": 0.0}


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
            info = np.iinfo(dtype)
            whole = int(number)
            if turned and not info.min <= whole <= info.max:
                whole += (1 << info.bits) * (1 if whole < 0 else -1)
            out += [dtype.type(whole)] if info.min <= whole <= info.max else []
    return out


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
