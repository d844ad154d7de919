"""Head and root directory of a tiled file, as bytes (spec clauses 12.3 and 12.4)."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

import numpy as np

from isospec.container import (
    MAX_ISOVALUES,
    READ_VERSION,
    WRITER_VERSION,
    Checksum,
    Double,
    Profile,
    write_varint,
)
from isospec.container import TILED_SIGNATURE as SIGNATURE

from ..errors import InputError, TruncatedError
from ..format.chunks import write_metadata
from ..format.header import HEAD_BYTES, check_version, write_isovalue
from .layout import TileGrid
from .numbers import Reader, wrong
from .structure import (
    EXPONENTS,
    FIXED_BYTES,
    MOST_IN_BLOCK,
    MOST_SIDE,
    MOST_STAGES,
    MOST_TOGETHER,
    Head,
    Root,
    Stage,
)

_MASK, _LEANING, _SCALED = 0x80, 0x40, 0x20
MOST_BYTES = 1 << 62
"""Upper bound on the size of files."""


def write_head(head: Head, leaves: Sequence[tuple[bytes, Sequence[int]]]) -> bytes:
    """Write the head and the root directory; for each leaf, its bytes and the sizes of its segments by area.

    Raises `InputError` if they are longer than ``HEAD_BYTES``.
    """
    grid = head.grid
    scaled = b"" if head.scale is None else Double.build(head.scale)
    body = b"".join(write_varint(s) for s in grid.shape) + bytes([grid.exponent, grid.block, len(head.stages)])
    body += bytes(stage.edge | stage.adaptive << 6 | stage.geometry << 7 for stage in head.stages) + scaled
    body += write_varint(len(head.isovalues))
    for value in head.isovalues:
        kind, number = write_isovalue(value)
        body += bytes([kind]) + number
    body += write_varint(head.together) if head.together > 1 else b""
    notes = write_metadata(head.metadata) if head.metadata else b""
    body += write_varint(len(notes)) + notes
    for leaf, sizes in leaves:
        body += write_varint(len(leaf)) + Checksum.build(zlib.crc32(leaf))
        body += b"".join(write_varint(size) for size in sizes)
    flags = _MASK * head.masked | _LEANING * (head.together > 1) | _SCALED * (head.scale is not None)
    flags |= (grid.n - 2) << 2 | head.profile
    length = FIXED_BYTES + len(body) + 4
    if length > HEAD_BYTES:
        raise InputError(
            f"the notes and the root directory take {length:,} bytes, but there is room for {HEAD_BYTES:,}",
            code="head",
            remedy="leave out notes, or use larger tiles or fewer isovalues",
        )
    out = SIGNATURE + bytes([WRITER_VERSION << 4 | READ_VERSION, flags]) + length.to_bytes(2, "big") + body
    return out + Checksum.build(zlib.crc32(out))


def _head_length(data: bytes) -> int:
    """Number of bytes of head and root directory, which must have been received.

    Raises `FormatError` or `TruncatedError`.
    """
    if data[:4] != SIGNATURE[: len(data)]:
        raise wrong("not a tiled .iso file: the signature is missing", "signature", 0, "12.3")
    if len(data) < FIXED_BYTES:
        raise TruncatedError("the file ends within its head", code="truncated", offset=len(data), clause="12.3")
    length = int.from_bytes(data[6:8], "big")
    if not FIXED_BYTES + 4 <= length <= HEAD_BYTES:
        raise wrong(f"a head of {length:,} bytes", "head", 6, "12.3")
    if len(data) < length:
        raise TruncatedError("the file ends within its head", code="truncated", offset=len(data), clause="12.3")
    return length


def read_head(data: bytes) -> tuple[Head, Root]:
    """Read the head and the root directory at the beginning of ``data``; raises `FormatError` or `TruncatedError`."""
    end = _head_length(data)
    if Checksum.parse(data[end - 4 : end]) != zlib.crc32(data[: end - 4]):
        raise wrong("the head's checksum is wrong", "checksum", end - 4, "12.3")
    check_version(data[4] & 15)
    reader = Reader(data, FIXED_BYTES, end - 4)
    flags = data[5]
    if flags & 0x1B & ~Profile.MAIN:
        raise wrong("unknown flags", "flags", 5, "12.3")
    n = 2 + (flags >> 2 & 1)
    shape = tuple(reader.number() for _ in range(n))
    exponent, block, stages = reader.byte(), reader.byte(), reader.byte()
    if not all(1 <= s <= MOST_SIDE for s in shape) or exponent not in EXPONENTS:
        raise wrong("invalid field size or tile size", "shape", FIXED_BYTES, "12.3")
    if not 1 << n * min(block, 20) <= MOST_IN_BLOCK or not 1 <= stages <= MOST_STAGES:
        raise wrong("blocks too large, or no stages", "head", FIXED_BYTES, "12.3")
    told = reader.bytes(stages)
    if any(byte & 0x30 for byte in told):
        raise wrong("unknown flags of a stage", "flags", reader.at - stages, "12.3")
    listed = tuple(Stage(byte & 15, byte > 127, bool(byte & 64)) for byte in told)
    scale = reader.scale() if flags & _SCALED else None
    count = reader.number()
    if not 1 <= count <= MAX_ISOVALUES:
        raise wrong(f"invalid number of isovalues: {count}", "isovalues", reader.at, "12.3")
    isovalues = tuple(reader.isovalue() for _ in range(count))
    together = reader.number() if flags & _LEANING else 1
    if flags & _LEANING and not 2 <= together <= MOST_TOGETHER:
        raise wrong(f"groups of {together:,} isovalues", "isovalues", reader.at, "12.3")
    notes = reader.notes()
    grid = TileGrid(shape, exponent, block)
    head = Head(grid, isovalues, listed, scale, Profile(flags & 3), bool(flags & _MASK), notes, together)
    total = math.prod(grid.blocks)
    # each leaf takes at least five bytes of the head
    if total > HEAD_BYTES // 5:
        raise wrong("more leaves than the head has room for", "leaves", reader.at, "12.3")
    lengths, checksums, sizes = [], [], []
    for _ in range(total):
        lengths.append(reader.number())
        checksums.append(Checksum.parse(reader.bytes(4)))
        sizes.append([reader.number() for _ in range(head.areas)])
    if reader.at != end - 4:
        raise wrong("the head continues after its root directory", "head", reader.at, "12.3")
    if sum(lengths) + sum(map(sum, sizes)) >= MOST_BYTES:
        raise TruncatedError(
            "the directory states more bytes of tiles than any file can hold", code="truncated", offset=end,
            clause="12.4",
        )
    whole = np.array(sizes, np.int64).reshape(total, head.areas)
    return head, Root(end, np.array(lengths, np.int64), np.array(checksums, np.int64), whole)
