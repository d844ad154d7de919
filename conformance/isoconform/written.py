"""Files written from the syntax: runs of random bytes, and runs that say symbol by symbol what their author wants.

No encoder would write most of these; every decoder reads them. They reach what no field leads to: meshes with holes,
signs that contradict each other, models driven to their ends.
"""

from __future__ import annotations

from contextlib import suppress

from isocodec import Decoder
from isocodec.entropy.range_coder import cut
from isocodec.errors import FormatError
from isocodec.format.chunks import CHECKSUM_BYTES
from isocodec.format.events import LayerComplete
from isospec.container import ChunkType, write_varint
from isospec.elements import ELEMENTS

from .fields import random_numbers
from .streams import Chunk, File, layers

ROOM = 4000
"""Bytes of a run that is stated, and not all there."""


def random_layers(file: File, program: bytes, seed: int, size: int) -> File:
    """A file with a chunk more: a program and a run of random bytes, up to ``size`` of them.

    If the program comes to its end, so does the run, and the chunk is one of layers. Else it is a cut one of all
    symbols that the bytes tell, or of those up to one that violates the specification.
    """
    start = bytes(file.with_chunks(*file.chunks, layers(program, bytes(ROOM))))[: -CHECKSUM_BYTES - ROOM]
    run = bytes(random_numbers(seed, size, 8))
    before = _total(_decoded(bytes(file))[0]) if file.chunks else 0
    decoder, ends = _decoded(start + run)
    if len(ends) == len(decoder.grid.layers):
        return file.with_chunks(*file.chunks, layers(program, run[: ends[-1] - decoder.grid.runs[-1].start]))
    return _cut(file, _total(decoder) - before, program, cut(decoder.grid.coder))


def _decoded(data: bytes) -> tuple[Decoder, list[int]]:
    """What a decoder makes of a file, up to an error if there is one, and where its layers end."""
    decoder = Decoder()
    decoder.feed(data)
    ends = []
    with suppress(FormatError):
        for event in decoder:
            if isinstance(event, LayerComplete):
                ends.append(event.offset)
    return decoder, ends


def said(file: File, program: bytes, *symbols: tuple[str, str]) -> File:
    """A file with a chunk more, whose run says these symbols.

    Parameters
    ----------
    file : File
    program : bytes
    symbols : pairs of str
        A syntax element and its symbols, zeros and ones, in the order of the run. The chunk is a cut one unless they
        bring the program to its end or to an error.

    Raises
    ------
    ValueError
        If the decoder asks for another element than stated, or for none.
    """
    wanted = [(element, bit) for element, bits in symbols for bit in bits]
    before = _decoded(bytes(file))[0].grid.symbols if file.chunks else dict.fromkeys(ELEMENTS, 0)
    low, width, shifts = 0, 1 << 32, 0
    for number, (element, bit) in enumerate(wanted, 1):
        # a 1 takes the lower part of the interval: its first value is always a 1, its last one a 0
        value = low if bit == "1" else low + width - 1
        decoder, _ = _decoded(bytes(_cut(file, number, program, value.to_bytes(shifts + 4, "big"))))
        asked = [name for name, count in decoder.grid.symbols.items() for _ in range(count - before[name])]
        if asked != [element]:
            raise ValueError(f"symbol {number} is asked for as {' '.join(asked) or 'nothing'}, not as {element}")
        before = decoder.grid.symbols
        reg = decoder.grid.coder.reg
        moved = reg.pos + reg.unknown // 8 - 4
        low, width = (value << 8 * (moved - shifts)) - reg.code, reg.range
        shifts = moved
    run = shortest(low, width, shifts)
    whole = file.with_chunks(*file.chunks, layers(program, run))
    decoder, _ = _decoded(bytes(whole))
    if decoder.complete and decoder.grid.symbols == before:
        return whole
    return _cut(file, len(wanted), program, run)


def _cut(file: File, symbols: int, program: bytes, run: bytes) -> File:
    return file.with_chunks(*file.chunks, Chunk(ChunkType.CUT_LAYERS, write_varint(symbols) + program + run))


def _total(decoder: Decoder) -> int:
    return sum(decoder.grid.symbols.values())


def shortest(low: int, width: int, shifts: int) -> bytes:
    """The fewest bytes whose value, followed by zeros, lies in an interval (clause 6.3(3))."""
    for extra in range(5):
        unit = 1 << (32 - 8 * extra)
        value = -(-low // unit) * unit
        if value < low + width:
            break
    return value.to_bytes(shifts + 4, "big")[: shifts + extra]
