"""From a sampled field to what the passes ask: signs, numbers of steps, offsets of crossings (spec clause 2)."""

from __future__ import annotations

import math
import sys
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isospec.container import MAX_SIDE

from ..deferred import dataclass
from ..errors import InputError, OptionError
from .filling import filled_smoothly

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
        Which samples are missing; ``values`` has something else for them. None if none is.
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
        """Whole steps from the isovalue's side of each vertex's interval (spec clause 2.3).

        Parameters
        ----------
        positions : (V, n) int
        above : (V,) bool
            Signs of those samples.

        Returns
        -------
        (V,) int64
        """
        samples = self.values[tuple(positions.T)]
        if self.scale is None:
            t = math.floor(self.isovalue)
            distance = np.array([abs(int(q) - t) for q in samples.ravel()], object) if _wide(samples, t) else (
                np.abs(samples.astype(np.int64) - t)
            )
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
        """Bits that the numbers of all samples need, above and below the isovalue."""
        ends = [np.unravel_index(int(i), self.values.shape) for i in (self.values.argmax(), self.values.argmin())]
        positions = np.array(ends, np.int64)
        above = self.signs[tuple(positions.T)]
        numbers = self.numbers(positions, above)
        bits = [max((int(n).bit_length() for n in numbers[above == side]), default=0) for side in (True, False)]
        return bits[0], bits[1]

    def crossings(self, low: NDArray[np.integer], high: NDArray[np.integer]) -> NDArray[np.int64]:
        """Places of the crossings on edges of the mesh as binary fractions of 30 bits, by linear interpolation.

        An edge that is longer than a sample's distance may be crossed several times: the crossing in the middle of all
        is taken.

        Parameters
        ----------
        low, high : (E, n) int
            Ends of the edges; of different signs.

        Returns
        -------
        (E,) int64
            From the lower ends.
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
        """Places on edges that all span ``length`` samples, as fractions."""
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
        """Crossings of edges between samples next to one another, as fractions (E,) of the way from the first.

        Beside an infinite sample the crossing is at the finite one, as beside an ever larger one; NaN between two.
        """
        f_low = self.values[tuple(low.T)].astype(np.float64)
        f_high = self.values[tuple(high.T)].astype(np.float64)
        with np.errstate(all="ignore"):
            # The larger end is brought between a half and 1 by a power of two: then the span of two large floats does
            # not overflow, all bits of tiny ones stay, and what loses some is too small to count.
            exponent = np.frexp(np.maximum(np.abs(f_low), np.abs(f_high)))[1]
            at, start, end = (np.ldexp(x, -exponent) for x in (self.isovalue, f_low, f_high))
            where: NDArray[np.float64] = (at - start) / (end - start)
        # from a finite sample to an infinite one the quotient is 0 as it is
        where[np.isinf(f_low) & np.isfinite(f_high)] = 1.0
        return where

    def along(self, edges: NDArray[np.int64]) -> NDArray[np.float64]:
        """Crossings of edges between vertices of a mesh, whose values these are, by their numbers (E, 2).

        As fractions (E,) of the way from the first, in the middle where that is not known.
        """
        where = self.between(edges[:, :1], edges[:, 1:2])
        return np.asarray(np.clip(np.nan_to_num(where, nan=0.5), 0.0, 1.0))


_UNSURE = 2.0**-50
"""Quotients this near to a whole number, relative to their size, may have been rounded to it, or past it."""


def _steps(
    samples: NDArray[np.float64], isovalue: float, scale: float, above: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Numbers of whole steps between an isovalue and samples, exactly: other isovalues may follow from them.

    Above, ``(isovalue, isovalue + scale]`` is number 0; below, ``(isovalue - scale, isovalue]`` is.

    Raises
    ------
    InputError
        If a sample is infinite.
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


def _wide(samples: NDArray[Any], t: int) -> bool:
    """Whether differences may overflow int64."""
    return abs(t) >= 1 << 62 or (samples.dtype.itemsize == 8 and bool(np.any(np.abs(samples.astype(float)) >= 2.0**62)))


def isovalue_of(given: object) -> float:
    """An isovalue as files hold it, in double precision.

    Parameters
    ----------
    given : int, float, Fraction, Decimal, or a number of numpy's
        Finite. Fractions are rounded as in a program's text; whole numbers are not, and no number past one, since that
        would move samples of integers to the other side.

    Raises
    ------
    InputError
        If it is not a number, not finite, or would be rounded so.
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


def without_holes(field: ArrayLike, mask: ArrayLike | None = None) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Samples with something in place of the missing ones, and which these are, None if none is.

    Parameters
    ----------
    field : (s0, .., sn-1) array_like
        NaN, and what a masked array of numpy masks, is missing.
    mask : (s0, .., sn-1) array_like of bool, optional
        What is missing, too.

    Raises
    ------
    InputError
        If the mask has another shape or is not of bool, or nothing is left.
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
    """Find which samples of a field of real numbers are missing.

    Raises
    ------
    InputError
        If the mask has another shape or is not of bool.
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
    return gone


def check_field(
    field: ArrayLike, isovalue: object, step: float | None = None, gone: NDArray[np.bool_] | None = None
) -> Samples:
    """A field that can be encoded at an isovalue.

    Parameters
    ----------
    field : (s0, s1) or (s0, s1, s2) array_like of bool, integers or floats
    isovalue : number
        As `isovalue_of` takes it.
    step : float, optional
        For float data: the largest error of values sent, more exactly twice it.
    gone : (s0, .., sn-1) bool, optional
        Which samples are missing, of a field that has something in place of them: `without_holes`.

    Raises
    ------
    InputError
        If the field or the isovalue cannot be encoded; the message gives the reason.
    OptionError
        If the step is not a positive number, or the data are integers.
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
    """The field of a mask (spec clause 5.10.1): 1 where samples are valid, 0 where they are missing."""
    valid = ~gone
    return Samples(valid.view(np.uint8), 0.5, valid)


def interval_value(isovalue: float, scale: float | None, number: NDArray[Any], above: NDArray[Any]) -> NDArray[Any]:
    """Field values for numbers of steps (spec clause 2.3); inverse of ``Samples.numbers``."""
    if scale is None:
        t = math.floor(isovalue)
        return np.where(above, t + 1 + number, t - number).astype(np.float64)
    # a file may state any scale; an overflow to infinity is as good as no value
    with np.errstate(over="ignore"):
        return np.where(above, isovalue + scale * (number + 0.5), isovalue - scale * (number + 0.5))
