"""Meshes that a plan states by criteria: coarsened for the field, each one contained in the next (spec clause 5.8).

Where a criterion is a distance, the mesh keeps to it with the geometry that follows it (`search.kept_distances`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from ..format.kinds import ADAPTIVE, LayerKind
from ..grid.lattice.vertex_set import Chosen
from ..grid.layers.plan import Criteria, Entry
from ..search.coarsening import Reduction
from ..search.kept_distances import PlannedMesh, keep, known_by
from ..search.promise import Promise


def with_meshes(
    plan: Sequence[Entry], full_level: int, lean_level: int, promise: Callable[[], Promise]
) -> Sequence[Entry]:
    """Replace the `Criteria` in a plan by meshes.

    Parameters
    ----------
    plan : sequence of entries
    full_level : int
        Level of the full grid.
    lean_level : int
        Uniform level of the isovalue that this one is predicted from, -1 if there is no such isovalue.
    promise : callable
        Makes the original curve for coarsening; called only if there are criteria.

    Raises
    ------
    OptionError
        If a distance cannot be kept.
    """
    if not any(_criteria(entry) for entry in plan):
        return plan
    levels, asked = _uniform_levels(plan, full_level, lean_level), _asked(plan)
    original = promise()
    meshes: list[PlannedMesh] = []
    later: Chosen | None = None
    # the last mesh first: earlier meshes must be contained in it
    for i in range(len(plan) - 1, -1, -1):
        entry, criteria = plan[i], asked[i]
        if criteria is not None:
            reduction = _reduced(original, later, criteria, levels[i], known_by(plan, i))
            later = reduction.chosen
            # no vertex finer than a stated level may come back
            meshes.insert(0, PlannedMesh(i, reduction if criteria.level is None else later, criteria.distortion))
        elif _is_adaptive(entry) and isinstance(entry[-1], Chosen):
            later = entry[-1]
            meshes.insert(0, PlannedMesh(i, later))
    return keep(original, plan, meshes)


def _asked(plan: Sequence[Entry]) -> list[Criteria | None]:
    """Find for each entry the criteria of its mesh: its own, and those of earlier entries that are about any mesh.

    A mesh holds those before it. Were it not to satisfy what they do, they could not either.
    """
    out: list[Criteria | None] = []
    held = Criteria()
    for own in map(_criteria, plan):
        if own is not None:
            curvatures = [one.curvature for one in (held, own) if one.curvature is not None]
            held = replace(
                own, topology=held.topology or own.topology, crossing=held.crossing or own.crossing,
                curvature=min(curvatures, default=None),
            )
        out.append(None if own is None else held)
    return out


def _is_adaptive(entry: object) -> bool:
    return isinstance(entry, Sequence) and len(entry) == 3 and entry[0] in ADAPTIVE


def _criteria(entry: object) -> Criteria | None:
    """The criteria of an entry, if any; anything that is not an entry is refused later."""
    if isinstance(entry, Sequence) and _is_adaptive(entry) and isinstance(entry[2], Criteria):
        return entry[2]
    return None


def _reduced(
    original: Promise, start: Chosen | None, criteria: Criteria, coarsest: int, known: tuple[int, int]
) -> Reduction:
    """Coarsen a mesh under the criteria; vertices of levels below ``coarsest`` are kept."""
    parts, unit = known
    reduction = original.reduction(start)
    reduction.reduce(
        topology=criteria.topology, crossing=criteria.crossing, level=criteria.level, coarsest=coarsest,
        distortion=criteria.distortion,
        original=None if criteria.distortion is None else original.target(criteria.distortion), parts=parts, unit=unit,
        curvature=None if criteria.curvature is None else original.curvature(), kappa=criteria.curvature or 0.0,
    )
    return reduction


def ends_alike(plans: Iterable[object], n: int, full_level: int) -> bool:
    """Whether the last mesh of each isovalue's plan, if stated, is the same at both ends of periodic axes.

    The full grid is, and a uniform mesh made up of squares or cubes; a mesh by criteria, since it has all crossed edges
    there are at the ends; and the leaves of an earlier isovalue on the full grid.
    """
    found = [_ends_alike(plan, n, full_level) for plan in plans if isinstance(plan, Sequence)]
    whole = all(full for _, full in found)
    return all(whole if alike is None else alike for alike, _ in found)


def _ends_alike(plan: Sequence[Entry], n: int, full_level: int) -> tuple[bool | None, bool]:
    """Whether the last mesh of a plan does, None if it is that of an earlier isovalue; and whether it may be full."""
    level, uniform, kept, leaves = 0, True, False, False
    for entry, level in zip(plan, _uniform_levels(plan, full_level, full_level), strict=True):
        kind = entry[0] if isinstance(entry, Sequence) and len(entry) else None
        if _is_adaptive(entry):
            kept |= _criteria(entry) is not None
            uniform = False
        elif kind == LayerKind.LEAF_BASE:
            leaves = True
        elif kind == LayerKind.REFINE and level == full_level:
            uniform, leaves = True, False
    alike = kept or (uniform and level % n == 0)
    return (None if leaves and not kept else alike), level == full_level


def _uniform_levels(plan: Sequence[Entry], full_level: int, lean_level: int) -> list[int]:
    """For each entry, the level up to which the mesh is uniform, if stated, also for adaptive bases."""
    level = 0
    out = []
    for entry in plan:
        kind, *rest = entry if isinstance(entry, Sequence) and len(entry) else [None]
        number = rest[0] if rest and isinstance(rest[0], int) else None
        if kind in (LayerKind.BASE, LayerKind.ADAPTIVE_BASE):
            level = full_level if number is None else number
        elif kind == LayerKind.LEAF_BASE:
            level = max(lean_level, 0)
        elif kind == LayerKind.REFINE:
            level = full_level if number is None else level + number
        out.append(min(level, full_level))
    return out
