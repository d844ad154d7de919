"""An input, and what may be read of it: which files, and how many samples."""

from __future__ import annotations

import math
import os
import stat
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...deferred import dataclass
from ...errors import InputError, LimitError, OptionError, plain
from ...limits import FIELD_SAMPLES

_PIECE = 1 << 20
"""Bytes that are unpacked at once."""
_PACKED, _LITTLE = 1 << 12, 1 << 25
"""Bytes that a packed byte becomes at most: some 1,000 by deflate, JPEG and the like; and those that never harm."""
_EITHER = 47
"""Window of zlib for what is packed by gzip as well as by zlib."""


@dataclass(frozen=True)
class InputFile:
    """A file to be read, with checks of its header before anything is read or allocated for it.

    Attributes
    ----------
    path : Path
        A regular file, as `source_of` checks.
    samples : int
        Most samples that may be read.
    follow : bool
        Whether other files are read that it names by a path, or links to.
    virtual : str
        Name by which GDAL knows an input that is no file: ``/vsicurl/https://..``; else empty.
    """

    path: Path
    samples: int = FIELD_SAMPLES
    follow: bool = False
    virtual: str = ""

    @property
    def target(self) -> str:
        """The name for libraries that know virtual files: whole, so that it cannot be taken for a URL."""
        return self.virtual or os.path.abspath(self.path)

    def named(self, *suffixes: str) -> bool:
        """Whether the name ends in one of these, in small letters or capitals."""
        return self.path.name.lower().endswith(suffixes)

    def check_array(self, shape: Sequence[int], dtype: np.dtype[Any]) -> int:
        """Check that an array holds real numbers, and not too many; returns how many bytes they take."""
        base, inner = dtype.subdtype or (dtype, ())
        check_kind(base)
        return self.check_count(math.prod(int(n) for n in (*shape, *inner))) * base.itemsize

    def check_count(self, count: int) -> int:
        """Check that so many samples may be read (else `LimitError`); returns their number."""
        if count > self.samples:
            raise LimitError(
                f"holds {count:,} samples, more than the limit of {self.samples:,}", code="limit-samples",
                remedy="raise it with --limit-samples (samples= in Python)",
            )
        return count

    def check_bytes(self, stated: int, there: int | None = None) -> None:
        """Check that samples which are stored as they are fit into the file, or into as many bytes as there are."""
        there = self.path.stat().st_size if there is None else there
        if stated > there:
            raise _cut_short(f"{stated:,} bytes, but there are {there:,}")

    def check_packed(self, stated: int, there: int | None = None) -> None:
        """Check that packed samples may come out of the file, or of as many bytes as there are."""
        there = self.path.stat().st_size if there is None else there
        if stated > _PACKED * there + _LITTLE:
            raise _cut_short(f"{stated:,} bytes, too many to be packed in {there:,}")

    def check_deflated(self, stated: int, begin: int = 0, path: Path | None = None) -> None:
        """Check that samples packed by gzip or zlib unpack to as many bytes as stated, a piece at a time, undamaged.

        Libraries stop at the last sample, before the checksum.
        """
        count, packed, unpacker = 0, b"", zlib.decompressobj(_EITHER)
        try:
            with (path or self.path).open("rb") as file:
                file.seek(begin)
                while count <= stated + _PIECE and (packed := packed or file.read(_PIECE)):
                    if unpacker.eof:  # a further part of the kind, or what may lie behind the last one
                        packed += file.read(1)
                        if not packed.startswith(b"\x1f\x8b"):
                            break
                        unpacker = zlib.decompressobj(_EITHER)
                    count += len(unpacker.decompress(packed, _PIECE))
                    packed = unpacker.unconsumed_tail or unpacker.unused_data
            count += 0 if count > stated else len(unpacker.flush())
        except zlib.error as exc:
            raise InputError(f"holds packed samples that are damaged ({exc})", code="unreadable") from exc
        if count < stated or not (unpacker.eof or count > stated + _PIECE):
            raise _cut_short(f"{stated:,} bytes, but {count:,} are packed")

    def beside(self, name: str) -> Path:
        """Find the file that a header names: in its directory, or in ``a`` beside ``a.vtm``; others if followed."""
        target = self.path.parent / name
        if not self.follow:
            # a backslash and a colon are paths elsewhere, and to some libraries a dash is standard input
            folder, _, leaf = name.rpartition("/")
            elsewhere = folder not in ("", self.path.stem) or folder in (".", "..") or name.startswith("/")
            if elsewhere or leaf in ("", ".", "..", "-") or any(c in leaf for c in "\\:\0"):
                raise self.refused(name)
            there = os.path.normpath(os.path.join(os.path.realpath(self.path.parent), folder))
            if os.path.dirname(os.path.realpath(target)) != there:
                raise self.refused(name, "which links to another directory")
        if "\0" in name or not target.is_file():
            raise InputError(f"names '{plain(name)}', but there is no such file beside it", code="other-file")
        return target

    def partner(self, suffix: str) -> Path:
        """Find the file beside it with another suffix, in letters of either size, which a pair of files has."""
        name = self.path.stem + suffix.upper()
        return self.beside(name if self.path.with_name(name).exists() else self.path.stem + suffix)

    def refused(self, name: str, why: str = "which is not beside it") -> InputError:
        """The error for another file that was not asked for."""
        return InputError(
            f"names another file, '{plain(name)}', {why}", code="other-file",
            remedy="use --follow-paths (follow=True in Python) if you trust this file",
        )


