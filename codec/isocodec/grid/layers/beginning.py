"""Beginnings of the layers of an isovalue, for both directions (spec clauses 3.6, 5.9.2)."""

from __future__ import annotations

import math

import numpy as np

from isospec.container import Profile

from ...entropy.context_layout import context_coder, gone_on, rates
from ...entropy.panel import no_panel, panel_after
from ...entropy.range_coder import Coder, CoderRegisters
from ...field.samples import steps_above
from ...format.header import Header
from ...format.kinds import LayerKind
from ...format.program import Layer
from ...limits import Budget, Limits
from ..models.contexts import models
from ..models.trained import shipped_models
from ..passes.runner import Tube
from ..tube.holes import Holes
from ..tube.state import FRAME
from ..tube.truth import Truth

MOST_SHIFT = 1 << 52
"""From this distance of isovalues on, in steps, values of the one are no bounds for the other (clause 5.9.3)."""


def first_coder(header: Header, size: int) -> Coder:
    """A coder with models as at the start of a file."""
    if header.profile == Profile.MAIN:
        prob, seen, blend = shipped_models(len(header.shape))
        return Coder(CoderRegisters(), np.zeros(size, np.uint8), prob, seen, rates(), blend)
    return context_coder(*models(), size)


def further_coder(header: Header, earlier: Coder | None, size: int, frame: bool = False) -> Coder:
    """A coder with copies of the models of an isovalue that is leant on (clause 5.9.2); None of one without layers.

    With ``frame`` that is one of the frame before.
    """
    cd = first_coder(header, size) if earlier is None else gone_on(earlier, size)
    panel = panel_after(cd.blend.panel) if frame and header.profile == Profile.MAIN else no_panel()
    return cd._replace(blend=cd.blend._replace(panel=panel))


def shared_coder(coder: Coder, size: int) -> Coder:
    """A coder with the same models as another one."""
    return coder._replace(reg=CoderRegisters(), buf=np.zeros(size, np.uint8))


def _leaning_coder(header: Header, lean: Tube | None, size: int, frame: bool) -> Coder:
    """A coder for an isovalue that begins: of one without layers the models are shared, but across frames."""
    if lean is None:
        return first_coder(header, size)
    return further_coder(header, lean.coder, size, frame) if lean.begun or frame else shared_coder(lean.coder, size)


def leaning_tube(
    header: Header, isovalue: float, lean: Tube | None, other: float, size: int, limits: Limits,
    truth: Truth | None = None, budget: Budget | None = None, holes: Holes | None = None, frame: bool = False,
    coder: Coder | None = None, shares: bool | None = None,
) -> Tube:
    """The tube of an isovalue, leaning on that of another one or on none, with a mask or without.

    With ``frame`` the other one is that of the frame before. With a coder its models are those of the tube;
    ``shares``: others have them, too.
    """
    if shares is None:
        shares = lean is not None and not frame and (coder is not None or not lean.begun)
    coder = coder or _leaning_coder(header, lean, size, frame)
    shape = header.shape
    if lean is None or lean.level < 0:
        return Tube(shape, coder, limits, truth, holes=holes, budget=budget, shares=shares)
    if frame:
        return Tube(shape, coder, limits, truth, lean=lean, side=FRAME, holes=holes, budget=budget, shares=shares)
    steps = steps_above(isovalue, other, header.scale)
    shift = (math.floor(steps), math.ceil(steps)) if abs(steps) <= MOST_SHIFT - 1 else None
    side = 1 if isovalue > other else -1
    return Tube(
        shape, coder, limits, truth, lean=lean, shift=shift, side=side, holes=holes, budget=budget, shares=shares
    )


def mask_tube(
    header: Header, size: int, limits: Limits, truth: Truth | None = None, budget: Budget | None = None
) -> Tube:
    """Make the tube of a mask, which has separate models (clause 5.10.1)."""
    return Tube(header.shape, first_coder(header, size), limits, truth, budget=budget)


def begin_layer(tube: Tube, layer: Layer) -> None:
    """Begin a layer of a program."""
    match layer.kind:
        case LayerKind.BASE | LayerKind.ADAPTIVE_BASE:
            tube.begin_base(layer.level, layer.kind == LayerKind.ADAPTIVE_BASE)
        case LayerKind.LEAF_BASE:
            tube.begin_leaf_base()
        case LayerKind.REFINE:
            tube.begin_round()
        case LayerKind.ADAPT:
            tube.begin_adapt(layer.births)
        case LayerKind.VALUES:
            tube.begin_values(layer.plane)
        case LayerKind.OFFSETS:
            tube.begin_offsets(layer.parts, layer.unit)
        case other:
            raise AssertionError(f"no way to begin a layer of the kind {other!r}")
