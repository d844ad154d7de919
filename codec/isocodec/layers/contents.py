"""What the chunks of a file say: one reader for each type, for the decoder and for inspection (spec clause 3.5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from isospec.container import ChunkType

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
from ..format.frames import FRAME_BEFORE, is_key, read_frame, read_interval
from ..format.header import Header
from ..format.program import Layer
from .events import ChunkSkipped, Event, FrameRead, IsovalueRead, MetadataRead, PromisesRead, SeriesRead

LAYER_CHUNKS = (ChunkType.LAYERS, ChunkType.CUT_LAYERS)
"""Chunks that are decoded as they come in; so is a mask. The others are read when they are complete."""


@dataclass
class Contents:
    """What has been read of a file so far, but for its symbols.

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
        What the level index says of the layers, if there is one.
    masked : bool
        Whether there is a mask.
    interval : int or None
        Of a series, how often a frame leans on none before it (see `SeriesRead`); None of a file without frames.
    frame, number : int
        The present frame and isovalue, whose layers come.
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

    def begin(self, header: Header) -> None:
        """Take note of the header, and of its isovalue."""
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

    def _add(self, isovalue: float, lean: int | None) -> None:
        self.isovalues.append(isovalue)
        self.leans.append(lean)
        self.number = len(self.leans) - 1
        self.promises.append(Promises({}, False))


Reader = Callable[[Contents, bytes, int, int], Event | None]
"""Of the payload of a chunk, given where it begins and where the chunk ends in the file; None if it has no event."""


def _isovalue(contents: Contents, payload: bytes, start: int, behind: int) -> Event:
    if contents.frame > 0:
        raise FormatError("another isovalue in a further frame", code="frame", offset=start, clause="3.5.7")
    isovalue, lean = read_further(payload, start, contents.isovalues)
    contents._add(isovalue, lean)
    return IsovalueRead(behind, len(contents.isovalues) - 1, isovalue, lean)


def _frame(contents: Contents, payload: bytes, start: int, behind: int) -> Event:
    if contents.interval is None:
        if contents.layers:
            raise FormatError("frames are announced behind layers", code="frame", offset=start, clause="3.5.7")
        contents.interval = read_interval(payload, start)
        return SeriesRead(behind, contents.interval)
    frame, number = contents.frame, contents.number + 1
    if number == len(contents.isovalues):
        frame, number = frame + 1, 0
    if frame == 0:
        raise FormatError("a frame begins before the first one", code="frame", offset=start, clause="3.5.7")
    lean = read_frame(payload, start, number, is_key(frame, contents.interval))
    if frame > contents.frame:
        contents.layers.clear()
        contents.promises[:] = [Promises({}, False) for _ in contents.promises]
    contents.frame, contents.number = frame, number
    before = lean == FRAME_BEFORE
    return FrameRead(behind, frame, number, number if before else lean, before)


def _metadata(contents: Contents, payload: bytes, start: int, behind: int) -> Event:
    contents.metadata.update(read_metadata(payload))
    return MetadataRead(behind, dict(contents.metadata))


def _promises(contents: Contents, payload: bytes, start: int, behind: int) -> Event | None:
    promises = read_promises(payload)
    if promises is None:
        return None
    contents.promises[contents.number] = promises
    return PromisesRead(behind, promises)


def _index(contents: Contents, payload: bytes, start: int, behind: int) -> None:
    contents.records = read_index(payload, contents.layers) or contents.records


READERS: Mapping[int, Reader] = {
    ChunkType.ISOVALUE: _isovalue,
    ChunkType.FRAME: _frame,
    ChunkType.METADATA: _metadata,
    ChunkType.PROMISES: _promises,
    ChunkType.INDEX: _index,
}
"""By type of chunk."""
