"""Plans: which layers an encoder is to make, and what each takes (spec clause 3.6)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING

from isospec.container import Operation

from ...errors import OptionError
from ...format.kinds import ADAPTIVE, LayerKind
from ..lattice.vertex_set import Chosen
from ..tube.truth import Place

if TYPE_CHECKING:
    pass

MAX_PROMISE = 1e12
"""Least distance that is too great to be promised, in cells: none is that large."""
Entry = Sequence[object]
"""Entry of a plan: the kind of layer, its number, and what else it takes: see `Encoder`."""
PROMISE = "promise"
"""An entry that makes no layer: what is promised of those before it."""
_MEMBERS: dict[str, int] = {
    LayerKind.BASE: 2, LayerKind.ADAPTIVE_BASE: 3, LayerKind.LEAF_BASE: 1, LayerKind.REFINE: 2, LayerKind.ADAPT: 3,
    LayerKind.VALUES: 3, LayerKind.OFFSETS: 5, PROMISE: 2,
}
"""Kinds of entries, and how many members they have at most."""


@dataclass(frozen=True)
class Criteria:
    """A mesh to be found by reduction: vertices go while all of these allow it (rows C2-reduce to C2-topology).

    Attributes
    ----------
    topology : bool
        Not if the topology of the curve changes.
    crossing : bool
        Not if the tubular neighbourhood changes.
    level : int, optional
        No vertex of this level or a finer one stays unless topology, crossing or curvature keep it; alone, it gives the
        uniform mesh.
    curvature : float, optional
        Where the mean curvature exceeds this, in 1 / cells, the finest mesh stays.
    distortion : float, optional
        Not if the curve, as it is decoded with the geometry that follows directly, gets farther than this, in cells,
        from the original one, or that from it.
    """

    topology: bool = False
    crossing: bool = False
    level: int | None = None
    curvature: float | None = None
    distortion: float | None = None

    def __post_init__(self) -> None:
        for name in ("level", "curvature", "distortion"):
            number = getattr(self, name)
            if number is not None and not (math.isfinite(number) and number >= 0):
                raise OptionError(f"{name} is {number:g}; it must be a number from 0 on", code="plan")


def promised(plan: Sequence[Entry]) -> dict[int, float]:
    """Distances promised, by number of operations before them."""
    out: dict[int, float] = {}
    kinds = [entry[0] for entry in plan]
    for i, entry in enumerate(plan):
        if entry[0] != PROMISE:
            continue
        distance = entry[1] if len(entry) == 2 else None
        if not isinstance(distance, float) or not 0 < distance < MAX_PROMISE or i == 0 or LayerKind.VALUES in kinds[:i]:
            raise OptionError(
                "a promise in a plan needs a distance greater than 0, and layers before it, none of values", code="plan"
            )
        out[i - kinds[:i].count(PROMISE)] = distance
    return out


def check_entries(plan: Sequence[Entry]) -> None:
    """Refuse what is not an entry of a plan, or has more members than its kind takes."""
    for entry in plan:
        if isinstance(entry, str) or not isinstance(entry, Sequence) or not entry:
            raise OptionError(
                f"{entry!r} in a plan is not a sequence", code="plan", remedy='for example ("base", level)'
            )
        kind = entry[0]
        if kind not in _MEMBERS:
            raise OptionError(f"unknown layer {kind!r} in a plan", code="plan", remedy=f"one of {', '.join(_MEMBERS)}")
        if len(entry) > _MEMBERS[str(kind)]:
            raise OptionError(f"{kind} in a plan takes at most {_MEMBERS[str(kind)] - 1} members", code="plan")
        if kind == LayerKind.VALUES and len(entry) == 3 and entry[1] is not None:
            raise OptionError(
                f"{entry!r} in a plan states both how many bits come and how many are left", code="plan",
                remedy='("values", bits) or ("values", None, left)',
            )


def operation_of(
    kind: str, number: object = None, more: object = None, place: Place | None = None, slack: Place | None = None
) -> tuple[Operation, int | None, int, Chosen | None, Place | None, Place | None]:
    """An entry of a plan: operation, argument, unit, mesh, places of crossings, and slack of these.

    The unit is that of offsets; of values it is the number of bits that are left.
    """
    argument = None if number is None else _count(kind, number)
    if kind == LayerKind.LEAF_BASE:
        argument = 0
    if kind == LayerKind.REFINE and argument == 0:
        raise OptionError("refine in a plan with 0 rounds", code="plan", remedy="give at least 1")
    if kind == LayerKind.OFFSETS:
        if argument is None or argument < 2:
            raise OptionError(f"offsets in a plan with radix {number}; it must be at least 2", code="plan")
        argument -= 1
    if kind in ADAPTIVE:
        if not isinstance(more, Chosen):
            raise OptionError(f"{kind} in a plan needs the mesh that it leads to", code="plan")
        return LayerKind(kind).operation, argument, 0, more, None, None
    return LayerKind(kind).operation, argument, 0 if more is None else _count(kind, more), None, place, slack


def _count(kind: str, number: object) -> int:
    """A number in an entry of a plan."""
    if not isinstance(number, Integral) or number < 0:
        raise OptionError(
            f"{kind} in a plan with {number!r}; it must be a whole number from 0 on, or None", code="plan"
        )
    return int(number)
