"""Both ends of the container, whatever its domain: pieces out, and bytes in as they come (spec clauses 3.3, 3.4, 8)."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from typing import NoReturn

from isospec.container import Checksum, ChunkType

from ..entropy.run import Account
from ..errors import FormatError, IsoError, LimitError, OptionError, TruncatedError, out_of_memory
from ..format.chunks import octets, write_chunk, write_metadata
from ..format.events import End, Event, HeaderRead
from ..format.header import Header, read_header, write_header
from ..limits import Budget, Limits
from .contents import Contents


def beginning(header: Header, metadata: Mapping[str, str] | None) -> Iterator[bytes]:
    """The header, and the chunk of notes if there are any."""
    yield write_header(header)
    if metadata:
        yield write_chunk(ChunkType.METADATA, write_metadata(metadata), ancillary=True)


def with_checksum(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces of a file, and the checksum of all of them behind."""
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


class ContainerDecoder(ABC):
    """Takes the bytes of a file as they come, and yields events; an error is raised again by every later call."""

    def __init__(self, limits: Limits | None, contents: Contents, frame: int | None) -> None:
        self.limits = limits or Limits()
        self.header: Header | None = None
        self._contents = contents
        self._wanted = frame
        self.isovalues = contents.isovalues
        self.metadata = contents.metadata
        self._budget = Budget(self.limits.memory)
        self._account = Account(self.limits.symbols, self.limits.work)
        self._data = bytearray()
        self._at = 0
        self._last = self._ended = self._closed = False
        self._error: IsoError | None = None

    @property
    def frame(self) -> int:
        """Number of the frame that has begun last, or, once it has come, of the one that is wanted: it can be drawn."""
        return self._contents.frame if self._wanted is None else min(self._contents.frame, self._wanted)

    @property
    def present(self) -> tuple[int, int]:
        """Number of the present frame and of its isovalue, whose layers come at present or come next."""
        return self._contents.frame, self._contents.number

    @property
    def complete(self) -> bool:
        """Whether the whole file has been received and verified."""
        return self._ended

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
            If the file is not complete. What has been decoded can still be drawn.
        """
        self._take_all()
        self._closed = True
        if not self._ended:
            raise TruncatedError(
                f"the file ends after {len(self._data)} bytes, before it is complete", code="truncated",
                offset=len(self._data), clause="8.3",
            )

    def __iter__(self) -> Iterator[Event]:
        while True:
            if self._error is not None:
                raise copy(self._error)
            failure: IsoError | None = None
            try:
                event = self._next()
            except IsoError as error:
                failure = error
            except MemoryError:
                failure = out_of_memory("to decode")
            if failure is not None:
                self._fail(failure)
            if event is None:
                return
            yield event

    def _take_all(self) -> None:
        """Decode what has been fed."""
        for _ in self:
            pass

    def _fail(self, error: IsoError) -> NoReturn:
        """Raise an error, now and whenever the decoder is used again."""
        # the frames of a traceback would keep everything that was decoded as long as somebody keeps the error
        error.with_traceback(None)
        self._error = copy(error)
        raise error

    def _next(self) -> Event | None:
        """Next event; None if it needs more bytes."""
        while not self._ended:
            if self._last:
                self._ended = True
                return End(self._at)
            if self.header is None:
                found = read_header(self._data)
                if found is None:
                    return None
                header, self._at = found
                self._begin_file(header)
                return HeaderRead(self._at, header)
            before = self._at
            event = self._step(self.header)
            if event is not None or self._at == before:
                return event
        if len(self._data) > self._at:
            raise FormatError("bytes after the end of the file", code="trailing", offset=self._at, clause="3.4.4")
        return None

    def _begin_file(self, header: Header) -> None:
        """The header has been read."""
        self.header = header
        self._contents.begin(header)

    @abstractmethod
    def _step(self, header: Header) -> Event | None:
        """Go on with the chunk at ``_at``; None if it needs more bytes, or if it has moved past one without event."""
