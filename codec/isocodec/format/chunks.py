"""Chunks: envelopes, checksums, the level index (spec clauses 3.4, 3.5, 3.7)."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

from isospec.container import (
    CHECKED_CHUNK,
    MAX_ISOVALUES,
    PROMISE_UNIT,
    Checksum,
    ChunkHead,
    ChunkType,
    IsovalueKind,
    write_varint,
)
from isospec.elements import BY_LAYER

from ..errors import FormatError, OptionError
from .header import read_isovalue, varint, write_isovalue
from .program import Layer

CHECKSUM_BYTES = 4
CRITICAL = (
    ChunkType.LAYERS, ChunkType.CUT_LAYERS, ChunkType.ISOVALUE, ChunkType.MASK, ChunkType.FRAME, ChunkType.DOMAIN,
)


@dataclass(frozen=True)
class Envelope:
    """Head of a chunk.

    Attributes
    ----------
    type : int
    ancillary, checked, last : bool
        May be skipped if unknown; has its own checksum; is the file's last.
    start, end : int
        Byte offsets of the payload.
    """

    type: int
    ancillary: bool
    checked: bool
    last: bool
    start: int
    end: int


def write_chunk(kind: ChunkType, payload: bytes, *, ancillary: bool = False, last: bool = False) -> bytes:
    """A chunk with its envelope; a large one carries its own checksum."""
    checked = len(payload) >= CHECKED_CHUNK
    head = ChunkHead.build({"ancillary": ancillary, "checked": checked, "last": last, "type": kind})
    chunk = head + write_varint(len(payload)) + payload
    return chunk + Checksum.build(zlib.crc32(chunk)) if checked else chunk


def read_envelope(data: bytes | bytearray, at: int) -> Envelope | None:
    """Envelope at ``at``; None if it is not all there yet.

    Raises
    ------
    FormatError
        If the chunk is critical and unknown.
    """
    if at >= len(data):
        return None
    head = ChunkHead.parse(bytes(data[at : at + 1]))
    if not head.ancillary and head.type not in CRITICAL:
        raise FormatError(f"unknown critical chunk of type {head.type}", code="chunk", offset=at, clause="3.5.2")
    if head.ancillary and head.type in CRITICAL:
        raise FormatError("a critical chunk marked as ancillary", code="chunk", offset=at, clause="3.5.2")
    length = varint(data, at + 1, len(data), "3.4.2")
    if length is None:
        return None
    return Envelope(head.type, head.ancillary, head.checked, head.last, length[1], length[1] + length[0])


def payload_of(chunk: bytes) -> bytes:
    """Payload of a chunk that is there in full."""
    envelope = read_envelope(chunk, 0)
    assert envelope is not None
    return chunk[envelope.start : envelope.end]


def whole_bytes(data: bytes | bytearray | memoryview) -> bytes:
    """The bytes of any buffer of bytes.

    Raises
    ------
    OptionError
        If it is none: a name, for example.
    """
    return data if isinstance(data, bytes) else bytes(octets(data))


def octets(data: bytes | bytearray | memoryview) -> memoryview:
    """A view of any buffer, byte by byte; raises as ``whole_bytes``."""
    try:
        return memoryview(data).cast("B")
    except TypeError:
        raise OptionError(
            f"expected the bytes of a file, not {type(data).__name__}", code="data",
            remedy="read them first: pathlib.Path(name).read_bytes()",
        ) from None


def verify(data: bytes | bytearray, chunk: Envelope, start: int) -> int | None:
    """Check the checksums behind a chunk that begins at ``start``, as far as they are there.

    Returns
    -------
    int or None
        Where they end; None if the bytes end before that.

    Raises
    ------
    FormatError
        If the chunk's own (clause 3.5.3) or the file's (3.4.4) is wrong.
    """
    at = chunk.end
    # without a copy of what may be large; a view that stayed would keep an array from growing
    with memoryview(data) as view:
        for there, first, what, clause in (
            (chunk.checked, start, "a chunk", "3.5.3"), (chunk.last, 0, "the file", "3.4.4")
        ):
            if there:
                if at + CHECKSUM_BYTES > len(data):
                    return None
                if Checksum.parse(bytes(view[at : at + CHECKSUM_BYTES])) != zlib.crc32(view[first:at]):
                    raise FormatError(f"{what}'s checksum is wrong", code="checksum", offset=at, clause=clause)
                at += CHECKSUM_BYTES
    return at if at <= len(data) else None


def write_further(isovalue: float, lean: int | None) -> bytes:
    """Payload of an isovalue chunk; ``lean`` is the number of the earlier isovalue that it leans on (clause 3.5.5)."""
    kind, number = write_isovalue(isovalue)
    return bytes([kind << 6 | (0 if lean is None else lean + 1)]) + number


def read_further(payload: bytes, offset: int, earlier: Sequence[float]) -> tuple[float, int | None]:
    """Inverse of ``write_further``, given the isovalues before it.

    Raises
    ------
    FormatError
        If the payload is not an independent isovalue, or leans on one that has not come.
    """
    if len(earlier) == MAX_ISOVALUES:
        raise FormatError(f"more than {MAX_ISOVALUES} isovalues", code="isovalues", offset=offset, clause="11.1")
    if not payload:
        raise FormatError("an isovalue is not complete", code="isovalue", offset=offset, clause="3.5.5")
    kind, lean = payload[0] >> 6, payload[0] & 63
    if kind not in IsovalueKind.__members__.values():
        raise FormatError("unknown kind of isovalue", code="isovalue", offset=offset, clause="3.3.4")
    if lean > len(earlier):
        raise FormatError(f"leaning on isovalue {lean - 1}, which has not come", code="lean", offset=offset,
                          clause="3.5.5")
    found = read_isovalue(payload, 1, len(payload), kind)
    if found is None or found[1] != len(payload):
        raise FormatError("an isovalue does not fill its chunk", code="isovalue", offset=offset, clause="3.5.5")
    if found[0] in earlier:
        raise FormatError(f"the isovalue {found[0]} comes twice", code="isovalue", offset=offset, clause="3.5.5")
    return found[0], lean - 1 if lean else None


def write_metadata(metadata: Mapping[str, str]) -> bytes:
    """Payload of a metadata chunk: a JSON object of strings, UTF-8."""
    return json.dumps(dict(metadata), ensure_ascii=False, separators=(",", ":")).encode()


def read_metadata(payload: bytes) -> dict[str, str]:
    """Inverse of ``write_metadata``; what is not a JSON object of strings is dropped, the chunk being ancillary."""
    try:
        found = json.loads(payload.decode(), object_pairs_hook=_strings)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _strings(members: Sequence[tuple[str, object]]) -> dict[str, str]:
    """Those that are strings, before the last one of each name is taken."""
    return {name: text for name, text in members if isinstance(text, str)}


@dataclass(frozen=True)
class Promises:
    """Promises of a writer for the layers of an isovalue (clause 3.7.3).

    Attributes
    ----------
    within : dict of int to float
        By number of a layer, counted from 1 within the isovalue: when it is complete, and no later one begun, decoded
        and original curve lie within that many cells of each other.
    topology : bool
        Whether each layer, when it is complete, has the topology of the original curve.
    """

    within: dict[int, float]
    topology: bool


def write_promises(promises: Promises) -> bytes:
    """Payload of a chunk of promises; distances are rounded up."""
    out = write_varint(int(promises.topology))
    before = 0
    for layer, distance in sorted(promises.within.items()):
        # what a decimal fraction misses by rounding is not a part more
        parts = math.ceil(distance * PROMISE_UNIT * (1 - 1e-12))
        out += write_varint(layer - before) + write_varint(parts)
        before = layer
    return out


def read_promises(payload: bytes) -> Promises | None:
    """Inverse of ``write_promises``; None if the payload is malformed, the chunk being ancillary."""
    numbers: list[int] = []
    at = 0
    while at < len(payload):
        try:
            number = varint(payload, at, len(payload), "3.7.3")
        except FormatError:
            return None
        if number is None:
            return None
        numbers.append(number[0])
        at = number[1]
    if len(numbers) % 2 == 0 or numbers[0] > 1 or not all(numbers[1:]):
        return None
    layers = accumulate(numbers[1::2])
    return Promises({k: d / PROMISE_UNIT for k, d in zip(layers, numbers[2::2], strict=True)}, bool(numbers[0]))


@dataclass(frozen=True)
class LayerRecord:
    """Position and contents of a layer.

    Attributes
    ----------
    bytes : int
        Bytes of entropy-coded data that the layer adds.
    symbols : dict of str to int
        Symbols by syntax element.
    """

    bytes: int
    symbols: dict[str, int]


def write_index(layers: Sequence[Layer], records: Sequence[LayerRecord]) -> bytes:
    """Payload of a level index: for each layer its bytes, then its symbols by element (clause 3.7)."""
    out = b""
    for layer, record in zip(layers, records, strict=True):
        out += write_varint(record.bytes)
        out += b"".join(write_varint(record.symbols[e]) for e in BY_LAYER[layer.kind])
    return out


def read_index(payload: bytes, layers: Sequence[Layer]) -> list[LayerRecord]:
    """Inverse of ``write_index``; an index that does not fit the layers gives an empty list."""
    records = []
    at = 0
    for layer in layers:
        numbers = []
        for _ in range(1 + len(BY_LAYER[layer.kind])):
            try:
                number = varint(payload, at, len(payload), "3.7")
            except FormatError:
                return []
            if number is None:
                return []
            numbers.append(number[0])
            at = number[1]
        records.append(LayerRecord(numbers[0], dict(zip(BY_LAYER[layer.kind], numbers[1:], strict=True))))
    return records if at == len(payload) else []
