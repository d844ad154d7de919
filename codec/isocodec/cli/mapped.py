"""Mapped grids on the command line: what the input says of coordinates and what options add to it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .report import warn

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..io.readers.place_of_samples import MappedPlace
    from ..stream.options import Options


def read_tolerance(text: str | None) -> float | None:
    """A number of cells; None of a distance with a unit, which takes a field to be one."""
    if text is None:
        return None
    from ..field.stretch import distance_of

    number, unit = distance_of(text)
    return None if unit else number


def cells_of(
    distance: str, field: ArrayLike, hole: ArrayLike | None, mapped: MappedPlace | None, placement: ArrayLike | None,
    period: Sequence[float] | None,
) -> float:
    """How many cells a distance in the world is at least."""
    from ..stream.placing import GivenWorld

    coordinates = None if mapped is None else mapped.coordinates
    periods = None if mapped is None else period or mapped.period
    return GivenWorld(coordinates, None, None, periods).cells_of(distance, field, hole, placement)


def world_of(
    source: Path, shape: tuple[int, ...], mapped: MappedPlace | None, placement: ArrayLike | None, options: Options,
    error: float | None, periodic: Sequence[int], period: Sequence[float] | None,
) -> dict[str, Any]:
    """Options of an encoder about where samples lie: a placement, or coordinates with their periods.

    Axes that are periodic by the input alone are left as they are, with a warning, where the options choose a mesh.
    """
    if mapped is None and periodic:
        return {
            "coordinates": None if placement is None else _by_matrix(placement, shape), "coordinates_error": error,
            "periodic": tuple(periodic), "period": period,
        }
    if mapped is None or shape != _shape(mapped.coordinates, shape):
        return {"placement": placement, "coordinates_error": error, "period": period}
    axes: Sequence[int] = tuple(periodic) or mapped.periodic
    if axes and not periodic and options.chooses_mesh:
        warn(source, f"its ends along axis {axes[0]} are not joined, as --{options.chooses_mesh} chooses a mesh")
        axes = ()
    return {
        "coordinates": mapped.coordinates, "coordinates_error": error, "periodic": axes or None,
        "period": mapped.period if period is None else period,
    }


def _shape(coordinates: Sequence[Any], shape: tuple[int, ...]) -> tuple[int, ...]:
    """The shape that coordinates broadcast to; another one than the field's where they do not."""
    return tuple(max(one.shape[axis] for one in coordinates) for axis in range(len(shape)))


def _by_matrix(placement: ArrayLike, shape: tuple[int, ...]) -> list[Any]:
    """Coordinates that a placement stands for."""
    import numpy as np

    from ..field.placement import placement_of

    n = len(shape)
    matrix = placement_of(placement, n)
    steps = [np.arange(size).reshape([-1 if a == axis else 1 for a in range(n)]) for axis, size in enumerate(shape)]
    out = []
    for row in matrix:
        parts = [row[axis] * steps[axis] for axis in range(n) if row[axis] != 0]
        out.append(row[n] + sum(parts[1:], start=parts[0]))
    return out
