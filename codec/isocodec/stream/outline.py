"""Outline of a file: what its chunks state apart from coded symbols, one reader for each type (spec clause 3.5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from isospec.container import ChunkType, Operation

from ..errors import FormatError
from ..format.chunks import (
    Envelope,
    LayerRecord,
    Promises,
    read_further,
    read_index,
    read_metadata,
    read_promises,
)
from ..format.coordinate_record import CoordinatesRecord, read_coordinates
from ..format.domain import DomainHead, read_domain
from ..format.events import (
    ChunkSkipped,
    CoordinatesRead,
    DomainRead,
    Event,
    FrameRead,
    IsovalueRead,
    MetadataRead,
    PromisesRead,
    SeriesRead,
)
from ..format.frames import FRAME_BEFORE, is_key, read_frame, read_interval
from ..format.header import Header
from ..format.program import Layer

REFUSED = (ChunkType.CUT_LAYERS, ChunkType.MASK)
"""Critical chunks that a file of an explicit domain does not have."""
LAYER_CHUNKS = (ChunkType.LAYERS, ChunkType.CUT_LAYERS)
"""Chunks that are decoded as they come in; so is a mask. The others are read when they are complete."""

_BASES = (Operation.BASE, Operation.BASE_AND_REFINE, Operation.ADAPTIVE_BASE, Operation.LEAF_BASE)
"""Operations that begin the layers of an isovalue."""


@dataclass
class Outline:
    """Everything read from a file so far, apart from its symbols.

    Attributes
    ----------
    isovalues : list of float
    leans : list of int or None
        For each isovalue the number of the earlier one that it leans on.
    promises : list of Promises
        For each isovalue what the writer promises of its layers.
    metadata : dict of str to str
    layers : list of Layer
        Announced so far; whoever reads the chunks of layers adds them.
    records : list of LayerRecord
        Entries of the level index, if the file has one.
    masked : bool
        Whether there is a mask.
    interval : int or None
        Of a series, how often a frame leans on none before it (see `SeriesRead`); None of a file without frames.
    frame, number : int
        The present frame and isovalue, whose layers come.
    based : bool
        Whether a chunk of its layers has begun with a base.
    begun : bool
        Of an explicit domain, whether a chunk of layers has come.
    coordinates : CoordinatesRecord or None
        Where the samples lie.
    shape : tuple of int
        Of the samples, once the header is there.
    cells : int or None
        Dimension of the cells of an explicit domain.
    domain : DomainHead or None
        Head of an explicit domain.
    run_of_domain : int
        Where the run of a coded mesh begins in the payload of its chunk.
    """

    isovalues: list[float] = field(default_factory=list)
    leans: list[int | None] = field(default_factory=list)
    promises: list[Promises] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    layers: list[Layer] = field(default_factory=list)
    records: list[LayerRecord] = field(default_factory=list)
    masked: bool = False
    interval: int | None = None
    frame: int = 0
    number: int = 0
    based: bool = False
    begun: bool = False
    coordinates: CoordinatesRecord | None = None
    shape: tuple[int, ...] = ()
    cells: int | None = None
    domain: DomainHead | None = None
    run_of_domain: int = 0

    def begin(self, header: Header) -> None:
        """Take note of the header, and of its isovalue."""
        self.shape = header.shape
        self.cells = header.cells
        self._add(header.isovalue, None)

    def begin_mask(self, offset: int) -> None:
        """Take note of a mask, whose chunk begins at ``offset``.

        Raises
        ------
        FormatError
            If there has been one, or a further frame.
        """
        if self.frame > 0:
            raise FormatError("a mask behind the first frame", code="mask", offset=offset, clause="3.5.7")
        if self.masked:
            raise FormatError("a second mask", code="mask", offset=offset, clause="3.5.6")
        self.masked = True

    def read(self, chunk: Envelope, payload: bytes, behind: int) -> Event:
        """Read a chunk other than of layers; ``behind`` is the place behind it in the file.

        Raises
        ------
        FormatError
            If the chunk is critical and malformed. Malformed ancillary ones are skipped.
        """
        reader = READERS.get(chunk.type)
        event = None if reader is None else reader(self, payload, chunk.start, behind)
        return event or ChunkSkipped(behind, chunk.type, len(payload))

    def begin_layers(self, operation: int, start: int) -> FrameRead | None:
        """Take note of a chunk of layers: of a series it may begin another isovalue, if it begins with a base.

        Parameters
        ----------
        operation : int
            The first byte of its program, and where that lies in the file.
        start : int
        """
        if operation >> 4 & 7 not in _BASES:
            return None
        again, self.based = self.based, True
        if self.interval is None or not again:
            return None
        event = self.begin_next(b"", start, start + 1)
        self.based = True
        return event

    def begin_next(self, payload: bytes, start: int, behind: int) -> FrameRead:
        """The next isovalue of a series begins, in the present frame or the next one.

        Raises
        ------
        FormatError
            If the payload of its chunk is malformed.
        """
        assert self.interval is not None
        frame, number = self.frame, self.number + 1
        if number == len(self.isovalues):
            frame, number = frame + 1, 0
        lean = read_frame(payload, start, number, is_key(frame, self.interval))
        if frame > self.frame:
            self.layers.clear()
            self.promises[:] = [Promises({}, False) for _ in self.promises]
        self.frame, self.number, self.based = frame, number, False
        before = lean == FRAME_BEFORE
        return FrameRead(behind, frame, number, number if before else lean, before)

    def _add(self, isovalue: float, lean: int | None) -> None:
        self.isovalues.append(isovalue)
        self.leans.append(lean)
        self.number, self.based = len(self.leans) - 1, False
        self.promises.append(Promises({}, False))


Reader = Callable[[Outline, bytes, int, int], Event | None]
"""Reads the payload of a chunk, given where it begins and where the chunk ends in the file; None without an event."""


def _isovalue(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.frame > 0:
        raise FormatError("another isovalue in a further frame", code="frame", offset=start, clause="3.5.7")
    isovalue, lean = read_further(payload, start, outline.isovalues)
    outline._add(isovalue, lean)
    return IsovalueRead(behind, len(outline.isovalues) - 1, isovalue, lean)


def _frame(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.interval is not None:
        return outline.begin_next(payload, start, behind)
    if outline.layers or outline.based or outline.begun:
        raise FormatError("frames behind layers", code="frame", offset=start, clause="3.5.7")
    outline.interval = read_interval(payload, start)
    return SeriesRead(behind, outline.interval)


def _metadata(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    outline.metadata.update(read_metadata(payload))
    return MetadataRead(behind, dict(outline.metadata))


def _promises(outline: Outline, payload: bytes, start: int, behind: int) -> Event | None:
    promises = read_promises(payload)
    if promises is None:
        return None
    outline.promises[outline.number] = promises
    return PromisesRead(behind, promises)


def _coordinates(outline: Outline, payload: bytes, start: int, behind: int) -> Event | None:
    found = read_coordinates(payload, outline.shape)
    if found is None:
        return None
    outline.coordinates = found
    return CoordinatesRead(behind, found)


def _index(outline: Outline, payload: bytes, start: int, behind: int) -> None:
    outline.records = read_index(payload, outline.layers) or outline.records


def _domain(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.cells is None:
        raise FormatError("a domain in a file of a grid", code="domain", offset=start, clause="3.5.8")
    outline.domain, outline.run_of_domain = read_domain(payload, outline.cells, start)
    return DomainRead(behind, outline.domain.vertices, outline.domain.cells)


READERS: Mapping[int, Reader] = {
    ChunkType.ISOVALUE: _isovalue,
    ChunkType.FRAME: _frame,
    ChunkType.METADATA: _metadata,
    ChunkType.PROMISES: _promises,
    ChunkType.INDEX: _index,
    ChunkType.COORDINATES: _coordinates,
    ChunkType.DOMAIN: _domain,
}
"""By type of chunk."""


def check_explicit(chunk: Envelope, at: int, begun: bool) -> None:
    """Check that a critical chunk may come in the file of an explicit domain; ``begun`` once its domain has come.

    Raises
    ------
    FormatError
    """
    if chunk.type in REFUSED:
        raise FormatError("not in an explicit domain", code="chunk", offset=at, clause="10.1.1")
    if (chunk.type == ChunkType.DOMAIN) == begun:
        what = "a second domain" if begun else "the domain has to come first"
        raise FormatError(what, code="domain", offset=at, clause="3.5.8")
