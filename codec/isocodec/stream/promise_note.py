"""The note of a file with the distances that it promises (spec clause 3.7.2)."""

from __future__ import annotations

from collections.abc import Mapping

from ..errors import OptionError
from ..field.placement import COORDINATE_UNIT
from ..field.units import distance_of, unit_of

PROMISE = "promise"
"""Name of the note with the distances that a file promises as they were asked for: ``4m,1m``."""
STEP = "step="
"""Prefix of a precision that is a step of values."""
AT = " at "
"""Precedes, in the note of a surface, the isovalues whose contours it was made for."""


def noted(metadata: Mapping[str, str]) -> tuple[list[str], list[float]]:
    """Distances in the note of a file, as they were asked for, and the isovalues that it is about, of a surface.

    Empty without a note, or with one that is something else.
    """
    text, at, values = metadata.get(PROMISE, "").partition(AT)
    parts = [part for part in text.split(",") if part and part != "exact"]
    try:
        for part in parts:
            distance_of(part)
        return parts, [float(value) for value in values.split()] if at else []
    except (OptionError, ValueError):
        return [], []


def noted_exact(metadata: Mapping[str, str]) -> bool:
    """Whether the note of a file states distances and, after them, exact values."""
    return metadata.get(PROMISE, "").endswith(",exact")


def noted_at_last(metadata: Mapping[str, str]) -> float | None:
    """The last distance in the note of a file on a mesh, in the unit of its points; None without a note, or if it has
    another unit.
    """
    parts, _ = noted(metadata)
    number, unit = distance_of(parts[-1]) if parts else (None, "")
    return number if unit in ("", unit_of(metadata.get(COORDINATE_UNIT))) else None


def last_promise(metadata: dict[str, str], keep: bool = False) -> dict[str, str]:
    """The notes without that of promises; or, if it is to be kept, with the last distance alone."""
    parts, _ = noted(metadata)
    out = {name: text for name, text in metadata.items() if name != PROMISE}
    return {**out, PROMISE: parts[-1]} if keep and parts else out
