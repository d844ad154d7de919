"""Choice of points and values of a coded surface: to an error, to a number of points, to a size of the file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..tin.criteria import AT1, SQUARED
from ..tin.fewest_points import fewest
from ..tin.fitting import fit
from ..tin.points import Points
from ..tin.swapping import ROUNDS, exchange
from ..tin.thinning import Thinning, thin_to, thinning

MOST_PALETTE = 24
"""Values that a field has at most, for its points to have no others."""
_BITS = 10.8
"""Bits of a point and its value, about."""
_STEP = 1.25
"""Step of values, in roots of the mean squared error without steps: found on pictures."""
_TRIES = 8
_TRIED = 1, 10, 3
"""Rounds of exchange for each, and for all later ones."""
_PARTS = 1 << 20
"""Parts of the range of values that entries of a palette are rounded to, if they are no whole numbers."""
_CLOSE = 0.985
"""A file that takes this much of the bytes that it may is good enough."""
_SWEEPS = 8
_ROUNDS = 6
"""Rounds in which points are put back and others taken out, within an error."""
_PIECE = 1 << 16
_LARGEST = (1 << 16) - 1


@dataclass(frozen=True)
class ChosenPoints:
    """Points by rank and the numbers of their values.

    Attributes
    ----------
    some : (K,) int64
        Which of the points are kept.
    numbers : (K,) int64
    offset, step : float
    palette : tuple of int
    largest : int
    squared : float
        Mean of squared errors of the surface.
    fitted : bool
        Whether values were fitted by least squares, and may be again.
    """

    some: NDArray[np.int64]
    numbers: NDArray[np.int64]
    offset: float
    step: float
    palette: tuple[int, ...]
    largest: int
    squared: float = 0.0
    fitted: bool = False


def within(given: Points, error: float) -> ChosenPoints:
    """Points such that the surface misses no value by more than an error.

    Values are rounded to steps of the error first; the error is held against what was given.
    """
    low, high = float(given.value.min()), float(given.value.max())
    step = error
    if step <= 0 or (high - low) / step > _LARGEST:
        step = _exact_step(given.value, low, high)
    number = np.rint((given.value - low) / step)
    value = low + step * number
    state = thinning(given.x, given.y, value.copy(), AT1, given.value)
    _thin(state, 0, error)
    some = fewest(state, value, error, _ROUNDS)
    return ChosenPoints(some, number[some].astype(np.int64), low, step, (), int(number.max()))


def evenly(given: Points, step: float | None, exact: bool) -> ChosenPoints:
    """All points, with values in steps: as fine ones as a file has, if none is given; errors are half a step.

    Raises
    ------
    OptionError
        If a file has no steps as fine, or none that hold the values exactly.
    """
    low, high = float(given.value.min()), float(given.value.max())
    finest = _exact_step(given.value, low, high)
    if step is None:
        step = finest
        if exact and not np.array_equal(given.value, np.rint(given.value)):
            raise OptionError("precision 'exact' is for whole values", code="exact", remedy="use step=..")
    if not (math.isfinite(step) and step > 0) or (high - low) / step > _LARGEST:
        raise OptionError(f"steps of {step:g} are too fine for values from {low:g} to {high:g}", code="step",
                          remedy=f"at least {(high - low) / _LARGEST:g}")
    number = np.rint((given.value - low) / step).astype(np.int64)
    return ChosenPoints(np.arange(len(number)), number, low, step, (), int(number.max()))


def _exact_step(value: NDArray[np.float64], low: float, high: float) -> float:
    """A step that holds all values exactly, if they are whole; else a 65,535th of their range."""
    if np.array_equal(value, np.rint(value)) and high - low <= _LARGEST:
        return 1.0
    return max(high - low, 1e-300) / _LARGEST


def best(given: Points, count: int, step: float | None) -> ChosenPoints:
    """So many points whose surface has the least squared error."""
    tried = [search.chosen(count, step, ROUNDS) for search in _searches(given, step)]
    return min(tried, key=lambda each: each.squared)


def smallest(given: Points, size: int, encode: Callable[[ChosenPoints], bytes], step: float | None) -> ChosenPoints:
    """Choose as many points as a file of so many bytes has room for."""
    found = [_filling(given, search, size, encode, step) for search in _searches(given, step)]
    fitting = [each for each in found if len(encode(each)) <= size] or found[:1]
    return min(fitting, key=lambda each: each.squared)


def _searches(given: Points, step: float | None) -> list[_Squared]:
    """Searches with fitted values, and, of fields with few values, with these only."""
    few = step is None and len(np.unique(given.value)) <= MOST_PALETTE
    return [_Squared(given, False), _Squared(given, True)] if few else [_Squared(given, False)]


def _filling(
    given: Points, search: _Squared, size: int, encode: Callable[[ChosenPoints], bytes], step: float | None
) -> ChosenPoints:
    """Choose as many points as a file of so many bytes has room for, by one search."""
    count = max(int(8 * size / _BITS), 3)
    found: ChosenPoints | None = None
    for turn in range(_TRIES):
        # the first ones find out how many points there is room for
        tried = search.chosen(count, step, _TRIED[min(turn, len(_TRIED) - 1)])
        took = len(encode(tried))
        if took <= size:
            found = tried
            if turn > 0 and (took >= _CLOSE * size or count >= len(given.x)):
                break
        # a little less than what seems to fit
        count = max(min(int(count * (size / took - 0.002)), len(given.x)), 3)
        if turn > 0 and found is not None and count <= len(found.some):
            break
    if found is None:
        found = search.chosen(3, step, 0)
    return found


class _Squared:
    """Surfaces of falling numbers of points, with the least squared error that was found."""

    def __init__(self, given: Points, few: bool) -> None:
        self._given, self._few = given, few
        self.low, self.high = float(given.value.min()), float(given.value.max())
        self._state: Thinning | None = None

    def chosen(self, count: int, step: float | None, rounds: int) -> ChosenPoints:
        """So many points after rounds of exchange, values fitted in steps."""
        given = self._given
        state = self._state
        if state is None or state.reg.count < count:
            state = thinning(given.x, given.y, given.value.copy(), SQUARED, given.value)
            _thin(state, count, math.inf)
        exchange(state, count, self.low, self.high, rounds, not self._few)
        self._state = state
        s = state.surface
        mean = float((s.error**2).mean())
        if self._few:
            return self._of_few(np.flatnonzero(s.tri.leaving >= 0), mean)
        if step is None:
            step = max(_STEP * math.sqrt(mean), (self.high - self.low) / _LARGEST, 1e-300)
            step = _rounded(step)
        value, error = s.value.copy(), s.error.copy()
        steps = min(max(math.ceil((self.high - self.low) / step - 0.25), 1), _LARGEST)
        top = self.low + steps * step
        fit(s, self.low, top, step, _SWEEPS)
        some = np.flatnonzero(s.tri.leaving >= 0)
        number = np.rint((s.value[some] - self.low) / step).astype(np.int64)
        mean = float((s.error**2).mean())
        s.value[:], s.error[:] = value, error
        return ChosenPoints(some, number, self.low, step, (), steps, mean, True)

    def _of_few(self, some: NDArray[np.int64], mean: float) -> ChosenPoints:
        """Points with the values that they were given."""
        there, number = np.unique(self._given.value[some], return_inverse=True)
        whole = np.array_equal(there, np.rint(there)) and np.ptp(there) < _PARTS
        step = 1.0 if whole else max(float(np.ptp(there)) / _PARTS, 1e-300)
        palette = tuple(np.rint((there - there[0]) / step).astype(np.int64).tolist())
        return ChosenPoints(some, number.astype(np.int64), float(there[0]), step, palette, len(there) - 1, mean)


def _rounded(step: float) -> float:
    """A number of few binary digits."""
    mantissa, exponent = math.frexp(step)
    return math.ldexp(round(mantissa * 16), exponent - 4)


def _thin(state: Thinning, count: int, error: float) -> None:
    while not thin_to(state, count, error, _PIECE):
        pass
