"""Read byte ranges of a file or URL, joined into few requests."""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from ..errors import LimitError, TruncatedError
from ..limits import Limits
from .content import by_fsspec, content, content_of_path, is_url, is_web
from .web import NoRangesError, Range, WebFile

Fetch = Callable[[Sequence[Range]], list[bytes]]
"""Reads ranges of a file, each from one offset up to another; fewer bytes if the file ends before."""
MOST_PIECES = 6
"""Ranges are joined over the smallest gaps until there are no more than this many, if `SLACK` allows."""
GAP, SLACK = 1 << 13, 1 << 14
"""Gaps, in bytes, that cost less than a request; and bytes of gaps that are read at most, unless the ranges have more.
"""


class Pieces:
    """Ranges of a file that have been fetched; ``first`` is its beginning, if it has already been read."""

    def __init__(self, first: bytes) -> None:
        self._left = 0
        self._starts, self._pieces = [0], [first]

    def begin(self, limit: int, kept: int) -> None:
        """Allow ``limit`` more bytes to be fetched; those fetched before are kept if they are at most ``kept``."""
        self._left = limit
        if sum(map(len, self._pieces)) > kept:
            self._starts, self._pieces = [0], self._pieces[:1]

    def has(self, start: int, end: int) -> bool:
        """Whether a range has been fetched."""
        return start == end or self._piece(start, end) is not None

    def get(self, start: int, end: int) -> bytes:
        """The bytes of a range that has been fetched."""
        if start == end:
            return b""
        number = self._piece(start, end)
        assert number is not None
        at = self._starts[number]
        return self._pieces[number][start - at : end - at]

    def _piece(self, start: int, end: int) -> int | None:
        """Number of a piece that holds a range; pieces may overlap."""
        before = range(bisect_right(self._starts, start) - 1, -1, -1)
        return next((i for i in before if end <= self._starts[i] + len(self._pieces[i])), None)

    def fetch(self, fetch: Fetch, ranges: Iterable[Range], partial: bool = False) -> None:
        """Fetch the ranges that are missing; with ``partial``, as much as the file has."""
        wanted = together(each for each in ranges if not self.has(*each))
        self._left -= sum(end - start for start, end in wanted)
        if self._left < 0:
            raise LimitError(
                f"{-self._left:,} bytes more than the limit would be fetched", code="limit-bytes", clause="11.2",
                remedy="ask for a smaller window or a coarser layer",
            )
        for (start, end), data in zip(wanted, fetch(wanted) if wanted else (), strict=True):
            if len(data) != end - start and not partial:
                raise TruncatedError(
                    f"the file ends at {start + len(data):,}, before its tiles do", code="truncated",
                    offset=start + len(data), clause="12.4",
                )
            number = bisect_right(self._starts, start)
            self._starts.insert(number, start)
            self._pieces.insert(number, data)


def together(ranges: Iterable[Range]) -> list[Range]:
    """Sort ranges, and join them: over small gaps, and over larger ones while there are many ranges.

    All gaps together have no more bytes than the ranges, or than `SLACK`: a window reads at most twice what it needs.
    """
    apart: list[Range] = []
    for start, end in sorted(each for each in ranges if each[0] < each[1]):
        if apart and start <= apart[-1][1]:
            apart[-1] = apart[-1][0], max(apart[-1][1], end)
        else:
            apart.append((start, end))
    most = max(SLACK, sum(end - start for start, end in apart))
    bridged: set[int] = set()
    for gap, i in sorted((b[0] - a[1], i) for i, (a, b) in enumerate(pairwise(apart), start=1)):
        most -= gap
        if most < 0 or (len(apart) - len(bridged) <= MOST_PIECES and gap > GAP):
            break
        bridged.add(i)
    starts = [start for i, (start, _) in enumerate(apart) if i not in bridged]
    ends = [end for i, (_, end) in enumerate(apart, start=1) if i not in bridged]
    return list(zip(starts, ends, strict=True))


def content_from(source: str | os.PathLike[str], start: int, limits: Limits | None = None) -> bytes:
    """Read a file or URL from a place on; raises `OSError`, `InputError` or `LimitError`.

    All of it is read if a server does not support range requests.
    """
    if not is_url(source):
        return content_of_path(source, start, limits)
    try:
        return ranges_of(source)([(start, (limits or Limits()).bytes)])[0]
    except NoRangesError:
        return content(source, limits)[start:]


def ranges_of(source: bytes | str | os.PathLike[str]) -> Fetch:
    """Make a function that reads ranges of bytes, a file or a URL.

    Raises
    ------
    OSError, MissingExtraError
        Also raised by the function: ``NoRangesError`` if a server sends the whole file although a range was requested.
    """
    if isinstance(source, bytes):
        return lambda ranges: [source[start:end] for start, end in ranges]
    if is_web(source):
        return WebFile(str(source)).read
    if is_url(source):
        return _remote(str(source))
    path = Path(source)
    # raises an error now if the file cannot be opened
    path.open("rb").close()

    def fetch(ranges: Sequence[Range]) -> list[bytes]:
        found = []
        with path.open("rb") as file:
            for start, end in ranges:
                file.seek(start)
                found.append(file.read(end - start))
        return found

    return fetch


def _remote(url: str) -> Fetch:
    with by_fsspec(url) as fsspec:
        system, path = fsspec.core.url_to_fs(url)

    def fetch(ranges: Sequence[Range]) -> list[bytes]:
        starts, ends = ([each[side] for each in ranges] for side in (0, 1))
        with by_fsspec(url):
            found: list[bytes] = system.cat_ranges([path] * len(ranges), starts, ends, on_error="raise")
        if any(len(data) > end - start for data, (start, end) in zip(found, ranges, strict=True)):
            raise NoRangesError()
        return found

    return fetch
