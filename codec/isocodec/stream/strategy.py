"""Which layers keep a promise in the fewest bytes (row S3-distortion; spec annex G).

A user states how far the decoded curve may lie from the original one, and whether its topology is to be kept. The
encoder reduces the mesh, chooses how finely crossings are told, draws what a decoder will draw, proves the distance
both ways, and puts vertices back where it is not proven.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from dataclasses import field as derived
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isospec.container import MAX_RADIX, Profile

from ..contour import Contour, Leaves, draw
from ..errors import OptionError
from ..grid.field import OFFSET_BITS, Field
from ..mesh.chosen import Chosen
from ..mesh.tables import cube_exponent
from ..passes.snapshot import leaves_of
from ..passes.state import WORK
from ..passes.tube import Tube
from ..reduce.distance import Target
from ..reduce.fit import AGAIN, ROUNDS, fitted_offsets
from ..reduce.original import original
from ..reduce.reduction import Reduction
from .crossings import Slack, grid_offsets, pitches, radices
from .header import Header
from .program import Progress
from .strand import Entry, Place, Strand, field_tube

Plan = list[Entry]

EXACT = 0.0
"""A step that asks for all values, to the last bit."""
BASE_CYCLES = 1
"""The default base has cubes of half the root's edge: refinements find what is small more cheaply than it does."""
MOST_REPAIRS = 16
LOOSE, BACK, SPACING = 2.0, 0.7, 1.0
"""Vertices are left out at first as long as the curve gets no farther than ``LOOSE`` tolerances from the original,
since the fit halves that where the curve bends, and strays no farther than ``BACK`` tolerances plus ``SPACING``."""
EDGES = 2.0, 16.0
"""Uniform meshes that are tried have edges longer than the one and at most as long as the other of these, in
tolerances."""
HOPELESS = 1.2
"""A reduced mesh that grows to this many times the smallest file so far is given up: another base may save some."""
STUCK, FEW = 0.7, 32
"""So is one with more places than ``FEW`` that are too far away, of which three repairs left more than this share."""
EDGE = 1e-6
"""Share of a tolerance that is below its rounding."""


class NotKeptError(OptionError):
    """No plan was found that is proven to keep a promise."""