def source_of(
    path: str | os.PathLike[str], samples: int | None = None, follow: bool = False, folder: bool = False
) -> InputFile:
    """Make a source of a file that can be read from any place in it, or of a ``folder`` whose format is one.

    Raises
    ------
    OSError
        If it cannot be opened.
    InputError
        If it is a device or a pipe, which may never end.
    OptionError
        If ``samples`` is not a positive number.
    """
    name, path = os.fspath(path), Path(path)
    if samples is not None and samples < 1:
        raise OptionError(f"at most {samples} samples; it must be a number from 1 on", code="limit-samples")
    most = FIELD_SAMPLES if samples is None else int(samples)
    if name.startswith("/vsi"):
        return InputFile(path, most, follow, name)
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError("is a device or a pipe; fields are read from files only", code="no-file",
                         remedy="save its contents to a file first")
    # missing files, directories and permissions are reported alike for all formats, before any library looks
    if not (stat.S_ISDIR(mode) and folder):
        with path.open("rb"):
            pass
    return InputFile(path, most, follow)


def beginning(path: Path, size: int) -> bytes:
    """Read the first bytes of a file."""
    with path.open("rb") as file:
        return file.read(size)


def is_dicom(path: Path) -> bool:
    """Whether this is a file of DICOM, by its first bytes: a preamble, or without one elements of the first groups."""
    if not path.is_file():
        return False
    first = beginning(path, 132)
    explicit = first[:2] in (b"\2\0", b"\x08\0", b"\0\x08") and first[4:6] in (b"UL", b"CS", b"UI", b"DA", b"SH")
    implicit = len(first) > 131 and first[:2] == b"\x08\0" and first[2] <= 0x18 and not first[3] + any(first[5:8])
    return first[128:] == b"DICM" or explicit or implicit


def check_kind(dtype: np.dtype[Any]) -> None:
    """Check that values of this type are real numbers."""
    if dtype.names is not None:
        raise InputError(f"holds records ({', '.join(map(plain, dtype.names))}), not numbers", code="dtype")
    if dtype.kind not in "biuf":
        kinds = {"O": "Python objects", "S": "strings", "U": "strings", "c": "complex numbers", "M": "dates"}
        if dtype.kind == "O" and dtype.metadata:  # what h5py makes of strings of any length
            kinds["O"] = "strings or references"
        held = kinds.get(dtype.kind, "values that are not real numbers")
        raise InputError(f"holds {held} (dtype {dtype}), not real numbers", code="dtype")


def _cut_short(what: str) -> InputError:
    return InputError(f"is cut short: its header states {what}", code="unreadable")
