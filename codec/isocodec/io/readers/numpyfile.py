"""NumPy files: .npy, and .npz with its arrays by name. Headers are read first, and held against what is allowed."""

from __future__ import annotations

import io
import zipfile
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ...errors import InputError, OptionError, plain
from .reading import pick_frame, reading
from .source import Source

Field = NDArray[Any]

DEFAULT_KEY = "values"
"""The array of a file that is taken if there are several and none is named."""
_HEADER = 1 << 16
"""Bytes in which a header has to end; NumPy reads none of more than 10,000 characters."""
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How NumPy packs arrays. What unpacks the others takes memory before it knows how much comes out."""
_LISTED = 20


def read_numpy(source: Source, key: str | None, frame: int | None) -> Field:
    with source.path.open("rb") as file:
        magic = file.read(6)
        # numpy takes anything else for a pickle and says so, which would lead the user astray.
        if magic != b"\x93NUMPY" and magic[:4] not in (b"PK\x03\x04", b"PK\x05\x06"):
            raise InputError("is not a NumPy file", code="unreadable")
        file.seek(0)
        with reading("NumPy file"):
            if magic[:2] == b"PK":
                return pick_frame(_member(source, file, key), frame)
            if key is not None:
                raise OptionError("a key names an array of an .npz file; this is a single array", code="key")
            return pick_frame(_array(source, file, source.path.stat().st_size), frame)


def _array(source: Source, file: IO[bytes], there: int) -> Field:
    """The array in an open file, of so many bytes."""
    shape, dtype, begin = _header(file.read(_HEADER))
    source.check_bytes(begin + source.check_array(shape, dtype), there)
    file.seek(0)
    return np.asarray(npy.read_array(file, allow_pickle=False))


def _header(begin: bytes) -> tuple[tuple[int, ...], np.dtype[Any], int]:
    """Shape and type of an array out of the first bytes of its file, and where its samples begin."""
    file = io.BytesIO(begin)
    # the third version is the second one in UTF-8, which changes names of fields only
    read = npy.read_array_header_1_0 if npy.read_magic(file) == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype, file.tell()


def _member(source: Source, file: IO[bytes], key: str | None) -> Field:
    with zipfile.ZipFile(file) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if key is None:
            if len(members) == 1:
                (key,) = members
            elif DEFAULT_KEY in members:
                key = DEFAULT_KEY
            elif not members:
                raise InputError("holds no arrays", code="key")
            else:
                raise InputError(
                    f"holds {len(members)} arrays: {_listing(archive, members)}", code="key",
                    remedy="choose one with --key",
                )
        elif (key := key.removesuffix(".npy")) not in members:
            listing = _listing(archive, members) or "nothing"
            raise InputError(f"holds no array '{plain(key)}', but: {listing}", code="key")
        info = members[key]
        if not info.filename.endswith(".npy"):
            raise InputError(f"'{plain(key)}' is not an array", code="key")
        with _opened(archive, info) as member:
            return _array(source, member, info.file_size)


def _opened(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> IO[bytes]:
    if info.compress_type not in _PACKED:
        raise InputError("is packed in a way that NumPy does not write", code="unreadable", remedy="use np.savez")
    return archive.open(info)


def _listing(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo]) -> str:
    parts = []
    for name, info in [*members.items()][:_LISTED]:
        try:
            with _opened(archive, info) as member:
                shape, dtype, _ = _header(member.read(_HEADER))
            kind = str(shape) if dtype.kind != "O" else "unreadable"
        except Exception:  # an unreadable neighbour must not hide the names of the others
            kind = "unreadable"
        parts.append(f"{plain(name)} {kind}")
    return ", ".join(parts + ["..."] * (len(members) > _LISTED))
