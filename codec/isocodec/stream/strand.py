"""The layers of one isovalue, on the encoder's side: from a plan to runs of symbols (spec clauses 3.6, 6.1)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from isospec.container import LAYER_LIMIT, Operation, Profile
from isospec.elements import BY_LAYER, ELEMENTS

from ..entropy.baseline import models, rates
from ..entropy.coder import ENCODE, POS, REGISTERS, Coder, finish, start
from ..entropy.main import no_blend, shipped_models
from ..errors import OptionError
from ..grid.field import Field
from ..kernel import DONE
from ..limits import Budget, Limits
from ..mesh.chosen import Chosen
from ..passes.truth import Truth
from ..passes.tube import Tube
from .container import LayerRecord
from .header import Header
from .program import Layer, Progress, expand

MAX_PROMISE = 1e12
"""Least distance that is too great to be promised, in cells: none is that large."""
MOST_SHIFT = 1 << 52
"""From this distance of isovalues on, in steps, values of the one say nothing of the other (clause 5.9.3)."""
RUN_BYTES = 1 << 16
"""A run is ended at the first end of a layer after this many bytes."""

Entry = Sequence[object]
"""Of a plan: the kind of layer, its number, and what else it takes: see `Encoder`."""

Place = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.int64]]
"""Where edges between positions are to be crossed, as 30-bit fractions: `passes.truth.Truth.crossing`; or how far from
there crossings may be told to be."""

PROMISE = "promise"
"""An entry that makes no layer: what is promised of those before it."""
_MEMBERS = {
    "base": 2, "adaptive_base": 3, "leaf_base": 1, "refine": 2, "adapt": 3, "values": 2, "offsets": 5, PROMISE: 2,
}  # fmt: skip
"""Kinds of entries, and how many members they have at most."""


def leaning_coder(header: Header, lean: Tube | None, size: int) -> Coder:
    """A coder with models as at the start of a file, or as the isovalue leaned on has left them (clause 5.9.2)."""
    registers, room = np.zeros(REGISTERS, np.int64), np.zeros(size, np.uint8)
    if lean is not None:
        cd = lean.coder
        blend = cd.blend._replace(mix=cd.blend.mix.copy())
        return Coder(registers, room, cd.prob.copy(), cd.seen.copy(), cd.rate, blend)
    if header.profile == Profile.MAIN:
        prob, seen, blend = shipped_models(len(header.shape))
        return Coder(registers, room, prob, seen, rates(), blend)
    return Coder(registers, room, *models(), rates(), no_blend())


def leaning_tube(
    header: Header, isovalue: float, lean: Tube | None, other: float, size: int, limits: Limits,
    truth: Truth | None = None, budget: Budget | None = None,
) -> Tube:  # fmt: skip
    """The tube of an isovalue, leaning on that of another one or on none."""
    coder = leaning_coder(header, lean, size)
    shape = header.shape
    if lean is None or lean.level < 0:
        return Tube(shape, coder, limits, truth, budget=budget)
    shift = None if header.scale is not None else math.floor(isovalue) - math.floor(other)
    if shift is not None and abs(shift) >= MOST_SHIFT:
        shift = None
    side = 1 if isovalue > other else -1
    return Tube(shape, coder, limits, truth, lean=lean, shift=shift, side=side, budget=budget)


def truth_of(field: Field) -> Truth:
    """What tubes of a field know."""
    return Truth(field.signs, field.numbers, field.crossings)


def field_tube(header: Header, field: Field, truth: Truth, lean: Tube | None = None, other: float = 0.0) -> Tube:
    """The encoder's tube of a field at its isovalue, leaning on that of the isovalue ``other`` or on none."""
    return leaning_tube(header, field.isovalue, lean, other, 1 << 16, Limits(), truth)


