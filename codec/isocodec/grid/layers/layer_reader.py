"""The layers of chunks, on the decoder's side: from a run of symbols to events (spec clauses 3.6, 6.1)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from isospec.container import LAYER_LIMIT
from isospec.elements import BY_LAYER, ELEMENTS

from ...entropy.range_coder import Coder
from ...entropy.run import Account, ReadingRun
from ...errors import FormatError, LimitError
from ...format.chunks import Envelope
from ...format.events import Event, LayerComplete
from ...format.program import Layer, ProgramReader, Progress, mask_layers
from ...kernel import DONE, SPENT
from ...limits import WORK_LIST, Limits
from ..passes.runner import Tube, out_of_steps
from .beginning import begin_layer


@dataclass
class BegunRun:
    """A run that the decoder has begun, for those who want to end it elsewhere.

    Attributes
    ----------
    chunk_start, program_start, start : int
        Byte offsets of its chunk, its layer program and its first byte.
    layers : list of Layer
        Of each isovalue.
    turn : range
        Numbers of the isovalues.
    before : Progress
        Where the programs of the first of them stood before.
    done : int
        Layers of the file that were complete before.
    """

    chunk_start: int
    program_start: int
    start: int
    layers: list[Layer]
    turn: range
    before: Progress
    done: int = 0


class _Steps:
    """Sum of the steps of inference of tubes of which only a few change at a time."""

    def __init__(self) -> None:
        self._still = 0
        self._watched: list[tuple[Tube, int]] = []

    @property
    def now(self) -> int:
        """Steps that all tubes have taken while they were watched."""
        return self._still + sum(tube.steps - began for tube, began in self._watched)

    def watch(self, *tubes: Tube) -> None:
        """Watch these tubes from now on, and no others: they take the steps."""
        self._still = self.now
        self._watched = [(tube, tube.steps) for tube in tubes]


class Turns(Protocol):
    """Selection of the isovalues that layers belong to."""

    @property
    def turn(self) -> range:
        """Numbers of the isovalues that the next chunk of layers belongs to."""

    def lean(self, number: int) -> int | None:
        """Number of the isovalue of a turn that this one leans on, which may have had layers since this one began."""

    def ready(self, number: int) -> Tube:
        """The tube of an isovalue whose next layer begins or goes on."""

    def layered(self, number: int) -> None:
        """A chunk of layers of an isovalue has begun."""


class Alone:
    """The turns of a single tube."""

    turn = range(1)

    def __init__(self, tube: Tube) -> None:
        self._tube = tube

    def lean(self, number: int) -> int | None:
        """See `Turns.lean`."""
        return None

    def ready(self, number: int) -> Tube:
        """See `Turns.ready`."""
        return self._tube

    def layered(self, number: int) -> None:
        """See `Turns.layered`."""


class LayerReader:
    """Decodes chunks of layers, as far as their bytes have come.

    Parameters
    ----------
    limits : Limits
    data : bytearray
        The file as far as it has come; it grows.
    tubes : list of Tube or None
        Those of all isovalues; the last one's layers come at present.
    progresses : list of Progress
        Positions in their programs.
    beside : list of Tube or None
        Others that have a part in the limits.
    layers : list of Layer
        Those announced so far; it grows.
    account : Account
        The file's.
    turns : Turns

    Attributes
    ----------
    runs : list of BegunRun
    """

    def __init__(
        self, limits: Limits, data: bytearray, tubes: list[Tube | None], progresses: list[Progress],
        beside: list[Tube | None], layers: list[Layer], account: Account, turns: Turns,
    ) -> None:
        self.limits = limits
        self.layers = layers
        self.runs: list[BegunRun] = []
        self._data = data
        self._tubes = tubes
        self._progresses = progresses
        self._beside = beside
        self._account = account
        self._turns = turns
        self._reading: tuple[Tube, ReadingRun] | None = None
        self._pending: deque[tuple[int, Layer]] | None = None
        self._program: ProgramReader | None = None
        self._program_start = 0
        self._before = np.zeros(len(ELEMENTS), np.int64)
        self._layer_start = 0
        self._done = 0
        self._turned: Tube | None = None
        self._tally_began = np.zeros(len(ELEMENTS) + 2, np.int64)
        self._tally = np.zeros(len(ELEMENTS) + 2, np.int64)
        self._work = _Steps()
        self._frame_work = self._counted = 0

    @property
    def coder(self) -> Coder:
        """The coder of the last run that was begun."""
        return self._run.coder

    @property
    def _run(self) -> ReadingRun:
        """The last run that was begun."""
        assert self._reading is not None
        return self._reading[1]

    @property
    def waiting(self) -> bool:
        """Whether layers of the chunk are still to come."""
        return self._pending is None or bool(self._pending)

    def drop(self, number: int) -> None:
        """Keep nothing of what was decoded of an isovalue but how many symbols it took."""
        tube = self._tubes[number]
        assert tube is not None
        self._tubes[number] = None
        if self._turned is tube:
            self._turn_to(None)
        if self._reading is not None and self._reading[0] is tube:
            self._reading = None

    def next_frame(self) -> None:
        """A further frame begins: keep of the present one how many symbols it took."""
        self._turn_to(None)
        self._frame_work = self._work.now
        self.runs.clear()

    def _turn_to(self, tube: Tube | None) -> None:
        """Count what the isovalue whose layers came so far took; those of another one, or of none, come from now on."""
        self._tally = self.tally()
        self._turned = tube
        if tube is not None:
            self._tally_began = tube.tally()
        self._work.watch(*(one for one in (tube, tube and tube.lean) if one))

    def leave(self) -> None:
        """The chunk has been read."""
        self._pending = None

    def symbols(self) -> NDArray[np.int64]:
        """Symbols by syntax element so far, of all isovalues."""
        return self.tally()[: len(ELEMENTS)]

    def tally(self) -> NDArray[np.int64]:
        """Symbols by syntax element, then predictions and right ones."""
        return self._tally + (0 if self._turned is None else self._turned.tally() - self._tally_began)

    def _steps(self) -> int:
        """Steps of inference so far, of all tubes of the frame."""
        return self._work.now - self._frame_work + sum(tube.steps for tube in self._beside if tube)

    def go_on(self, chunk: Envelope, chunk_start: int) -> Event | None:
        """Go on with a chunk of layers; None if all are done or more bytes are needed."""
        there = min(len(self._data), chunk.end)
        whole = there == chunk.end
        if self._pending is None and not self._open_run(chunk, chunk_start, there, whole):
            return None
        run = self._arrived(there, whole)
        while self._pending:
            number, layer = self._pending[0]
            try:
                tube = self._present(number, run)
                if not tube.running:
                    run.spend(_listed(tube))
                    self._grant(run)
                    begin_layer(tube, layer)
                status = tube.advance()
                while status == SPENT:
                    self._grant(run)
                    status = tube.advance()
                if self._steps() >= self.limits.steps:
                    raise out_of_steps(self.limits)
            except (FormatError, LimitError) as error:
                error.offset = run.place
                raise
            if status != DONE:
                return None
            self._pending.popleft()
            return self._completed(layer, chunk)
        if whole:
            run.end()
        return None

    def _present(self, number: int, run: ReadingRun) -> Tube:
        """The tube of an isovalue, with its models in the run's coder."""
        tube = self._turns.ready(number)
        if self._turned is not tube:
            self._turn_to(tube)
        own = tube.coder
        if own is not run.coder:
            run.coder = run.coder._replace(prob=own.prob, seen=own.seen, rate=own.rate, blend=own.blend)
            tube.coder = run.coder
        self._reading = tube, run
        bits = self._progresses[number].bits
        if bits is not None:
            tube.estimates.bits = bits
        return tube

    def _grant(self, run: ReadingRun) -> None:
        """Allow some more symbols, counting the steps of inference so far."""
        steps = self._work.now
        self._account.steps += steps - self._counted
        self._counted = steps
        run.grant()

    def _open_run(self, chunk: Envelope, chunk_start: int, there: int, whole: bool) -> bool:
        """Read the program of a chunk and start its run; False if more bytes are needed."""
        if self._program is None:
            self._program = ProgramReader(chunk.start, self._progress(self._turns.turn[0]))
            self._program_start = chunk.start
        program = self._program
        if not program.read(self._data, there):
            return self._incomplete(there, whole)
        turn = self._turns.turn
        programs = [program, *(self._same(number, program, there) for number in turn[1:])]
        for number in turn:
            self._turns.layered(number)
        counted = len(self.layers) + len(turn) * len(program.layers)
        if counted > LAYER_LIMIT:
            raise FormatError(f"more than {LAYER_LIMIT:,} layers", code="layers", offset=self._program_start,
                              clause="11.1")
        if counted > self.limits.layers:
            raise LimitError(
                f"more than {self.limits.layers} layers", code="limit-layers", offset=self._program_start, clause="11.2"
            )
        before = self._progresses[turn[0]]
        for number, one in zip(turn, programs, strict=True):
            self._progresses[number] = one.progress
        self._program = None
        self._begin_run(BegunRun(
            chunk_start, self._program_start, program.at, program.layers, turn, before, self._done
        ), [one.layers for one in programs])
        return True

    def _progress(self, number: int) -> Progress:
        """Copy the state of the programs of an isovalue, for its next one."""
        found = self._progresses[number].copy()
        found.layers = len(self.layers)
        if (lean := self._turns.lean(number)) is not None:
            found.lean_level = self._progresses[lean].level
        return found

    def _same(self, number: int, first: ProgramReader, there: int) -> ProgramReader:
        """The program that has been read for the first isovalue of a turn, for another one."""
        found = ProgramReader(self._program_start, self._progress(number))
        if not found.read(self._data, there) or found.at != first.at or len(found.layers) != len(first.layers):
            raise FormatError("a program differs among the isovalues of a turn", code="program",
                              offset=self._program_start, clause="3.5.9")
        return found

    def _begin_run(self, run: BegunRun, layers: Sequence[Sequence[Layer]]) -> None:
        """Begin the layers of a run, those of each isovalue of the turn."""
        self._pending = deque(
            (number, layer) for each in zip(*layers, strict=True) for number, layer in zip(run.turn, each, strict=True)
        )
        self.layers += [layer for _, layer in self._pending]
        self._layer_start = 0
        coder = self._turns.ready(run.turn[0]).coder
        reading = ReadingRun(coder, self._account, run.start)
        self._reading = self._turns.ready(run.turn[0]), reading
        self.runs.append(run)

    @staticmethod
    def _incomplete(there: int, whole: bool) -> bool:
        """A program that is not all there: an error if no more of it can come."""
        if whole:
            raise FormatError("a layer program is not complete", code="program", offset=there, clause="3.6")
        return False

    def _arrived(self, there: int, whole: bool) -> ReadingRun:
        """The present run, with bytes of it that have come since."""
        run = self._run
        run.feed(self._data[run.at + run.read : there], whole)
        return run

    def _completed(self, layer: Layer, chunk: Envelope) -> Event:
        self._done += 1
        counts = self.symbols()
        fresh = (counts - self._before).tolist()
        self._before = counts
        run = self._run
        used = min(run.passed + 4, chunk.end - run.at)
        took, self._layer_start = used - self._layer_start, used
        symbols = {name: fresh[ELEMENTS.index(name)] for name in BY_LAYER[layer.kind]}
        return LayerComplete(run.at + used, self._done, layer, symbols, took)


