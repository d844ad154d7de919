"""Read files of web servers: all of a file, or ranges, several at a time, and never more than was asked for."""

from __future__ import annotations

import errno
import re
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import InputError, one_line
from ..extras import optional
from ..limits import TIMEOUT, patience

if TYPE_CHECKING:
    from typing import Self

# asyncio takes longer to import than a small file to decode: it is imported by what needs it

Range = tuple[int, int]
Answer = TypeVar("Answer")
LANES = 6
"""Number of requests at a time."""
PIECE = 1 << 16
"""Bytes that have to arrive within `patience`, again and again."""
PAUSES = (0.25, 0.5, 1.0)
"""Seconds before a request is made again."""
BUSY = (408, 425, 429, 500, 502, 503, 504)
"""Statuses after which a request is made again."""
_ENDS = re.compile(r"bytes (\d{1,18})-(\d{1,18})/(\d{1,18}|\*)")


class NoRangesError(InputError):
    """The server sends the whole file although a range was requested."""

    def __init__(self) -> None:
        super().__init__("the server sends the whole file instead of the requested range", code="ranges",
                         remedy="download the file first, or use a server that supports range requests")


class WebFile:
    """A file of a web server.

    All methods raise `InputError` or `OSError` if the server does not answer, answers with an error, or sends anything
    but what was asked for, and `NoRangesError` if it sends the whole file instead of a range.
    """

    def __init__(self, url: str) -> None:
        fsspec = optional("fsspec", extra="remote", purpose="reading URLs")
        self._http = optional("aiohttp", extra="remote", purpose="reading URLs")
        # compressed bodies are neither asked for nor unpacked; waiting is limited here
        options = {"auto_decompress": False, "timeout": self._http.ClientTimeout(total=None)}
        self._system = fsspec.filesystem("https", client_kwargs=options)
        self._sync = fsspec.asyn.sync
        self._url = url
        self._version: dict[str, str] = {}

    def read(self, ranges: Sequence[Range]) -> list[bytes]:
        """Read ranges, each from one offset up to another; fewer bytes if the file ends before."""
        return self.run(self._ranges(ranges))

    def open(self) -> WebStream:
        """Read the whole file from its beginning, as a file object."""
        return WebStream(self, self.run(self._again(partial(self._answer, {}))))

    def run(self, work: Coroutine[Any, Any, Answer]) -> Answer:
        """Wait for something that this file does, and explain errors of libraries, whose messages may be empty."""

        async def explained() -> Answer:
            try:
                return await work
            except TimeoutError as exc:
                raise InputError(
                    f"the server has not answered within {patience():g} seconds", code="timeout",
                    remedy=f"try again later, or raise {TIMEOUT}",
                ) from exc
            except (self._http.ClientError, ValueError) as exc:
                if isinstance(exc, InputError):
                    raise
                text = one_line(str(exc)) or type(exc).__name__
                raise InputError(f"cannot be read ({text})", code="url", remedy="try again later") from exc

        answer: Answer = self._sync(self._system.loop, explained)
        return answer

    async def _ranges(self, ranges: Sequence[Range]) -> list[bytes]:
        import asyncio

        lanes = asyncio.Semaphore(LANES)

        async def one(start: int, end: int) -> bytes:
            async with lanes:
                return await self._again(partial(self._range, start, end))

        tasks = [asyncio.ensure_future(one(*each)) for each in ranges]
        try:
            return [*await asyncio.gather(*tasks)]
        finally:
            for task in tasks:
                task.cancel()

    async def _again(self, ask: Callable[[float], Coroutine[Any, Any, Answer]]) -> Answer:
        """Ask again if the server is busy, or a connection is lost, as long as anyone would wait."""
        import asyncio

        clock = asyncio.get_running_loop().time
        until = clock() + patience()
        for pause in PAUSES:
            try:
                return await ask(until)
            except _BusyError as busy:
                pause = max(pause, busy.pause)
                if clock() + pause >= until:
                    raise
            except (self._http.ServerDisconnectedError, self._http.ClientPayloadError, ConnectionResetError):
                if clock() + pause >= until:
                    raise
            await asyncio.sleep(pause)
        return await ask(until)

    async def _answer(self, headers: dict[str, str], until: float) -> Any:
        """Ask for the file; returns the answer, whose body has not been read and which has to be closed."""
        import asyncio

        session = await self._system.set_session()
        asked = session.get(self._url, headers={"Accept-Encoding": "identity", **headers})
        answer = await asyncio.wait_for(asked, until - asyncio.get_running_loop().time())
        try:
            self._check(answer)
        except BaseException:
            answer.close()
            raise
        return answer

    def _check(self, answer: Any) -> None:
        """Check the status, and whether the file is still the one that was read before."""
        if answer.status in (404, 410):
            raise FileNotFoundError(errno.ENOENT, "the server has no such file", self._url)
        if answer.status in BUSY:
            raise _BusyError(answer)
        if answer.status not in (200, 206, 416):
            raise InputError(f"the server answers {_status(answer)}", code="url", remedy="check the address")
        if (coding := answer.headers.get("Content-Encoding", "identity").strip().lower()) != "identity":
            raise InputError(f"the server compresses what it sends ({one_line(coding, 40)}), though asked not to",
                             code="url", remedy="download the file first")
        for name in ("ETag", "Last-Modified") if answer.status == 206 else ():
            value = answer.headers.get(name)
            if value is not None and self._version.setdefault(name, value) != value:
                raise InputError("the file has changed on the server while it was being read", code="changed",
                                 remedy="open it again")

    async def _range(self, start: int, end: int, until: float) -> bytes:
        answer = await self._answer({"Range": f"bytes={start}-{end - 1}"}, until)
        try:
            if answer.status == 416:
                return b""
            if answer.status == 200:
                raise NoRangesError()
            found = _ENDS.fullmatch(answer.headers.get("Content-Range", "").strip())
            first, after = (int(found[1]), int(found[2]) + 1) if found else (-1, -1)
            # fewer bytes are right at the end of the file only
            right = start < after <= end and (after == end or found is None or found[3] in ("*", str(after)))
            if first != start or not right:
                raise InputError(f"the server sends other bytes than the requested {start:,} to {end - 1:,}",
                                 code="ranges", remedy="download the file first")
            body = await _body(answer, after - start + 1, until)
            if len(body) > after - start:
                raise InputError(f"the server sends more than the {after - start:,} bytes that it announces",
                                 code="ranges", remedy="download the file first")
            if len(body) < after - start:
                raise self._http.ClientPayloadError("the answer ends too early")
            return body
        finally:
            # what has not been read of the body is not wanted
            answer.close()


