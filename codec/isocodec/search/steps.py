"""Layers that promise one distance after the other (row S3-distortion; spec annex G.3).

Coarse steps are meshes without offsets: the finer ones need their signs anyway, and the curve gets no
worse on the way from one to the next. Offsets come with the last step, as in a file for that step alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..format.kinds import ADAPTIVE, LayerKind
from ..grid.lattice.vertex_set import Chosen
from ..grid.layers.plan import PROMISE
from .choice import smallest
from .promise import Promise
from .repair import MOST_REPAIRS, Plan, repaired
from .strategy import NotKeptError, base_of, whole_mesh
from .tolerance import EXACT, NO_OFFSETS, grid_offsets, pitches, radices

FULL: Plan = [("refine", None)]
"""From any mesh to the full grid."""


_Step = tuple[float, Chosen]
"""A distance, and the mesh that keeps to it."""
STEADY, MOST_STEADIED = 1.04, 8
"""Factor by which the curve may miss its promise before the next one, and the number of times that is mended."""


def stepwise(promise: Promise, steps: Sequence[float], topology: bool) -> Plan:
    """Layers that promise one distance after the other; the last step may be ``EXACT``."""
    if any(not later < step for step, later in pairwise(steps)):
        raise OptionError("the distances must decrease", code="steps", remedy="for example 4, 1, 0.25")
    values: Plan = [(LayerKind.VALUES, None)] if steps[-1] == EXACT else []
    distances = [step for step in steps if step != EXACT]
    if promise.full_level == 0:
        return [("base", 0), *(values or [("offsets", r) for r in radices(steps[-1])])]
    if not distances:
        return [*whole_mesh(promise, topology), *values]
    # what signs alone cannot keep, and the last one
    fine = [d for d in distances[:-1] if not _signs_keep(promise, d)] + distances[-1:]
    coarse = distances[: -len(fine)]
    plans = []
    if len(fine) == 1:
        plans.append(_joined(promise, coarse, smallest(promise, fine[0], topology), fine, topology))
    if values or plans in ([], [None]):
        # if values follow, offsets on the full grid usually waste less
        grid = [*whole_mesh(promise, topology), *_offsets(promise, fine)]
        plans.append(_joined(promise, coarse, grid, fine, topology))
    if plans[0] is None and _signs_keep(promise, fine[0]):
        # a mesh with offsets has no room for one without: none at all
        bare = _bare(promise, fine[0], topology, None)
        plans.append(bare and _joined(promise, coarse, _first(promise, bare, topology), fine, topology))
    found = [[*plan, *(FULL if values and _chosen(plan) else []), *values] for plan in plans if plan]
    if not found:
        raise NotKeptError(f"no sequence of meshes was found for the distances {steps}", code="steps", remedy="leave "
                                                                                                              "some "
                                                                                                              "of "
                                                                                                              "them "
                                                                                                              "out")
    return min(found, key=lambda plan: promise.trial(plan)[0]) if len(found) > 1 else found[0]


def _signs_keep(promise: Promise, distance: float) -> bool:
    """Whether the full grid keeps to a distance without offsets."""
    return not len(promise.excess(promise.trial([("base", promise.full_level)])[1], distance))


def _offsets(promise: Promise, distances: Sequence[float]) -> Plan:
    """Offsets on the full grid for these distances, each finer by at least one digit; with slack if only one."""
    plan: Plan = []
    for distance in distances[:-1]:
        plan += [*grid_offsets(distance, False), (PROMISE, distance)]
    free = promise.free and len(distances) == 1
    return [*plan, *grid_offsets(distances[-1], free, promise.fixed), (PROMISE, distances[-1])]


def _chosen(plan: Plan) -> Chosen | None:
    """The mesh that a plan leads to, None for the full grid."""
    last = next(entry for entry in reversed(plan) if entry[0] not in (LayerKind.OFFSETS, PROMISE))
    mesh = last[2] if last[0] in ADAPTIVE else None
    return mesh if isinstance(mesh, Chosen) else None


def _joined(
    promise: Promise, coarse: Sequence[float], ending: Plan, fine: Sequence[float], topology: bool
) -> Plan | None:
    """Steps without offsets, and the mesh and the offsets of a plan that keeps to the finer distances.

    None if a step would need vertices that the mesh has not.
    """
    promised = [] if PROMISE in [entry[0] for entry in ending] else [(PROMISE, fine[-1])]
    geometry = [entry for entry in ending if entry[0] in (LayerKind.OFFSETS, PROMISE)]
    mesh = finer = _chosen(ending)
    meshes: list[_Step] = []
    for distance in reversed(coarse):
        found = _bare(promise, distance, topology, finer)
        if found is None:
            return None
        finer = found
        meshes.append((distance, found))
    meshes.reverse()
    for _ in range(MOST_STEADIED if meshes else 0):
        plan = _through(meshes, mesh, promise, topology) + [*geometry, *promised]
        if not _steadied(promise, plan, meshes, mesh):
            break
    if not meshes:
        return [*ending, *promised]
    plan = _through(meshes, mesh, promise, topology)
    after: Plan = [*plan, *geometry, *promised]
    if mesh is None or topology or not len(promise.excess(promise.trial(after)[1], fine[-1])):
        return after
    # the uniform base has vertices that the mesh lacks: fitted anew
    for pitch in pitches(fine[-1], promise.n):
        kept = repaired(promise, promise.reduction(mesh), fine[-1], pitch, plan[:-1])
        if kept:
            return [*kept.plan, (PROMISE, fine[-1])]
    return [*plan[:-1], *FULL, *_offsets(promise, fine)]


def _through(meshes: Sequence[_Step], mesh: Chosen | None, promise: Promise, topology: bool) -> Plan:
    """Layers that lead to one mesh after the other, with what each promises, and to a last one or the full grid."""
    births = 0 if topology else 1
    plan: Plan = []
    for distance, chosen in meshes:
        plan += [("adapt", births, chosen)] if plan else _first(promise, chosen, topology)
        plan.append((PROMISE, distance))
    return plan + (FULL if mesh is None else [("adapt", births, mesh)])


def _steadied(promise: Promise, plan: Plan, meshes: list[_Step], last: Chosen | None) -> bool:
    """Put vertices back where the curve gets worse than promised in layers on the way to the next mesh; whether any."""
    places: dict[float, list[NDArray[np.float64]]] = {}
    for contour, promised in promise.layers(plan):
        if promised is not None and promised in dict(meshes):
            found = promise.excess(contour, STEADY * promised)
            places.setdefault(promised, []).extend([found] if len(found) else [])
    added = 0
    finer = last
    for i, (distance, mesh) in reversed(list(enumerate(meshes))):
        reduction = promise.reduction(mesh)
        if places.get(distance):
            added += reduction.restore(np.concatenate(places[distance]), finer)
        finer = reduction.chosen
        meshes[i] = distance, finer
    return added > 0


def _first(promise: Promise, mesh: Chosen, topology: bool) -> Plan:
    """The layers that lead to the first mesh."""
    if topology:
        return [("adaptive_base", 0, mesh)]
    return [("base", base_of(promise.n, promise.full_level)), ("adapt", 1, mesh)]


def _bare(promise: Promise, distance: float, topology: bool, finer: Chosen | None) -> Chosen | None:
    """A mesh, part of a finer one, that keeps to a distance without offsets."""
    reduction = promise.reduction(finer)
    parts, unit = NO_OFFSETS
    original = promise.target(distance)
    coarsest = 0 if topology else base_of(promise.n, promise.full_level)
    reduction.reduce(
        topology=topology, distortion=distance, original=original, parts=parts, unit=unit, coarsest=coarsest
    )
    for _ in range(MOST_REPAIRS):
        contour = promise.trial(_first(promise, reduction.chosen, topology))[1]
        places = promise.excess(contour, distance)
        if not len(places):
            return reduction.chosen
        if not reduction.restore(places, finer):
            break
    return None
