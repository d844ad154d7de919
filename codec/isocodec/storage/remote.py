"""Inputs that are no files here: URLs, open files and standard input, each as a file of its own for a while."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
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
_SIGNS: tuple[tuple[int, bytes, str], ...] = (
    (0, b"\x93NUMPY", ".npy"), (0, b"PK\x03\x04", ".npz"), (0, b"\x89HDF\r\n\x1a\n", ".h5"), (0, b"\x89PNG", ".png"),
    (0, b"\xff\xd8\xff", ".jpg"), (0, b"II*\0", ".tif"), (0, b"MM\0*", ".tif"), (0, b"II+\0", ".tif"),
    (0, b"MM\0+", ".tif"), (344, b"n+1\0", ".nii"), (4, b"n+2\0", ".nii"), (0, b"\x1f\x8b", ".nii.gz"),
    (0, b"NRRD", ".nrrd"), (0, b"CDF\x01", ".nc"), (0, b"CDF\x02", ".nc"), (0, b"CDF\x05", ".nc"),
    (0, b"GRIB", ".grib"), (128, b"DICM", ".dcm"), (0, b"<VTKFile", ".vti"), (0, b"<?xml", ".vti"),
    (0, b"ObjectType", ".mha"), (0, b"NDims", ".mha"),
)
"""What files of each kind begin with, and where."""
_HEAD = 512


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
def local(thing: Any, samples: int | None = None, kind: str | None = None) -> Iterator[Path]:
    """A file with the bytes of a URL or of an open file, its suffix that of its format, for as long as it is needed.

    Parameters
    ----------
    thing : str or file object
    samples : int, optional
        How many may be read; it may have 16 bytes for each.
    kind : str, optional
        The suffix; without it that of the name, or the one that the first bytes tell.

    Raises
    ------
    OSError
    InputError
        If neither its name nor its first bytes tell which format it has.
    LimitError
        If there are too many bytes.
    """
    if is_url(thing):
        with opened(thing) as file, local(file, samples, kind or _suffix_of(urlsplit(thing).path)) as path:
            yield path
        return
    named = getattr(thing, "name", None)
    kind = kind or _suffix_of(named if isinstance(named, str) else "")
    with tempfile.TemporaryDirectory(prefix="isocodec-") as folder:
        first = _all_of(thing, _HEAD)
        suffix = kind or _suffix_by(first)
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


def _suffix_of(name: str) -> str | None:
    from ..io.readers.read import FIELD_SUFFIXES

    lower = PurePosixPath(name).name.lower()
    return next((suffix for suffix in sorted(FIELD_SUFFIXES, key=len, reverse=True) if lower.endswith(suffix)), None)


def _suffix_by(first: bytes) -> str | None:
    return next((suffix for at, sign, suffix in _SIGNS if first[at : at + len(sign)] == sign), None)
