"""Headers of MetaImage and NRRD: which files they name for their samples.

Libraries follow these names to any place. So a header is read here first, strictly enough that a library cannot take a
line for a name that was not seen.
"""

from __future__ import annotations

import re
from pathlib import Path

from ...deferred import dataclass
from ...errors import InputError, LimitError
from .source import InputFile

_HEADER = 1 << 20
"""Bytes in which a header has to end."""
_PATTERN = re.compile(r"([^%\s]*%0?[0-9]{0,3}d[^%\s]*)\s+(-?\d{1,9})\s+(-?\d{1,9})(\s+-?\d{1,9}(?:\s.*)?)?\s*", re.A)
"""A name with the place of one whole number, its first number, last number, and step: ``slice%03d.raw 1 40 1``."""
_FILES = 100_000
_KEY = b"ElementDataFile"
_NAMES = ("utf-8", "surrogateescape")
_NO_KIND = ("domain", "space", "time", "none", "???")
"""Kinds of axes that ITK takes for axes in space."""
_AXES = (b"2", b"3", b"4", b"5")
_META_END, _NRRD_END = re.compile(rb"ElementDataFile[^\n]*\n"), re.compile(rb"\n\r?\n")
"""Ends of headers before samples in the same file."""


@dataclass(frozen=True)
class Stored:
    """Storage of the samples that a header describes.

    Attributes
    ----------
    files : list of Path
    packing : str
        ``raw``, ``gzip``, or another one.
    begin : int
        Where they begin in the file of the header, if they are in it.
    """

    files: list[Path]
    packing: str
    begin: int = 0

    def check(self, source: InputFile, stated: int) -> None:
        """Check that the samples take as many bytes as stated, and if packed are not damaged; raises `InputError`."""
        if self.packing == "raw":
            source.check_bytes(stated, sum(path.stat().st_size for path in self.files))
        elif self.packing in ("gz", "gzip") and len(self.files) == 1:
            (path,) = self.files
            source.check_deflated(stated, self.begin if path == source.path else 0, path)


def meta_files(source: InputFile) -> Stored:
    """Find the files that hold the samples of a MetaImage.

    Raises
    ------
    InputError
        If it is malformed, or names a file that is not to be read.
    LimitError
        If it names too many.
    """
    head, cut, begin = _head(source, _META_END)
    at = head.find(_KEY)
    before, line_break, indent = head[: max(at, 0)].rpartition(b"\n")
    line, _, rest = head[at + len(_KEY) :].partition(b"\n")
    value = line.strip()
    fields = [line.partition(b"=" if b"=" in line else b":") for line in before.split(b"\n") if line.strip()]
    # the first occurrence of the key has to begin a line, and not continue a field without a value
    alone = line_break and not indent.strip() and fields and fields[-1][2].strip()
    if at < 0 or not alone or value[:1] not in (b"=", b":") or any(c in before + line for c in b"\r\0"):
        raise InputError("has no MetaImage header", code="unreadable")
    stated = {name.strip(): value.strip().lower() for name, _, value in fields}
    packing = "gzip" if stated.get(b"CompressedData") == b"true" else "raw"
    if stated.get(b"BinaryData") == b"false":
        packing = "text"
    if stated.get(b"NDims") not in _AXES:
        raise InputError("states no number of axes from 2 to 5", code="unreadable")
    target = value.lstrip(b"=: \t").decode(*_NAMES)
    if target.startswith("LIST") and cut:
        raise InputError(f"has a header of more than {_HEADER:,} bytes", code="unreadable")
    here = target in ("LOCAL", "Local", "local")
    files = [source.path] if here else _files(source, target, rest.decode(*_NAMES), upwards=True)
    packed = stated.get(b"CompressedDataSize", b"")
    if packed.isdigit():
        source.check_bytes(int(packed), sum(path.stat().st_size for path in files))
    return Stored(files, packing, begin)


