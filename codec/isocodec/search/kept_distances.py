"""Meshes of a plan that keep their distances, with all that decoders know by then (row C2-distortion).

The test of the reduction looks at one diamond at a time, and at points of the original curve only. So the plan is
encoded, drawn as a decoder draws it once the geometry behind each mesh is known, quantised as it is, and held against
the original curve both ways; where a distance is not proven, vertices are put back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..format.kinds import GEOMETRY, LayerKind
from ..grid.lattice.vertex_set import Chosen
from ..grid.layers.plan import Entry
from .coarsening import Reduction
from .promise import Promise
from .reduced import LINEAR_POINTS
from .strategy import MOST_REPAIRS
from .tolerance import NO_OFFSETS


@dataclass(frozen=True)
class PlannedMesh:
    """A mesh of a plan.

    Attributes
    ----------
    entry : int
        Number of its entry in the plan.
    mesh : Reduction or Chosen
        To which vertices may be put back, or as it was given.
    distance : float or None
        In cells, that the curve keeps to once the geometry behind the mesh is known; None if that is any.
    """

    entry: int
    mesh: Reduction | Chosen
    distance: float | None = None

    @property
    def chosen(self) -> Chosen:
        """The vertices."""
        return self.mesh.chosen if isinstance(self.mesh, Reduction) else self.mesh


def geometry_end(plan: Sequence[Entry], entry: int) -> int:
    """Number of the last entry of the geometry that follows an entry directly; its own if none does."""
    end = entry
    while end + 1 < len(plan) and plan[end + 1][0] in GEOMETRY:
        end += 1
    return end


def known_by(plan: Sequence[Entry], entry: int) -> tuple[int, int]:
    """Find how finely crossings are known once the geometry behind a mesh is, as `Reduction.reduce` takes it."""
    end = geometry_end(plan, entry)
    if any(each[0] == LayerKind.VALUES for each in plan[: end + 1]):
        return LINEAR_POINTS, 0
    offsets = [[*each[1:3], 0][:2] for each in plan[entry + 1 : end + 1]]
    if not offsets:
        return NO_OFFSETS
    radices, units = zip(*offsets, strict=True)
    return math.prod(int(str(radix)) for radix in radices), int(str(units[-1]))


def keep(promise: Promise, plan: Sequence[Entry], meshes: Sequence[PlannedMesh]) -> list[Entry]:
    """A plan with its meshes, to which vertices are put back until all distances are proven.

    Parameters
    ----------
    promise : Promise
    plan : sequence of entries
        Of those with meshes only the first two members are used.
    meshes : sequence of PlannedMesh
        In the order of the plan, each part of the next.

    Raises
    ------
    OptionError
        Naming the line of a distance that cannot be kept.
    """
    out = list(plan)
    for each in meshes:
        out[each.entry] = (*plan[each.entry][:2], each.chosen)
    ends = {geometry_end(plan, each.entry): number for number, each in enumerate(meshes) if each.distance is not None}
    for _ in range(MOST_REPAIRS * len(ends)):
        failed = False
        # how many bits values have depends on the layers that follow
        whole = any(each[0] == LayerKind.VALUES for each in out)
        tried = out if whole else out[: max(ends) + 1]
        for end, contour in promise.after_entries(tried, ends).items():
            number = ends[end]
            distance = meshes[number].distance
            assert distance is not None
            places = promise.excess(contour, distance)
            if not len(places):
                continue
            failed = True
            # where leaves are the finest already, implied points are too far away, which a full grid has none of
            if not _put_back(meshes, number, places) and not _put_back(meshes, number, contour.points):
                raise _not_kept(plan[meshes[number].entry], distance)
        if not failed:
            return out
        for each in meshes:
            out[each.entry] = (*plan[each.entry][:2], each.chosen)
    if ends:
        number = next(iter(ends.values()))
        raise _not_kept(plan[meshes[number].entry], meshes[number].distance or 0.0)
    return out


def _put_back(meshes: Sequence[PlannedMesh], number: int, places: NDArray[np.float64]) -> bool:
    """Bisect leaves of a mesh at some places, or, where the next one has no finer ones, of that."""
    each = meshes[number]
    if isinstance(each.mesh, Chosen):
        return False
    later = meshes[number + 1].chosen if number + 1 < len(meshes) else None
    if each.mesh.restore(places, later):
        return True
    return later is not None and _put_back(meshes, number + 1, places)


def _not_kept(entry: Entry, distance: float) -> OptionError:
    return OptionError(
        f"no mesh was proven to stay within a distortion of {distance:g} cells", code="plan",
        remedy="allow a larger distortion or a finer level, or let offsets or values follow it that store crossings "
               "more precisely",
    )
