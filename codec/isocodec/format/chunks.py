"""Chunks: envelopes, checksums and the layer index (spec clauses 3.4, 3.5, 3.7)."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate

from isospec.container import (
    CHECKED_CHUNK,
    FAR_LEAN,
    MAX_ISOVALUES,
    PROMISE_UNIT,
    Checksum,
    ChunkHead,
    ChunkType,
    write_varint,
)
from isospec.elements import BY_LAYER

from ..errors import FormatError, OptionError
from .header import read_isovalue, varint, write_isovalue
from .program import Layer

CHECKSUM_BYTES = 4
_head = cache(ChunkHead.parse)
CRITICAL = (
    ChunkType.LAYERS, ChunkType.ISOVALUE, ChunkType.MASK, ChunkType.FRAME, ChunkType.DOMAIN, ChunkType.TURN,
    ChunkType.SERIES,
)


@dataclass(frozen=True)
class Envelope:
    """Head of a chunk.

    Attributes
    ----------
    type : int
    ancillary, checked, last : bool
        Whether it may be skipped if unknown, has its own checksum, and is the last one in the file.
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
    """Write a chunk with its envelope; a large chunk gets its own checksum."""
    checked = len(payload) >= CHECKED_CHUNK
    head = ChunkHead.build({"ancillary": ancillary, "checked": checked, "last": last, "type": kind})
    chunk = head + write_varint(len(payload)) + payload
    return chunk + Checksum.build(zlib.crc32(chunk)) if checked else chunk


def read_envelope(data: bytes | bytearray, at: int) -> Envelope | None:
    """Read the envelope at ``at``; None if it has not arrived completely.

    Raises
    ------
    FormatError
        If the chunk is critical and unknown.
    """
    if at >= len(data):
        return None
    head = _head(bytes(data[at : at + 1]))
    if not head.ancillary and head.type not in CRITICAL:
        raise FormatError(f"unknown critical chunk of type {head.type}", code="chunk", offset=at, clause="3.5.2")
    if head.ancillary and head.type in CRITICAL:
        raise FormatError("a critical chunk marked as ancillary", code="chunk", offset=at, clause="3.5.2")
    length = varint(data, at + 1, len(data), "3.4.2")
    if length is None:
        return None
    return Envelope(head.type, head.ancillary, head.checked, head.last, length[1], length[1] + length[0])


def payload_of(chunk: bytes) -> bytes:
    """Payload of a complete chunk."""
    envelope = read_envelope(chunk, 0)
    assert envelope is not None
    return chunk[envelope.start : envelope.end]


def whole_bytes(data: bytes | bytearray | memoryview) -> bytes:
    """Convert any buffer to bytes.

    Raises
    ------
    OptionError
        If the argument is not a buffer, but for example a name.
    """
    return data if isinstance(data, bytes) else bytes(octets(data))


def octets(data: bytes | bytearray | memoryview) -> memoryview:
    """View any buffer byte by byte; raises the same errors as ``whole_bytes``."""
    try:
        return memoryview(data).cast("B")
    except TypeError:
        raise OptionError(
            f"expected the bytes of a file, not {type(data).__name__}", code="data",
            remedy="read them first: pathlib.Path(name).read_bytes()",
        ) from None


def verify(data: bytes | bytearray, chunk: Envelope, start: int) -> int | None:
    """Check the checksums after a chunk that begins at ``start``, as far as they have arrived.

    Returns
    -------
    int or None
        Where the checksums end; None if the bytes end earlier.

    Raises
    ------
    FormatError
        If the checksum of the chunk (clause 3.5.3) or of the file (3.4.4) is wrong.
    """
    at = chunk.end
    # without copying what may be large; the view is released, because it keeps the array from growing
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


def write_further(number: int, isovalue: float, lean: int | None) -> bytes:
    """Write the payload of the chunk of isovalue ``number``; it is predicted from isovalue ``lean`` (clause 3.5.5)."""
    kind, form = write_isovalue(isovalue)
    back = 0 if lean is None else number - lean
    far = write_varint(back) if back >= FAR_LEAN else b""
    return bytes([kind << 6 | min(back, FAR_LEAN)]) + far + form


