"""Libraries of other formats: import one, put its errors into words of ours, choose among the things it found."""

from __future__ import annotations

import errno
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from ..errors import InputError, IsoError, LimitError, one_line, plain
from ..extras import optional as library

__all__ = ["choose", "library", "reading"]

_OF_CONTENT = (errno.EINVAL, errno.EOVERFLOW, errno.EFBIG, errno.ERANGE, errno.EDOM)
"""Errors of the operating system that come of numbers in a file, such as a place before its beginning."""
_NOISE = re.compile(r"In \S+, line \d+\s+\w+ \(0x\w+\): | ?(at |\()?0x[0-9a-fA-F]{6,}\)?"
                    r"| for request: .*|; It might help .*| Use force=True .*", re.S)
"""Places in sources, addresses of objects, with which VTK and Python name them, and advice to callers of a library."""
_LISTED = 20
"""Names that an error lists at most."""


@contextmanager
def reading(what: str, remedy: str = "check it with the program that wrote it") -> Iterator[list[str]]:
    """Turn whatever a library raises while it reads into an `InputError` with the library's words.

    Its warnings are collected, a line each, in the list that the context gives; those about versions are dropped.
    Errors of this package, of the operating system that carry a number, and of memory keep their kind.
    """
    said: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield said
        of_use = (one for one in caught if not issubclass(one.category, DeprecationWarning | FutureWarning))
        said += dict.fromkeys(one_line(str(one.message)) for one in of_use)
    except IsoError:
        raise
    except MemoryError as error:
        raise LimitError(f"not enough memory to read this {what}", code="memory") from error
    except (Exception, SystemExit) as error:  # meshio ends the program
        if isinstance(error, OSError) and (error.errno or 0) > 0 and error.errno not in _OF_CONTENT:
            raise
        words = one_line(_NOISE.sub("", str(error).rpartition("ERROR: ")[2])) if isinstance(error, Exception) else ""
        raise InputError(f"cannot be read as {what}" + f" ({words})" * bool(words), code="unreadable",
                         remedy=remedy) from error


def choose(found: Sequence[str], key: str | None, what: str = "arrays") -> str:
    """Return the name that a key asks for, or the only one there is; raises `InputError` listing the names."""
    if key is not None and key in found:
        return key
    if key is None and len(found) == 1:
        return found[0]
    listed = ", ".join(map(plain, found[:_LISTED])) + (", .." if len(found) > _LISTED else "")
    holds = f"no {what} named '{plain(key)}'" if key is not None else f"{len(found) or 'no'} {what}"
    raise InputError(f"holds {holds}{f': {listed}' if found else ''}", code="key",
                     remedy="choose one with --key (key= in Python)" if found else None)
