"""Chunks of series and frames: the interval of key frames, what an isovalue of a frame is predicted from (3.5.7)."""

from __future__ import annotations

import zlib

from isospec.container import Checksum, write_varint

from ..errors import FormatError
from .header import varint

FRAME_BEFORE = -1
"""In place of a number: the isovalue is predicted from the same isovalue of the frame before."""
LAST, _CHECKED = 0x20, 0x40
"""Bits of a chunk's head that mark the last one of a file, and one with a checksum."""


def is_key(frame: int, interval: int) -> bool:
    """Whether a frame is a key frame, which is not predicted from earlier frames."""
    return frame == 0 or (interval > 0 and frame % interval == 0)


def key_of(frame: int, interval: int) -> int:
    """The last key frame up to ``frame``."""
    return frame - frame % interval if interval > 0 else 0


def write_interval(interval: int) -> bytes:
    """Write the payload of a chunk of series: every ``interval``-th frame is a key frame; 0 if only the first is."""
    return write_varint(interval)


def read_interval(payload: bytes, start: int) -> int:
    """Inverse of ``write_interval``; ``start`` is the payload's place in the file.

    Raises
    ------
    FormatError
        If it is malformed.
    """
    return _number(payload, start, "the interval of frames")


def _number(payload: bytes, start: int, what: str) -> int:
    """Read a payload that is one number; ``what`` names it in messages."""
    try:
        found = varint(payload, 0, len(payload), "3.5.7")
    except FormatError as error:
        error.offset = start
        raise
    if found is None or found[1] != len(payload):
        raise FormatError(f"{what} is not a single number", code="frame", offset=start, clause="3.5.7")
    return found[0]


def write_frame(number: int, lean: int | None, key: bool) -> bytes:
    """Write the payload of a chunk of frames, with which an isovalue of a further frame begins.

    Parameters
    ----------
    number : int
        Number of the isovalue that begins.
    lean : int or None
        Number of the isovalue of the same frame that it is predicted from, ``FRAME_BEFORE``, or None.
    key : bool
        Whether the frame is a key frame.
    """
    if lean == (None if key else FRAME_BEFORE):
        return b""
    return write_varint(0 if lean is None else number - lean)


def read_frame(payload: bytes, start: int, number: int, key: bool) -> int | None:
    """Inverse of ``write_frame``, of isovalue ``number`` of a frame; ``start`` is the payload's place in the file.

    Raises
    ------
    FormatError
        If it is malformed.
    """
    if not payload:
        return None if key else FRAME_BEFORE
    back = _number(payload, start, "what an isovalue of a frame refers to")
    if back > number:
        raise FormatError(
            "an isovalue of a frame refers to one that has not appeared earlier in that frame",
            code="frame", offset=start, clause="3.5.7"
        )
    return number - back if back else None


def as_last(chunk: bytes) -> bytes:
    """Mark a chunk as the last one of its file, before the file's checksum is appended."""
    found = varint(chunk, 1, len(chunk), "3.4.2")
    assert found is not None
    length, start = found
    body = bytes([chunk[0] | LAST]) + chunk[1 : start + length]
    return body + Checksum.build(zlib.crc32(body)) if chunk[0] & _CHECKED else body