class WebStream:
    """The body of an answer, read like a file; a context manager."""

    def __init__(self, file: WebFile, answer: Any) -> None:
        self._file, self._answer = file, answer

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._answer.close()

    def read(self, count: int) -> bytes:
        """Read ``count`` bytes, or what is left."""
        return self._file.run(_body(self._answer, count))


class _BusyError(InputError):
    """The server has no time; ``pause`` is the number of seconds that it asks for."""

    def __init__(self, answer: Any) -> None:
        asked = answer.headers.get("Retry-After", "").strip()
        self.pause = float(asked) if re.fullmatch(r"\d{1,9}", asked) else 0.0
        later = f"in {self.pause:,.0f} seconds" if self.pause else "later"
        super().__init__(f"the server answers {_status(answer)}", code="busy", remedy=f"try again {later}")


def _status(answer: Any) -> str:
    return f"{answer.status} {one_line(answer.reason or '', 80)}".rstrip()


async def _body(answer: Any, most: int, until: float | None = None) -> bytes:
    """Read at most ``most`` bytes of a body; each piece has to arrive in time, the first one by ``until``."""
    import asyncio

    body, clock = bytearray(), asyncio.get_running_loop().time
    end = clock() + patience() if until is None else until
    while len(body) < most:
        part = await asyncio.wait_for(answer.content.read(min(most - len(body), PIECE)), end - clock())
        if not part:
            break
        if (len(body) + len(part)) // PIECE > len(body) // PIECE:
            end = clock() + patience()
        body += part
    return bytes(body)
