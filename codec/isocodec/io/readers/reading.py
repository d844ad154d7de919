"""Shared by readers: errors of libraries as errors of ours, which name the file; one picture or volume of a series."""

from __future__ import annotations

import errno
import logging
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, IsoError, LimitError, OptionError, one_line, plain

DEFAULT_KEY = "values"
"""The array of a file that is taken if there are several and none is named."""
LISTED = 20
"""Names that an error lists at most."""

_OF_CONTENT = (errno.EINVAL, errno.EOVERFLOW, errno.EFBIG, errno.ERANGE, errno.EDOM)
"""Errors of the operating system that come of numbers in a file, such as a place before its beginning."""
_LOG = "tifffile"
"""Logger of a library that reports damage there as an error, and then reads a part of the file as if it were all."""


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Turn what a library raises on a bad file, or logs as an error, into one error of ours.

    Parsers raise whatever they stumble over, so only our own errors and those of the operating system go on.
    """
    complaints: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: complaints.append(record.getMessage())  # type: ignore[method-assign]
    logging.getLogger(_LOG).addHandler(handler)
    try:
        yield
        if complaints:
            raise InputError(f"is damaged ({one_line(complaints[0])})", code="unreadable")
    except IsoError:
        raise
    except MemoryError as exc:
        raise LimitError(f"not enough memory to read this {what}", code="memory") from exc
    except Exception as exc:
        if isinstance(exc, OSError) and exc.errno is not None and exc.errno not in _OF_CONTENT:
            raise
        raise InputError(f"cannot be read as {what} ({said(exc)})", code="unreadable") from exc
    finally:
        logging.getLogger(_LOG).removeHandler(handler)


@contextmanager
def about(name: str) -> Iterator[None]:
    """Let errors of ours name the input that they are about, if it has a name, unless they name one already."""
    try:
        yield
    except IsoError as exc:
        exc.source = exc.source or name or None
        raise


def said(exc: Exception) -> str:
    """Give the message of a library's error in one line."""
    # SimpleITK puts first where in its source it is
    return one_line(str(exc).rpartition("ERROR: ")[2]) or type(exc).__name__


def check_frame(frame: int, count: int) -> None:
    """Raise `OptionError` unless a series of that many, 0 if it is none, has such a frame."""
    if not 0 <= frame < count:
        there = f"the series has {count}, counted from 0" if count else "this is not a series"
        raise OptionError(f"there is no frame {frame}: {there}", code="frame")


def pick_frame(series: NDArray[Any], frame: int | None, axis: int = 0) -> NDArray[Any]:
    """One of a series of pictures or volumes along an axis; what is given if none is asked for."""
    if frame is None:
        return series
    check_frame(frame, series.shape[axis] if series.ndim > 2 else 0)
    return np.take(series, frame, axis=axis)


def channel_of(count: int, channel: int | None) -> int:
    """Choose one of so many channels of a picture, counted from 0."""
    if channel is not None and not 0 <= channel < count:
        raise OptionError(f"there is no channel {channel}: the picture has {count}, counted from 0", code="channel")
    if channel is None and count > 1:
        raise InputError(
            f"is a picture of {count} channels, colours or bands", code="colour",
            remedy=f"take one with --channel 0 to {count - 1}, or convert it to one",
        )
    return channel or 0


def choose(
    shapes: Mapping[str, tuple[int, ...] | str], key: str | None, others: Collection[str] = (),
    default: str | None = None, option: str = "--key", axes: int = 2,
) -> str:
    """Choose the array that a key names, or the only one of so many axes or more, or that of the usual name.

    A word may take the place of a shape that is unknown. A key may name ``others``, too.
    """
    several = {
        name: shape for name, shape in shapes.items()
        if isinstance(shape, str) or sum(size > 1 for size in shape) >= axes
    }
    if key is not None:
        if key not in shapes and key not in others:
            raise InputError(f"holds no array '{plain(key)}', but: {_listing(shapes)}", code="key")
        return key
    only = [*several] if len(several) == 1 or all(isinstance(shape, str) for shape in several.values()) else []
    found = DEFAULT_KEY if DEFAULT_KEY in several else default or next(iter(only), None)
    if found is None:
        what = f"{len(several)} arrays" if several else "no array of two or more axes, but"
        raise InputError(f"holds {what}: {_listing(several or shapes)}", code="key",
                         remedy=f"choose one with {option}" if several else None)
    return found


def _listing(shapes: Mapping[str, tuple[int, ...] | str]) -> str:
    parts = [f"{plain(name)} {shape}" for name, shape in shapes.items() if shape]
    return ", ".join(parts[:LISTED] + ["..."] * (len(parts) > LISTED)) or "nothing"


def named(
    what: str, names: Mapping[Any, Sequence[str]], key: str | None, remedy: str = "choose one with --key"
) -> Any:
    """Choose the only one of several things that has a name; errors list the last name of each."""
    found = [each for each, known in names.items() if key is None or key in known]
    if len(found) == 1:
        return found[0]
    which = f"{len(names)} {what}" if key is None else f"{len(found) or 'no'} {what} '{plain(key)}'"
    listed = "; ".join(plain(names[each][-1]) for each in [*(found or names)][:LISTED])
    raise InputError(f"holds {which}: {listed}", code="key", remedy=remedy)


def upright(picture: NDArray[Any], orientation: Any) -> NDArray[Any]:
    """Turn a picture of an orientation, 1 to 8 as EXIF and TIFF count them, as it is meant to be seen."""
    picture = picture.T if orientation in (5, 6, 7, 8) else picture
    return picture[:: -1 if orientation in (3, 4, 7, 8) else 1, :: -1 if orientation in (2, 3, 6, 7) else 1]
