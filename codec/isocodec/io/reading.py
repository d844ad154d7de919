"""What a library raises on a bad file, as one error of ours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import InputError, IsoError, LimitError


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Turn what a library raises on a bad file into one error of ours.

    Parsers raise whatever they stumble over (KeyError, SyntaxError, struct.error, zlib.error, OSError without
    a number ...), so everything is caught here but our own errors and those of the operating system.
    """
    try:
        yield
    except IsoError:
        raise
    except MemoryError as exc:
        raise LimitError(f"not enough memory to read this {what}", code="memory") from exc
    except Exception as exc:
        if isinstance(exc, OSError) and exc.errno is not None:
            raise
        if "DecompressionBombError" in (type(exc).__name__, type(exc.__cause__).__name__):
            raise LimitError(
                f"the picture is larger than the picture library accepts ({one_line(exc)})",
                code="picture-size",
                remedy="save it as TIFF or .npy",
            ) from exc
        raise InputError(f"cannot be read as {what} ({one_line(exc)})", code="unreadable") from exc


def one_line(exc: Exception) -> str:
    # SimpleITK says first where in its source it is
    text = " ".join(str(exc).split()).rpartition("sitk::ERROR: ")[2]
    return text[:200] or type(exc).__name__
