"""Which layers keep a promise in the fewest bytes (row S3-distortion; spec annex G).

A user states how far the decoded curve may lie from the original one, and whether its topology is to be kept. The
encoder reduces the mesh, chooses how finely crossings are told, draws what a decoder will draw, proves the distance
both ways, and puts vertices back where it is not proven.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from isospec.container import MAX_RADIX

from ..errors import OptionError
from ..layers.plan import PROMISE, Entry
from ..mesh.vertex_set import Chosen
from ..tube.truth import Place
from .promise import Promise
from .reduction import Reduction, distinct
from .tolerance import Slack, grid_offsets, pitches, radices

Plan = list[Entry]
_Found = tuple[float, Plan]
"""Bytes of the runs of a plan, and the plan."""
EXACT = 0.0
"""A step that asks for all values, to the last bit."""
BASE_CYCLES = 1
"""The default base has cubes of half the root's edge: refinements find what is small more cheaply than it does."""
MOST_REPAIRS, MOST_TIGHTENED = 64, 16
"""How often vertices are put back, and how often slack is taken back."""
LOOSE, BACK, SPACING = 2.0, 0.7, 1.0
"""Vertices are left out at first as long as the curve gets no farther than ``LOOSE`` tolerances from the original,
since the fit halves that where the curve bends, and strays no farther than ``BACK`` tolerances plus ``SPACING``."""
EDGES = 2.0, 16.0
"""Uniform meshes that are tried have edges longer than the one and at most as long as the other of these, in
tolerances."""
HOPELESS = 1.1
"""A reduced mesh that grows to this many times the smallest file so far is given up: another base may save some."""
LEAF = 0.25
"""Bytes that a leaf costs at least, with all that comes of it, where the curve is too far away."""
SHARES = {2: 1.0, 3: 0.25}
"""Of the leaves where it is, so many are bisected before points are fitted again: of surfaces that helps the others."""
EDGE = 1e-6
"""Share of a tolerance that is below its rounding."""


class NotKeptError(OptionError):
    """No plan was found that is proven to keep a promise."""


def _base(n: int, finest: int) -> int:
    """Level of the default base of a mesh that is nowhere finer than a level."""
    return min(BASE_CYCLES * n, finest)


def grid_plan(n: int, full: int, base_level: int | None) -> Plan:
    """Base and refinement to the full grid."""
    level = _base(n, full) if base_level is None else base_level
    if not 0 <= level <= full:
        raise OptionError(
            f"base level {level}; for this field it lies between 0 and {full}", code="base-level",
            remedy=f"the full grid is level {full}",
        )  # fmt: skip
    plan: Plan = [("base", level)]
    if level < full:
        plan.append(("refine", None))
    return plan


def smallest(promise: Promise, tolerance: float, topology: bool) -> Plan:
    """The plan with the fewest bytes, of those tried, whose decoded curve is proven to keep to the tolerance."""
    full = promise.full_level
    grids = [whole_mesh(promise, topology)]
    if topology:
        # one layer, which cannot go wrong
        grids.append([("base", full)])
    offsets = grid_offsets(tolerance, promise.free)
    best: _Found = (math.inf, [])
    for plan in [*([*grid, *offsets] for grid in grids), *grids]:
        best = _better(promise, tolerance, plan, best)
    best = _coarsest(promise, grids[0], tolerance, best)
    if not best[1]:
        raise NotKeptError(
            f"no plan was proven to keep to a tolerance of {tolerance:g}", code="tolerance", remedy="use a smaller one"
        )
    if full == 0:
        return best[1]
    helped = False
    for start, lead in () if topology else even_starts(promise, tolerance):
        found = _meshed(promise, tolerance, start, lead, best)
        if helped and found is best:
            # of even larger cubes the same would come
            break
        helped |= found is not best
        best = found
    return _meshed(promise, tolerance, loose_start(promise, tolerance, topology), [], best, topology)[1]


def _better(promise: Promise, tolerance: float, plan: Plan, best: _Found) -> _Found:
    """A plan, if it keeps to the tolerance in fewer bytes than the best so far, else that one."""
    size, contour = promise.trial(plan)
    return (size, plan) if size < best[0] and not len(promise.excess(contour, tolerance)) else best