class Strand:
    """Encodes the layers of one isovalue.

    Parameters
    ----------
    field : Field
    tube : Tube
    plan : sequence of entries
    progress : Progress
        Where the programs stand when the strand begins.

    Attributes
    ----------
    layers : list of Layer
        Known so far: values wait until their range is known.
    records : list of LayerRecord
        Of the layers that are done.
    run_bytes : int
    within : dict of int to float
        What the plan promises, by number of layers (see `Promises`).
    """

    def __init__(self, field: Field, tube: Tube, plan: Sequence[Entry], progress: Progress) -> None:
        self.field = field
        self.tube = tube
        self.layers: list[Layer] = []
        self.records: list[LayerRecord] = []
        self.run_bytes = 0
        self.progress = progress
        self.within: dict[int, float] = {}
        _check_entries(plan)
        if not field.integer and field.scale is None and any(entry[0] == "values" for entry in plan):
            raise OptionError("values of floats are told in steps", code="plan", remedy="say how large: step")
        self._plan = [_operation(*entry) for entry in plan if entry[0] != PROMISE]  # type: ignore[arg-type]
        self._promised = _promised(plan)
        self._expanded = 0
        self._meshes: dict[int, Chosen] = {}
        self._places: dict[int, Place] = {}
        self._slack: dict[int, Place] = {}
        self._extend()

    @property
    def bits(self) -> tuple[int, int]:
        """Bits of the numbers above and below the isovalue, as far as known."""
        return self.tube.estimates.bits

    def _extend(self) -> None:
        """Turn operations of the plan into layers, up to the first values: they wait until their range is known."""
        state = self.progress
        while self._plan:
            operation, number, unit, mesh, place, slack = self._plan[0]
            if operation == Operation.VALUES and state.bits is None:
                if len(self.layers) > len(self.records):
                    return
                later = any(step[0] in (Operation.REFINE, Operation.ADAPT) for step in self._plan)
                state.bits = self.field.number_bits() if later else self.tube.value_bits()
                state.plane = max(state.bits)
                self.tube.estimates.bits = state.bits
            try:
                fresh = expand(operation, number or 0, number is None, state, unit)
            except ValueError as error:
                raise OptionError(f"the plan cannot be carried out: {error}", code="plan") from None
            if state.layers + len(fresh) > LAYER_LIMIT:
                raise OptionError(
                    f"more than {LAYER_LIMIT} layers, which is as many as a file may have", code="plan",
                    remedy="fewer of them, or fewer isovalues",
                )  # fmt: skip
            for layer in fresh:
                state.add(layer)
            if mesh is not None:
                self._meshes[len(self.layers)] = mesh
            if place is not None:
                self._places[len(self.layers)] = place
            if slack is not None:
                self._slack[len(self.layers)] = slack
            self.layers += fresh
            del self._plan[0]
            self._expanded += 1
            if self._expanded in self._promised:
                self.within[len(self.layers)] = self._promised[self._expanded]

    def encode_run(self, first: int, report: Callable[[], object]) -> tuple[int, bytes]:
        """Encode layers from number ``first`` on until the run is long enough; their end and the bytes."""
        tube = self.tube
        start(tube.coder.reg, ENCODE)
        begun = 0
        i = first
        while i < len(self.layers):
            before = tube.tally()
            self._advance(i)
            symbols = tube.tally() - before
            used = int(tube.coder.reg[POS]) + 4
            counts = {name: int(symbols[ELEMENTS.index(name)]) for name in BY_LAYER[self.layers[i].kind]}
            self.records.append(LayerRecord(used - begun, counts))
            begun = used
            i += 1
            self._extend()
            report()
            if used >= RUN_BYTES:
                break
        run = finish(tube.coder)
        # what the decoder's window reads past the end of the run belongs to no layer
        self._trim(first, i, len(run))
        self.run_bytes += len(run)
        return i, run

    def _trim(self, first: int, end: int, length: int) -> None:
        place = 0
        for i in range(first, end):
            stop = min(place + self.records[i].bytes, length)
            self.records[i] = LayerRecord(stop - place, self.records[i].symbols)
            place = stop

    def _advance(self, number: int) -> None:
        tube = self.tube
        if number in self._meshes:
            tube.choose(self._meshes[number])
        if number in self._places:
            tube.estimates.place = self._places[number]
        tube.estimates.slack = self._slack.get(number)
        begin_layer(tube, self.layers[number])
        while tube.advance() != DONE:
            buf = tube.coder.buf
            wider = np.zeros(2 * len(buf), np.uint8)
            wider[: len(buf)] = buf
            tube.coder = tube.coder._replace(buf=wider)


def begin_layer(tube: Tube, layer: Layer) -> None:
    """Begin a layer of a program."""
    match layer.kind:
        case "base" | "adaptive_base":
            tube.begin_base(layer.level, layer.kind == "adaptive_base")
        case "leaf_base":
            tube.begin_leaf_base()
        case "refine":
            tube.begin_round()
        case "adapt":
            tube.begin_adapt(layer.births)
        case "values":
            tube.begin_values(layer.plane)
        case _:
            tube.begin_offsets(layer.parts, layer.unit)


def _promised(plan: Sequence[Entry]) -> dict[int, float]:
    """Distances promised, by number of operations before them."""
    out: dict[int, float] = {}
    kinds = [entry[0] for entry in plan]
    for i, entry in enumerate(plan):
        if entry[0] != PROMISE:
            continue
        distance = entry[1] if len(entry) == 2 else None
        if not isinstance(distance, float) or not 0 < distance < MAX_PROMISE or i == 0 or "values" in kinds[:i]:
            raise OptionError(
                "a promise in a plan needs a distance greater than 0, and layers before it, none of values", code="plan"
            )
        out[i - kinds[:i].count(PROMISE)] = distance
    return out


def _check_entries(plan: Sequence[Entry]) -> None:
    """Refuse what is no entry of a plan, or has more members than its kind takes."""
    for entry in plan:
        if isinstance(entry, str) or not isinstance(entry, Sequence) or not entry:
            raise OptionError(
                f"{entry!r} in a plan, needed is a sequence", code="plan", remedy='for example ("base", level)'
            )
        kind = entry[0]
        if kind not in _MEMBERS:
            raise OptionError(f"unknown layer {kind!r} in a plan", code="plan", remedy=f"one of {', '.join(_MEMBERS)}")
        if len(entry) > _MEMBERS[str(kind)]:
            raise OptionError(f"{kind} in a plan takes at most {_MEMBERS[str(kind)] - 1} members", code="plan")


def _operation(
    kind: str, number: object = None, more: object = None, place: Place | None = None, slack: Place | None = None
) -> tuple[Operation, int | None, int, Chosen | None, Place | None, Place | None]:
    """An entry of a plan: operation, argument, unit of offsets, mesh, places of crossings, and slack of these."""
    argument = None if number is None else _count(kind, number)
    if kind == "leaf_base":
        argument = 0
    if kind == "offsets":
        if argument is None or argument % 2 == 0:
            raise OptionError(f"offsets with radix {number}, needed is an odd number", code="plan")
        argument //= 2
    if kind in ("adaptive_base", "adapt"):
        if not isinstance(more, Chosen):
            raise OptionError(f"{kind} in a plan needs the mesh that it leads to", code="plan")
        return Operation[kind.upper()], argument, 0, more, None, None
    return Operation[kind.upper()], argument, 0 if more is None else _count(kind, more), None, place, slack


def _count(kind: str, number: object) -> int:
    """A number in an entry of a plan."""
    if not isinstance(number, Integral) or number < 0:
        raise OptionError(
            f"{kind} in a plan with {number!r}, needed is a whole number", code="plan", remedy="at least 0, or None"
        )
    return int(number)