class MaskReader(LayerReader):
    """Decodes the chunk of a mask, whose layers are always the same (spec clause 5.10.1).

    Parameters
    ----------
    limits, data
        As of `LayerReader`.
    tube : Tube
    beside : list of Tube or None
        Those of the isovalues.
    account : Account
    """

    def __init__(
        self, limits: Limits, data: bytearray, tube: Tube, beside: list[Tube | None], account: Account
    ) -> None:
        super().__init__(limits, data, [tube], [Progress(tube.full_level)], beside, [], account, Alone(tube))

    def _open_run(self, chunk: Envelope, chunk_start: int, there: int, whole: bool) -> bool:
        tube = self._turns.ready(0)
        layers = mask_layers(tube.n, tube.full_level)
        run = BegunRun(chunk_start, chunk.start, chunk.start, layers, range(1), self._progresses[0])
        self._begin_run(run, [layers])
        return True

    def read(self, chunk: Envelope, chunk_start: int) -> bool:
        """Go on with the chunk; whether all of it has been read."""
        while self.go_on(chunk, chunk_start) is not None:
            pass
        return not self.waiting


def _listed(tube: Tube) -> int:
    """Work that beginning a layer counts: lists over what is there, or over the frame before."""
    first = tube.lean if tube.follows else None
    return ((first or tube).vertices + (first or tube).simplices) // WORK_LIST
