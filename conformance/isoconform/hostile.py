"""Vectors of files that a decoder must refuse: each violates one clause, and all checksums but such are right."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace

from isocodec import Encoder, truncate
from isocodec.stream.header import Header, write_header
from isospec.container import ChunkType, Operation, OperationByte, write_varint

from .draft import Draft
from .dump import dump
from .fields import balls, noise, random_numbers
from .streams import Chunk, File, closed, layers, program_length, reopened, split

BASE, REFINE, VALUES, OFFSETS, BOTH = Operation
ESCAPE, ALL = 14, 15
FULL = 6
"""Full level of the small plane file: 9 x 8 samples."""


def _plane() -> bytes:
    return b"".join(Encoder(noise((9, 8), 31, 8), 128.5, exact=True, base_level=2))


def _space() -> bytes:
    return b"".join(Encoder(balls((6, 7, 5), [((5, 6, 4), 6)]), 0.5, tolerance=0.1, base_level=4))


def _refused(name: str, data: bytes, clause: str, about: str) -> Draft:
    return Draft(f"bad_{name}", data, 3 if name.startswith("space") else 2, (f"refused: {about}",), clause)


def headers() -> Iterator[Draft]:
    """Headers that are wrong."""
    plane, space = split(_plane()), split(_space())
    flags = plane.header[5]
    yield _refused("signature", bytes(plane.with_header(1, ord("i"))), "3.3.1", "another signature")
    yield _refused("text", b"This is not an .iso file.\n", "3.3.1", "a text file")
    yield _refused("read_version", bytes(plane.with_header(4, 0x11)), "3.3.1", "a newer read version")
    for bit in (0x40, 0x80):
        yield _refused(f"reserved_{bit:02x}", bytes(plane.with_header(5, flags | bit)), "3.3.2", "reserved bits")
    yield _refused("space_profile", bytes(space.with_header(5, space.header[5] | 3)), "3.3.2", "an unknown profile")
    yield _refused("isovalue_kind", bytes(plane.with_header(5, flags | 0x18)), "3.3.4", "an unknown kind of isovalue")
    yield _refused("side_zero", bytes(plane.with_header(6, 0)), "3.3.3", "no samples along an axis")
    for name, file, sides in (
        ("side_absurd", plane, ((1 << 24) + 1, 8)),
        ("side_huge", plane, (9, (1 << 63) - 1)),
        ("space_side_absurd", space, (6, 7, (1 << 20) + 1)),
    ):
        head = file.header[:6] + b"".join(write_varint(s) for s in sides) + file.header[6 + len(sides) :]
        yield _refused(name, bytes(replace(file, header=head)), "3.3.3", "too many samples along an axis")
    for name, number, about in (
        ("number_not_shortest", b"\x80\x09", "a number not in its shortest form"),
        ("number_endless", b"\xff" * 9 + b"\x7f", "a number of more than 63 bits"),
    ):
        head = plane.header[:6] + number + plane.header[7:]
        yield _refused(name, bytes(replace(plane, header=head)), "3.3.3", about)
    kinds = {"isovalue_nan": float("nan"), "isovalue_infinite": float("-inf")}
    for name, isovalue in kinds.items():
        head = plane.header[:5] + bytes([flags | 2 << 3]) + plane.header[6:8] + struct.pack(">d", isovalue)
        yield _refused(name, bytes(replace(plane, header=head)), "3.3.4", "an isovalue that is not finite")
    scaled = write_header(Header((9, 8), 128.5, 0.1))[:-8]
    for name, scale in (("scale_zero", 0.0), ("scale_negative", -0.5), ("scale_nan", float("nan"))):
        head = scaled + struct.pack(">d", scale)
        yield _refused(name, bytes(replace(plane, header=head)), "3.3.5", "a scale that is not a positive number")


def containers() -> Iterator[Draft]:
    """Chunks and checksums that are wrong."""
    data = _plane()
    plane = split(data)
    first = plane.chunks[0]
    unknown = Chunk(9, b"needed")
    yield _refused("critical_chunk", bytes(plane.with_chunks(first, unknown)), "3.5.2", "an unknown critical chunk")
    yield _refused("chunk_zero", bytes(plane.with_chunks(Chunk(0, b""), first)), "3.5.2", "a critical chunk of type 0")
    for kind, name in ((ChunkType.METADATA, "metadata"), (ChunkType.INDEX, "index")):
        critical = Chunk(kind, b"{}")
        yield _refused(f"critical_{name}", bytes(plane.with_chunks(first, critical)), "3.5.2", f"{name} as critical")
    ancillary = replace(first, ancillary=True)
    yield _refused("ancillary_layers", bytes(plane.with_chunks(ancillary)), "3.5.2", "layers as ancillary")
    at = len(plane.header) + 1
    length = closed(reopened(data)[:at] + b"\x80" + reopened(data)[at:])
    yield _refused("chunk_length_not_shortest", length, "3.4.2", "a length not in its shortest form")
    checked = bytes(plane.with_chunks(replace(first, checked=True)))
    yield _refused(
        "chunk_checksum", closed(checked[:-5] + bytes([checked[-5] ^ 1])), "3.5.3", "a chunk's checksum is wrong"
    )
    yield _refused("file_checksum", data[:-1] + bytes([data[-1] ^ 0x80]), "3.4.4", "the file's checksum is wrong")
    space = _space()
    yield _refused("space_file_checksum", space[:-4] + bytes(4), "3.4.4", "the file's checksum is wrong")
    yield _refused("trailing", data + b"\0", "3.4.4", "bytes after the end")
    yield _refused("two_files", data + data, "3.4.4", "bytes after the end")


Step = tuple[int, int] | bytes


def _steps(*steps: Step) -> bytes:
    """A program of operations; bytes stand for numbers that follow the operation before."""
    places = [i for i, step in enumerate(steps) if isinstance(step, tuple)]
    return b"".join(
        step if isinstance(step, bytes)
        else OperationByte.build({"more": i != places[-1], "operation": step[0], "argument": step[1]})
        for i, step in enumerate(steps)
    )  # fmt: skip


def programs() -> Iterator[Draft]:
    """Layer programs that are wrong."""
    plane, space = split(_plane()), split(_space())
    full, bits = (BASE, ALL), b"\x77"
    finest: list[Step] = [(OFFSETS, ESCAPE), b"\x1f"]
    wrong: list[tuple[str, str, tuple[Step, ...]]] = [
        ("second_base", "a second base", ((BASE, 2), (BASE, 2))),
        ("base_too_fine", "a base past the full grid", ((BASE, FULL + 1),)),
        ("base_too_fine_by_escape", "a base past the full grid", ((BASE, ESCAPE), write_varint(1 << 60))),
        ("past_full_grid", "refinement past the full grid", ((BASE, 2), (REFINE, FULL - 1))),
        ("past_full_grid_again", "refinement past the full grid", ((BOTH, 2), (REFINE, ALL))),
        ("no_rounds", "no rounds of refinement", ((BASE, 2), (REFINE, 0))),
        ("refine_first", "refinement before the base", ((REFINE, 2), (BASE, 0))),
        ("offsets_coarse", "offsets before the full grid", ((BASE, 2), (OFFSETS, 1))),
        ("offsets_radix_1", "offsets that divide nothing", (full, (OFFSETS, 0))),
        ("offsets_radix_65", "offsets of a radix over 63", (full, (OFFSETS, ESCAPE), b"\x20")),
        ("offsets_all", "offsets without a radix", (full, (OFFSETS, ALL))),
        ("offsets_too_fine", "more than 2**24 parts", (full, *finest * 5)),
        ("offsets_after_values", "offsets after values", (full, (VALUES, 1), bits, (OFFSETS, 1))),
        ("values_after_offsets", "values after offsets", (full, (OFFSETS, 1), (VALUES, 1), bits)),
        ("values_first", "values before the base", ((VALUES, 1), bits, full)),
        ("values_too_many", "more value bits than there are", (full, (VALUES, 8), bits)),
        ("operation", "an unknown operation", (full, (7, 1))),
        ("program_open", "a program that does not end", (bytes([0x80 | BASE << 4 | ALL]),)),
    ]
    for name, about, steps in wrong:
        yield _refused(name, bytes(plane.with_chunks(layers(_steps(*steps), b""))), "3.6", about)
    many = _steps(full, (VALUES, 0), bits, *[(VALUES, 0)] * 4095)
    yield _refused("layers_4097", bytes(plane.with_chunks(layers(many, b""))), "11.1", "more than 4096 layers")
    for name, stated in (("bits_53", b"\x0f\x35"), ("bits_by_escape", b"\xf0\x0e")):
        program = _steps(full, (VALUES, 1), stated)
        yield _refused(name, bytes(plane.with_chunks(layers(program, b""))), "3.6.4", "too many or too few value bits")
    over = layers(_steps((BASE, ALL), (REFINE, 1)), b"")
    yield _refused("space_past_full_grid", bytes(space.with_chunks(over)), "3.6", "refinement past the full grid")
    symbols = Chunk(ChunkType.CUT_LAYERS, b"\x80\x05" + _steps(full))
    yield _refused(
        "symbols_not_shortest", bytes(plane.with_chunks(symbols)), "3.5.4", "a number not in its shortest form"
    )


def runs() -> Iterator[Draft]:
    """Entropy-coded data that are wrong."""
    for name, data in (("", _plane()), ("space_", _space())):
        file, size = split(data), program_length(data)
        whole = file.chunks[0]
        program, run = whole.payload[:size], whole.payload[size:]
        yield _refused(
            f"{name}leftover", bytes(file.with_chunks(layers(program, run + b"\x01\x02\x03\x04\x05"))), "6.3",
            "bytes left over in a run",
        )  # fmt: skip
        yield _refused(
            f"{name}overrun", bytes(file.with_chunks(layers(program, run[: len(run) // 2]))), "6.3",
            "symbols past the end of a run",
        )  # fmt: skip
        yield _refused(f"{name}leftover_1", _least_refused(file, program, run), "6.3", "one byte left over in a run")
        cut = split(truncate(data, max_bytes=len(data) - 8)).chunks[0]
        spare = replace(cut, payload=cut.payload + b"\x01\x02\x03\x04\x05")
        yield _refused(f"{name}cut_leftover", bytes(file.with_chunks(spare)), "6.3", "bytes left over in a cut run")
        assert cut.type == ChunkType.CUT_LAYERS
        more = layers(_steps((OFFSETS, 1)), b"")
        yield _refused(f"{name}after_cut", bytes(file.with_chunks(cut, more)), "3.5.4", "layers after a cut run")
        yield _refused(f"{name}cut_twice", bytes(file.with_chunks(cut, cut)), "3.5.4", "layers after a cut run")
    plane, space = split(_plane()), split(_space())
    for name, file, clause, about in (
        ("start_not_mixed", plane, "5.3.3", "a component starts where the curve does not pass"),
        ("start_visited", plane, "5.3.2", "a component starts where one has been"),
        ("space_start_not_mixed", space, "5.3.3", "a component starts where the surface does not pass"),
        ("space_start_visited", space, "5.3.2", "a component starts where one has been"),
    ):
        yield _refused(name, _searched(file, clause), clause, about)


def _least_refused(file: File, program: bytes, run: bytes) -> bytes:
    """The file with its run lengthened by zeros until a decoder must refuse it."""
    while True:
        run += b"\0"
        data = bytes(file.with_chunks(layers(program, run)))
        if dump(data).error is not None:
            return data


def _searched(file: File, clause: str) -> bytes:
    """The first file, of a row of random ones, whose base violates a clause; its checksums are right."""
    for seed in range(20000):
        run = bytes(random_numbers(seed, 12, 8))
        data = bytes(file.with_chunks(layers(_steps((BASE, 3)), run)))
        error = dump(data).error
        if error is not None and error.clause == clause:
            return data
    raise AssertionError(f"no random run violates clause {clause}")


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (headers, containers, programs, runs):
        yield from group()
