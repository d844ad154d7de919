"""Shorten files at the end of a layer: after a number of layers, or the last one that fits into a number of bytes."""

from __future__ import annotations

import zlib
from dataclasses import replace

from isospec.container import Checksum, ChunkType

from ..entropy.range_coder import cut
from ..errors import OptionError, TruncatedError
from ..format.chunks import payload_of, read_metadata, whole_bytes, write_chunk, write_metadata
from ..format.events import LayerComplete
from ..format.frames import as_last
from ..format.program import write_program
from ..limits import Limits
from .container import closed
from .decoder import Decoder
from .file_info import FileInfo
from .inspect import inspect
from .promises import PROMISE, last_promise
from .surface_contents import surface_chunks


def truncate(
    data: bytes, *, layers: int | None = None, max_bytes: int | None = None, limits: Limits | None = None
) -> bytes:
    """Make a complete, valid file from the first layers of another.

    Parameters
    ----------
    data : bytes
        A file, which may be truncated anywhere.
    layers : int, optional
        Number of layers to keep.
    max_bytes : int, optional
        Largest size of the result, in bytes; it ends with the last whole layer that fits.
    limits : Limits, optional
        Limits for decoding.

    Returns
    -------
    bytes

    Raises
    ------
    OptionError
        If not exactly one of ``layers`` and ``max_bytes`` is given, or if it is too small for any curve.
    FormatError
        If ``data`` is not a valid file, or is a complete one with a wrong checksum; ``TruncatedError`` if it ends
        before a curve begins.
    LimitError
        If decoding takes more than the limits allow.
    """
    if (layers is None) == (max_bytes is None):
        raise OptionError("give either layers or max_bytes", code="options")
    data = whole_bytes(data)
    # damaged data must not get a correct checksum
    info = inspect(data)
    if layers is not None and layers < 1:
        raise OptionError(f"layers is {layers}; it must be at least 1", code="layers")
    enough = (layers or 0) >= len(info.layers) if max_bytes is None else len(data) <= max_bytes
    if enough and info.complete and info.kind in ("surface", "mesh"):
        return data
    if info.kind == "surface":
        return _first_points(data, layers, max_bytes, limits)
    if info.kind == "mesh":
        return _first_chunks(data, info, layers, max_bytes)
    return _first_layers(data, info, layers, max_bytes, limits)


def _too_few(received: int, remedy: str = "ask for fewer, or for a number of bytes") -> OptionError:
    return OptionError(f"only {received} whole layers have been received", code="layers", remedy=remedy)


def _first_points(data: bytes, layers: int | None, max_bytes: int | None, limits: Limits | None) -> bytes:
    """Truncate a surface by encoding its points again, up to the layers asked for."""
    decoder = _decoder(data, limits).take()
    head, parts = decoder.surface.received()
    there = len(parts.places)
    if layers is not None and layers > there:
        raise _too_few(there, "ask for fewer")
    for kept in range(layers or there, 0, -1):
        some = replace(head, counts=head.counts[:kept])
        out = b"".join(closed(surface_chunks(some, parts.first(kept), last_promise(dict(decoder.metadata)))))
        if max_bytes is None or len(out) <= max_bytes:
            return out
    raise OptionError(
        f"{max_bytes} bytes are too few for the first layer of this surface", code="max-bytes",
        remedy="encode it with more layers",
    )


def _first_chunks(data: bytes, info: FileInfo, layers: int | None, max_bytes: int | None) -> bytes:
    """Truncate a file on a mesh, whose layers are chunks (spec clause 10.1.1(3))."""
    there = [chunk for chunk in info.chunks if chunk.type == "layers"][: len(info.layers)]
    if layers is not None and layers > len(there):
        raise _too_few(len(there))
    for chunk in reversed(there[:layers]):
        begun = _without_promise(data[: chunk.offset], info)
        out = _with_checksum(begun + as_last(data[chunk.offset : chunk.offset + chunk.bytes]))
        if max_bytes is None or len(out) <= max_bytes:
            return out
    raise OptionError(
        f"{max_bytes} bytes are too few for this file's mesh and a layer" if there else "no layer has been received",
        code="max-bytes", remedy="the mesh in a file cannot be cut",
    )


def _without_promise(data: bytes, info: FileInfo) -> bytes:
    """The beginning of a file on a mesh, whose note of a promise is about all layers, without that note."""
    out, at = b"", 0
    for chunk in info.chunks if PROMISE in info.metadata else ():
        if chunk.type == "metadata" and chunk.offset + chunk.bytes <= len(data):
            notes = read_metadata(payload_of(data[chunk.offset : chunk.offset + chunk.bytes]))
            left = {name: text for name, text in notes.items() if name != PROMISE}
            out += data[at : chunk.offset]
            out += write_chunk(ChunkType.METADATA, write_metadata(left), ancillary=True) if left else b""
            at = chunk.offset + chunk.bytes
    return out + data[at:]


def _decoder(data: bytes, limits: Limits | None) -> Decoder:
    """Make a decoder, and feed it a file."""
    decoder = Decoder(limits)
    decoder.feed(data)
    return decoder


def _first_layers(
    data: bytes, info: FileInfo, layers: int | None, max_bytes: int | None, limits: Limits | None
) -> bytes:
    """Truncate a file of a grid at the end of a layer; of isovalues in turn, where the same layer of all of them ends.

    Of numbers of layers in between the one before is taken; the first turn is kept in any case.
    """
    decoder = _decoder(data, limits)
    best, ends = None, 0
    for event in decoder:
        if not isinstance(event, LayerComplete):
            continue
        run = decoder.grid.runs[-1]
        whole, part = divmod(event.number - run.done, len(run.turn))
        if part:
            continue
        if layers is not None and event.number > layers and best is not None:
            return best
        ends = event.number
        if layers is not None and ends + len(run.turn) <= layers and whole < len(run.layers):
            continue
        kept = write_program(run.layers[:whole], run.before.copy(), decoder.grid.value_bits)
        chunks = [write_chunk(ChunkType.LAYERS, kept + cut(decoder.grid.coder))]
        # a complete mask may follow
        chunks += [
            write_chunk(ChunkType.MASK, payload_of(data[chunk.offset : chunk.offset + chunk.bytes]))
            for chunk in info.chunks if chunk.type == "mask" and chunk.offset >= run.chunk_start
        ]
        out = b"".join(closed([data[: run.chunk_start], *chunks]))
        if max_bytes is not None and len(out) > max_bytes:
            break
        best = out
        if layers is not None and ends >= layers:
            return best
    else:
        if decoder.complete and (max_bytes is None or len(data) <= max_bytes):
            return data
        if layers is not None:
            raise _too_few(ends)
    if not ends:
        raise TruncatedError(
            f"the file ends after {len(data)} bytes, before its first layer does", code="truncated", offset=len(data)
        )
    if best is None:
        raise OptionError(f"{max_bytes} bytes are too few for the first layer of this file", code="max-bytes",
                          remedy="allow more bytes")
    return best


def _with_checksum(data: bytes) -> bytes:
    return data + Checksum.build(zlib.crc32(data))
