"""Bytes of a file and what they mean, row by row: what annotated dumps are made of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field

from isocodec.errors import FormatError

WIDE = 16
"""Bytes in a row."""


@dataclass
class Rows(ABC):
    """A file from its first byte on, of which more and more is known.

    Attributes
    ----------
    data : bytes
    at : int
        Where what is known ends.
    """

    data: bytes
    at: int = 0
    _rows: list[tuple[int, int, str]] = field(default_factory=list)

    @abstractmethod
    def read(self) -> None:
        """Note what the whole file is; FormatError where it cannot be read on."""

    def note(self, end: int, meaning: str) -> None:
        """The bytes up to ``end`` are that."""
        self._rows.append((self.at, min(end, len(self.data)), meaning))
        self.at = min(end, len(self.data))

    def lines(self) -> Iterator[str]:
        """All rows, as far as the file can be read, with a line about bytes that nothing is known of."""
        try:
            self.read()
        except FormatError as error:
            self.note(max(error.offset or 0, self.at), "what comes before an error")
        if self.at < len(self.data):
            self.note(len(self.data), "not read")
        yield from (f"{len(self.data)} bytes", "", "offset  bytes and their meaning")
        for start, end, meaning in self._rows:
            for at in range(start, end, WIDE):
                part = self.data[at : min(at + WIDE, end)].hex(" ")
                yield f"{at:6}  {part:<12}  {meaning}" if at == start else f"{at:6}  {part}"
        yield ""