def read_further(payload: bytes, offset: int, earlier: Collection[float]) -> tuple[float, int | None]:
    """Inverse of ``write_further``, given the isovalues before it, best as something that finds them quickly.

    Raises
    ------
    FormatError
        If the payload is malformed, or refers to an isovalue that has not appeared yet.
    """
    if len(earlier) == MAX_ISOVALUES:
        raise FormatError(f"more than {MAX_ISOVALUES:,} isovalues", code="isovalues", offset=offset, clause="11.1")
    if not payload:
        raise FormatError("an isovalue is not complete", code="isovalue", offset=offset, clause="3.5.5")
    kind, back, at = payload[0] >> 6, payload[0] & FAR_LEAN, 1
    if back == FAR_LEAN:
        far = varint(payload, 1, len(payload), "3.5.5")
        if far is None:
            raise FormatError("an isovalue is not complete", code="isovalue", offset=offset, clause="3.5.5")
        back, at = far
    if back > len(earlier):
        raise FormatError(f"an isovalue refers to the one {back} before it, but only {len(earlier)} have appeared",
                          code="lean", offset=offset, clause="3.5.5")
    found = read_isovalue(payload, at, len(payload), kind)
    if found is None or found[1] != len(payload):
        raise FormatError("an isovalue does not fill its chunk", code="isovalue", offset=offset, clause="3.5.5")
    if found[0] in earlier:
        raise FormatError(f"the isovalue {found[0]} appears twice", code="isovalue", offset=offset, clause="3.5.5")
    return found[0], len(earlier) - back if back else None


def write_turn(turn: range) -> bytes:
    """Write the payload of a turn: the isovalues, by number, that layers come of (clause 3.5.9)."""
    return write_varint(turn.start) + write_varint(len(turn))


def read_turn(payload: bytes, offset: int, begun: int) -> range:
    """Inverse of ``write_turn``, given how many isovalues have begun.

    Raises
    ------
    FormatError
        If the payload is malformed, or names an isovalue that has not begun.
    """
    numbers, at = [], 0
    for _ in range(2):
        found = varint(payload, at, len(payload), "3.5.9")
        if found is None:
            raise FormatError("a turn is not complete", code="turn", offset=offset, clause="3.5.9")
        at = found[1]
        numbers.append(found[0])
    first, count = numbers
    if at != len(payload) or not count or first + count > begun:
        raise FormatError("a turn of isovalues that have not begun", code="turn", offset=offset, clause="3.5.9")
    return range(first, first + count)


def write_metadata(metadata: Mapping[str, str]) -> bytes:
    """Write the payload of a metadata chunk: a JSON object of strings in UTF-8."""
    return json.dumps(dict(metadata), ensure_ascii=False, separators=(",", ":")).encode()


def read_metadata(payload: bytes) -> dict[str, str]:
    """Inverse of ``write_metadata``; anything but a JSON object of strings is dropped, as the chunk is ancillary."""
    try:
        found = json.loads(payload.decode(), object_pairs_hook=_strings)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _strings(members: Sequence[tuple[str, object]]) -> dict[str, str]:
    """Drop notes that are not strings, before the last note of each name is taken."""
    return {name: text for name, text in members if isinstance(text, str)}


@dataclass(frozen=True)
class Promises:
    """Promises (guaranteed distances and topology) of a writer for the layers of an isovalue (clause 3.7.3).

    Attributes
    ----------
    within : dict of int to float
        Distance by number of a layer, counted from 1 within the isovalue: when that layer is complete and no later one
        has begun, decoded and original curve lie within this many cells of each other, on a mesh units of positions.
    topology : bool
        Whether each layer, when it is complete, has the topology of the original curve.
    """

    within: dict[int, float]
    topology: bool


def write_promises(promises: Promises) -> bytes:
    """Write the payload of a chunk of promises; distances are rounded up."""
    out = write_varint(int(promises.topology))
    before = 0
    for layer, distance in sorted(promises.within.items()):
        # the rounding error of a decimal fraction must not add a unit
        parts = math.ceil(distance * PROMISE_UNIT * (1 - 1e-12))
        out += write_varint(layer - before) + write_varint(parts)
        before = layer
    return out


def read_promises(payload: bytes) -> Promises | None:
    """Inverse of ``write_promises``; None if the payload is malformed, as the chunk is ancillary."""
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
    """Write the payload of a layer index: for each layer its bytes, then its symbols by element (clause 3.7)."""
    out = b""
    for layer, record in zip(layers, records, strict=True):
        out += write_varint(record.bytes)
        out += b"".join(write_varint(record.symbols[e]) for e in BY_LAYER[layer.kind])
    return out


def read_index(payload: bytes, layers: Sequence[Layer]) -> list[LayerRecord]:
    """Inverse of ``write_index``; an empty list if the index does not fit the layers."""
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
