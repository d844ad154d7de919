"""The container on the encoder's side, whatever its domain: pieces of a file, and its checksum (spec 3.3, 3.4)."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping

from isospec.container import Checksum, ChunkType

from ..errors import OptionError
from ..format.chunks import write_chunk, write_metadata
from ..format.header import Header, write_header


def beginning(header: Header, metadata: Mapping[str, str] | None) -> Iterator[bytes]:
    """The header, and the chunk of notes if there are any."""
    yield write_header(header)
    if metadata:
        yield write_chunk(ChunkType.METADATA, write_metadata(metadata), ancillary=True)


def with_checksum(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces of a file, followed by the checksum of all of them."""
    checksum = 0
    for piece in pieces:
        checksum = zlib.crc32(piece, checksum)
        yield piece
    yield Checksum.build(checksum)


class ContainerEncoder(ABC):
    """Yields the bytes of a file, chunk by chunk, once."""

    _begun = False

    def __iter__(self) -> Iterator[bytes]:
        if self._begun:
            raise OptionError("an encoder can be iterated only once", code="iterated", remedy="make another one")
        self._begun = True
        yield from with_checksum(self._pieces())

    @abstractmethod
    def _pieces(self) -> Iterator[bytes]:
        """The file but for its checksum."""
