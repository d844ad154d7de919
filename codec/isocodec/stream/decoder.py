"""The incremental decoder: bytes in, events and snapshots out (spec clause 8). It does no input or output itself."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from copy import copy
from typing import NoReturn

from isospec.container import ChunkType

from ..drawing.contour import Contour
from ..errors import FormatError, IsoError, LimitError, OptionError, TruncatedError, out_of_memory
from ..format.chunks import CRITICAL, Envelope, octets, read_envelope, verify
from ..format.frames import first_operation
from ..format.header import read_header
from ..layers.contents import LAYER_CHUNKS
from ..layers.events import ChunkSkipped, End, Event, FrameRead, HeaderRead, IsovalueRead, MaskComplete, SeriesRead
from ..limits import Limits
from .received import Received


class Decoder(Received):
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
    frame : int, optional
        Of a series, the frame to decode, from 0; those that it leans on are decoded, too, the chunks of others are
        skipped. All frames if not given, one after the other: drawings are of the last that has begun.

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

    def __init__(
        self, limits: Limits | None = None, *, only: Collection[int] | None = None, frame: int | None = None
    ) -> None:
        super().__init__(limits, only=only, frame=frame)
        self._at = 0
        self._chunk: Envelope | None = None
        self._chunk_start = 0
        self._looked = False
        self._last = False
        self._closed = False

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

    def snapshot(self, number: int = 0, smooth: bool = False) -> Contour:
        """The curve or surface of all symbols received of an isovalue (spec clause 9).

        What a half-received layer has not reached yet stays as the layer before left it. ``smooth`` as in `decode`.
        """
        for _ in self:
            pass
        return self.drawn(number, smooth)

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
                if found[0].cells is not None:
                    raise OptionError("the file's domain is a mesh", code="domain", remedy="take MeshDecoder")
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
            if chunk.type in LAYER_CHUNKS and not self._looked:
                place = first_operation(self._data, chunk)
                if place is None and len(self._data) < chunk.end:
                    return None
                self._looked = True
                frame = None if place is None else self._contents.begin_layers(self._data[place], place)
                if frame is not None:
                    self._begin(frame)
                    return frame
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
            self._chunk, self._looked = None, False
            self._reader.leave()
            self._cut |= chunk.type == ChunkType.CUT_LAYERS
            self._last = chunk.last
            if self._mask.coming:
                self._strands.end_mask(self.header)
                return MaskComplete(behind, chunk.end - chunk.start)
            if chunk.type not in LAYER_CHUNKS:
                event = self._contents.read(chunk, bytes(self._data[chunk.start : chunk.end]), behind)
                self._begin(event)
                return event
            if skipped:
                return ChunkSkipped(behind, chunk.type, chunk.end - chunk.start)
        self._nothing_behind()
        return None

    def _begin(self, event: Event) -> None:
        """What begins with an event: another isovalue, a series, a further frame."""
        assert self.header is not None
        if isinstance(event, IsovalueRead):
            self._strands.begin(self.header, event.lean, self._at)
        elif isinstance(event, SeriesRead):
            self._strands.begin_series()
        elif isinstance(event, FrameRead):
            if event.number == 0 and not self._strands.past:
                self._reader.next_frame(self._strands.before)
                self._strands.next_frame()
            self._strands.begin_frame(self.header, event)

    def _nothing_behind(self) -> None:
        """Raise where bytes come behind the end of the file."""
        if len(self._data) > self._at:
            raise FormatError("bytes after the end of the file", code="trailing", offset=self._at, clause="3.4.4")
