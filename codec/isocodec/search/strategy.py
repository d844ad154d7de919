"""Plans of layers that keep a promise (row S3-distortion; spec annex G); `choice` takes the smallest.

A user states how far the decoded curve may lie from the original one, and whether its topology is to be kept. The
encoder reduces the mesh, chooses how finely crossings are stored, draws what a decoder will draw, proves the distance
both ways, and puts vertices back where it is not proven.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from isospec.container import MAX_RADIX

from ..errors import OptionError
from ..grid.lattice.vertex_set import Chosen
from .promise import Promise
from .repair import MOST_REPAIRS, Plan
from .tolerance import EDGE, Slack, grid_offsets, radices

Found = tuple[float, Plan]
"""Bytes of the runs of a plan, and the plan."""
BASE_CYCLES = 1
"""The default base has cubes of half the root's edge: refinements find what is small more cheaply than it does."""
MOST_TIGHTENED = 16
"""Number of times that slack is taken back."""
LOOSE, BACK, SPACING = 2.0, 0.7, 1.0
"""Vertices are left out at first as long as the curve gets no farther than ``LOOSE`` tolerances from the original,
since the fit halves that where the curve bends, and strays no farther than ``BACK`` tolerances plus ``SPACING``."""
EDGES = 2.0, 16.0
"""Uniform meshes that are tried have edges longer than the one and at most as long as the other of these, in
tolerances."""
HOPELESS = 1.1
"""A reduced mesh that grows to this many times the smallest file so far is given up: another base may save some."""
HEADERS = 8
"""Bytes by which files with the same runs may differ."""


class NotKeptError(OptionError):
    """No plan was found that is proven to keep a promise."""


def base_of(n: int, finest: int) -> int:
    """Level of the default base of a mesh that is nowhere finer than a level."""
    return min(BASE_CYCLES * n, finest)


def grid_plan(n: int, full: int, base_level: int | None) -> Plan:
    """Base and refinement to the full grid."""
    level = base_of(n, full) if base_level is None else base_level
    if not 0 <= level <= full:
        raise OptionError(
            f"the base level is {level}; for this field it must lie between 0 and {full}", code="base-level",
            remedy=f"the full grid is level {full}",
        )
    plan: Plan = [("base", level)]
    if level < full:
        plan.append(("refine", None))
    return plan


def grids(promise: Promise, tolerance: float, topology: bool) -> Found:
    """The plan to the full grid with the fewest bytes; without layers if none keeps to the tolerance."""
    grid = [whole_mesh(promise, topology)]
    if topology:
        # one layer, which cannot go wrong
        grid.append([("base", promise.full_level)])
    offsets = grid_offsets(tolerance, promise.free, promise.fixed)
    best: Found = (math.inf, [])
    for plan in [*([*each, *offsets] for each in grid), *grid]:
        best = better(promise, tolerance, plan, best)
    return _coarsest(promise, grid[0], tolerance, best)


def better(promise: Promise, tolerance: float, plan: Plan, best: Found) -> Found:
    """A plan, if it keeps to the tolerance in fewer bytes than the best so far, else that one."""
    size, contour = promise.trial(plan)
    return (size, plan) if size < best[0] and not len(promise.excess(contour, tolerance)) else best


def loose_start(promise: Promise, tolerance: float, topology: bool) -> Chosen:
    """A mesh to begin with that is coarse where the curve is flat."""
    reduction = promise.reduction()
    original = promise.target(BACK * tolerance + SPACING)
    reduction.reduce(topology=topology, distortion=LOOSE * tolerance, original=original)
    return reduction.chosen


def even_exponents(promise: Promise, tolerance: float) -> Iterator[int]:
    """Exponents of the edges of uniform meshes to begin with, the finest first: even squares and cubes code little.

    Where the tolerance is large against the domain, the coarsest.
    """
    most = promise.full_level // promise.n - 1
    for exponent in range(1, most + 1):
        if min(EDGES[0] * tolerance, (1 << most) - 1) < 1 << exponent <= EDGES[1] * tolerance:
            yield exponent


def even_start(promise: Promise, exponent: int) -> tuple[Chosen, Plan]:
    """A uniform mesh of an edge to begin with, and what leads there."""
    level = promise.full_level - exponent * promise.n
    uniform = promise.reduction()
    uniform.reduce(level=level)
    base = base_of(promise.n, level)
    lead: Plan = [("base", base)]
    if base < level:
        lead.append(("refine", level - base))
    return uniform.chosen, lead


