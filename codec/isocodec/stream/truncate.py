"""Shorter files out of files: at the end of a layer, or within a number of bytes (spec clause 6.6)."""

from __future__ import annotations

import zlib

from isospec.container import Checksum, ChunkType, write_varint

from ..entropy.range_coder import cut
from ..errors import OptionError, TruncatedError
from ..format.chunks import CHECKSUM_BYTES, read_envelope, whole_bytes, write_chunk
from ..format.events import LayerComplete
from ..format.frames import as_last
from ..format.program import write_program
from ..limits import Limits
from .decoder import Decoder
from .inspect import inspect

_CLOSING = 24
"""More bytes than the ending of a file and what else a cut adds to what it keeps."""


def truncate(
    data: bytes, *, layers: int | None = None, max_bytes: int | None = None, limits: Limits | None = None
) -> bytes:
    """A complete, valid file with the first layers, or the first symbols, of another.

    Parameters
    ----------
    data : bytes
        A file; one that was cut off anywhere will do.
    layers : int, optional
        Layers to keep.
    max_bytes : int, optional
        Most bytes of the result.
    limits : Limits, optional
        What decoding may take at most.

    Returns
    -------
    bytes

    Raises
    ------
    OptionError
        If not exactly one of ``layers`` and ``max_bytes`` is given, or it is too small for any curve.
    FormatError
        If ``data`` is not a valid file, or is a whole one that does not agree with its checksum; ``TruncatedError`` if
        it was cut off before a curve begins.
    LimitError
        If decoding takes more than the limits allow.
    """
    if (layers is None) == (max_bytes is None):
        raise OptionError("give either layers or max_bytes", code="options")
    data = whole_bytes(data)
    # What is damaged must not get a checksum that is right.
    if inspect(data).domain is not None:
        return _first_chunks(data, layers, max_bytes)
    if layers is not None:
        return _first_layers(data, layers, limits)
    assert max_bytes is not None
    if max_bytes >= len(data) and _whole(data, limits):
        return data
    short = _first_bytes(data, max_bytes, limits) if max_bytes > 0 else None
    if short is None and max_bytes >= len(data):
        raise TruncatedError(
            f"the file ends after {len(data)} bytes, before its curve begins", code="truncated", offset=len(data)
        )
    if short is None:
        raise OptionError(f"{max_bytes} bytes are too few for the header of this file and a curve", code="max-bytes")
    return short


def _first_chunks(data: bytes, layers: int | None, max_bytes: int | None) -> bytes:
    """The same of a file of an explicit domain, whose layers are chunks (spec clause 10.1.1(3))."""
    info = inspect(data)
    if info.complete and (len(data) <= max_bytes if max_bytes is not None else (layers or 0) >= len(info.layers)):
        return data
    if layers is not None and layers < 1:
        raise OptionError(f"layers is {layers}; it must be at least 1", code="layers")
    there = [chunk for chunk in info.chunks if chunk.type == "layers"][: len(info.layers)]
    if layers is not None and layers > len(there):
        raise OptionError(
            f"only {len(there)} whole layers have been received", code="layers",
            remedy="ask for fewer, or for a number of bytes",
        )
    for chunk in reversed(there[:layers]):
        end = read_envelope(data, chunk.offset)
        assert end is not None
        raw = data[chunk.offset : end.end + CHECKSUM_BYTES * end.checked]
        out = _closed(data[: chunk.offset] + as_last(raw))
        if max_bytes is None or len(out) <= max_bytes:
            return out
    raise OptionError(
        f"{max_bytes} bytes are too few for this file's mesh and a layer" if there else "no layer has been received",
        code="max-bytes", remedy="the mesh and a surface in a file cannot be cut",
    )


def _whole(data: bytes, limits: Limits | None) -> bool:
    decoder = Decoder(limits)
    decoder.feed(data)
    for _ in decoder:
        pass
    return decoder.complete


def _first_layers(data: bytes, layers: int, limits: Limits | None) -> bytes:
    if layers < 1:
        raise OptionError(f"layers is {layers}; it must be at least 1", code="layers")
    decoder = Decoder(limits)
    decoder.feed(data)
    number = 0
    for event in decoder:
        if isinstance(event, LayerComplete):
            number = event.number
            if number == layers:
                break
    if number < layers:
        if decoder.complete:
            return data
        raise OptionError(
            f"only {number} whole layers have been received",
            code="layers",
            remedy="ask for fewer, or for a number of bytes",
        )
    run = decoder.runs[-1]
    kept = run.layers[: number - run.done]
    bits = decoder.value_bits
    payload = write_program(kept, run.before.copy(), bits) + cut(decoder.coder)
    mask = _later_mask(data, run.chunk_start)
    chunks = write_chunk(ChunkType.LAYERS, payload, last=mask is None)
    if mask is not None:
        chunks += write_chunk(ChunkType.MASK, mask, last=True)
    return _closed(data[: run.chunk_start] + chunks)


def _later_mask(data: bytes, start: int) -> bytes | None:
    """Payload of a mask that comes behind a chunk that begins at ``start``, as far as it is there in full."""
    at = start
    while (chunk := read_envelope(data, at)) is not None and chunk.end <= len(data):
        if chunk.type == ChunkType.MASK:
            return data[chunk.start : chunk.end]
        at = chunk.end + CHECKSUM_BYTES * (chunk.checked + chunk.last)
    return None


def _first_bytes(data: bytes, most: int, limits: Limits | None) -> bytes | None:
    """File of as many symbols as fit ``most`` bytes; None if that is not enough for a run."""
    decoder = Decoder(limits)
    end = min(most, len(data))
    at = max(end - _CLOSING, 0)
    decoder.feed(data[:at])
    best = None
    while True:
        for _ in decoder:
            pass
        if decoder.runs:
            run = decoder.runs[-1]
            symbols = decoder.run_symbols
            payload = write_varint(symbols) + data[run.program_start : run.start] + cut(decoder.coder)
            chunk = write_chunk(ChunkType.CUT_LAYERS, payload, last=True)
            if run.chunk_start + len(chunk) + CHECKSUM_BYTES <= most:
                best = run.chunk_start, chunk
        if at == end:
            return _closed(data[: best[0]] + best[1]) if best else None
        decoder.feed(data[at : at + 1])
        at += 1


def _closed(data: bytes) -> bytes:
    return data + Checksum.build(zlib.crc32(data))