def _meshed(
    promise: Promise, tolerance: float, start: Chosen, lead: Plan, best: _Found, topology: bool = False
) -> _Found:
    """The best plan, or a better one on a mesh to begin with; ``lead`` leads to a part of it."""
    for parts, unit in pitches(tolerance, promise.n):
        most = best[0] if lead else HOPELESS * best[0]
        kept = _repaired(promise, promise.reduction(start), tolerance, parts, unit, lead, fit=True, most=most)
        if kept is None:
            continue
        if kept.size < best[0]:
            best = kept.size, kept.plan
        coarse = _base(promise.n, promise.full_level)
        if not (lead or topology) and coarse < promise.full_level:
            # a coarse uniform base has vertices that the mesh may lack: proven anew
            best = _better(promise, tolerance, [("base", coarse), ("adapt", 1, kept.mesh), kept.plan[-1]], best)
    return best


def loose_start(promise: Promise, tolerance: float, topology: bool) -> Chosen:
    """A mesh to begin with that is coarse where the curve is flat."""
    reduction = promise.reduction()
    original = promise.target(BACK * tolerance + SPACING)
    reduction.reduce(topology=topology, distortion=LOOSE * tolerance, original=original)
    return reduction.chosen


def even_starts(promise: Promise, tolerance: float) -> Iterator[tuple[Chosen, Plan]]:
    """Uniform meshes to begin with, and what leads there, the finest first: even squares and cubes tell little.

    Where the tolerance is large against the domain, the coarsest.
    """
    most = promise.full_level // promise.n - 1
    for cycles in range(1, most + 1):
        if min(EDGES[0] * tolerance, (1 << most) - 1) < 1 << cycles <= EDGES[1] * tolerance:
            level = promise.full_level - cycles * promise.n
            uniform = promise.reduction()
            uniform.reduce(level=level)
            base = _base(promise.n, level)
            lead: Plan = [("base", base)]
            if base < level:
                lead.append(("refine", level - base))
            yield uniform.chosen, lead


def _coarsest(promise: Promise, grid: Plan, tolerance: float, best: _Found) -> _Found:
    """The best plan, or the full grid with crossings told as coarsely as can be, with slack also at a slant."""
    # as few parts as can be, even if in the worst case a crossing on their border is told a rounding too far away
    fewest = max(math.ceil(0.5 / tolerance * (1 - EDGE)), 1) | 1
    for radix in sorted({fewest, math.prod(radices(tolerance))} - {1}):
        slack = Slack(tolerance, promise.phi) if promise.free else None
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


@dataclass(frozen=True)
class _Kept:
    """A mesh and a layer of offsets that keep a promise, with the plan that leads there and the bytes of its runs."""

    size: int
    plan: Plan
    mesh: Chosen


def _repaired(
    promise: Promise, reduction: Reduction, tolerance: float, parts: int, unit: int, lead: Sequence[Entry] = (), *,
    fit: bool = False, most: float = math.inf, within: Chosen | None = None,
) -> _Kept | None:  # fmt: skip
    """A mesh as reduced, with vertices of ``within`` put back until the promise is kept; None if it cannot be.

    Points lie where the field crosses the edges, or with ``fit`` where they do best. Plans of more than ``most`` bytes
    are given up. ``lead`` leads to a part of the mesh; without one it is a base.
    """
    place: Place | None = None
    for _ in range(MOST_REPAIRS):
        if fit:
            place = promise.placed(reduction.chosen, parts, unit, tolerance, place)
        mesh: Entry = ("adapt", 1, reduction.chosen) if lead else ("adaptive_base", 0, reduction.chosen)
        plan = [*lead, mesh, ("offsets", parts, unit, place)]
        size, contour = promise.trial(plan)
        if size > most:
            return None
        places = promise.excess(contour, tolerance)
        if not len(places):
            return _Kept(size, plan, reduction.chosen)
        leaves = reduction.leaves_at(places)
        hopeless = size + LEAF * len(distinct(promise.n, leaves)[0]) > most
        if hopeless or not reduction.restore(places, within, SHARES[promise.n] if fit else 1.0, leaves):
            return None
    return None


