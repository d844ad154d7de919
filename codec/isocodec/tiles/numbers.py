"""Read the numbers of a directory with bounds checks (spec clause 3.2)."""

from __future__ import annotations

import math

from isospec.container import Double, IsovalueKind, VarintError, read_varint

from ..errors import FormatError
from ..format.chunks import read_metadata
from ..format.header import read_isovalue


def wrong(text: str, code: str, at: int, clause: str) -> FormatError:
    """Make the error for an invalid directory, with its offset in the file."""
    return FormatError(text, code=code, offset=at, clause=clause)


class Reader:
    """Reads numbers one after the other with bounds checks; ``base`` is the offset of the bytes in the file."""

    def __init__(self, data: bytes, at: int, end: int, base: int = 0) -> None:
        self.data, self.at, self.end, self.base = data, at, end, base

    def check(self, count: int) -> None:
        """Raise `FormatError` unless this many bytes are left."""
        if count > self.end - self.at:
            raise self._early()

    def bytes(self, count: int) -> bytes:
        """Read this many bytes."""
        self.check(count)
        self.at += count
        return self.data[self.at - count : self.at]

    def byte(self) -> int:
        """Read a number below 256."""
        return self.bytes(1)[0]

    def number(self) -> int:
        """Read a varint."""
        try:
            found = read_varint(self.data, self.at, self.end)
        except VarintError as error:
            raise wrong(str(error), "varint", self.base + self.at, "3.2.1") from None
        if found is None:
            raise self._early()
        self.at = found[1]
        return found[0]

    def scale(self) -> float:
        """Read a positive number."""
        value = float(Double.parse(self.bytes(8)))
        if not (math.isfinite(value) and value > 0):
            raise wrong("the scale is not a positive number", "scale", self.at - 8, "12.3")
        return value

    def isovalue(self) -> float:
        """Read an isovalue: its kind, and the number."""
        kind = self.byte()
        if kind > max(IsovalueKind):
            raise wrong("unknown kind of isovalue", "isovalue", self.at - 1, "12.3")
        found = read_isovalue(self.data, self.at, self.end, kind)
        if found is None:
            raise self._early()
        self.at = found[1]
        return found[0]

    def notes(self) -> dict[str, str]:
        """Read notes: their length, and a JSON object (clause 3.7.2)."""
        size = self.number()
        if size > self.end - self.at:
            raise wrong("metadata longer than the head", "metadata", self.base + self.at, "12.3")
        return read_metadata(self.bytes(size))

    def _early(self) -> FormatError:
        return wrong("a directory ends too early", "directory", self.base + self.end, "12.4")
