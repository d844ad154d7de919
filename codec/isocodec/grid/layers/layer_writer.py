"""The layers of one isovalue, on the encoder's side: from a plan to runs of symbols (spec clauses 3.6, 6.1)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence

from isospec.container import LAYER_LIMIT, Operation
from isospec.elements import BY_LAYER, ELEMENTS

from ...entropy.range_coder import Coder
from ...entropy.run import WritingRun
from ...errors import OptionError
from ...field.samples import Samples
from ...format.chunks import LayerRecord
from ...format.header import Header
from ...format.kinds import GEOMETRY, LayerKind
from ...format.program import Layer, Progress, expand, mask_layers, write_program
from ...kernel import DONE
from ...limits import Limits
from ..lattice.vertex_set import Chosen
from ..passes.runner import Tube
from ..tube.holes import Holes
from ..tube.truth import Place, Truth
from .beginning import begin_layer, leaning_tube, mask_tube
from .plan import PROMISE, Entry, check_entries, operation_of, promised

RUN_BYTES = 1 << 16
"""A run is ended at the first end of a layer after this many bytes."""


def field_tube(
    header: Header, field: Samples, truth: Truth, lean: Tube | None = None, other: float = 0.0,
    holes: Holes | None = None, frame: bool = False, coder: Coder | None = None,
) -> Tube:
    """The encoder's tube of a field at its isovalue, leaning on that of the isovalue ``other`` or on none."""
    return leaning_tube(
        header, field.isovalue, lean, other, 1 << 16, Limits(), truth, holes=holes, frame=frame, coder=coder
    )


def encoded_mask(header: Header, field: Samples, truth: Truth) -> tuple[bytes, Holes]:
    """Code the run of a mask (spec clause 5.10.1); the run, and the holes that it describes."""
    tube = mask_tube(header, 1 << 16, Limits(), truth)
    layers = mask_layers(tube.n, tube.full_level)
    plan: list[Entry] = [("base", layers[0].level)]
    plan += [("refine", None)] if len(layers) > 1 else []
    run = LayerWriter(field, tube, plan, Progress(tube.full_level)).encode_run(0, lambda: None, math.inf)[1]
    return run, Holes(tube.state)


