"""Layers that promise one distance after the other (row S3-distortion; docs/encoders.md, 3).

Coarse steps are meshes without offsets, each part of the next: finer ones need their signs anyway. Steps that no even
mesh is worth it for lead to the full grid, with offsets where its signs alone do not keep the distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ..errors import OptionError
from ..format.kinds import LayerKind
from ..grid.lattice.vertex_set import Chosen
from ..grid.layers.plan import PROMISE
from .promise import Promise
from .strategy import NotKeptError, Plan, even_mesh, exponent_of, mesh_of, whole_mesh
from .tolerance import EXACT, grid_offsets, radices


def stepwise(promise: Promise, steps: Sequence[float], topology: bool) -> Plan:
    """Layers that promise one distance after the other; the last step may be ``EXACT``."""
    if any(not later < step for step, later in pairwise(steps)):
        raise OptionError("the distances must decrease", code="steps", remedy="for example 4, 1, 0.25")
    values: Plan = [(LayerKind.VALUES, None)] if steps[-1] == EXACT else []
    if promise.full_level == 0:
        return [("base", 0), *(values or [("offsets", r) for r in radices(steps[-1])])]
    fine = [step for step in steps if step != EXACT and not exponent_of(step)]
    meshes: list[tuple[float, Plan]] = []
    finer: Chosen | None = None
    for distance in reversed(steps[: len(steps) - len(fine) - len(values)]):
        found = even_mesh(promise, distance, topology, finer=finer)
        if found is None:
            raise NotKeptError(f"no sequence of meshes was found for the distances {steps}", code="steps",
                               remedy="leave some of them out")
        meshes.append((distance, found[1]))
        finer = mesh_of(found[1])
    plan: Plan = []
    for distance, single in reversed(meshes):
        # only the first one begins with a base
        plan += [*(single if not plan else [("adapt", 0 if topology else 1, mesh_of(single))]), (PROMISE, distance)]
    if fine or values:
        plan += [("refine", None)] if plan else whole_mesh(promise, topology)
    return [*plan, *_offsets(promise, fine), *values]


def _offsets(promise: Promise, distances: Sequence[float]) -> Plan:
    """Offsets on the full grid for these distances, each finer by at least one digit; with slack if only one."""
    plan: Plan = []
    for i, distance in enumerate(distances):
        last = i == len(distances) - 1
        offsets = grid_offsets(distance, promise.free and len(distances) == 1, promise.fixed)
        # signs alone keep to the smallest of some distances as well
        if offsets or last or radices(distances[i + 1]):
            plan += [*offsets, (PROMISE, distance)]
    return plan
