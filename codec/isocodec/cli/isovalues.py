"""Isovalues in even steps, as ``--interval`` asks for them."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LINES = 25
"""Isovalues at most where no interval is given."""


def check_interval(interval: float | None, offset: float | None) -> None:
    """That an interval is one, and an offset has one."""
    if interval is not None and not 0 < interval < math.inf:
        raise click.UsageError(f"--interval {interval}: must be greater than 0")
    if offset is not None and interval is None:
        raise click.UsageError("--offset goes with --interval")
    if offset is not None and not math.isfinite(offset):
        raise click.UsageError(f"--offset {offset}: must be finite")


def usual_interval(samples: NDArray[Any]) -> float:
    """A round interval of which about twenty multiples lie within the data; of integers a whole one."""
    low, high = _finite(*range_of(samples))
    least = max((high - low) / _LINES, 1e-300)
    power = 10.0 ** math.floor(math.log10(least))
    interval = next(k * power for k in (1, 2, 5, 10) if k * power >= least)
    return max(interval, 1) if samples.dtype.kind in "biu" else interval


def range_of(samples: NDArray[Any]) -> tuple[float, float]:
    """The least and the largest of some samples."""
    return float(samples.min()), float(samples.max())


def _finite(low: float, high: float) -> tuple[float, float]:
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError("the data hold infinite values", code="interval", remedy="use --isovalue")
    return low, high


def multiples(interval: float, low: float, high: float, offset: float | None = None) -> tuple[float, ...]:
    """Multiples of an interval with samples above and not above them, rising; of 0.1 they are 0.1, 0.2, 0.3 .. .

    ``low`` and ``high`` are the least and the largest sample. With an offset, so much more than multiples.

    Raises
    ------
    InputError
        If there are none, or more than a file holds.
    """
    from isospec.container import MAX_ISOVALUES

    low, high = _finite(low, high)
    offset = offset or 0
    first, end = math.floor((low - offset) / interval), math.ceil((high - offset) / interval) + 1
    step, start = Decimal(repr(interval)), Decimal(repr(offset))
    near = (float(k * step + start) for k in range(first, min(end, first + MAX_ISOVALUES + 3)))
    out = tuple(value for value in near if low <= value < high)
    if len(out) > MAX_ISOVALUES:
        raise InputError(
            f"about {end - first - 1:,} multiples of {interval:g} lie within the data ({low:g} to {high:g}); a file "
            f"holds at most {MAX_ISOVALUES}", code="interval", remedy="choose a larger interval",
        )
    if not out:
        raise InputError(
            f"no multiple of {interval:g} lies within the data ({low:g} to {high:g})", code="interval",
            remedy="choose a smaller interval",
        )
    return out
