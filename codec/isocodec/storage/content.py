"""Read paths, URLs and file objects within limits, or copy them to a temporary local file."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias
from urllib.parse import urlsplit

from ..errors import InputError, IsoError, LimitError, MissingExtraError, OptionError, plain
from ..extras import optional
from ..limits import FIELD_SAMPLES, Limits
from .web import WebFile

Readable: TypeAlias = bytes | bytearray | memoryview | str | os.PathLike[str] | BinaryIO
"""An ``.iso`` file: its bytes, or where to read them."""
SuffixOf = Callable[[str, bytes], str | None]
"""Finds the suffix of a format from the name of a file, if any, and its first `HEAD` bytes."""
HEAD = 512
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(://|::)")
_PIECE = 1 << 20
_SAMPLE = 16
"""Largest size of a file, in bytes, per sample that may be read."""


def is_url(thing: object) -> bool:
    """Whether a text is a URL: ``https://..``, ``s3://..``, ``zip::..``."""
    return isinstance(thing, str) and _URL.match(thing) is not None


def is_web(thing: object) -> bool:
    """Whether a text is the URL of a file on a web server."""
    return isinstance(thing, str) and thing.lower().startswith(("http://", "https://"))


def is_file(thing: object) -> bool:
    """Whether an object is an open file or behaves like one."""
    return callable(getattr(thing, "read", None))


@contextmanager
def opened(url: str) -> Iterator[Any]:
    """Open a URL for reading; raises `OSError`, `InputError` or `MissingExtraError`."""
    if is_web(url):
        with WebFile(url).open() as body:
            yield body
        return
    with by_fsspec(url) as fsspec, fsspec.open(url, "rb") as file:
        yield file


@contextmanager
def by_fsspec(url: str) -> Iterator[Any]:
    """Give the library that opens a URL; its errors, whose messages may be no more than the URL, are explained."""
    urls = f"{plain(url.partition(':')[0])}: URLs"
    fsspec = optional("fsspec", extra="remote", purpose=f"opening {urls}")
    try:
        yield fsspec
    except FileNotFoundError as exc:
        raise FileNotFoundError(errno.ENOENT, "the store has no such bucket, folder or file", url) from exc
    except PermissionError as exc:
        raise PermissionError(errno.EACCES, plain(exc.strerror or str(exc)), url) from exc
    except (IsoError, OSError):
        raise
    except ImportError as exc:
        raise MissingExtraError(f"opening {urls} needs another package ({plain(str(exc))})", code="missing-extra",
                                remedy="pip install it beside isocodec") from exc
    except Exception as exc:
        raise InputError(f"cannot be opened ({type(exc).__name__}: {plain(str(exc))})", code="url",
                         remedy="check the address and the credentials") from exc


def content_of_path(path: str | os.PathLike[str], start: int, limits: Limits | None = None) -> bytes:
    """Read a local file from a place on; errors as of `content`."""
    with Path(path).open("rb") as file:
        file.seek(start)
        return _read(file, (limits or Limits()).bytes - start, ())


def content(data: Readable, limits: Limits | None = None, signatures: Collection[bytes] = ()) -> bytes:
    """Read a path, a URL or a file object; anything else is returned unchanged.

    ``limits.bytes`` bounds the size. A file must begin with one of the ``signatures``, which have the same length; of
    any other file, which may be endless, no more than that is read. Raises `OSError` if it cannot be opened,
    `OptionError` for a file object that was opened as text, and `LimitError` if it is too large.
    """
    most = (limits or Limits()).bytes
    if isinstance(data, str) and is_url(data):
        with opened(data) as file:
            return _read(file, most, signatures)
    if isinstance(data, str | os.PathLike):
        with Path(data).open("rb") as file:
            return _read(file, most, signatures)
    return _read(data, most, signatures) if is_file(data) else data  # type: ignore[return-value]


def _read(file: Any, most: int, signatures: Collection[bytes]) -> bytes:
    first = _first(file, max(map(len, signatures), default=0))
    if signatures and first not in signatures:
        return first
    pieces, left = [first], most - len(first)
    while piece := file.read(_PIECE):
        pieces.append(_binary(piece))
        left -= len(piece)
        if left < 0:
            raise LimitError(f"more than {most:,} bytes", code="limit-bytes", clause="11.2")
    return b"".join(pieces)


@contextmanager
def local(thing: Any, suffix_of: SuffixOf, samples: int | None = None) -> Iterator[Path]:
    """Yield a temporary local copy of a URL or an open file, with the suffix that ``suffix_of`` finds.

    If ``samples`` is the number that may be read, the file may have 16 bytes for each. Raises `InputError` if no suffix
    is found, and `LimitError` if there are too many bytes.
    """
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="isocodec-") as folder:
        if is_url(thing):
            with opened(thing) as file:
                path = _copied(file, urlsplit(thing).path, Path(folder), suffix_of, samples)
        else:
            named = getattr(thing, "name", None)
            path = _copied(thing, named if isinstance(named, str) else "", Path(folder), suffix_of, samples)
        yield path


def _copied(file: Any, name: str, folder: Path, suffix_of: SuffixOf, samples: int | None) -> Path:
    """Copy a file into a folder, with the suffix of its format."""
    first = _first(file, HEAD)
    suffix = suffix_of(name, first)
    if suffix is None:
        raise InputError("unknown format: neither a name nor the first bytes identify it", code="suffix",
                         remedy="save it to a file whose suffix names the format")
    left = _SAMPLE * (FIELD_SAMPLES if samples is None else samples) + (1 << 26) - len(first)
    with (path := folder / f"input{suffix}").open("wb") as copy:
        copy.write(first)
        while len(first) == HEAD and (piece := file.read(_PIECE)):
            left -= len(piece)
            if left < 0:
                raise LimitError("is larger than the permitted number of samples could fill", code="limit-samples",
                                 remedy="download it first")
            copy.write(piece)
    return path


def _first(file: Any, count: int) -> bytes:
    """Read the first bytes; a pipe may deliver them in pieces."""
    out = b""
    while len(out) < count and (piece := file.read(count - len(out))):
        out += bytes(_binary(piece))
    return out


def _binary(piece: Any) -> bytes:
    if isinstance(piece, str):
        raise OptionError("the file was opened as text", code="data", remedy="open it in binary mode: open(name, 'rb')")
    return piece
