"""Mapped grids on the command line: what the input says of coordinates and what options add to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .report import warn

if TYPE_CHECKING:
    from ..field.placement import Placement
    from ..stream.options import Options


def read_tolerance(text: str | None) -> float | None:
    """A number of cells; None of a distance with a unit, which takes a field to be one."""
    if text is None:
        return None
    from ..field.stretch import distance_of

    number, unit = distance_of(text)
    return None if unit else number


def world_of(
    source: Path, shape: tuple[int, ...], place: Placement, options: Options, error: float | None,
    periodic: Sequence[int], periods: Sequence[float] | None,
) -> Placement | None:
    """Where samples lie, by the input and the options.

    Axes that are periodic by the input alone are left as they are, with a warning, where the options choose a mesh.
    """
    from ..field.placement import Placement

    if place.coordinates is None or place.grid != shape:
        if place.coordinates is not None or not (place.placed or error or periods or periodic):
            place = Placement()
        found = replace(place, crs=None, remark="", periodic=tuple(periodic), periods=tuple(periods or ()), error=error)
        return found if found.placed or found.periodic else None
    found = replace(place, crs=None, remark="", error=error)
    if periods is not None:
        found = replace(found, periods=tuple(periods))
    if periodic:
        found = replace(found, periodic=tuple(periodic), inferred=False)
    if found.inferred and found.periodic and options.chooses_mesh:
        axis = found.periodic[0]
        warn(source, f"its ends along axis {axis} are not joined, as --{options.chooses_mesh} chooses a mesh")
        return replace(found, periodic=())
    return found