def stepwise(promise: Promise, steps: Sequence[float], topology: bool) -> Plan:
    """Layers that promise one distance after the other; the last step may be ``EXACT``."""
    if any(not later < step for step, later in pairwise(steps)):
        raise OptionError("the steps must fall", code="steps", remedy="for example 4, 1, 0.25")
    if promise.full_level == 0:
        last = [("values", None)] if steps[-1] == EXACT else [("offsets", r) for r in radices(steps[-1])]
        return [("base", 0), *last]
    if len(steps) == 1 and steps[0] != EXACT:
        return [*smallest(promise, steps[0], topology), (PROMISE, steps[0])]
    distances = [step for step in steps if step != EXACT]
    meshes = _nested(promise, distances, topology)
    plan: Plan = []
    full = False
    for i, tolerance in enumerate(distances):
        # where the mesh of this step does not do it after all: those of later steps, which have all its vertices
        for j in range(i, len(meshes)):
            within = meshes[j + 1][0] if j + 1 < len(meshes) else None
            entries = None if full else _kept(promise, plan, *meshes[j], tolerance, topology, within)
            if entries is not None:
                meshes[i:j] = meshes[j : j + 1] * (j - i)
                break
        else:
            if not full:
                plan += [("refine", None)] if plan else whole_mesh(promise, topology)
            full = True
            entries = [("offsets", radix) for radix in radices(tolerance)]
            if len(promise.excess(promise.trial([*plan, *entries])[1], tolerance)):
                raise NotKeptError(f"no mesh keeps to the step {tolerance:g}", code="steps", remedy="leave it out")
        plan += [*entries, (PROMISE, tolerance)]
    if steps[-1] == EXACT:
        if not full:
            plan += [("refine", None)] if plan else whole_mesh(promise, topology)
        plan.append(("values", None))
    return plan


def _nested(promise: Promise, distances: Sequence[float], topology: bool) -> list[tuple[Chosen, int, int]]:
    """A mesh with parts and unit of its offsets for each distance, each mesh part of the next one."""
    meshes: list[tuple[Chosen, int, int]] = []
    start: Chosen | None = None
    for tolerance in reversed(distances):
        found = []
        for parts, unit in pitches(tolerance, promise.n):
            reduction = promise.reduction(start)
            original = promise.target(tolerance)
            reduction.reduce(topology=topology, distortion=tolerance, original=original, parts=parts, unit=unit)
            kept = _repaired(promise, reduction, tolerance, parts, unit, within=start)
            if kept is not None:
                found.append((kept.size, parts, unit, kept.mesh))
        if found:
            _, parts, unit, start = min(found, key=lambda x: x[:3])
            meshes.append((start, parts, unit))
        elif meshes:
            meshes.append(meshes[-1])
    return meshes[::-1]


def _kept(
    promise: Promise, before: Plan, mesh: Chosen, parts: int, unit: int, tolerance: float, topology: bool,
    within: Chosen | None,
) -> Plan | None:  # fmt: skip
    """Entries that lead to a mesh and keep to the tolerance there, in the fewest bytes, None if none were found.

    Crossings that were told before are divided further, which moves them: proven as they come out. The mesh may get
    finer for it, within that of the next step.
    """
    best: Plan | None = None
    fewest: float = math.inf
    for finer in (parts, 3 * parts | 1, 9 * parts | 1, MAX_RADIX):
        chosen = mesh
        for _ in range(MOST_REPAIRS):
            step = ("adapt", 0 if topology else 1, chosen) if before else ("adaptive_base", 0, chosen)
            entries: Plan = [step, ("offsets", min(finer, MAX_RADIX), unit)]
            size, contour = promise.trial([*before, *entries])
            if size >= fewest:
                break
            places = promise.excess(contour, tolerance)
            if not len(places):
                best, fewest = entries, size
                break
            reduction = promise.reduction(chosen)
            if not reduction.restore(places, within):
                break
            chosen = reduction.chosen
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


def within(promise: Promise, distance: float, topology: bool, geometry: Plan, told: tuple[int, int], grid: Plan) -> Plan:
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
    best: _Found = (math.inf, [])
    for _ in range(MOST_REPAIRS):
        plan: Plan = [("adaptive_base", 0, reduction.chosen), *geometry]
        size, contour = promise.trial(plan)
        places = promise.excess(contour, distance)
        if not len(places):
            best = size, plan
            break
        if not reduction.restore(places):
            break
    best = _better(promise, distance, grid, best)
    if not best[1]:
        raise NotKeptError(
            f"no mesh was proven to keep to a distortion of {distance:g}", code="criterion",
            remedy="use a larger one, or tell crossings more finely",
        )  # fmt: skip
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
                    f"the level is {parameter:g}, needed is a whole number up to that of the full grid, "
                    f"{promise.full_level}", code="criterion",
                )  # fmt: skip
            reduction.reduce(topology=topology, level=int(parameter))
        case "curvature", float():
            reduction.reduce(topology=topology, curvature=promise.curvature(), kappa=parameter)
        case "distortion", float():
            reduction.reduce(topology=topology, distortion=parameter, original=promise.target(parameter))
        case _:
            raise OptionError(
                f"unknown criterion {criterion!r}", code="criterion",
                remedy="crossing, curvature, distortion, topology or level",
            )  # fmt: skip
    return [("adaptive_base", 0, reduction.chosen)]
