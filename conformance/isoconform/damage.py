"""Damaged files: anything changed anywhere, checksums mostly repaired, so that decoders get to see what is wrong."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random

from isocodec.errors import FormatError
from isocodec.format.chunks import CHECKSUM_BYTES, read_envelope
from isocodec.format.header import read_header
from isospec.container import MAX_SIDE, ChunkType, IsovalueKind, read_varint, write_varint

from .streams import Chunk, closed

SCALED, KIND, PROFILE, EQUAL = 0x20, 0x18, 0x03, 0x40
"""Bits of the flags (clause 3.3.2)."""
FLAGS = 5
"""Their place."""
PREFIX = 6


@dataclass(frozen=True)
class Torn:
    """A file in parts, whole or cut off; ``bytes`` puts them together with right lengths, flags and checksums.

    Attributes
    ----------
    header : bytes
    chunks : tuple of Chunk
        Those that are all there.
    rest : bytes
        Of a file that is cut off, the start of a further chunk; may be empty, too.
    whole : bool
        Whether the last chunk says that it is.
    """

    header: bytes
    chunks: tuple[Chunk, ...]
    rest: bytes
    whole: bool

    def __bytes__(self) -> bytes:
        last = len(self.chunks) - 1 if self.whole else -1
        out = self.header + b"".join(c.enveloped(last=i == last) for i, c in enumerate(self.chunks))
        return closed(out) if self.whole and self.chunks else out + self.rest


def torn(data: bytes) -> Torn | None:
    """The parts of a file or of the start of one, its checksums forgotten; None if it has no header or bad chunks."""
    try:
        found = read_header(data)
        if found is None:
            return None
        at = found[1]
        header, chunks = data[:at], []
        while (envelope := read_envelope(data, at)) is not None and envelope.end <= len(data):
            payload = data[envelope.start : envelope.end]
            chunks.append(Chunk(envelope.type, payload, envelope.ancillary, envelope.checked))
            at = envelope.end + CHECKSUM_BYTES * envelope.checked
            if envelope.last:
                return Torn(header, tuple(chunks), b"", True)
    except FormatError:
        return None
    return Torn(header, tuple(chunks), data[at:], False)


@dataclass(frozen=True)
class Fields:
    """A header in parts, as it is written."""

    prefix: bytes
    sides: tuple[bytes, ...]
    isovalue: bytes
    scale: bytes

    def __bytes__(self) -> bytes:
        return self.prefix + b"".join(self.sides) + self.isovalue + self.scale

    def flagged(self, *, clear: int = 0, add: int = 0) -> Fields:
        """With other flags."""
        flags = self.prefix[FLAGS] & ~clear | add
        return replace(self, prefix=self.prefix[:FLAGS] + bytes([flags]) + self.prefix[FLAGS + 1 :])


def fields_of(header: bytes) -> Fields:
    """A valid header in parts."""
    found = read_header(header)
    assert found is not None
    flags, at, sides = header[FLAGS], PREFIX, []
    for _ in range(1 if flags & EQUAL else len(found[0].shape)):
        number = read_varint(header, at, len(header))
        assert number is not None
        sides.append(header[at : number[1]])
        at = number[1]
    kind = IsovalueKind((flags & KIND) >> 3)
    size = {IsovalueKind.FLOAT32: 4, IsovalueKind.FLOAT64: 8}.get(kind)
    if size is None:
        number = read_varint(header, at + (kind == IsovalueKind.DECIMAL), len(header))
        assert number is not None
        size = number[1] - at
    return Fields(header[:PREFIX], tuple(sides), header[at : at + size], header[at + size :])


NUMBERS = (
    b"\0", b"\x80\x05", b"\x80", b"\xff" * 9, b"\xff" * 8 + b"\x7f", b"\xff" * 9 + b"\x7f",
    b"\x81" + b"\x80" * 7 + b"\0", b"\x81" + b"\x80" * 8 + b"\0",
    *(write_varint(most + more) for most in MAX_SIDE.values() for more in (0, 1)),
)
"""Numbers of variable length that are too small, too large or too long."""
SINGLES = [struct.pack(">f", x) for x in (float("nan"), float("inf"), float("-inf"), -0.0, 0.5, 3e38)]
DOUBLES = [struct.pack(">d", x) for x in (float("nan"), float("inf"), float("-inf"), -0.0, 0.0, 0.5, -1.0, 5e-324)]


def _header(random: Random, file: Torn) -> bytes:
    fields = fields_of(file.header)
    match random.randrange(8):
        case 0:
            place = random.randrange(PREFIX)
            prefix = bytearray(fields.prefix)
            prefix[place] ^= 1 << random.randrange(8)
            fields = replace(fields, prefix=bytes(prefix))
        case 1:
            fields = fields.flagged(clear=PROFILE, add=random.randrange(4))
        case 2 | 3 if fields.sides:
            sides = list(fields.sides)
            sides[random.randrange(len(sides))] = random.choice(NUMBERS)
            fields = replace(fields, sides=tuple(sides))
        case 4:
            fields = replace(fields.flagged(clear=KIND, add=1 << 3), isovalue=random.choice(SINGLES))
        case 5:
            fields = replace(fields.flagged(clear=KIND, add=2 << 3), isovalue=random.choice(DOUBLES))
        case 6:
            halves = fields.flagged(clear=KIND, add=random.choice((0, 3 << 3)))
            fields = replace(halves, isovalue=random.choice(NUMBERS))
        case _:
            scale = random.choice((*[b"\x80" + random.choice(DOUBLES)] * 4, b"\x80", random.randbytes(1), b""))
            fields = replace(fields.flagged(add=SCALED), scale=scale)
    return bytes(replace(file, header=bytes(fields)))


def _isovalue(random: Random, file: Torn) -> bytes:
    """A chunk of an isovalue put in, mostly one that is wrong."""
    old = fields_of(file.header)
    kind, lean = random.randrange(4), random.choice((0, 1, 2, 3, 63))
    again = old.isovalue if (old.prefix[FLAGS] & KIND) >> 3 == kind else b""
    number = random.choice((*NUMBERS, *SINGLES, *DOUBLES, b"\x05", b"\x07\0", again))
    payload = random.choice((bytes([kind << 6 | lean]) + number, bytes([lean]) + random.randbytes(1), b""))
    chunk = Chunk(ChunkType.ISOVALUE, payload, random.randrange(8) == 0)
    place = random.randint(0, len(file.chunks))
    return bytes(replace(file, chunks=(*file.chunks[:place], chunk, *file.chunks[place:])))


def _order(random: Random, file: Torn) -> bytes:
    """Chunks that are missing, there twice, or elsewhere."""
    chunks = list(file.chunks)
    if chunks:
        taken = chunks.pop(random.randrange(len(chunks)))
        for _ in range(random.randrange(3)):
            chunks.insert(random.randint(0, len(chunks)), taken)
    return bytes(replace(file, chunks=tuple(chunks)))


def _envelope(random: Random, file: Torn) -> bytes:
    """A chunk of another type, or marked otherwise."""
    if not file.chunks:
        return bytes(file)
    place = random.randrange(len(file.chunks))
    chunk = file.chunks[place]
    match random.randrange(3):
        case 0:
            chunk = replace(chunk, type=random.choice((0, 1, 2, 3, 4, 5, 6, 7, 31)))
        case 1:
            chunk = replace(chunk, ancillary=not chunk.ancillary)
        case _:
            chunk = replace(chunk, type=random.randrange(8), ancillary=random.randrange(2) == 0, checked=True)
    return bytes(replace(file, chunks=(*file.chunks[:place], chunk, *file.chunks[place + 1 :])))


def _payload(random: Random, file: Torn) -> bytes:
    """Bytes of a payload changed, put in, or taken out: at its beginning programs, then runs."""
    if not file.chunks:
        return bytes(file)
    place = random.randrange(len(file.chunks))
    chunk = file.chunks[place]
    old = chunk.payload
    at = random.choice((0, 1, 2, len(old), random.randint(0, len(old))))
    match random.randrange(6):
        case 0:
            new = old[:at] + random.randbytes(1) + old[at + 1 :]
        case 1:
            new = old[:at] + random.randbytes(random.randint(1, 2)) + old[at:]
        case 2:
            new = old[:at] + old[at + random.randint(1, 3) :]
        case 3:
            new = old[:at]
        case 4:
            new = old + bytes(random.randint(1, 6))
        case _:
            new = old[:at] + bytes([(old[at : at + 1] or b"\0")[0] ^ 1 << random.randrange(8)]) + old[at + 1 :]
    return bytes(replace(file, chunks=(*file.chunks[:place], replace(chunk, payload=new), *file.chunks[place + 1 :])))


def _length(random: Random, file: Torn) -> bytes:
    """The length of the first chunk written otherwise, or another one."""
    if not file.chunks:
        return bytes(file)
    first, *more = file.chunks
    written = first.enveloped(last=file.whole and not more)
    size = len(write_varint(len(first.payload)))
    other = write_varint(max(len(first.payload) + random.randint(-2, 2), 0))
    number = random.choice((b"\x80" + written[1 : 1 + size], other, *NUMBERS))
    start = file.header + written[:1] + number + written[1 + size :]
    if not more:
        return closed(start) if file.whole else start
    return start + bytes(replace(file, chunks=tuple(more)))[len(file.header) :]


def _checksum(random: Random, file: Torn) -> bytes:
    """A checksum that is wrong, the file's or a chunk's own, or bytes behind."""
    data = bytes(file)
    match random.randrange(3):
        case 0:
            return data + random.randbytes(random.randint(1, 3))
        case 1:
            return data[:-1] + bytes([data[-1] ^ 1 << random.randrange(8)])
    if not file.chunks:
        return data
    place = random.randrange(len(file.chunks))
    chunk = replace(file.chunks[place], checked=True)
    out = file.header
    for i, other in enumerate((*file.chunks[:place], chunk, *file.chunks[place + 1 :])):
        written = other.enveloped(last=file.whole and i == len(file.chunks) - 1)
        out += written[:-1] + bytes([written[-1] ^ 1]) if i == place else written
    return closed(out) if random.randrange(2) else out


KINDS: tuple[Callable[[Random, Torn], bytes], ...] = (
    _header, _header, _isovalue, _order, _envelope, _payload, _payload, _payload, _payload, _length, _checksum,
)


def damaged(data: bytes, random: Random) -> bytes:
    """A file with something changed, checksums repaired but where they are what is wrong.

    Parameters
    ----------
    data : bytes
        Whole or cut off.
    random : Random
    """
    file = torn(data)
    if file is None:
        place = random.randrange(len(data) + 1)
        return data[:place] + random.randbytes(1) + data[place + 1 :]
    return random.choice(KINDS)(random, file)
