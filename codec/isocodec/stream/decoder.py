"""The incremental decoder: bytes in, events and snapshots out (spec clause 8). It does no input or output itself."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from copy import copy
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType
from isospec.elements import ELEMENTS

from ..drawing.contour import Contour
from ..drawing.mask import MaskRows
from ..drawing.tessellation import Tessellation
from ..entropy.range_coder import Coder
from ..errors import FormatError, IsoError, LimitError, OptionError, TruncatedError, out_of_memory
from ..format.chunks import (
    CRITICAL,
    Envelope,
    octets,
    read_envelope,
    verify,
)
from ..format.header import Header, read_header
from ..format.program import Layer, Progress
from ..layers.contents import LAYER_CHUNKS, Contents
from ..layers.events import ChunkSkipped, End, Event, HeaderRead, IsovalueRead, MaskComplete
from ..layers.reader import LayerReader
from ..limits import Budget, Limits
from ..passes.runner import Tube
from ..passes.snapshot import state_of
from ..tube.decoded import Decoded
from .drawn import contour_of, mask_rows_of, mesh_of, tessellation_of, valid_rows_of
from .tubes import Tubes


class Decoder:
    """Decodes a file as its bytes come in.

    ``feed`` only stores; iterating decodes and yields events until more bytes are needed; ``snapshot`` draws what
    has been received, at any moment; ``close`` says that no more will come. Nothing depends on how the
    bytes were cut. An error is raised again by every later call.

    Parameters
    ----------
    limits : Limits, optional
    only : collection of int, optional
        Numbers of the isovalues to decode, from 0; the chunks of others are skipped. Those that they lean on are
        needed, too. All isovalues if not given.

    Attributes
    ----------
    header : Header or None
    isovalues : list of float
        Those that have come so far, skipped ones included.
    layers : list of Layer
        Layers announced so far.
    metadata : dict of str to str
    runs : list of Run

    Raises
    ------
    FormatError
        From iterating or ``close``: the bytes violate the specification.
    LimitError
        From iterating: the file needs more than the limits allow.
    """

    def __init__(self, limits: Limits | None = None, *, only: Collection[int] | None = None) -> None:
        self.limits = limits or Limits()
        self.header: Header | None = None
        self._data = bytearray()
        self._at = 0
        self._chunk: Envelope | None = None
        self._chunk_start = 0
        self.layers: list[Layer] = []
        self._contents = Contents(layers=self.layers)
        self._budget = Budget(self.limits.memory)
        self._strands = strands = Tubes(self.limits, self._data, self._contents, self._budget, only)
        self._tubes, self._progresses, self._mask = strands.all, strands.progresses, strands.mask
        self._reader = LayerReader(
            self.limits, self._data, self._tubes, self._progresses, self._mask.tubes, self.layers
        )
        self.isovalues = self._contents.isovalues
        self.metadata = self._contents.metadata
        self.runs = self._reader.runs
        self._cut = False
        self._last = False
        self._ended = False
        self._closed = False
        self._error: IsoError | None = None

    # -- in ------------------------------------------------------------------------------------------------------

    def feed(self, data: bytes | bytearray | memoryview) -> None:
        """Store some more bytes of the file."""
        if self._error is not None:
            raise copy(self._error)
        if self._closed:
            raise TruncatedError("bytes fed after close", code="closed")
        data = octets(data)
        if len(self._data) + len(data) > self.limits.bytes:
            self._fail(LimitError(f"more than {self.limits.bytes} bytes", code="limit-bytes", clause="11.2"))
        self._data += data

    def close(self) -> None:
        """Say that no more bytes will come; events that are still due are dropped.

        Raises
        ------
        TruncatedError
            If the file is not complete. ``snapshot`` still works.
        """
        for _ in self:
            pass
        self._closed = True
        if not self._ended:
            raise TruncatedError(
                f"the file ends after {len(self._data)} bytes, before it is complete", code="truncated",
                offset=len(self._data), clause="8.3",
            )  # fmt: skip

    # -- out -----------------------------------------------------------------------------------------------------

    @property
    def complete(self) -> bool:
        """Whether the whole file has been received and verified."""
        return self._ended

    @property
    def _tube(self) -> Tube | None:
        """That of the isovalue whose layers come at present; None if it is skipped."""
        return self._strands.present

    @property
    def _progress(self) -> Progress:
        return self._progresses[-1]

    @property
    def value_bits(self) -> tuple[int, int]:
        """Bits of the numbers above and below the isovalue, as far as stated."""
        return (self._progress.bits if self._progresses else None) or (0, 0)

    @property
    def coder(self) -> Coder:
        """The coder of the last run that was begun."""
        return self._reader.coder

    @property
    def run_symbols(self) -> int:
        """Symbols that have been decoded of the last run that was begun."""
        return self._reader.run_symbols

    @property
    def memory(self) -> int:
        """Bytes that count to `Limits.memory` at present."""
        return self._budget.held

    @property
    def symbols(self) -> dict[str, int]:
        """Symbols received so far, by syntax element."""
        return dict(zip(ELEMENTS, map(int, self._reader.symbols()), strict=True))

    @property
    def predictions(self) -> tuple[int, int]:
        """Signs that were predicted so far, and how many of them rightly."""
        tallies = [tube.tally()[-2:] for tube in self._tubes if tube]
        return sum(int(t[0]) for t in tallies), sum(int(t[1]) for t in tallies)

    def __iter__(self) -> Iterator[Event]:
        while True:
            if self._error is not None:
                raise copy(self._error)
            failure: IsoError | None = None
            try:
                event = self._step()
            except IsoError as error:
                failure = error
            except MemoryError:
                failure = out_of_memory("to decode")
            if failure is not None:
                self._fail(failure)
            if event is None:
                return
            yield event

    def _tube_of(self, number: int) -> Tube | None:
        """That of an isovalue, by number; None before it has come, or if it is skipped."""
        if isinstance(self._error, LimitError):
            # what was decoded has been dropped
            raise copy(self._error)
        if number < 0:
            raise OptionError(f"isovalue number {number}; they are counted from 0", code="isovalue")
        return self._tubes[number] if number < len(self._tubes) else None

    def state(self, number: int = 0) -> Decoded | None:
        """The decoded state of an isovalue, by number, in integers; None before it has come, or if it is skipped."""
        tube = self._tube_of(number)
        return state_of(tube) if tube else None

    def mask_state(self) -> Decoded | None:
        """The decoded state of the mask, likewise; None before its chunk has come."""
        return state_of(self._mask.tube) if self._mask.tube else None

    def snapshot(self, number: int = 0, smooth: bool = False) -> Contour:
        """The curve or surface of all symbols received of an isovalue (spec clause 9).

        What a half-received layer has not reached yet stays as the layer before left it. ``smooth`` as in `decode`.
        """
        for _ in self:
            pass
        return self.drawn(number, smooth)

    def drawn(self, number: int = 0, smooth: bool = False, through_holes: bool = False) -> Contour:
        """Like ``snapshot``, but of the events taken so far only; ``through_holes`` as in `decode`.

        Raises
        ------
        LimitError
            If drawing takes more memory than the limits allow; the decoder stays as it is.
        """
        try:
            return self._drawn(number, smooth, through_holes)
        except MemoryError:
            pass
        raise out_of_memory("to draw the contour")

    def _drawn(self, number: int, smooth: bool, through_holes: bool) -> Contour:
        tube = self._tube_of(number)
        isovalue = self.isovalues[number] if tube else math.nan
        complete = self._ended and not self._cut
        return contour_of(
            tube, isovalue, self.header, self.metadata, complete, smooth, self._budget, self._mask.holes, through_holes
        )

    def mask(self, number: int = 0) -> NDArray[np.bool_]:
        """Which samples lie above an isovalue, by number, as of the events taken so far (spec clause 9.7).

        Raises
        ------
        TruncatedError
            If that has not been received yet.
        OptionError
            If the file does not tell: its mesh is coarser than the samples.
        LimitError
            If there are more samples than the limits allow.
        """
        try:
            return self.mask_rows(number).whole()
        except MemoryError:
            pass
        raise out_of_memory("for the mask")

    def mask_rows(self, number: int = 0, last_first: bool = False) -> MaskRows:
        """The same some rows at a time, so that the mask need not be in memory as a whole.

        With ``last_first`` of the transposed array, whose first axis is the last one.

        Raises
        ------
        TruncatedError, OptionError, LimitError
            As `mask`.
        """
        tube = self._tube_of(number)
        return mask_rows_of(tube, len(self._data), self.complete, last_first, self.limits, self._budget)

    def valid(self) -> NDArray[np.bool_]:
        """Which samples are valid, as of the events taken so far; all are if the file has no mask.

        Raises
        ------
        TruncatedError
            If a mask may still come.
        LimitError
            If there are more samples than the limits allow.
        """
        try:
            return self.valid_rows().whole()
        except MemoryError:
            pass
        raise out_of_memory("for the mask")

    def valid_rows(self, last_first: bool = False) -> MaskRows:
        """The same some rows at a time; ``last_first`` and errors as in `mask_rows`."""
        if isinstance(self._error, LimitError):
            raise copy(self._error)
        tube, received = self._mask.tube if self._mask.holes else None, len(self._data)
        return valid_rows_of(tube, self.header, received, self.complete, last_first, self.limits, self._budget)

    def mesh(self, number: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """The crossed leaves of the mesh: positions (V, n) and vertices of simplices (M, n + 1), both int64."""
        n = len(self.header.shape) if self.header else 2
        return mesh_of(self._tube_of(number), n, self._budget)

    def tessellation(self, number: int = 0, whole: bool = True) -> Tessellation:
        """The mesh of an isovalue, by number, with signs of vertices: of the whole box, or its crossed leaves alone.

        Raises
        ------
        TruncatedError
            If that has not been received yet.
        LimitError
            If it takes more memory than the limits allow; the decoder stays as it is.
        """
        tube = self._tube_of(number)
        isovalue = self.isovalues[number] if tube else math.nan
        complete = self._ended and not self._cut
        try:
            return tessellation_of(tube, isovalue, self.header, self.metadata, complete, whole, self._budget)
        except MemoryError:
            pass
        raise out_of_memory("for the mesh")

    def hold(self, size: int) -> None:
        """Count ``size`` bytes that the caller holds, of drawings for example, to the limit of memory from now on.

        Raises
        ------
        LimitError
            If that is more than there may be; the decoder stays as it is.
        """
        self._budget.hold(self, size)

    def discard(self, number: int | None = None) -> None:
        """Drop what has been decoded of an isovalue, or of all: to free memory once it has been drawn.

        What is to come must not lean on it.
        """
        for i, tube in enumerate(self._tubes):
            if tube is not None and number in (None, i):
                self._budget.release(tube, tube.estimates)
                self._reader.drop(i)

    # -- the machine ---------------------------------------------------------------------------------------------

    def _fail(self, error: IsoError) -> NoReturn:
        """Raise an error, now and whenever the decoder is used again."""
        # the frames of a traceback would keep everything that was decoded as long as somebody keeps the error
        error.with_traceback(None)
        self._error = copy(error)
        if isinstance(error, LimitError):
            self.discard()
            self._mask.drop()
        raise error

    def _step(self) -> Event | None:
        """Next event; None if it needs more bytes."""
        while not self._ended:
            if self._last:
                self._ended = True
                return End(self._at)
            if self.header is None:
                found = read_header(self._data)
                if found is None:
                    return None
                self.header, self._at = found
                self._contents.begin(self.header)
                self._strands.begin(self.header, None, self._at)
                return HeaderRead(self._at, self.header)
            if self._chunk is None:
                chunk = read_envelope(self._data, self._at)
                if chunk is None:
                    return None
                if self._cut and chunk.type in CRITICAL:
                    raise FormatError("layers after a cut run", code="cut", offset=self._at, clause="3.5.4")
                if chunk.type == ChunkType.MASK:
                    self._strands.begin_mask(self.header, self._at)
                self._chunk, self._chunk_start = chunk, self._at
            chunk = self._chunk
            if not self._mask.go_on(chunk, self._chunk_start):
                return None
            skipped = chunk.type in LAYER_CHUNKS and self._tube is None
            if chunk.type in LAYER_CHUNKS and not skipped:
                event = self._reader.go_on(chunk, self._chunk_start)
                if event is not None or self._reader.waiting:
                    return event
            behind = verify(self._data, chunk, self._chunk_start)
            if behind is None:
                return None
            self._at = behind
            self._chunk = None
            self._reader.leave()
            self._cut |= chunk.type == ChunkType.CUT_LAYERS
            self._last = chunk.last
            if self._mask.coming:
                self._strands.end_mask(self.header)
                return MaskComplete(behind, chunk.end - chunk.start)
            if chunk.type not in LAYER_CHUNKS:
                event = self._contents.read(chunk, bytes(self._data[chunk.start : chunk.end]), behind)
                if isinstance(event, IsovalueRead):
                    self._strands.begin(self.header, event.lean, self._at)
                return event
            if skipped:
                return ChunkSkipped(behind, chunk.type, chunk.end - chunk.start)
        if len(self._data) > self._at:
            raise FormatError("bytes after the end of the file", code="trailing", offset=self._at, clause="3.4.4")
        return None
