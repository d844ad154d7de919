"""A series: fields of one shape, one after another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sized
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .missing import missing_samples
from .sampled import Field


@dataclass(frozen=True, eq=False)
class Frames:
    """A series of fields.

    Attributes
    ----------
    fields : iterable of Field or array_like
        All of one shape; each may be made only when it is asked for.
    step : str or None
        Time from one to the next with its unit, as ``1.5 s``; None if unknown.
    """

    fields: Iterable[Any]
    step: str | None = None


def value_range(fields: Iterable[Any], progress: Callable[[int, int], object] | None = None) -> tuple[float, float]:
    """Find the smallest and the largest sample of some fields, missing ones left out.

    Parameters
    ----------
    fields : iterable of Field or array_like
    progress : callable, optional
        Called with the number of fields read and of all, if there are several.

    Raises
    ------
    InputError
        If all samples are missing.
    """
    found = []
    count = len(fields) if isinstance(fields, Sized) else 0
    for number, each in enumerate(fields, 1):
        field = each if isinstance(each, Field) else Field(np.asarray(each))
        gone = missing_samples(field.values, None)
        valid = field.values[~(gone if field.mask is None else gone | field.mask)]
        if valid.size:
            found.append((float(valid.min()), float(valid.max())))
        if progress and count > 1:
            progress(number, count)
    if not found:
        raise InputError("all samples are missing", code="missing")
    return min(low for low, _ in found), max(high for _, high in found)
