"""Sizes that the parts of a TIFF state for themselves: tiles and strips that are files of other formats.

Their decoders allocate what the header of the part asks for, whatever the TIFF around it states.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any

from ...errors import InputError
from ...extras import optional

JPEG, JPEG_2000, LERC, PNG, WEBP = (6, 7, 33007), (33003, 33004, 33005, 34712), (34887,), (34933,), (34927, 50001)
PICTURES = frozenset((*JPEG, *JPEG_2000, *LERC, *PNG, *WEBP))
"""Compressions of TIFF whose parts are files of their own and whose sizes are known here."""
_LERC_DEFLATE, _LERC_ZSTD = 1, 2
_ROOM = 1 << 16
"""Bytes of headers that may come on top of samples."""
_MARKERS_ALONE = {0x01, *range(0xD0, 0xD9)}
_NO_FRAME = {0xC4, 0xC8, 0xCC}


def stated_samples(part: bytes, compression: int) -> int | None:
    """Number of samples of one channel by a part's header; None if it is unknown."""
    try:
        if compression in JPEG:
            return _of_jpeg(part)
        if compression in JPEG_2000:
            at = part.index(b"\xff\x4f\xff\x51") + 8  # start of the codestream, SIZ, its length, capabilities
            width, height, left, top = struct.unpack_from(">4I", part, at)
            return int((width - left) * (height - top))
        if compression in LERC:
            return _of_lerc(part)
        if compression in PNG:
            width, height = struct.unpack_from(">2I", part, 16)
            return int(width * height)
        return _of_webp(part)
    except (ValueError, struct.error, IndexError):
        return None


def unpacked_lerc(part: bytes, tag: Any, samples: int) -> bytes:
    """A LERC part without what packs it once more; ``tag`` is the TIFF's entry for that.

    Raises
    ------
    InputError
        If it unpacks to more than the samples take.
    """
    packing = tag[1] if isinstance(tag, tuple) and len(tag) > 1 else 0
    most = samples * 16 + _ROOM
    if packing == _LERC_DEFLATE:
        out = zlib.decompressobj().decompress(part, most + 1)
    elif packing == _LERC_ZSTD:
        codec = optional("imagecodecs", extra="image", purpose="reading a TIFF packed with Zstandard")
        try:
            out = bytes(codec.zstd_decode(part, out=most + 1))
        except codec.ZstdError as exc:
            raise InputError("holds packed samples that unpack to more than its header states, or are damaged",
                             code="unreadable") from exc
    else:
        return part
    if len(out) > most:
        raise InputError("holds packed samples that unpack to more than its header states", code="unreadable")
    return out


def _of_jpeg(part: bytes) -> int:
    at = 2
    while True:
        if part[at] != 0xFF:
            raise ValueError
        marker = part[at + 1]
        if marker == 0xFF:
            at += 1
        elif marker in _MARKERS_ALONE:
            at += 2
        elif 0xC0 <= marker <= 0xCF and marker not in _NO_FRAME:
            height, width = struct.unpack_from(">2H", part, at + 5)
            return int(height * width)
        else:
            at += 2 + struct.unpack_from(">H", part, at + 2)[0]


def _of_lerc(part: bytes) -> int:
    if part[:6] != b"Lerc2 ":
        raise ValueError
    version = struct.unpack_from("<i", part, 6)[0]
    # from version 3 on a checksum stands before the size, from 4 on the number of values of a pixel behind it
    at = 14 if version >= 3 else 10
    rows, columns = struct.unpack_from("<2i", part, at)
    deep = struct.unpack_from("<i", part, at + 8)[0] if version >= 4 else 1
    if min(rows, columns, deep) < 0:
        raise ValueError
    return int(rows * columns * deep)


def _of_webp(part: bytes) -> int:
    kind = part[12:16]
    if kind == b"VP8X":
        return int((1 + int.from_bytes(part[24:27], "little")) * (1 + int.from_bytes(part[27:30], "little")))
    if kind == b"VP8L":
        bits = int.from_bytes(part[21:25], "little")
        return (1 + (bits & 0x3FFF)) * (1 + (bits >> 14 & 0x3FFF))
    width, height = struct.unpack_from("<2H", part, 26)
    return int((width & 0x3FFF) * (height & 0x3FFF))