@dataclass
class Promise:
    """The original curve of a field, and trial encodings held against it.

    Attributes
    ----------
    field : Field
    fresh : callable, optional
        Makes tubes for trial encodings, as that of the file: what is known of earlier isovalues changes what
        is told. By default those of a file of its own.
    free : bool
        Whether crossings may be told with slack (see `Slack`).
    contour : Contour
        The original curve.
    phi : ndarray of float32
        The field less its isovalue.
    """

    field: Field
    fresh: Callable[[], Tube] | None = None
    free: bool = True
    contour: Contour = derived(init=False)
    phi: NDArray[np.float32] = derived(init=False)

    def __post_init__(self) -> None:
        self.contour = original(self.field)
        values = self.field.values.astype(np.float64) - self.field.isovalue
        largest = np.finfo(np.float32).max
        self.phi = np.clip(values, -largest, largest).astype(np.float32)
        self._points = _grid_points(self.contour)

    @property
    def n(self) -> int:
        """Number of axes."""
        return self.field.signs.ndim

    @property
    def full_level(self) -> int:
        """Level of the full grid."""
        return self.n * cube_exponent(self.field.signs.shape)

    def reduction(self, start: Chosen | None = None) -> Reduction:
        """A reduction of the full grid, or of a mesh."""
        return Reduction(self.field.signs, self.phi, self._points, start)

    def trial(self, plan: Sequence[Entry]) -> tuple[int, Contour]:
        """Bytes of the runs of a plan, and what a decoder draws in the end."""
        total, tube = self._encoded(plan)
        return total, draw(self._leaves(tube))

    def placed(self, mesh: Chosen, parts: int, unit: int, tolerance: float, before: Place | None = None) -> Place:
        """Where the curve is to cross the edges of a mesh so that it lies within a tolerance, if it can be.

        ``before`` are the places on a mesh of which most edges are left.
        """
        tube = self._encoded([("adaptive_base", 0, mesh), ("offsets", parts, unit)])[1]
        told = tube.estimates
        position = tube.state.vertex[:, : self.n].astype(np.int64)
        low, high = position[told.edges[:, 0]], position[told.edges[:, 1]]
        where = np.ldexp((before or self.field.crossings)(low, high) + 0.5, -OFFSET_BITS)
        number = fitted_offsets(
            self.contour, self._leaves(tube), told.edges, told.parts, where, tolerance, AGAIN if before else ROUNDS
        )
        return Places(self.field, low, high, ((2 * number + 1) << (OFFSET_BITS - 1)) // told.parts)

    def _leaves(self, tube: Tube) -> Leaves:
        return leaves_of(tube, self.field.isovalue, lambda number, above: number)

    def _encoded(self, plan: Sequence[Entry]) -> tuple[int, Tube]:
        tube = self.fresh() if self.fresh else self._alone()
        # the earlier isovalue has a limit of steps, which trials do not take part in
        steps = tube.lean.state.at[WORK] if tube.lean else 0
        strand = Strand(self.field, tube, plan, Progress(tube.full_level))
        total = done = 0
        while done < len(strand.layers):
            done, run = strand.encode_run(done, lambda: None)
            total += len(run)
        if tube.lean:
            tube.lean.state.at[WORK] = steps
        return total, tube

    def _alone(self) -> Tube:
        header = Header(self.field.values.shape, self.field.isovalue, self.field.scale, Profile.MAIN)
        return field_tube(header, self.field)

    def excess(self, contour: Contour, tolerance: float) -> np.ndarray:
        """Places where the two curves are not proven to lie within the tolerance of each other, (K, n)."""
        ours, theirs = (self.contour.points, self.contour.cells), (contour.points, contour.cells)
        return np.concatenate(
            [Target(*theirs, tolerance).exceeded(*ours).places, Target(*ours, tolerance).exceeded(*theirs).places]
        )


class Places:
    """Chosen places on edges; on others those where the field crosses."""

    def __init__(self, field: Field, low: NDArray[np.int64], high: NDArray[np.int64], where: NDArray[np.int64]) -> None:
        self._field = field
        names = np.hstack([low, high])
        self._where = {name.tobytes(): int(x) for name, x in zip(names, where, strict=True)}

    def __call__(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
        """As ``Field.crossings``."""
        out = self._field.crossings(low, high)
        for i, name in enumerate(np.hstack([low, high])):
            out[i] = self._where.get(name.tobytes(), out[i])
        return out


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
    best: Plan = []
    fewest: float = math.inf
    for plan in [*([*grid, *offsets] for grid in grids), *grids]:
        size, contour = promise.trial(plan)
        if size < fewest and not len(promise.excess(contour, tolerance)):
            best, fewest = plan, size
    coarser = _coarsest(promise, grids[0], tolerance, fewest)
    if coarser is not None:
        fewest, best = coarser
    if not best:
        raise NotKeptError(
            f"no plan was proven to keep to a tolerance of {tolerance:g}", code="tolerance", remedy="use a smaller one"
        )
    if full == 0:
        return best
    for start, lead in starts(promise, tolerance, topology):
        for parts, unit in pitches(tolerance, promise.n):
            reduction = promise.reduction(start)
            most = fewest if lead else HOPELESS * fewest
            kept = _repaired(promise, reduction, tolerance, parts, unit, lead, fit=True, most=most)
            if kept is None:
                continue
            if kept.size < fewest:
                best, fewest = kept.plan, kept.size
            coarse = _base(promise.n, full)
            if not topology and coarse < full and not lead:
                plan = [("base", coarse), ("adapt", 1, kept.mesh), kept.plan[-1]]
                size, contour = promise.trial(plan)
                # a coarse uniform base has vertices that the mesh may lack: proven anew
                if size < fewest and not len(promise.excess(contour, tolerance)):
                    best, fewest = plan, size
    return best


def starts(promise: Promise, tolerance: float, topology: bool) -> Iterator[tuple[Chosen, Plan]]:
    """Meshes to begin with, and what leads to a uniform one: reduced ones fit a curve better, even cubes tell less."""
    loose = promise.reduction()
    loose.reduce(topology=topology, distortion=LOOSE * tolerance, back=BACK * tolerance + SPACING)
    yield loose.chosen, []
    if topology:
        return
    for cycles in range(1, promise.full_level // promise.n):
        if EDGES[0] * tolerance < 1 << cycles <= EDGES[1] * tolerance:
            level = promise.full_level - cycles * promise.n
            uniform = promise.reduction()
            uniform.reduce(level=level)
            base = _base(promise.n, level)
            lead: Plan = [("base", base)]
            if base < level:
                lead.append(("refine", level - base))
            yield uniform.chosen, lead


def _coarsest(promise: Promise, grid: Plan, tolerance: float, most: float) -> tuple[int, Plan] | None:
    """The full grid with crossings told as coarsely as can be, with slack also at a slant, in less than ``most``."""
    found = None
    # as few parts as can be, even if in the worst case a crossing on their border is told a rounding too far away
    fewest = max(math.ceil(0.5 / tolerance * (1 - EDGE)), 1) | 1
    for radix in sorted({fewest, math.prod(radices(tolerance))} - {1}):
        slack = Slack(tolerance, promise.phi) if promise.free else None
        for _ in range(MOST_REPAIRS if radix <= MAX_RADIX else 0):
            plan: Plan = [*grid, ("offsets", radix, 0, None, slack)]
            size, contour = promise.trial(plan)
            if size >= most:
                break
            places = promise.excess(contour, tolerance)
            if not len(places):
                found, most = (size, plan), size
            if not len(places) or slack is None:
                break
            slack.tighten(places)
    return found


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
    left: list[int] = []
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
        left.append(len(places))
        stuck = fit and len(left) > 3 and left[-1] > max(STUCK * left[-4], FEW)
        if stuck or not reduction.restore(places, within):
            return None
    return None


def stepwise(promise: Promise, steps: Sequence[float], topology: bool) -> Plan:
    """Layers that promise one distance after the other; the last step may be ``EXACT``."""
    if any(not later < step for step, later in pairwise(steps)):
        raise OptionError("the steps must fall", code="steps", remedy="for example 4, 1, 0.25")
    if promise.full_level == 0:
        last = [("values", None)] if steps[-1] == EXACT else [("offsets", r) for r in radices(steps[-1])]
        return [("base", 0), *last]
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
        plan += entries
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
            reduction.reduce(topology=topology, distortion=tolerance, parts=parts, unit=unit)
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


def whole_mesh(promise: Promise, topology: bool) -> Plan:
    """To the full grid, by way of meshes that all have the right topology if that is asked for."""
    if not topology:
        return grid_plan(promise.n, promise.full_level, None)
    reduction = promise.reduction()
    reduction.reduce(topology=True)
    return [("adaptive_base", 0, reduction.chosen)] + ([("refine", None)] if promise.full_level else [])


def reduced(promise: Promise, criterion: str, parameter: float | None, topology: bool) -> Plan:
    """A base on a mesh reduced under one criterion, as published."""
    reduction = promise.reduction()
    match criterion:
        case "crossing":
            reduction.reduce(topology=topology, crossing=True)
        case "topology":
            reduction.reduce(topology=True)
        case "curvature" | "distortion" | "level":
            if parameter is None:
                raise OptionError(f"the criterion {criterion} needs a number", code="criterion")
            if criterion == "level":
                reduction.reduce(topology=topology, level=int(parameter))
            elif criterion == "curvature":
                reduction.reduce(topology=topology, keep=reduction.curved(parameter))
            else:
                reduction.reduce(topology=topology, distortion=parameter)
        case _:
            raise OptionError(
                f"unknown criterion {criterion!r}", code="criterion",
                remedy="crossing, curvature, distortion, topology or level",
            )  # fmt: skip
    return [("adaptive_base", 0, reduction.chosen)]


def _grid_points(contour: Contour) -> np.ndarray:
    """The points of a contour that lie on edges of the grid, for each of the grid's edges that it crosses."""
    return contour.points[(contour.points != np.floor(contour.points)).sum(axis=1) <= 1]
