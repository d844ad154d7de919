"""The layers of chunks, on the decoder's side: from a run of symbols to events (spec clauses 3.6, 6.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType
from isospec.elements import BY_LAYER, ELEMENTS

from ...entropy.range_coder import UNLIMITED, Coder
from ...entropy.run import Account, ReadingRun
from ...errors import FormatError, LimitError
from ...format.chunks import Envelope
from ...format.events import BaseComplete, Event, GeometryRefined, LayerComplete, LevelComplete
from ...format.header import varint
from ...format.kinds import BASES, GEOMETRY, LayerKind
from ...format.program import Layer, ProgramReader, Progress, mask_layers
from ...kernel import CUT, DONE
from ...limits import WORK_LIST, Limits
from ..passes.runner import Tube, out_of_steps
from .beginning import begin_layer

_EVENTS: dict[str, type[LayerComplete]] = {
    **dict.fromkeys(BASES, BaseComplete),
    LayerKind.REFINE: LevelComplete,
    LayerKind.ADAPT: LevelComplete,
    **dict.fromkeys(GEOMETRY, GeometryRefined),
}


@dataclass
class BegunRun:
    """A run that the decoder has begun, for those who want to end it elsewhere.

    Attributes
    ----------
    chunk_start, program_start, start : int
        Byte offsets of its chunk, its layer program and its first byte.
    layers : list of Layer
    before : Progress
        Where the programs stood before.
    symbols : int
        The stated number of symbols of a cut run, or no limit.
    done : int
        Layers of the file that were complete before.
    """

    chunk_start: int
    program_start: int
    start: int
    layers: list[Layer]
    before: Progress
    symbols: int
    done: int = 0


class LayerReader:
    """Decodes chunks of layers, as far as their bytes have come.

    Parameters
    ----------
    limits : Limits
    data : bytearray
        The file as far as it has come; it grows.
    tubes : list of Tube or None
        Of all isovalues; the last one's layers come at present.
    progresses : list of Progress
        Positions in their programs.
    beside : list of Tube or None
        Others that have a part in the limits.
    layers : list of Layer
        Those announced so far; it grows.
    account : Account
        Of the file.

    Attributes
    ----------
    runs : list of BegunRun
    """

    def __init__(
        self, limits: Limits, data: bytearray, tubes: list[Tube | None], progresses: list[Progress],
        beside: list[Tube | None], layers: list[Layer], account: Account,
    ) -> None:
        self.limits = limits
        self.layers = layers
        self.runs: list[BegunRun] = []
        self._data = data
        self._tubes = tubes
        self._progresses = progresses
        self._beside = beside
        self._account = account
        self._reading: tuple[Tube, ReadingRun] | None = None
        self._pending: list[Layer] | None = None
        self._program: ProgramReader | None = None
        self._program_start = 0
        self._symbols = UNLIMITED
        self._before = np.zeros(len(ELEMENTS), np.int64)
        self._dropped = np.zeros(len(ELEMENTS) + 2, np.int64)
        self._layer_start = 0
        self._done = 0
        self._spent = self._counted = 0

    @property
    def _tube(self) -> Tube:
        """The tube of the isovalue whose layers come at present."""
        tube = self._tubes[-1]
        assert tube is not None, "chunks of isovalues that are skipped are not read"
        return tube

    @property
    def _progress(self) -> Progress:
        return self._progresses[-1]

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
        self._dropped = self._dropped + tube.tally()
        self._tubes[number] = None
        if self._reading is not None and self._reading[0] is tube:
            self._reading = None

    def next_frame(self, before: list[Tube | None]) -> None:
        """A further frame begins: keep of the present one how many symbols it took; ``before`` is let go of."""
        for tube in filter(None, self._tubes):
            self._dropped = self._dropped + tube.tally()
        self._spent += sum(tube.steps for tube in before if tube)
        self.runs.clear()

    def leave(self) -> None:
        """The chunk has been read."""
        self._pending = None

    @property
    def run_symbols(self) -> int:
        """Symbols that have been decoded of the last run that was begun."""
        return self._run.symbols

    def symbols(self) -> NDArray[np.int64]:
        """Symbols by syntax element so far, of all isovalues."""
        return self.tally()[: len(ELEMENTS)]

    def tally(self) -> NDArray[np.int64]:
        """Symbols by syntax element, then predictions and right ones."""
        return sum((tube.tally() for tube in self._tubes if tube), self._dropped)

    def _steps(self) -> int:
        """Steps of inference so far, of all tubes."""
        return sum(tube.steps for tube in (*self._tubes, *self._beside) if tube)

    def go_on(self, chunk: Envelope, chunk_start: int) -> Event | None:
        """Go on with a chunk of layers; None if all are done or more bytes are needed."""
        there = min(len(self._data), chunk.end)
        whole = there == chunk.end
        if self._pending is None and not self._open_run(chunk, chunk_start, there, whole):
            return None
        run = self._arrived(there, whole)
        while self._pending:
            layer = self._pending[0]
            try:
                if not self._tube.running:
                    self._account.units += _listed(self._tube)
                    self._grant(run)
                    begin_layer(self._tube, layer)
                status = self._tube.advance()
                while status == CUT and not run.complete:
                    self._grant(run)
                    status = self._tube.advance()
                if self._steps() >= self.limits.steps:
                    raise out_of_steps(self.limits)
            except (FormatError, LimitError) as error:
                error.offset = run.place
                raise
            if status == CUT:
                self._pending = []
            elif status != DONE:
                return None
            else:
                self._pending.pop(0)
                return self._completed(layer, chunk)
        if whole:
            run.end()
        return None

    def _grant(self, run: ReadingRun) -> None:
        """Allow some more symbols, counting the steps of inference so far."""
        steps = sum(tube.steps for tube in self._tubes if tube) + self._spent
        self._account.steps += steps - self._counted
        self._counted = steps
        run.grant()

    def _open_run(self, chunk: Envelope, chunk_start: int, there: int, whole: bool) -> bool:
        """Read the program of a chunk and start its run; False if more bytes are needed."""
        if self._program is None:
            at = chunk.start
            self._symbols = UNLIMITED
            if chunk.type == ChunkType.CUT_LAYERS:
                number = varint(self._data, at, there, "3.5.4")
                if number is None:
                    return self._incomplete(there, whole)
                self._symbols, at = number
            self._program = ProgramReader(at, self._progress.copy())
            self._program_start = at
        program = self._program
        if not program.read(self._data, there):
            return self._incomplete(there, whole)
        if program.progress.layers > self.limits.layers:
            raise LimitError(
                f"more than {self.limits.layers} layers", code="limit-layers", offset=self._program_start, clause="11.2"
            )
        before, self._progresses[-1] = self._progress, program.progress
        self._program = None
        start = self._program_start
        self._begin_run(BegunRun(chunk_start, start, program.at, program.layers, before, self._symbols, self._done))
        if self._progress.bits is not None:
            self._tube.estimates.bits = self._progress.bits
        return True

    def _begin_run(self, run: BegunRun) -> None:
        """Begin the layers of a run."""
        self._pending = list(run.layers)
        self.layers += run.layers
        self._layer_start = 0
        tube = self._tube
        self._reading = tube, ReadingRun(tube.coder, self._account, run.start, stated=run.symbols)
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
        self._tube.coder = run.coder
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
        return _EVENTS[layer.kind](run.at + used, self._done, layer, symbols, took)


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
        super().__init__(limits, data, [tube], [Progress(tube.full_level)], beside, [], account)

    def _open_run(self, chunk: Envelope, chunk_start: int, there: int, whole: bool) -> bool:
        layers = mask_layers(self._tube.n, self._tube.full_level)
        self._begin_run(BegunRun(chunk_start, chunk.start, chunk.start, layers, self._progress, UNLIMITED))
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
