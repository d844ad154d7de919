"""One hierarchy of errors, sorted by origin: the caller, the input, the file, the limits.

Every error carries a short stable ``code``, the exit code that the command line ends with, and
where it makes sense the byte offset in the file and the clause of the specification that is violated.

Text from files and libraries becomes fit for a terminal by `plain` and `one_line`.
"""

from __future__ import annotations


class IsoError(Exception):
    """Base of every error that this package raises on purpose.

    Attributes
    ----------
    code : str
        Short stable identifier, for programs.
    offset : int or None
        Byte offset in the file at which the error was found.
    clause : str or None
        Clause of the specification that the file violates.
    remedy : str or None
        What the caller can do about it.
    source : str or None
        Name of the input that could not be read; the text of the error begins with it.
    """

    exit_code = 1

    def __init__(
        self,
        message: str,
        *,
        code: str = "error",
        offset: int | None = None,
        clause: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        self.offset = offset
        self.clause = clause
        self.remedy = remedy
        self.source: str | None = None

    def __str__(self) -> str:
        text = self.message if self.source is None else f"{self.source}: {self.message}"
        if self.offset is not None:
            text += f" (at byte {self.offset})"
        if self.clause is not None:
            text += f" [spec {self.clause}]"
        if self.remedy is not None:
            text += f": {self.remedy}"
        return text


class OptionError(IsoError, ValueError):
    """The caller's options cannot be combined or are out of range."""

    exit_code = 2


class InputError(IsoError, ValueError):
    """The field or the isovalue cannot be encoded, or an input file cannot be read."""

    exit_code = 3


class FormatError(IsoError, ValueError):
    """The bytes are not a valid ``.iso`` file."""

    exit_code = 4


class TruncatedError(FormatError):
    """The bytes end before the file does; what was received is still there in a snapshot."""

    exit_code = 5


class LimitError(IsoError):
    """Decoding or encoding would need more than the limits allow."""

    exit_code = 6


def out_of_memory(doing: str) -> LimitError:
    """Error to raise instead of a ``MemoryError``."""
    return LimitError(f"not enough memory {doing}", code="memory", remedy="free some, or take a smaller file")


class MissingExtraError(IsoError, ImportError):
    """An optional library is needed; ``remedy`` names the extra to install."""

    exit_code = 7


class KernelError(IsoError):
    """The compiled kernels cannot be loaded, are not those of this source, or were called with other types."""

    exit_code = 8


def plain(text: str, keep: str = "") -> str:
    """Escape, as in Python's strings, what a terminal would interpret: control characters, changes of direction.

    The characters in ``keep``, such as line breaks, stay although they do not print.
    """
    return "".join(c if c.isprintable() or c in keep else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str, most: int = 200) -> str:
    """Shorten a text to one line that is safe for a terminal."""
    line = plain(" ".join(text.split()))
    return line if len(line) <= most else line[: most - 3] + "..."
