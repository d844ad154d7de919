"""The plan of an isovalue's layers that the options of a file ask for; `search` finds the meshes (docs/encoders.md)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..errors import OptionError
from ..format.kinds import LayerKind
from ..grid.layers.plan import Entry
from ..search import strategy
from ..search.promise import Promise
from ..search.reduced import LINEAR_POINTS
from ..search.steps import stepwise
from ..search.tolerance import NO_OFFSETS, grid_offsets, radices
from .grid_file import GridFile
from .options import BEST, SEARCHED
from .plan_meshes import with_meshes

FINE_SHARE = 0.25
"""With the criterion distortion, crossings are stored to within this fraction of its distance, or more precisely."""


def plan_of(
    file: GridFile, number: int, lean_level: int, promise_of: Callable[[], Promise], base: int | None = None
) -> Sequence[Entry]:
    """Make the plan of an isovalue.

    Parameters
    ----------
    file : GridFile
    number : int
        Number of the isovalue.
    lean_level : int
        Uniform level of the isovalue that it is predicted from, -1 without one.
    promise_of : callable
        Makes the original curve, and trial encodings; called only if a mesh is to be found.
    base : int, optional
        Level of a base on the way to the full grid, unless the options state one.

    Raises
    ------
    OptionError
        If there is no such plan; `strategy.NotKeptError` if none was found.
    """
    o = file.options
    given = o.layers.plan_for(file.series.isovalues[number])
    if given is not None:
        if not len(given) and number == len(file.series.isovalues) - 1:
            raise OptionError("the plan has no layers", code="plan", remedy='begin it with ("base", level)')
        return with_meshes(given, file.full_level, lean_level, promise_of)
    level = o.layers.level
    behind = file.geometry[number] if file.geometry is not None else [
        *file.values, *grid_offsets(file.fine, file.free and not file.periodic)
    ]
    if file.on_grid or (level is not None and not o.keep_topology):
        return [*strategy.grid_plan(len(file.header.shape), file.full_level, base if level is None else level), *behind]
    promise = promise_of()
    if o.precision.steps is not None:
        for step in o.precision.steps:
            if 0 < step < SEARCHED:
                raise OptionError(
                    f"a sequence has a distance of {step:.3g} cells; each must be at least {SEARCHED:g} cells",
                    code="steps", remedy="leave it out; the last one may be exact or step=..",
                )
        return stepwise(promise, o.precision.steps, o.keep_topology)
    if o.layers.criterion is not None:
        return _under_criterion(file, promise, o.layers.criterion, o.layers.parameter)
    if file.searched is not None and level is None:
        return strategy.smallest(promise, file.searched, o.keep_topology, thorough=o.effort == BEST)
    return [*strategy.whole_mesh(promise, True, level), *behind]


def _under_criterion(file: GridFile, promise: Promise, criterion: str, parameter: float | None) -> Sequence[Entry]:
    """Make layers on a mesh under a criterion; under distortion, points are precise enough unless that is asked for."""
    o, fine, values = file.options, file.fine, file.values
    within = criterion == "distortion" and bool(parameter)
    if within and fine is not None and not o.precision.tolerance:
        fine = min(fine, FINE_SHARE * float(parameter or 0))
    geometry = [*values, *((LayerKind.OFFSETS, radix, 0) for radix in radices(fine))]
    if not within or parameter is None:
        return [*strategy.reduced(promise, criterion, parameter, o.keep_topology), *geometry]
    known = (LINEAR_POINTS, 0) if values else NO_OFFSETS if fine is None else (math.prod(radices(fine)), 0)
    grid = [
        *strategy.whole_mesh(promise, o.keep_topology), *values, *grid_offsets(fine, file.free, promise.fixed)
    ]
    return strategy.within(promise, parameter, o.keep_topology, geometry, known, grid)
