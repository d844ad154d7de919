"""The container as encoders write it, for every kind of file: pieces of a file and its checksum (spec 3.3, 3.4)."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping

from isospec.container import Checksum, ChunkType

from ..errors import OptionError
from ..format.chunks import write_chunk, write_metadata
from ..format.frames import as_last
from ..format.header import Header, write_header


def beginning(header: Header, metadata: Mapping[str, str] | None) -> Iterator[bytes]:
    """Write the header, and the chunk of notes if there are any."""
    yield write_header(header)
    if metadata:
        yield write_chunk(ChunkType.METADATA, write_metadata(metadata), ancillary=True)


def with_checksum(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the pieces of a file, followed by the checksum of all of them."""
    checksum = 0
    for piece in pieces:
        checksum = zlib.crc32(piece, checksum)
        yield piece
    yield Checksum.build(checksum)


class Ending:
    """Holds back the latest chunk, which is marked if no other follows, and computes the checksum."""

    def __init__(self) -> None:
        self._waiting = b""
        self._checksum = 0

    def add(self, chunks: Iterable[bytes]) -> bytes:
        """Add chunks, and return the bytes that are ready: all but the latest chunk."""
        *ready, waiting = [self._waiting, *chunks]
        self._waiting = waiting
        return self._checked(b"".join(ready))

    def last(self) -> bytes:
        """The last chunk."""
        return self._checked(as_last(self._waiting))

    def end(self) -> bytes:
        """Return the last bytes of the file: the last chunk, and the checksum."""
        return self.last() + Checksum.build(self._checksum)

    def _checked(self, data: bytes) -> bytes:
        self._checksum = zlib.crc32(data, self._checksum)
        return data


class ContainerEncoder(ABC):
    """Yields the bytes of a file, chunk by chunk, once."""

    _begun = False

    def __iter__(self) -> Iterator[bytes]:
        if self._begun:
            raise OptionError("an encoder can be iterated only once", code="iterated", remedy="make a new encoder")
        self._begun = True
        yield from with_checksum(self._pieces())

    @abstractmethod
    def _pieces(self) -> Iterator[bytes]:
        """Yield the pieces of the file without its checksum."""
