"""Times of the frames of a series: numbers, with or without a unit, and dates."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from datetime import date, datetime, timezone
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OptionError

TIME = "time"
"""Name of the note with the time of a frame: ``0.5``, ``6 h`` or ``2024-01-31T06:00``, in UTC."""
Time: TypeAlias = "float | str | date | np.datetime64"
_NUMBER = re.compile(r"(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)( (?P<unit>\S.*))?", re.ASCII)
_DATE = re.compile(r"-?\d{4,}-\d\d(-\d\d(T\d\d(:\d\d(:\d\d(\.\d{1,9})?)?)?)?)?", re.ASCII)


def time_text(time: Time) -> str:
    """Write a time as a note; raises `OptionError` if it is neither a finite number, with or without unit, nor a date.
    """
    text: Any = time
    if isinstance(time, datetime) and time.tzinfo is not None:
        time = time.astimezone(timezone.utc).replace(tzinfo=None)
    if isinstance(time, date | np.datetime64):
        text = str(np.datetime_as_string(np.datetime64(time), unit="auto"))
    elif isinstance(time, Real) and not isinstance(time, bool):
        text = repr(float(time)).removesuffix(".0")
    if not isinstance(text, str) or _parsed(text) is None:
        raise OptionError(f"the time {time!r} is neither a finite number nor a date", code="time",
                          remedy='for example 0.5, "6 h" or "2024-01-31T06:00"')
    return text


def time_texts(times: Sequence[Time] | None, count: int) -> list[str | None]:
    """Write the times of frames as notes, None without times; raises `InputError` if there is not one for each frame.
    """
    if times is not None and len(times) != count:
        raise InputError(f"{len(times)} times for {count} frames", code="time", remedy="give one for each frame")
    return [None] * count if times is None else [time_text(time) for time in times]


def times_of(texts: Iterable[str | None]) -> NDArray[Any] | None:
    """Read times, (F,) float64 or datetime64; None unless all are there, of one kind and in one unit."""
    found = [None if text is None else _parsed(text) for text in texts]
    if not found or None in found or len({each[1] for each in found if each}) > 1:
        return None
    return np.array([each[0] for each in found if each])


def _parsed(text: str) -> tuple[Any, str | None] | None:
    """The number or date that a note states, and the unit of a number, empty without one; None for another text."""
    if (match := _NUMBER.fullmatch(text)) and math.isfinite(float(match["number"])):
        return float(match["number"]), match["unit"] or ""
    try:
        return (np.datetime64(text), None) if _DATE.fullmatch(text) else None
    except ValueError:  # 30 February
        return None


def nearest(times: NDArray[Any], time: Time) -> int:
    """Number of the time nearest to another one, the first of several; raises `OptionError` if the kinds differ."""
    found = _parsed(time_text(time))
    assert found is not None
    if np.asarray(found[0]).dtype.kind != times.dtype.kind:
        kind = "dates" if times.dtype.kind == "M" else "numbers"
        raise OptionError(f"the time {time!r} cannot be compared with those of the frames, which are {kind}",
                          code="time", remedy=f"for example {times[0]}")
    return int(np.argmin(np.abs(times - found[0])))
