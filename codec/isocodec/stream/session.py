"""The loop over the chunks of a file as its bytes arrive, for every kind of file (spec clauses 3.3, 3.4, 8)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from functools import cached_property, wraps
from typing import TYPE_CHECKING, NoReturn, ParamSpec, Protocol, TypeAlias, TypeVar

from isospec.container import ChunkType

from ..errors import FormatError, IsoError, LimitError, TruncatedError, out_of_memory
from ..format.chunks import Envelope, octets, read_envelope, verify
from ..format.events import End, Event, HeaderRead
from ..format.header import Header, read_header
from ..limits import Budget, Limits
from .outline import Outline

if TYPE_CHECKING:
    from ..entropy.run import Account


P = ParamSpec("P")
T = TypeVar("T")


def within_memory(doing: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Make a function raise a `LimitError` instead of a ``MemoryError``, whose traceback would keep arrays alive."""

    def made(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def run(*given: P.args, **named: P.kwargs) -> T:
            try:
                return function(*given, **named)
            except MemoryError:
                pass
            raise out_of_memory(doing)

        return run

    return made


class Contents(Protocol):
    """Meaning of chunks for one kind of file."""

    outline: Outline

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """Decode as much of a critical chunk as possible before its checksums are verified.

        Returns
        -------
        event : Event or None
        done : bool
            False while symbols remain: with an event, the method is to be called again; without one, it needs more
            bytes.
        """

    def take(self, chunk: Envelope, at: int, behind: int) -> Event | None:
        """Take a complete chunk, whose checksums have been verified; it ends at ``behind``."""

    def drop(self) -> None:
        """Release everything that was decoded, after a limit was exceeded."""


class Session:
    """Takes the bytes of a file as they arrive and yields events; once raised, an error is raised by every later call.

    Parameters
    ----------
    limits : Limits, optional
    contents_of : callable
        Makes the contents once the header has been read.

    Attributes
    ----------
    limits : Limits
    budget : Budget
        Memory held by decoding.
    data : bytearray
        The part of the file that has arrived.
    at : int
        Byte offset of the current chunk.
    header : Header or None
    outline : Outline
    contents : Contents or None
        None before the header has been read.
    """

    def __init__(self, limits: Limits | None, contents_of: ContentsOf) -> None:
        self.limits = limits or Limits()
        self.budget = Budget(self.limits.memory)
        self.data = bytearray()
        self.at = 0
        self.header: Header | None = None
        self.outline = Outline()
        self.contents: Contents | None = None
        self._contents_of = contents_of
        self._chunk: Envelope | None = None
        self._last = self._ended = self._closed = False
        self._error: IsoError | None = None

    @cached_property
    def account(self) -> Account:
        """Symbols and work used by decoding; made when it is first used, since inspecting a file needs no kernels."""
        from ..entropy.run import Account

        return Account(self.limits.symbols, self.limits.work)

    @property
    def complete(self) -> bool:
        """Whether the whole file has been received and verified."""
        return self._ended

    @property
    def frames(self) -> int:
        """Number of frames that have been received with all their bytes; a file that is no series is one frame."""
        return self.outline.frame + (self._ended or self.outline.ended)

    def whole(self, frame: int | None) -> bool:
        """Whether all layers of a frame, of the current one if None or not reached yet, have been received."""
        now = self.outline.frame
        drawn = now if frame is None else min(frame, now)
        return self.frames > drawn

    @property
    def pending(self) -> Envelope | None:
        """The incomplete chunk that begins at ``at``."""
        return self._chunk

    def feed(self, data: bytes | bytearray | memoryview) -> None:
        """Store more bytes of the file; iterating decodes them."""
        self.check()
        if self._closed:
            raise TruncatedError("bytes fed after close", code="closed")
        data = octets(data)
        if len(self.data) + len(data) > self.limits.bytes:
            self._fail(LimitError(f"more than {self.limits.bytes} bytes", code="limit-bytes", clause="11.2"))
        self.data += data

    def close(self) -> None:
        """Decode what has been fed, and declare that no more bytes will come.

        Raises
        ------
        TruncatedError
            If the file is not complete. What has been decoded can still be drawn.
        """
        for _ in self:
            pass
        self._closed = True
        if not self._ended:
            raise TruncatedError(
                f"the file ends after {len(self.data)} bytes, before it is complete", code="truncated",
                offset=len(self.data), clause="8.3",
            )

    def check(self) -> None:
        """Raise the error that decoding ended with, if it did."""
        if self._error is not None:
            raise copy(self._error)

    def __iter__(self) -> Iterator[Event]:
        while True:
            self.check()
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

    @property
    def exceeded(self) -> LimitError | None:
        """The limit that decoding exceeded, if any; the decoded state has then been dropped."""
        return self._error if isinstance(self._error, LimitError) else None

    def _fail(self, error: IsoError) -> NoReturn:
        """Raise an error, now and whenever the session is used again."""
        if isinstance(error, LimitError) and self.contents is not None:
            self.contents.drop()
        # the frames of the traceback would keep everything that was decoded alive as long as the error
        error.with_traceback(None)
        self._error = copy(error)
        raise error

    def _next(self) -> Event | None:
        """Return the next event; None if more bytes are needed."""
        while not self._ended:
            if self._last:
                self._ended = True
                return End(self.at)
            if self.header is None or self.contents is None:
                found = read_header(self.data)
                if found is None:
                    return None
                self.header, self.at = found
                self.outline.begin(self.header)
                self.contents = self._contents_of(self, self.header)
                return HeaderRead(self.at, self.header)
            before = self.at
            event = self._step(self.contents)
            if event is not None or self.at == before:
                return event
        if len(self.data) > self.at:
            raise FormatError("bytes after the end of the file", code="trailing", offset=self.at, clause="3.4.4")
        return None

    def _step(self, contents: Contents) -> Event | None:
        """Continue with the current chunk; None if more bytes are needed, or if a chunk without an event was passed."""
        chunk = self._chunk
        if chunk is None:
            chunk = read_envelope(self.data, self.at)
            if chunk is None:
                return None
            if not chunk.ancillary:
                self.outline.expect(chunk, self.at)
                # more layers of a frame that was marked as ended
                self.outline.ended &= chunk.type == ChunkType.FRAME
            self._chunk = chunk
        if not chunk.ancillary:
            event, done = contents.arrive(chunk, self.at)
            if event is not None or not done:
                return event
        behind = verify(self.data, chunk, self.at)
        if behind is None:
            return None
        start, self.at, self._chunk = self.at, behind, None
        self._last = chunk.last
        # a file without a grid may only now know which kind it is
        assert self.contents is not None
        return self.contents.take(chunk, start, behind)


ContentsOf: TypeAlias = Callable[[Session, Header], Contents]
