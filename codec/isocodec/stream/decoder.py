"""The incremental decoder: bytes in, events and snapshots out (spec clause 8). It does no input or output itself."""

from __future__ import annotations

from collections.abc import Collection
from typing import NoReturn

from isospec.container import ChunkType

from ..drawing.contour import Contour
from ..errors import FormatError, IsoError, LimitError, OptionError
from ..format.chunks import CRITICAL, Envelope, read_envelope, verify
from ..format.events import ChunkSkipped, Event, FrameRead, IsovalueRead, MaskComplete, SeriesRead
from ..format.frames import first_operation
from ..format.header import Header
from ..limits import Limits
from .contents import LAYER_CHUNKS
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
        self._chunk: Envelope | None = None
        self._chunk_start = 0
        self._looked = False

    def snapshot(self, number: int = 0, smooth: bool = False) -> Contour:
        """The curve or surface of all symbols received of an isovalue (spec clause 9).

        What a half-received layer has not reached yet stays as the layer before left it. ``smooth`` as in `decode`.
        """
        self._take_all()
        return self.drawn(number, smooth)

    # -- the machine ---------------------------------------------------------------------------------------------

    def _begin_file(self, header: Header) -> None:
        if header.cells is not None:
            raise OptionError("the file's domain is a mesh", code="domain", remedy="take MeshDecoder")
        super()._begin_file(header)
        self._strands.begin(header, None, self._at)

    def _fail(self, error: IsoError) -> NoReturn:
        if isinstance(error, LimitError):
            self.discard()
            self._mask.drop()
        super()._fail(error)

    def _step(self, header: Header) -> Event | None:
        if self._chunk is None:
            chunk = read_envelope(self._data, self._at)
            if chunk is None:
                return None
            if self._cut and chunk.type in CRITICAL:
                raise FormatError("layers after a cut run", code="cut", offset=self._at, clause="3.5.4")
            if chunk.type == ChunkType.MASK:
                self._strands.begin_mask(header, self._at)
            self._chunk, self._chunk_start = chunk, self._at
        chunk = self._chunk
        if chunk.type in LAYER_CHUNKS and not self._looked:
            place = first_operation(self._data, chunk)
            if place is None and len(self._data) < chunk.end:
                return None
            self._looked = True
            frame = None if place is None else self._contents.begin_layers(self._data[place], place)
            if frame is not None:
                self._begin(header, frame)
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
            self._strands.end_mask(header)
            return MaskComplete(behind, chunk.end - chunk.start)
        if chunk.type not in LAYER_CHUNKS:
            event = self._contents.read(chunk, bytes(self._data[chunk.start : chunk.end]), behind)
            self._begin(header, event)
            return event
        if skipped:
            return ChunkSkipped(behind, chunk.type, chunk.end - chunk.start)
        return None

    def _begin(self, header: Header, event: Event) -> None:
        """What begins with an event: another isovalue, a series, a further frame."""
        if isinstance(event, IsovalueRead):
            self._strands.begin(header, event.lean, self._at)
        elif isinstance(event, SeriesRead):
            self._strands.begin_series()
        elif isinstance(event, FrameRead):
            if event.number == 0 and not self._strands.past:
                self._reader.next_frame(self._strands.before)
                self._strands.next_frame()
            self._strands.begin_frame(header, event)
