"""Makes a file smaller as long as something stays true of it: fewer chunks, shorter runs, smaller shapes, zeros.

Lengths, flags and checksums are repaired with each step, so that what stays true is not about them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from isospec.container import ChunkType, write_varint

from .damage import EQUAL, KIND, PROFILE, SCALED, Fields, Torn, fields_of, torn


def shrunk(data: bytes, holds: Callable[[bytes], bool], *, seconds: float = 30.0, tries: int = 2000) -> bytes:
    """The smallest file found of which something holds.

    Parameters
    ----------
    data : bytes
        A file, or the start of one, of which it holds.
    holds : callable
        Whether it holds of a file.
    seconds, tries : float, int
        Neither more time nor more questions are taken.
    """
    best, asked, end = data, {data}, time.monotonic() + seconds
    going = True
    while going:
        going = False
        for other in _smaller(best):
            if len(asked) > tries or time.monotonic() > end:
                return best
            if other in asked or _size(other) >= _size(best):
                continue
            asked.add(other)
            if holds(other):
                best, going = other, True
                break
    return best


def _size(data: bytes) -> tuple[int, int, int]:
    """What is to become small: the length, then how many bytes are not 0, then their sum."""
    return len(data), sum(map(bool, data)), sum(data)


def _smaller(data: bytes) -> Iterator[bytes]:
    """Smaller files, those that save most first."""
    file = torn(data)
    if file is not None:
        yield from _fewer_chunks(file)
        yield from _shorter_runs(file)
        yield from _simpler_header(file)
        yield from _changed_bytes(file)
    size = len(data) // 2
    while size:
        yield data[:-size]
        size //= 2
    for i in range(len(data)):
        yield data[:i] + data[i + 1 :]


def _fewer_chunks(file: Torn) -> Iterator[bytes]:
    chunks = file.chunks
    for i in range(len(chunks)):
        yield bytes(replace(file, chunks=chunks[i + 1 :]))
        yield bytes(replace(file, chunks=chunks[:i] + chunks[i + 1 :]))
        yield bytes(replace(file, chunks=chunks[: i + 1], rest=b""))
    if file.rest and chunks:
        yield bytes(replace(file, rest=b"", whole=True))


def _with_payload(file: Torn, place: int, payload: bytes, **more: object) -> bytes:
    chunk = replace(file.chunks[place], payload=payload, **more)  # type: ignore[arg-type]
    return bytes(replace(file, chunks=(*file.chunks[:place], chunk, *file.chunks[place + 1 :])))


def _shorter_runs(file: Torn) -> Iterator[bytes]:
    for place, chunk in enumerate(file.chunks):
        old = chunk.payload
        if chunk.checked:
            yield _with_payload(file, place, old, checked=False)
        size = len(old) // 2
        while size:
            yield _with_payload(file, place, old[:-size])
            size //= 2


def _simpler_header(file: Torn) -> Iterator[bytes]:
    old = fields_of(file.header)
    found: list[Fields] = [
        replace(old.flagged(clear=SCALED), scale=b""), replace(old.flagged(clear=KIND), isovalue=b"\0"),
        old.flagged(clear=PROFILE), replace(old, prefix=old.prefix[:4] + b"\0" + old.prefix[5:]),
    ]
    for axis in range(len(old.sides)):
        for side in range(2, 10):
            sides = (*old.sides[:axis], write_varint(side), *old.sides[axis + 1 :])
            found.append(replace(old, sides=sides))
            if len(old.sides) > 1 and axis == 0:
                found.append(replace(old.flagged(add=EQUAL), sides=(write_varint(side),)))
    for fields in found:
        yield bytes(replace(file, header=bytes(fields)))


def _changed_bytes(file: Torn) -> Iterator[bytes]:
    """Bytes of payloads, and of what comes of a chunk that is not all there: left out, 0, or the last of a program."""
    for place, chunk in enumerate(file.chunks):
        for other in _bytewise(chunk.payload, program=chunk.type == ChunkType.LAYERS):
            yield _with_payload(file, place, other)
    for other in _bytewise(file.rest, program=True):
        yield bytes(replace(file, rest=other))


def _bytewise(old: bytes, *, program: bool) -> Iterator[bytes]:
    for i in range(len(old)):
        yield old[:i] + old[i + 1 :]
    for i in range(min(len(old), 16)) if program else ():
        if old[i] & 0x80:
            # the operation becomes the last one, and those behind it go
            for j in range(i + 1, min(len(old), i + 8)):
                yield old[:i] + bytes([old[i] & 0x7F]) + old[j:]
    for i in range(len(old)):
        for byte in (0, old[i] & 0xF0, old[i] & 0x0F, old[i] >> 1):
            yield old[:i] + bytes([byte]) + old[i + 1 :]