class LayerWriter:
    """Encodes the layers of one isovalue.

    Parameters
    ----------
    field : Samples
    tube : Tube
    plan : sequence of entries
    progress : Progress
        Positions in the programs when the strand begins.

    Attributes
    ----------
    layers : list of Layer
        Known so far: values wait until their range is known.
    records : list of LayerRecord
        For the layers that are done.
    run_bytes : int
    ends : list of int
        Number of layers by the end of each entry of the plan, as far as known.
    within : dict of int to float
        What the plan promises, by number of layers (see `Promises`).
    """

    def __init__(self, field: Samples, tube: Tube, plan: Sequence[Entry], progress: Progress) -> None:
        self.field = field
        self.tube = tube
        self.layers: list[Layer] = []
        self.records: list[LayerRecord] = []
        self.run_bytes = 0
        self.progress = progress
        self._stated = progress.copy()
        self.ends: list[int] = []
        self.within: dict[int, float] = {}
        self._entries: list[Entry] = []
        self._plan: deque[tuple[Operation, int | None, int, Chosen | None, Place | None, Place | None]] = deque()
        check_entries(plan)
        self._promised = promised(plan)
        self._expanded = 0
        self._meshes: dict[int, Chosen] = {}
        self._places: dict[int, Place] = {}
        self._slack: dict[int, Place] = {}
        self._whole: list[tuple[int, bytes]] = []
        self._open: tuple[WritingRun, int, int] | None = None
        self.go_on(plan)

    def go_on(self, plan: Sequence[Entry]) -> None:
        """Append validated entries, without promises."""
        if not self.field.integer and self.field.scale is None and any(entry[0] == LayerKind.VALUES for entry in plan):
            raise OptionError("a plan with values of floats needs a step", code="plan", remedy="give step")
        entries = [entry for entry in plan if entry[0] != PROMISE]
        self._entries += entries
        self._plan += [operation_of(*entry) for entry in entries]  # type: ignore[arg-type]
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
            if operation == Operation.VALUES and unit:
                # down to so many bits, of which there may be fewer
                number = max(state.plane - unit, 0)
            try:
                fresh = expand(operation, number or 0, number is None, state, unit)
            except ValueError as error:
                fewer = "fewer bits, or all of them" if operation == Operation.VALUES else None
                raise OptionError(
                    f"the plan cannot be carried out: {self._entries[self._expanded]!r}: {error}", code="plan",
                    remedy=fewer,
                ) from None
            if state.layers + len(fresh) > LAYER_LIMIT:
                raise OptionError(
                    f"more than {LAYER_LIMIT:,} layers, which is as many as a file may have", code="plan",
                    remedy="fewer of them, or fewer isovalues",
                )
            for layer in fresh:
                state.add(layer)
            if mesh is not None:
                self._meshes[len(self.layers)] = mesh
            if place is not None:
                self._places[len(self.layers)] = place
            if slack is not None:
                self._slack[len(self.layers)] = slack
            self.layers += fresh
            self._plan.popleft()
            self._expanded += 1
            self.ends.append(len(self.layers))
            if self._expanded in self._promised:
                self.within[len(self.layers)] = self._promised[self._expanded]

    @property
    def planned(self) -> int:
        """Layers that are known, and operations of the plan that wait."""
        return len(self.layers) + len(self._plan)

    @property
    def has_values(self) -> bool:
        """Whether values come."""
        return any(operation == Operation.VALUES for operation, *_ in self._plan)

    def to_level(self, level: int | None) -> int:
        """Number of layers up to a level, before any geometry; of all that are known if no level is given."""
        if level is None:
            return len(self.layers)
        return next((i for i, one in enumerate(self.layers) if one.level > level or one.kind in GEOMETRY),
                    len(self.layers))

    def program(self, first: int, end: int) -> bytes:
        """Write the program of some layers, those before which have been stated."""
        return write_program(self.layers[first:end], self._stated, self.bits)

    def encode_layer(self, run: WritingRun, number: int, begun: int) -> int:
        """Encode a layer in a run, maybe of several isovalues, that has ``begun`` bytes; how many it has then."""
        tube = self.tube
        tube.coder = run.coder
        before = tube.tally()
        self._advance(run, number)
        symbols = tube.tally() - before
        used = run.coder.reg.pos + 4
        counts = {name: int(symbols[ELEMENTS.index(name)]) for name in BY_LAYER[self.layers[number].kind]}
        self.records.append(LayerRecord(used - begun, counts))
        self._extend()
        return used

    def rest(self) -> None:
        """All layers have been encoded: keep only what others may lean on."""
        self.tube.rest()
        del self.field

    def encode_run(
        self, first: int, report: Callable[[], object], enough: float | None = None, last: int | None = None
    ) -> tuple[int, bytes]:
        """Encode layers from number ``first`` on until the run has enough bytes, or has layer ``last``; their end and
        the bytes.
        """
        if self._whole:
            end, data = self._whole.pop(0)
            for _ in range(first, end):
                report()
            return end, data
        run, end, _ = self._encode(first, report, RUN_BYTES if enough is None else enough, last)
        return end, self._ended(run, first, end)

    def trial(self) -> int:
        """Encode the layers so far; the bytes that their runs take if nothing follows.

        What `encode_run` hands out afterwards begins with them: they are not encoded again.
        """
        first = 0
        while first < len(self.layers):
            run, end, full = self._encode(first, lambda: None, RUN_BYTES, None)
            if not full:
                return self.run_bytes + len(run.end())
            self._whole.append((end, self._ended(run, first, end)))
            first = end
        return self.run_bytes

    def _encode(
        self, first: int, report: Callable[[], object], enough: float, last: int | None
    ) -> tuple[WritingRun, int, bool]:
        """Go on with a run of the layers from ``first`` on; the run, the layer it has reached, and whether it ends.
        """
        run, i, begun = self._open or (WritingRun(self.tube.coder), first, 0)
        for _ in range(first, i):
            report()
        full = False
        while i < len(self.layers) and not full:
            begun = self.encode_layer(run, i, begun)
            i += 1
            report()
            full = begun >= enough or i - 1 == last
        self._open = run, i, begun
        return run, i, full

    def _ended(self, run: WritingRun, first: int, end: int) -> bytes:
        """The bytes of a run."""
        self._open = None
        data = run.end()
        # what the decoder's window reads past the end of the run belongs to no layer
        self._trim(first, end, len(data))
        self.run_bytes += len(data)
        return data

    def _trim(self, first: int, end: int, length: int) -> None:
        place = 0
        for i in range(first, end):
            stop = min(place + self.records[i].bytes, length)
            self.records[i] = LayerRecord(stop - place, self.records[i].symbols)
            place = stop

    def _advance(self, run: WritingRun, number: int) -> None:
        tube = self.tube
        if number in self._meshes:
            tube.choose(self._meshes[number])
        if number in self._places:
            tube.estimates.place = self._places[number]
        tube.estimates.slack = self._slack.get(number)
        begin_layer(tube, self.layers[number])
        while tube.advance() != DONE:
            run.widen()
            tube.coder = run.coder