def even_starts(promise: Promise, tolerance: float) -> Iterator[tuple[Chosen, Plan]]:
    """Uniform meshes to begin with, and what leads there."""
    for exponent in even_exponents(promise, tolerance):
        yield even_start(promise, exponent)


def _coarsest(promise: Promise, grid: Plan, tolerance: float, best: Found) -> Found:
    """The best plan, or the full grid with crossings stored as coarsely as can be, with slack also at a slant."""
    # as few parts as can be, even if in the worst case a crossing on their border is stored a rounding too far away
    fewest = max(math.ceil(0.5 / tolerance * (1 - EDGE)), 1) | 1
    for radix in sorted({fewest, math.prod(radices(tolerance))} - {1}):
        slack = Slack(tolerance, promise.phi, promise.fixed) if promise.free else None
        for _ in range(MOST_TIGHTENED if radix <= MAX_RADIX else 0):
            plan: Plan = [*grid, ("offsets", radix, 0, None, slack)]
            size, contour = promise.trial(plan)
            if size >= best[0]:
                break
            places = promise.excess(contour, tolerance)
            if not len(places):
                best = size, plan
            if not len(places) or slack is None:
                break
            slack.tighten(places)
    return best


def whole_mesh(promise: Promise, topology: bool, base_level: int | None = None) -> Plan:
    """To the full grid, by way of meshes that all have the right topology if that is asked for.

    With topology a base of a uniform level is finer where that needs it.
    """
    grid = grid_plan(promise.n, promise.full_level, base_level)
    if not topology:
        return grid
    reduction = promise.reduction()
    reduction.reduce(topology=True, level=base_level)
    return [("adaptive_base", 0, reduction.chosen)] + ([("refine", None)] if promise.full_level else [])


def within(
    promise: Promise, distance: float, topology: bool, geometry: Plan, told: tuple[int, int], grid: Plan
) -> Plan:
    """The mesh of the criterion distortion: greedily reduced, with vertices put back where the proof fails in the end.

    Parameters
    ----------
    geometry : plan
        Layers that follow on the mesh.
    told : (parts, unit)
        How points are known after these, as `Reduction.reduce` takes it.
    grid : plan
        A file on the full grid, which is taken if it is smaller and keeps to the distance, too.
    """
    reduction = promise.reduction()
    original = promise.target(distance)
    parts, unit = told
    reduction.reduce(topology=topology, distortion=distance, original=original, parts=parts, unit=unit)
    best: Found = (math.inf, [])
    for _ in range(MOST_REPAIRS):
        plan: Plan = [("adaptive_base", 0, reduction.chosen), *geometry]
        size, contour = promise.trial(plan)
        places = promise.excess(contour, distance)
        if not len(places):
            best = size, plan
            break
        if not reduction.restore(places):
            break
    # headers differ by a few bytes, which trials do not count
    best = better(promise, distance, grid, (best[0] + HEADERS, best[1]))
    if not best[1]:
        raise NotKeptError(
            f"no mesh was proven to stay within a distortion of {distance:g} cells", code="criterion",
            remedy="allow a larger distortion, or store crossings more precisely",
        )
    return best[1]


def reduced(promise: Promise, criterion: str, parameter: float | None, topology: bool) -> Plan:
    """A base on a mesh reduced under one criterion, as published; under distortion as `within` begins."""
    if criterion in ("crossing", "topology") and parameter is not None:
        raise OptionError(f"the criterion {criterion} takes no number", code="criterion")
    if criterion in ("curvature", "distortion", "level") and parameter is None:
        raise OptionError(f"the criterion {criterion} needs a number", code="criterion")
    reduction = promise.reduction()
    match criterion, parameter:
        case "crossing", _:
            reduction.reduce(topology=topology, crossing=True)
        case "topology", _:
            reduction.reduce(topology=True)
        case "level", float():
            if not (parameter.is_integer() and parameter <= promise.full_level):
                raise OptionError(
                    f"the level {parameter:g} is not an integer up to that of the full grid, "
                    f"{promise.full_level}", code="criterion",
                )
            reduction.reduce(topology=topology, level=int(parameter))
        case "curvature", float():
            reduction.reduce(topology=topology, curvature=promise.curvature(), kappa=parameter)
        case "distortion", float():
            reduction.reduce(topology=topology, distortion=parameter, original=promise.target(parameter))
        case _:
            raise OptionError(
                f"unknown criterion {criterion!r}", code="criterion",
                remedy="crossing, curvature, distortion, topology or level",
            )
    return [("adaptive_base", 0, reduction.chosen)]
