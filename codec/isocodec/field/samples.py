"""Signs, numbers of steps and offsets of crossings from a sampled field (spec clause 2)."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import MAX_SIDE

from ..errors import InputError, OptionError
from .filling import filled_smoothly

if TYPE_CHECKING:
    from fractions import Fraction

OFFSET_BITS = 30
MAX_NUMBER = 1 << 52


@dataclass(frozen=True)
class Samples:
    """A sampled field at one isovalue.

    Attributes
    ----------
    values : (s0, .., sn-1) array of integers or floats
    isovalue : float
    signs : (s0, .., sn-1) bool
        ``value > isovalue``, strict (spec clause 2.2).
    scale : float or None
        Step of the numbers; None for integers, which are their own numbers.
    gone : (s0, .., sn-1) bool, or None
        Which samples are missing, and have a substitute in ``values``; None if none is.
    """

    values: NDArray[Any]
    isovalue: float
    signs: NDArray[np.bool_]
    scale: float | None = None
    gone: NDArray[np.bool_] | None = None

    @property
    def integer(self) -> bool:
        """Whether the samples are integers."""
        return self.values.dtype.kind in "iub"

    def numbers(self, positions: NDArray[np.integer], above: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Count whole steps from the isovalue (spec clause 2.3), (V,) int64, of samples (V, n) with signs (V,)."""
        samples = self.values[tuple(positions.T)]
        if self.scale is None:
            t = math.floor(self.isovalue)
            large = samples.dtype.itemsize == 8 and (np.abs(samples.astype(float)) >= 2.0**62).any()
            wide = large or abs(t) >= 1 << 62  # differences may overflow int64
            distance = (np.array([abs(int(q) - t) for q in samples.ravel()], object) if wide
                        else np.abs(samples.astype(np.int64) - t))
            number = np.where(above, distance - 1, distance)
        else:
            number = _steps(samples.astype(np.float64), self.isovalue, self.scale, above)
        if len(number) and int(number.max()) >= MAX_NUMBER:
            raise InputError(
                f"values next to the curve lie {float(number.max()):.3g} steps from the isovalue, more than 2**52",
                code="range", remedy="use a larger step or a tolerance; nodata if they mark missing samples",
            )
        return number.astype(np.int64)

    def number_bits(self) -> tuple[int, int]:
        """Count the bits that the numbers of all samples need, above and below the isovalue."""
        ends = [np.unravel_index(int(i), self.values.shape) for i in (self.values.argmax(), self.values.argmin())]
        positions = np.array(ends, np.int64)
        above = self.signs[tuple(positions.T)]
        numbers = self.numbers(positions, above)
        bits = [max((int(n).bit_length() for n in numbers[above == side]), default=0) for side in (True, False)]
        return bits[0], bits[1]

    def crossings(self, low: NDArray[np.integer], high: NDArray[np.integer]) -> NDArray[np.int64]:
        """Interpolate crossings of edges with ends (E, n) of different signs, as 30-bit fractions (E,) from ``low``.

        If an edge longer than the sample spacing is crossed several times, the crossing in the middle is used.
        """
        below: NDArray[np.int64] = low.astype(np.int64)
        beyond: NDArray[np.int64] = high.astype(np.int64)
        where = np.empty(len(low))
        lengths = np.abs(beyond - below).max(axis=1, initial=0)
        for length in np.unique(lengths):
            some = np.flatnonzero(lengths == length)
            where[some] = self._middle_crossing(below[some], beyond[some], int(length))
        where = np.where(np.isnan(where), 0.5, where)
        return np.clip(np.floor(np.ldexp(where, OFFSET_BITS)), 0, (1 << OFFSET_BITS) - 1).astype(np.int64)

    def _middle_crossing(self, low: NDArray[np.int64], high: NDArray[np.int64], length: int) -> NDArray[np.float64]:
        """Interpolate crossings of edges that all span ``length`` samples, as fractions."""
        rows = np.arange(len(low))
        step = np.zeros(len(low), np.int64)
        if length > 1:
            along = np.arange(length + 1)
            samples = [
                np.rint(a[:, None] + along * ((b - a) / length)[:, None]).astype(np.int64)
                for a, b in zip(low.T, high.T, strict=True)
            ]
            signs = self.signs[tuple(samples)]
            changes = np.cumsum(signs[:, 1:] != signs[:, :-1], axis=1)
            step = np.argmax(changes == (changes[:, -1:] + 1) // 2, axis=1)
            low, high = (np.stack([x[rows, step + i] for x in samples], axis=1) for i in (0, 1))
        return (step + np.clip(self.between(low, high), 0.0, 1.0)) / length

    def between(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.float64]:
        """Interpolate crossings between adjacent samples, as fractions (E,) from the first.

        Next to an infinite sample, the crossing is at the finite one; it is NaN between two.
        """
        f_low = self.values[tuple(low.T)].astype(np.float64)
        f_high = self.values[tuple(high.T)].astype(np.float64)
        with np.errstate(all="ignore"):
            # A power of two brings the larger end between a half and 1: then the span of two large floats does not
            # overflow, tiny ones keep all bits, and whatever loses some is too small to matter.
            exponent = np.frexp(np.maximum(np.abs(f_low), np.abs(f_high)))[1]
            at, start, end = (np.ldexp(x, -exponent) for x in (self.isovalue, f_low, f_high))
            where: NDArray[np.float64] = (at - start) / (end - start)
        # from a finite sample to an infinite one the quotient is 0 as it is
        where[np.isinf(f_low) & np.isfinite(f_high)] = 1.0
        return where

    def along(self, edges: NDArray[np.int64]) -> NDArray[np.float64]:
        """Interpolate crossings of edges (E, 2) between vertices of a mesh, whose values these are.

        They are fractions (E,) from the first vertex, in the middle where that is undefined.
        """
        where = self.between(edges[:, :1], edges[:, 1:2])
        return np.asarray(np.clip(np.nan_to_num(where, nan=0.5), 0.0, 1.0))


_UNSURE = 2.0**-50
"""Relative distance from a whole number within which a quotient may have been rounded to it, or past it."""


def _steps(
    samples: NDArray[np.float64], isovalue: float, scale: float, above: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Count whole steps between an isovalue and samples exactly, since other isovalues may be predicted from them.

    Above, ``(isovalue, isovalue + scale]`` is number 0; below, ``(isovalue - scale, isovalue]`` is. Raises `InputError`
    if a sample is infinite.
    """
    from fractions import Fraction

    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.abs((samples - isovalue) / scale)
    if not np.all(np.isfinite(steps)):
        raise InputError("the field is infinite next to the curve", code="infinite", remedy="clip the field")
    number = np.where(above, np.ceil(steps) - 1, np.floor(steps))
    unsure = np.flatnonzero((np.abs(steps - np.rint(steps)) <= _UNSURE * steps) & (steps < MAX_NUMBER))
    values, which = np.unique(samples[unsure], return_inverse=True)
    exact = [(Fraction(value) - Fraction(isovalue)) / Fraction(scale) for value in values.tolist()]
    whole = np.array([math.ceil(x) - 1 if x > 0 else math.floor(-x) for x in exact], np.float64)
    number[unsure] = whole[which.ravel()]
    # a sample of a wider type may have been rounded to the isovalue
    return np.maximum(number, 0)


def isovalue_of(given: object) -> float:
    """Convert an isovalue (int, float, Fraction, Decimal or numpy number) to double precision, as files hold it.

    Raises `InputError` if it is not a finite number, or rounding would change or pass a whole number, which would move
    integer samples to the other side.
    """
    from decimal import Decimal
    from fractions import Fraction

    number = given
    if isinstance(given, np.generic) or (isinstance(given, np.ndarray) and given.ndim == 0):
        number = given.item()
    if not isinstance(number, Real | Decimal) or isinstance(number, bool):
        raise InputError(f"the isovalue {given!r} is not a number", code="isovalue", remedy="for example 500.5")
    try:
        isovalue = float(number)
    except (ValueError, OverflowError):  # a signalling NaN, and what is larger than any float
        isovalue = math.inf
    if not math.isfinite(isovalue):
        raise InputError(f"the isovalue {isovalue} is not a finite number of double precision", code="isovalue")
    exact = Fraction(*number.as_integer_ratio()) if isinstance(number, np.longdouble) else number
    if math.floor(exact) != math.floor(isovalue):
        raise InputError(
            f"the isovalue {number} is not a number of double precision, which files hold", code="isovalue",
            remedy=f"the nearest one is {isovalue:.0f}; or subtract a constant from the field",
        )
    return isovalue


def steps_above(isovalue: float, other: float, scale: float | None) -> Fraction:
    """Count the steps that an isovalue lies above another one, exactly (spec clause 5.9.1).

    Steps are whole numbers (``scale`` None), between the floors of both, or multiples of the scale.
    """
    from fractions import Fraction

    if scale is None:
        return Fraction(math.floor(isovalue) - math.floor(other))
    return (Fraction(isovalue) - Fraction(other)) / Fraction(scale)


def without_holes(field: ArrayLike, mask: ArrayLike | None = None) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Substitute missing samples, and return which these are, or None; `missing_of` finds them.

    Raises `InputError` as that does, and if all samples are missing.
    """
    values = np.asarray(field)
    if values.dtype.kind not in "biuf":
        return values, None
    gone = missing_of(field, mask)
    if not gone.any():
        return values, None
    if gone.all():
        raise InputError("all samples are missing", code="missing")
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    return filled_smoothly(values, gone), gone


def missing_of(field: ArrayLike, mask: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Find which samples of a field of real numbers are missing: NaN, masked by numpy, or True in ``mask``.

    Raises `InputError` if the mask has another shape or is not of bool.
    """
    values = np.asarray(field)
    gone = np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, np.bool_)
    # whoever has a masked array has loaded numpy.ma, which takes longer than a small field
    if "numpy.ma" in sys.modules and np.ma.is_masked(field):
        gone |= np.ma.getmaskarray(np.ma.asanyarray(field))
    if mask is not None:
        masked = np.asarray(mask)
        if masked.dtype.kind != "b":
            raise InputError(
                f"the mask has samples of type {masked.dtype}", code="mask", remedy="make it bool: True where missing"
            )
        if masked.shape != values.shape:
            raise InputError(f"the mask has shape {masked.shape}, the field {values.shape}", code="mask")
        gone |= masked
    return np.ascontiguousarray(gone)


def check_field(
    field: ArrayLike, isovalue: object, step: float | None = None, gone: NDArray[np.bool_] | None = None
) -> Samples:
    """Check that a field of bool, integers or floats with two or three axes can be encoded at an isovalue.

    For floats, ``step`` is twice the largest error of values. ``gone`` are the missing samples, which have substitutes
    (`without_holes`). Raises `InputError` if the field or the isovalue cannot be encoded, `OptionError` if the step is
    not a positive number, or the data are integers.
    """
    values = np.asarray(field)
    if values.dtype.kind not in "biuf":
        raise InputError(
            f"the field has samples of type {values.dtype}", code="dtype", remedy="convert it to integers or floats"
        )
    if values.ndim not in (2, 3):
        raise InputError(
            f"the field has {values.ndim} axes {values.shape}, not 2 or 3", code="axes",
            remedy="choose one of the series; isocodec encode has --frame" if values.ndim > 3 else "reshape it",
        )
    if min(values.shape) < 2:
        raise InputError(
            f"the field of shape {values.shape} has fewer than 2 samples along an axis", code="shape",
            remedy="drop axes of length 1" if min(values.shape) == 1 and values.ndim == 3 else "add samples",
        )
    if max(values.shape) > MAX_SIDE[values.ndim]:
        raise InputError(
            f"the field has {max(values.shape)} samples along an axis, at most {MAX_SIDE[values.ndim]} are possible",
            code="shape", remedy="cut it into tiles",
        )
    isovalue = isovalue_of(isovalue)
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    if values.dtype.kind == "f":
        signs = values > np.float64(isovalue)
    else:
        signs = values > math.floor(isovalue)
        if step is not None:
            raise OptionError("a step is for float data; integers are sent exactly", code="step", remedy="use exact")
    if step is not None and not (math.isfinite(step) and step > 0):
        raise OptionError(f"the step {step} is not a positive number", code="step")
    return Samples(values, isovalue, np.ascontiguousarray(signs), step, gone)


def mask_field(gone: NDArray[np.bool_]) -> Samples:
    """Make the field of a mask (spec clause 5.10.1): 1 where samples are valid, 0 where they are missing."""
    valid = ~gone
    return Samples(valid.view(np.uint8), 0.5, valid)


def interval_value(isovalue: float, scale: float | None, number: NDArray[Any], above: NDArray[Any]) -> NDArray[Any]:
    """Convert numbers of steps to field values (spec clause 2.3); inverse of ``Samples.numbers``."""
    if scale is None:
        t = math.floor(isovalue)
        return np.where(above, t + 1 + number, t - number).astype(np.float64)
    # a file may state any scale; an overflow to infinity counts as no value
    with np.errstate(over="ignore"):
        return np.where(above, isovalue + scale * (number + 0.5), isovalue - scale * (number + 0.5))
