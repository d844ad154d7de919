"""Inputs that are no files here: URLs, open files and standard input, each as a file of its own for a while."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ..errors import InputError, LimitError
from ..extras import optional
from ..field.text import plain
from ..limits import FIELD_SAMPLES

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(://|::)")
_PIECE = 1 << 20
_SAMPLE = 16
"""Bytes of a file for each sample that may be read of it, at most."""
_HEAD = 512
SuffixOf = Callable[[str, bytes], str | None]
"""The suffix of a format, by the name of a file (or nothing) and its first 512 bytes."""


def is_url(thing: object) -> bool:
    """Whether a text names something elsewhere: ``https://..``, ``s3://..``, ``zip::..``."""
    return isinstance(thing, str) and _URL.match(thing) is not None


def is_file(thing: object) -> bool:
    """Whether this is a file that is open, or something like it."""
    return callable(getattr(thing, "read", None))


@contextmanager
def opened(url: str) -> Iterator[Any]:
    """What a URL names, open for reading.

    Raises
    ------
    OSError, InputError, MissingExtraError
    """
    fsspec = optional("fsspec", extra="remote", purpose=f"reading {plain(url.partition(':')[0])}: URLs")
    try:
        with fsspec.open(url, "rb") as file:
            yield file
    except ImportError as exc:
        raise InputError(f"cannot be opened ({exc})", code="url", remedy="install what it names") from exc
    except ValueError as exc:
        if isinstance(exc, InputError):
            raise
        raise InputError(f"cannot be opened ({plain(str(exc))})", code="url") from exc


@contextmanager
def local(thing: Any, suffix_of: SuffixOf, samples: int | None = None) -> Iterator[Path]:
    """A file with the bytes of a URL or of an open file, its suffix that of its format, for as long as it is needed.

    Parameters
    ----------
    thing : str or file object
    suffix_of : callable
        Finds the suffix.
    samples : int, optional
        How many may be read; it may have 16 bytes for each.

    Raises
    ------
    OSError
    InputError
        If ``suffix_of`` finds none.
    LimitError
        If there are too many bytes.
    """
    if is_url(thing):
        with opened(thing) as file, _copied(file, urlsplit(thing).path, suffix_of, samples) as path:
            yield path
        return
    named = getattr(thing, "name", None)
    with _copied(thing, named if isinstance(named, str) else "", suffix_of, samples) as path:
        yield path


@contextmanager
def _copied(thing: Any, name: str, suffix_of: SuffixOf, samples: int | None) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="isocodec-") as folder:
        first = _all_of(thing, _HEAD)
        suffix = suffix_of(name, first)
        if suffix is None:
            raise InputError(
                "neither a name nor the first bytes tell which format this has", code="suffix",
                remedy="name it: kind='.tif' (--kind .tif)",
            )
        path = Path(folder) / f"input{suffix}"
        left = _SAMPLE * (FIELD_SAMPLES if samples is None else samples) + (1 << 26) - len(first)
        with path.open("wb") as copy:
            copy.write(first)
            while len(first) == _HEAD and (piece := thing.read(_PIECE)):
                left -= len(piece)
                if left < 0:
                    raise LimitError("has more bytes than the samples that may be read take", code="limit-samples",
                                     remedy="raise the limit with samples= (--limit-samples)")
                copy.write(piece)
        yield path


def _all_of(file: Any, count: int) -> bytes:
    """The first bytes: a pipe may hand them out in pieces."""
    out = b""
    while len(out) < count and (piece := file.read(count - len(out))):
        if not isinstance(piece, bytes | bytearray | memoryview):
            raise InputError("is a file of text", code="no-file", remedy="open it in binary mode: open(name, 'rb')")
        out += bytes(piece)
    return out
