"""Read byte ranges of a file or URL, joined into few requests."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

from ..errors import InputError, LimitError, TruncatedError
from ..extras import optional
from ..limits import TIMEOUT, patience
from .content import MISSING, is_url, waiting

Fetch = Callable[[int, int], bytes]
"""Reads the bytes of a file from one offset up to another."""
Range = tuple[int, int]
MOST_PIECES = 5
"""Ranges are joined over gaps of at most ``GAP`` bytes until there are no more than this many."""
GAP = 1 << 18
BEHIND = 416
"""HTTP status if a range begins after the end of the file."""


class NoRangesError(InputError):
    """The server sends the whole file although a range was requested."""


class Pieces:
    """Ranges of a file that have been fetched.

    Parameters
    ----------
    fetch : callable
    limit : int
        Largest number of bytes to fetch at once.
    first : bytes
        The beginning of the file, if it has already been read.
    """

    def __init__(self, fetch: Fetch, limit: int, first: bytes) -> None:
        self._fetch = fetch
        self._limit = limit
        self._pieces = [(0, first)]

    def has(self, start: int, end: int) -> bool:
        """Whether a range has been fetched."""
        return any(at <= start and end <= at + len(data) for at, data in self._pieces)

    def get(self, start: int, end: int) -> bytes:
        """The bytes of a range that has been fetched."""
        if start == end:
            return b""
        return next(data[start - at : end - at] for at, data in self._pieces if at <= start and end <= at + len(data))

    def fetch(self, ranges: Iterable[Range], partial: bool = False) -> None:
        """Fetch the ranges that are missing; with ``partial``, as much of them as the file has.

        Raises
        ------
        LimitError, TruncatedError
        """
        for start, end in together(each for each in ranges if not self.has(*each)):
            if end - start > self._limit:
                raise LimitError(
                    f"{end - start:,} bytes would be fetched, more than the limit of {self._limit:,}",
                    code="limit-bytes", clause="11.2", remedy="ask for a smaller window or a coarser layer",
                )
            data = self._fetch(start, end)
            if len(data) != end - start and not partial:
                raise TruncatedError(
                    f"the file ends at {start + len(data):,}, before its tiles do", code="truncated",
                    offset=start + len(data), clause="12.4",
                )
            self._pieces.append((start, data))


def together(ranges: Iterable[Range]) -> list[Range]:
    """Sort ranges, and join them over the smallest gaps while there are too many."""
    apart: list[Range] = []
    for start, end in sorted(each for each in ranges if each[0] < each[1]):
        if apart and start <= apart[-1][1]:
            apart[-1] = apart[-1][0], max(apart[-1][1], end)
        else:
            apart.append((start, end))
    gaps = sorted((b[0] - a[1], i) for i, (a, b) in enumerate(pairwise(apart), start=1))
    most = max(len(apart) - MOST_PIECES, 0)
    bridged = {i for gap, i in gaps[:most] if gap <= GAP}
    out: list[Range] = []
    for i, (start, end) in enumerate(apart):
        if i in bridged:
            out[-1] = out[-1][0], end
        else:
            out.append((start, end))
    return out


def ranges_of(source: str | os.PathLike[str]) -> Fetch:
    """Make a function that reads a file or URL from one offset up to another, or to the end of the file.

    Raises
    ------
    OSError, MissingExtraError
        Also raised by the function: ``NoRangesError`` if a server sends the whole file although a range was requested.
    """
    if is_url(source):
        return _remote(str(source))
    path = Path(source)
    # raises an error now if the URL cannot be opened
    path.open("rb").close()

    def fetch(start: int, end: int) -> bytes:
        with path.open("rb") as file:
            file.seek(start)
            return file.read(end - start)

    return fetch


def _remote(url: str) -> Fetch:
    fsspec = optional("fsspec", extra="remote", purpose="reading URLs")
    try:
        system, path = fsspec.core.url_to_fs(url, **waiting(url))
    except (ImportError, ValueError) as exc:
        raise InputError(f"cannot be opened ({exc})", code="url") from exc

    def fetch(start: int, end: int) -> bytes:
        try:
            data: bytes = system.cat_file(path, start=start, end=end)
        except TimeoutError as exc:
            # the library's message is empty
            raise InputError(
                f"the server has not answered within {patience():g} seconds", code="timeout",
                remedy=f"try again later, or raise {TIMEOUT}",
            ) from exc
        except FileNotFoundError as exc:
            raise FileNotFoundError(errno.ENOENT, MISSING, url) from exc
        except OSError:
            raise
        except Exception as exc:
            if getattr(exc, "status", None) == BEHIND:
                return b""
            raise InputError(f"cannot be read ({type(exc).__name__}: {exc})", code="url") from exc
        if len(data) > end - start:
            raise NoRangesError(
                "the server sends the whole file instead of the requested range", code="ranges",
                remedy="download the file first, or use a server that supports range requests",
            )
        return data

    return fetch