def nrrd_files(source: InputFile) -> Stored:
    """Find the files of an NRRD header; raises as `meta_files`."""
    lines, fields, begin = _nrrd(source)
    files: list[Path] = []
    for number, (line, field) in enumerate(zip(lines, fields, strict=True)):
        value = line.partition(":")[2]
        if field == "datafile" and not value.startswith("="):
            files += _files(source, value.strip(), "\n".join(lines[number + 1 :]))
            if value.strip().startswith("LIST"):
                break
    values = _values(lines, fields)
    skips = any(field in ("lineskip", "byteskip") for field in fields)
    return Stored(files or [source.path], "other" if skips else values.get("encoding", "").strip().lower(), begin)


def listed(source: InputFile, files: list[Path]) -> bytes:
    """Make an NRRD header whose axis without a direction, or of time, is a list, for a file ``samples`` beside it.

    Empty if ITK takes the header of the source as it is, or finds its samples in several files.
    """
    lines, fields, _ = _nrrd(source)
    values = _values(lines, fields)
    directions = re.findall(r"none|\([^)]*\)", values.get("spacedirections", ""))
    kinds = values.get("kinds", "").split() or ["domain"] * len(directions)
    apart = [n for n, each in enumerate(directions or kinds) if each == ("none" if directions else "time")]
    if len(files) > 1 or len(apart) != 1 or len(kinds) < apart[0] + 1 or kinds[apart[0]] not in _NO_KIND:
        return b""
    kinds[apart[0]] = "list"
    attached = files == [source.path]
    own = ("kinds", "datafile", *(("lineskip",) if attached else ()))
    kept = [line for name, line in zip(fields, lines, strict=True) if name not in own]
    skip = [f"line skip: {len(lines) + 1 + int(values.get('lineskip', 0))}"] * attached
    return "\n".join([*kept, f"kinds: {' '.join(kinds)}", *skip, "data file: samples", "", ""]).encode(*_NAMES)


def _nrrd(source: InputFile) -> tuple[list[str], list[str], int]:
    """The lines of a header, the names of their fields, and where samples begin behind it."""
    head, cut, begin = _head(source, _NRRD_END)
    head, end, _ = head.partition(b"\n\n")
    if not head.startswith(b"NRRD") or (cut and not end) or any(c in head for c in b"\r\0"):
        raise InputError("has no NRRD header", code="unreadable")
    lines = head.decode(*_NAMES).split("\n")
    return lines, ["".join(line.partition(":")[0].lower().split()) for line in lines], begin


def _values(lines: list[str], fields: list[str]) -> dict[str, str]:
    return {field: line.partition(":")[2] for field, line in zip(fields, lines, strict=True) if ":=" not in line}


def _head(source: InputFile, end: re.Pattern[bytes]) -> tuple[bytes, bool, int]:
    """The first bytes of a file, with line breaks of one kind, whether there are more, and where the header ends."""
    with source.path.open("rb") as file:
        head, more = file.read(_HEADER), bool(file.read(1))
    found = end.search(head)
    return head.replace(b"\r\n", b"\n"), more, found.end() if found else 0


def _files(source: InputFile, value: str, rest: str, upwards: bool = False) -> list[Path]:
    """Files that the field of a header names: one, some by numbers, or those of the lines that follow it.

    With ``upwards`` numbers have to grow: MetaIO reads nothing of others, and leaves the samples as memory was.
    """
    names, count = [value], 1
    if value.startswith("LIST"):
        names = [line.strip() for line in rest.split("\n") if line.strip()]
        count = len(names)
    elif "%" in value:
        found = _PATTERN.fullmatch(value)
        step = int((found[4] or "1").split()[0]) if found else 0
        if not found or not step or (upwards and step < 0):
            raise InputError("names files by a pattern that cannot be followed", code="unreadable")
        numbers = range(int(found[2]), int(found[3]) + (1 if step > 0 else -1), step)
        names, count = [found[1] % number for number in numbers[:_FILES]], len(numbers)
    if count > _FILES:
        raise LimitError(f"names {count:,} files", code="limit-files")
    return [source.beside(name) for name in dict.fromkeys(names)]
