"""Files written from the syntax: runs of random bytes, and runs that say symbol by symbol what their author wants.

No encoder would write most of these; every decoder reads them. They reach what no field leads to: meshes with holes,
signs that contradict each other, models driven to their ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

from isocodec import Decoder
from isocodec.entropy.run import ReadingRun
from isocodec.errors import FormatError
from isocodec.format.chunks import CHECKSUM_BYTES
from isocodec.format.events import LayerComplete
from isospec.elements import ELEMENTS

from .fields import random_numbers
from .streams import File, layers

ROOM = 4000
"""Bytes of a run that is stated, and not all there."""


class _EnoughError(Exception):
    """A run has had as many symbols as it may have."""


@contextmanager
def _only(symbols: int) -> Iterator[None]:
    """Let decoders stop before they decode more symbols of a run."""
    grant = ReadingRun._grant

    def some(run: ReadingRun, most: int) -> None:
        run.count()
        if run.symbols >= symbols:
            raise _EnoughError
        grant(run, min(most, symbols - run.symbols))

    with patch.object(ReadingRun, "_grant", some):
        yield


def random_layers(file: File, program: bytes, seed: int, size: int) -> File:
    """A file with a chunk more: a program and a run of random bytes, up to ``size`` of them.

    If the program comes to its end, so does the run. Else the file ends early, within the run: with its last byte, or
    with the first one that violates the specification.
    """
    start = bytes(file.with_chunks(*file.chunks, layers(program, bytes(ROOM))))[: -CHECKSUM_BYTES - ROOM]
    run = bytes(random_numbers(seed, size, 8))
    decoder, ends, error = _decoded(start + run)
    if len(ends) == len(decoder.grid.layers):
        return file.with_chunks(*file.chunks, layers(program, run[: ends[-1] - decoder.grid.runs[-1].start]))
    if error is not None:
        run = next(run[:length] for length in range(size + 1) if _decoded(start + run[:length])[2] is not None)
    return _ending_early(file, program, run)


def _ending_early(file: File, program: bytes, run: bytes) -> File:
    return replace(file.with_chunks(*file.chunks, layers(program, run)), ends_early=True)


def _decoded(data: bytes) -> tuple[Decoder, list[int], FormatError | None]:
    """What a decoder makes of a file, where its layers end, and the error that it ends with."""
    decoder = Decoder()
    decoder.feed(data)
    ends = []
    try:
        for event in decoder:
            if isinstance(event, LayerComplete):
                ends.append(event.offset)
    except _EnoughError:
        pass
    except FormatError as error:
        return decoder, ends, error
    return decoder, ends, None


def said(file: File, program: bytes, *symbols: tuple[str, str]) -> File:
    """A file with a chunk more, whose run says these symbols.

    Parameters
    ----------
    file : File
    program : bytes
    symbols : pairs of str
        A syntax element and its symbols, zeros and ones, in the order of the run. Unless they bring the program to its
        end, the file ends early, with the first byte by which all of them are received.

    Raises
    ------
    ValueError
        If the decoder asks for another element than stated, or for none.
    """
    wanted = [(element, bit) for element, bits in symbols for bit in bits]
    before = _decoded(bytes(file))[0].grid.symbols if file.chunks else dict.fromkeys(ELEMENTS, 0)
    total = sum(before.values())
    low, width, shifts = 0, 1 << 32, 0
    for number, (element, bit) in enumerate(wanted, 1):
        # a 1 takes the lower part of the interval: its first value is always a 1, its last one a 0
        value = low if bit == "1" else low + width - 1
        run = value.to_bytes(shifts + 4, "big") + bytes(ROOM)
        with _only(number):
            decoder = _decoded(bytes(file.with_chunks(*file.chunks, layers(program, run))))[0]
        asked = [name for name, count in decoder.grid.symbols.items() for _ in range(count - before[name])]
        if asked != [element]:
            raise ValueError(f"symbol {number} is asked for as {' '.join(asked) or 'nothing'}, not as {element}")
        before = decoder.grid.symbols
        reg = decoder.grid.coder.reg
        moved = reg.pos + reg.unknown // 8 - 4
        # the run goes on with zeros
        low, width = (value << 8 * (moved - shifts)) - reg.code, reg.range
        shifts = moved
    whole = file.with_chunks(*file.chunks, layers(program, shortest(low, width, shifts)))
    decoder = _decoded(bytes(whole))[0]
    if decoder.complete and decoder.grid.symbols == before:
        return whole
    run = (low + width // 2).to_bytes(shifts + 4, "big")
    for size in range(len(run) + 1):
        short = _ending_early(file, program, run[:size])
        if sum(_decoded(bytes(short))[0].grid.symbols.values()) >= total + len(wanted):
            return short
    raise AssertionError("symbols that their own bytes do not say")


def shortest(low: int, width: int, shifts: int) -> bytes:
    """The fewest bytes whose value, followed by zeros, lies in an interval (clause 6.3(3))."""
    for extra in range(5):
        unit = 1 << (32 - 8 * extra)
        value = -(-low // unit) * unit
        if value < low + width:
            break
    return value.to_bytes(shifts + 4, "big")[: shifts + extra]
