"""Vectors of valid files out of the ordinary: layers in other orders, several chunks, other containers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate
from operator import mul

import numpy as np

from isocodec import encode
from isocodec.field.samples import Samples, check_field
from isocodec.format.chunks import write_index, write_metadata
from isocodec.format.header import Header, write_header
from isocodec.format.program import Layer
from isocodec.stream.encoder import encoder_of
from isocodec.stream.grid_encoder import GridEncoder
from isocodec.stream.truncation import truncate
from isospec.container import MAX_SIDE, ChunkType, Operation

from .draft import Draft, encoded
from .fields import Integers, balls, checkers, noise, torus, waves
from .streams import Chunk, File, encoding_tube, planned, rounds, sign_tube, split

HILLS = waves((17, 20), 255)
BALL = balls((7, 8, 9), [((7, 8, 7), 9)])
UNKNOWN = 20
"""A chunk type that means nothing yet."""


def _values(level: int, *planes: int) -> list[Layer]:
    return [Layer("values", level, plane) for plane in planes]


def _offsets(level: int, *radices: int) -> list[Layer]:
    return [Layer("offsets", level, 0, parts) for parts in accumulate(radices, mul)]


def _bits(field: Samples) -> tuple[int, int]:
    """Bits of the numbers of all samples, above and below the isovalue."""
    positions = np.argwhere(np.ones(field.values.shape, np.bool_))
    above = field.signs[tuple(positions.T)]
    numbers = field.numbers(positions, above)
    most = [int(numbers[side].max(initial=0)).bit_length() for side in (above, ~above)]
    return most[0], most[1]


def _in_order(values: Integers, isovalue: float, *plan: list[Layer]) -> File:
    field = check_field(values, isovalue)
    return planned(Header(values.shape, isovalue), encoding_tube(field), plan, _bits(field))


def orders() -> Iterator[Draft]:
    """Values between rounds of refinement, and programs of every form."""
    about = ("values between rounds of refinement",)
    plan = [Layer("base", 4), *_values(4, 6, 5), *rounds(5, 7), *_values(7, 5), *rounds(8, 10), *_values(10, 4, 3, 2)]
    yield Draft(
        "plane_values_interleaved", bytes(_in_order(HILLS, 100.5, plan)), 2,
        (*about, "new vertices catch up, with and without a new bit for the others"), layers=True,
    )
    field = noise((5, 6, 7), 21, 6)
    plan = [Layer("base", 3), *_values(3, 4), *rounds(4, 6), *_values(6, 4), *rounds(7, 9), *_values(9, 3, 2, 1, 0)]
    yield Draft("space_values_interleaved", bytes(_in_order(field, 31.0, plan)), 3, (*about, "noise"), layers=True)
    plan = [Layer("base", 10), *_values(10, 6, 5, 4)]
    yield Draft("plane_values_part", bytes(_in_order(HILLS, 100.5, plan)), 2, ("values: the first bits only",))
    plan = [Layer("base", 2), *_values(2, 0)]
    yield Draft(
        "plane_values_no_bits", bytes(_in_order(checkers((5, 4)), 0.5, plan)), 2, ("values of zero bits on both sides",)
    )
    plan = [Layer("base", 2), *_values(2, *range(6, -1, -1)), *rounds(3, 4), *_values(4, 0)]
    yield Draft(
        "plane_values_coarse_first", bytes(_in_order(noise((5, 5), 22, 8), 128.0, plan)), 2,
        (*about, "all bits on a coarse mesh", "noise"),
    )
    plan = [Layer("base", 5), *_values(5, 2), *rounds(6, 6), *_values(6, 1, 0)]
    yield Draft(
        "plane_values_same_vertices", bytes(_in_order(noise((6, 2), 2, 4), 7.5, plan)), 2,
        (*about, "the full grid brings no vertices: its values are those of grid edges all the same"), layers=True,
    )
    for name, radices, about_offsets in (
        ("2", (2,) * 24, "offsets in the most layers"),
        ("3", (3,) * 15, "offsets in many layers"),
        ("10", (10,), "offsets in an even number of parts"),
        ("63", (63,) * 4, "offsets of the largest radix, stated by escape"),
        ("mixed", (13, 2, 28, 29, 5), "offsets of several radices"),
    ):
        plan = [Layer("base", 6), *_offsets(6, *radices)]
        file = _in_order(noise((5, 6), 24, 8), 128.5, plan)
        yield Draft(f"plane_offsets_by_{name}", bytes(file), 2, ("offsets", about_offsets, "noise"))
        plan = [Layer("base", 9), *_offsets(9, *radices)]
        file = _in_order(noise((3, 4, 6), 25, 8), 128.5, plan)
        yield Draft(f"space_offsets_by_{name}", bytes(file), 3, ("offsets", about_offsets, "noise"))
    plan = [Layer("base", 3), *rounds(4, 5), Layer("refine", 6)]
    yield Draft("space_partly_refined", bytes(_in_order(BALL, 0.5, plan)), 3, ("the full grid is not reached",))
    plan = [Layer("base", 0), *rounds(1, 14)]
    yield Draft(
        "plane_rounds_by_escape", bytes(_in_order(noise((3, 140), 23, 1), 0.5, plan)), 2,
        ("14 rounds or more in one operation", "the full grid is not reached", "border: 3x140 samples"),
    )


def chunks() -> Iterator[Draft]:
    """Layers in several chunks, and chunks of other kinds."""
    plan = [[Layer("base", 6)], rounds(7, 8), rounds(9, 10), _values(10, 6, 5), _values(10, 4, 3, 2, 1, 0)]
    several = _in_order(HILLS, 100.5, *plan)
    yield Draft("plane_chunks", bytes(several), 2, ("several chunks of layers",), layers=True)
    offsets = _offsets(9, 3, 5, 3, 3)
    run = _in_order(BALL, 0.5, [Layer("base", 5)], rounds(6, 9), offsets[:1], offsets[1:])
    yield Draft("space_chunks", bytes(run), 3, ("several chunks of layers", "offsets in two runs"))
    checked = several.with_chunks(*(Chunk(c.type, c.payload, checked=True) for c in several.chunks))
    yield Draft("plane_chunk_checksums", bytes(checked), 2, ("chunks with checksums of their own",))

    disc = balls((17, 17), [((16, 17), 19)])
    yield encoded(
        "plane_metadata", disc, 0.5, "metadata chunk, with letters beyond ASCII",
        metadata={"title": "disc", "unit": "\u00b5m"}, precision="signs",
    )
    square = split(encode(disc, 0.5, profile="baseline"))
    sizes = bytes([square.header[5] & ~0x40]) + 2 * square.header[6:7] + square.header[7:]
    apart = replace(square, header=square.header[:5] + sizes)
    yield Draft("plane_sides_told_apart", bytes(apart), 2, ("equal sides told one by one",))
    encoder = encoder_of(BALL, 0.5, profile="baseline")
    assert isinstance(encoder, GridEncoder)
    whole = split(b"".join(encoder))
    index = Chunk(ChunkType.INDEX, write_index(encoder.frame.layers, encoder.frame.records), ancillary=True)
    yield Draft("space_index", bytes(whole.with_chunks(*whole.chunks, index)), 3, ("layer index",))
    wrong = Chunk(ChunkType.INDEX, bytes(11), ancillary=True)
    yield Draft("space_index_wrong", bytes(whole.with_chunks(*whole.chunks, wrong)), 3, ("layer index to ignore",))
    unknown = Chunk(UNKNOWN, b"anything at all", ancillary=True)
    first, *rest = several.chunks
    yield Draft(
        "plane_unknown_ancillary", bytes(several.with_chunks(unknown, first, unknown, *rest, unknown)), 2,
        ("unknown ancillary chunks, before, between and after layers",),
    )
    odd = [Chunk(ChunkType.METADATA, text, ancillary=True) for text in (b"\xff\xfe", b"[1]", write_metadata({}))]
    yield Draft("plane_metadata_odd", bytes(several.with_chunks(*odd, *several.chunks)), 2, ("metadata to ignore",))
    texts = (b"", b"\x02", b"\x00\x01", b"\x01\x00\x05", b"\x00\x01\x80\x05", b"\x01\x01\x85", b"\x01\xa0\x00\x85\x00")
    odd = [Chunk(ChunkType.PROMISES, text, ancillary=True) for text in texts]
    yield Draft("plane_promises_odd", bytes(several.with_chunks(*odd, *several.chunks)), 2, ("promises to ignore",))
    empty = several.with_chunks(Chunk(UNKNOWN, b"", ancillary=True))
    yield Draft("plane_no_layers", bytes(empty), 2, ("no layers at all",))
    newer = several.with_header(4, 0x31)
    yield Draft("plane_newer_writer", bytes(newer), 2, ("a newer writer, this read version",))


def cuts() -> Iterator[Draft]:
    """Files of the first layers of others."""
    disc = waves((33, 29), 255, 2)
    plane = b"".join(encoder_of(disc, 110.5, precision="exact", layers=4, profile="baseline"))
    space = b"".join(encoder_of(torus((15, 15, 9), 9, 4), 0.5, layers=6, profile="baseline"))
    for layers in (1, 5, 11):
        yield Draft(
            f"plane_first_{layers}_layers", truncate(plane, layers=layers), 2, (f"truncated to {layers} layers",)
        )
    yield Draft("space_first_3_layers", truncate(space, layers=3), 3, ("truncated to 3 layers",))


def truncated() -> Iterator[Draft]:
    """Files that end too early: what was received counts."""
    plane = b"".join(encoder_of(HILLS, 100.5, precision="exact", layers=4, profile="baseline"))
    space = b"".join(encoder_of(BALL, 0.5, layers=3, profile="baseline"))
    single = b"".join(encoder_of(BALL, 0.5, precision="signs", layers=9, profile="baseline"))
    one_rate = b"".join(encoder_of(HILLS, 100.5, precision="signs", layers=10, profile="baseline"))
    for name, data, size in (
        ("plane_ends_in_signature", plane, 3),
        ("plane_ends_in_header", plane, 8),
        ("plane_ends_in_program", plane, 12),
        ("plane_ends_in_base", one_rate, 24),
        ("plane_ends_in_refinement", plane, 30),
        ("plane_ends_in_values", plane, 80),
        ("plane_ends_in_checksum", plane, len(plane) - 1),
        ("space_ends_in_base", single, 40),
        ("space_ends_in_refinement", space, 25),
        ("space_ends_in_offsets", space, len(space) - 20),
    ):
        yield Draft(name, data[:size], int(name.startswith("space")) + 2, ("the file ends too early",))
    run = _in_order(HILLS, 100.5, [Layer("base", 6)], rounds(7, 10))
    chunk = run.chunks[0]
    end = len(run.header) + 2 + len(chunk.payload)
    yield Draft("plane_ends_between_chunks", bytes(run)[:end], 2, ("the file ends too early", "no chunk is the last"))


def flat() -> Iterator[Draft]:
    """One sample along an axis: a domain without simplices of positive volume (the encoder refuses to make these)."""
    for name, signs in (
        ("plane_flat", np.arange(9).reshape(1, 9) % 2 > 0),
        ("space_flat", np.arange(20).reshape(4, 1, 5) % 3 > 0),
        ("plane_one_sample", np.ones((1, 1), np.bool_)),
    ):
        tube = sign_tube(signs.shape, signs)
        plan = [Layer("base", 0), *rounds(1, tube.full_level)]
        file = planned(Header(signs.shape, 0.5), tube, [plan])
        yield Draft(name, bytes(file), signs.ndim, ("one sample along an axis",))


def largest() -> Iterator[Draft]:
    """As many samples as the format allows, with one curve from border to border and a base of the root's simplices.

    The symbols do not depend on the size, so those of the smallest domain serve.
    """
    for name, n in (("plane_largest", 2), ("space_largest", 3)):
        smallest = encoded(name, np.arange(2**n).reshape((2,) * n), 0.5, precision="signs", layers=0)
        header = write_header(Header((MAX_SIDE[n],) * n, 0.5))
        file = replace(split(smallest.data), header=header)
        plan = file.chunks[0].payload
        base = bytes([plan[0] & 0x80 | Operation.BASE << 4]) + plan[1:]
        data = bytes(file.with_chunks(replace(file.chunks[0], payload=base)))
        yield Draft(name, data, n, ("the largest domain", "the full grid is not reached"))


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (orders, chunks, cuts, truncated, flat, largest):
        yield from group()
