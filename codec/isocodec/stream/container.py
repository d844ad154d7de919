"""The container as encoders write it, for every kind of file: chunks of a file and its checksum (spec 3.3, 3.4)."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping

from isospec.container import Checksum, ChunkType

from ..errors import OptionError
from ..field.times import TIME
from ..format.chunks import write_chunk, write_further, write_metadata
from ..format.frames import as_last, is_key, write_frame, write_interval
from ..format.header import Header, write_header


def beginning(
    header: Header, metadata: Mapping[str, str] | None, shared: Iterable[bytes] = (), interval: int | None = None
) -> list[bytes]:
    """Write the header, and the chunks that concern the whole file: notes, ``shared`` ones, and those of a series."""
    notes = [write_chunk(ChunkType.METADATA, write_metadata(metadata), ancillary=True)] if metadata else []
    series = [] if interval is None else [write_chunk(ChunkType.SERIES, write_interval(interval))]
    return [write_header(header), *notes, *shared, *series]


def opening(
    frame: int, number: int, isovalue: float, lean: int | None, interval: int | None, time: str | None = None
) -> list[bytes]:
    """Write the chunk with which an isovalue of a frame begins, and with the first one the time of the frame.

    The first isovalue of a file begins with the header.
    """
    out: list[bytes] = []
    if frame:
        out.append(write_chunk(ChunkType.FRAME, write_frame(number, lean, is_key(frame, interval or 0))))
    elif number:
        out.append(write_chunk(ChunkType.ISOVALUE, write_further(number, isovalue, lean)))
    if number == 0 and time is not None:
        out.append(write_chunk(ChunkType.METADATA, write_metadata({TIME: time}), ancillary=True))
    return out


def closed(chunks: Iterable[bytes]) -> Iterator[bytes]:
    """Yield header and chunks of a file, the last one marked as such, and the checksum of them all."""
    checksum, waiting = 0, b""
    for chunk in chunks:
        if waiting:
            checksum = zlib.crc32(waiting, checksum)
            yield waiting
        waiting = chunk
    waiting = as_last(waiting)
    yield waiting
    yield Checksum.build(zlib.crc32(waiting, checksum))


class ContainerEncoder(ABC):
    """Yields the bytes of a file, chunk by chunk, once."""

    _begun = False

    def __iter__(self) -> Iterator[bytes]:
        if self._begun:
            raise OptionError("an encoder can be iterated only once", code="iterated", remedy="make a new encoder")
        self._begun = True
        yield from closed(self._chunks())

    @abstractmethod
    def _chunks(self) -> Iterator[bytes]:
        """Yield the header and the chunks of the file; the last one need not be marked."""
