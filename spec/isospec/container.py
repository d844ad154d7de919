"""The container of ``.iso`` files, declared (spec clause 3).

``construct`` serves for the parts of fixed shape, on bytes whose length has been checked; variable-length numbers
are read by ``read_varint``, which is bounded and refuses encodings that are not the shortest.
"""

from __future__ import annotations

from enum import IntEnum

from construct import BitsInteger, BitStruct, Bytes, Flag, Float32b, Float64b, Int32ub, Nibble, Struct

SIGNATURE = b"\x89ISO"
TILED_SIGNATURE = b"\x89IST"
"""Of a file in tiles (clause 12)."""
WRITER_VERSION = 1
READ_VERSION = 1

MAX_SIDE = {2: 1 << 24, 3: 1 << 20}
"""Most samples along an axis, by dimension (spec clause 11.1)."""
MAX_VARINT = 9
"""Most bytes of a variable-length number: 63 bits."""
CHECKED_CHUNK = 1 << 14
"""Chunks with at least this payload carry a checksum of their own (clause 3.5.3)."""
LAYER_LIMIT = 1 << 17
"""Most layers of a file, of a series of a frame (clause 11.1)."""
MAX_RADIX = 63
"""Most parts that a digit of offsets divides a part into (clause 3.6.5)."""
STEP_RADIX = 27
"""Radix of the first digits of an edge that needs more parts than that (clause 5.7.3)."""
MAX_UNIT = 24
"""Largest power of two samples that parts of offsets are counted in (clause 3.6.5)."""
MAX_ISOVALUES = 4096
"""Most isovalues of a file (clause 11.1)."""
MAX_PLACES = 15
"""Most decimal places of an isovalue that is written as a decimal (clause 3.3.4)."""
MAX_DECIMAL = 1 << 53
"""Whole numbers of units below this are decimals (clause 3.3.4)."""
FAR_LEAN = 63
"""Distance of the isovalue leant on from which a number of its own follows (clause 3.5.5)."""
PROMISE_UNIT = 1000
"""Parts of the distance of samples that promises count in (clause 3.7.3)."""
MOST_COORDINATE = 1 << 52
"""Coordinates of samples lie within so many units of their first one (clause 3.7.4)."""
MAX_PARTS = 1 << 24
"""Most parts of an edge, by all layers of offsets together (clause 3.6.5)."""


class Profile(IntEnum):
    """Entropy profiles (clause 3.3.2)."""

    BASELINE = 0
    MAIN = 1


class IsovalueKind(IntEnum):
    """How the isovalue is written (clause 3.3.4)."""

    HALVES = 0
    FLOAT32 = 1
    FLOAT64 = 2
    DECIMAL = 3


class ChunkType(IntEnum):
    """Chunk types (clause 3.5)."""

    LAYERS = 1
    METADATA = 3
    INDEX = 4
    ISOVALUE = 5
    PROMISES = 6
    MASK = 7
    COORDINATES = 8
    FRAME = 9
    DOMAIN = 10
    TURN = 11
    FRAME_END = 12
    SERIES = 13


class DomainKind(IntEnum):
    """Where an explicit domain comes from (clause 10.1.2)."""

    KNOWN = 0
    CODED = 1
    POINTS = 2
    DELAUNAY = 3


class MeshLayer(IntEnum):
    """Layers of an explicit domain (clause 10.1.3)."""

    SIGNS = 0
    OFFSETS = 1
    VALUES = 2
    LEVELS = 3
    CUT = 4


class Operation(IntEnum):
    """Operations of a layer program (clause 3.6)."""

    BASE = 0
    REFINE = 1
    VALUES = 2
    OFFSETS = 3
    BASE_AND_REFINE = 4
    ADAPTIVE_BASE = 5
    ADAPT = 6
    LEAF_BASE = 7


ESCAPE = 14
"""Argument of an operation that stands for a number that follows."""
ALL = 15
"""Argument of an operation that stands for: as far as it goes."""

Prefix = Struct(
    "signature" / Bytes(4),
    "version" / BitStruct("writer" / Nibble, "read" / Nibble),
    "flags"
    / BitStruct(
        "explicit" / Flag,
        "equal" / Flag,
        "scaled" / Flag,
        "isovalue" / BitsInteger(2),
        "axes" / BitsInteger(1),
        "profile" / BitsInteger(2),
    ),
)
"""First six bytes of a file; ``axes`` is the dimension less two, ``equal`` says that all sides are, ``explicit`` that
there are no sides, but cells (clause 10).
"""

ChunkHead = BitStruct("ancillary" / Flag, "checked" / Flag, "last" / Flag, "type" / BitsInteger(5))
"""First byte of a chunk; its length follows as a variable-length number."""

OperationByte = BitStruct("more" / Flag, "operation" / BitsInteger(3), "argument" / Nibble)
"""One step of a layer program."""

Checksum = Int32ub
"""CRC-32 as of zlib, PNG and gzip."""

Single = Float32b
Double = Float64b


class VarintError(ValueError):
    """A variable-length number is too long or not the shortest encoding."""


def write_varint(value: int) -> bytes:
    """Seven bits a byte, the highest first; all bytes but the last have their top bit set (clause 3.2)."""
    out = [value & 0x7F]
    while value >> 7:
        value >>= 7
        out.append(value & 0x7F | 0x80)
    return bytes(reversed(out))


def read_varint(data: bytes | bytearray | memoryview, at: int, end: int) -> tuple[int, int] | None:
    """Number at ``at`` and the place behind it; None if ``end`` comes first.

    Raises
    ------
    VarintError
        If it has more than ``MAX_VARINT`` bytes, or starts with a zero group.
    """
    value = 0
    for i in range(at, min(end, at + MAX_VARINT)):
        byte = data[i]
        if i == at and byte == 0x80:
            raise VarintError("a number is not in its shortest form")
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, i + 1
    if end - at >= MAX_VARINT:
        raise VarintError("a number has more than 63 bits")
    return None


def zigzag(value: int) -> int:
    """Signed to unsigned: 0, -1, 1, -2 .. to 0, 1, 2, 3 .. (clause 3.2.2)."""
    return value << 1 if value >= 0 else (-value << 1) - 1


def unzigzag(value: int) -> int:
    """Inverse of ``zigzag``."""
    return value >> 1 if not value & 1 else -(value + 1 >> 1)
