"""Isovalues from what a user gives: numbers, or evenly spaced values over the range of the data."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isospec.container import MAX_ISOVALUES

from ..errors import InputError, OptionError
from .labelling import listed
from .samples import isovalue_of

Range = Callable[[], tuple[float, float]]
"""Finds the least and the largest sample of all frames."""
_NAMED = 6
"""Most isovalues that an error names."""
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_EVERY = re.compile(rf"every\s+({_NUMBER})(?:\s+from\s+({_NUMBER}))?")


def isovalues_of(given: object, ends: Range | None = None, most: int = MAX_ISOVALUES) -> list[float]:
    """Determine the isovalues of a file from a number, numbers, or a text.

    "every 20" means all multiples of 20 within the range of the data, "every 20 from 5" the same shifted by 5; only for
    these is ``ends`` called to find the range. Raises `InputError` if a file cannot hold an isovalue or no multiple
    lies within the range, and `OptionError` for no, too many or equal isovalues, if a text is not valid, or if
    the range is not known yet.
    """
    if isinstance(given, str):
        return list(_every(given, ends, most))
    if isinstance(given, bytes) or not isinstance(given, Sequence | np.ndarray) or np.shape(given) == ():
        return [isovalue_of(given)]
    values = [isovalue_of(value) for value in given]
    if not values:
        raise OptionError("no isovalue", code="isovalue", remedy="give one")
    if len(set(values)) < len(values):
        raise OptionError("an isovalue is given twice", code="isovalue", remedy="give each once")
    if len(values) > most:
        raise OptionError(f"{len(values):,} isovalues are given, but {_held(most)}", code="isovalue")
    return values


def _every(text: str, ends: Range | None, most: int) -> tuple[float, ...]:
    found = _EVERY.fullmatch(text.strip())
    interval = float(found[1]) if found else 0.0
    if found is None or not 0 < interval < math.inf:
        raise OptionError(f"{text!r} is not an isovalue", code="isovalue",
                          remedy='give a number, or "every 20 from 5"')
    if ends is None:
        raise OptionError(f"{text!r} needs the range of all frames before the first one is encoded", code="isovalue",
                          remedy="give the isovalues as numbers")
    return multiples(interval, *ends(), float(found[2] or 0), most)


def _held(most: int) -> str:
    return f"{'a file holds' if most == MAX_ISOVALUES else 'a map has'} at most {most:,}"


def multiples(
    interval: float, low: float, high: float, offset: float | None = None, most: int = MAX_ISOVALUES
) -> tuple[float, ...]:
    """Multiples of an interval that some samples lie above and others do not, increasing: for 0.1, 0.1, 0.2, 0.3 .. .

    ``low`` and ``high`` are the least and the largest sample. With an offset, multiples shifted by it. Raises
    `InputError` if no multiple lies within the range of the data, or more than ``most``.
    """
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError("the data hold infinite values", code="interval", remedy="give the isovalues as numbers")
    offset = offset or 0
    if low == high:
        raise InputError(f"the data are all {low:g}: they have no contours", code="interval")
    first, end = math.floor((low - offset) / interval), math.ceil((high - offset) / interval) + 1
    step, start = Decimal(repr(interval)), Decimal(repr(offset))
    near = (float(k * step + start) for k in range(first, min(end, first + most + 3)))
    out = tuple(value for value in near if low <= value < high)
    if len(out) > most:
        raise InputError(
            f"about {end - first - 1:,} multiples of {interval:g} lie within the data ({low:g} to {high:g}), but "
            f"{_held(most)}", code="interval", remedy="choose a larger interval",
        )
    if not out:
        raise InputError(
            f"no multiple of {interval:g} lies within the data ({low:g} to {high:g})", code="interval",
            remedy="choose a smaller interval",
        )
    return out


def range_of(samples: NDArray[Any]) -> tuple[float, float]:
    """Find the least and the largest of some samples; raises `InputError` if the array is empty."""
    if not samples.size:
        raise InputError("all samples are missing", code="missing")
    return float(samples.min()), float(samples.max())


def number_of(isovalue: float | None, isovalues: Sequence[float], noun: str = "isovalue") -> int:
    """Find the place of an isovalue among those of a file; 0 for None.

    Raises `OptionError`, naming the nearest ones, if the file does not have it.
    """
    if isovalue is None:
        return 0
    if isovalue not in isovalues:
        near = sorted(sorted(isovalues, key=lambda one: abs(one - isovalue))[:_NAMED])
        others = f", and {len(isovalues) - len(near):,} others" if len(near) < len(isovalues) else ""
        raise OptionError(f"the file has no {noun} {listed([isovalue])}", code="isovalue",
                          remedy=f"it has {listed(near, ', ')}{others}")
    return isovalues.index(isovalue)
