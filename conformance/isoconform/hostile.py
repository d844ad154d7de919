"""Vectors of files that a decoder must refuse: each violates one clause, and all checksums but such are right.

One more violates none, and asks for more than a decoder has to give.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace

from isocodec.errors import FormatError
from isocodec.format.chunks import write_further
from isocodec.format.header import Header, write_header
from isocodec.stream.encoder import encoder_of
from isospec.container import LAYER_LIMIT, MAX_ISOVALUES, ChunkType, Operation, Profile, write_varint, zigzag

from .draft import Draft
from .dump import dump
from .fields import balls, noise, random_numbers
from .streams import Chunk, File, Step, bare, closed, layers, program_length, reopened, split, steps_of

BASE, REFINE, VALUES, OFFSETS, BOTH, ADAPTIVE, ADAPT, LEAVES = Operation
ESCAPE, ALL = 14, 15
FULL = 6
"""Full level of the small plane file: 9 x 8 samples."""
LONG = b"\x81" + b"\x80" * 8 + b"\0"
"""2**63 as a number of ten bytes."""


def _plane() -> bytes:
    return b"".join(encoder_of(noise((9, 8), 31, 8), 128.5, precision="exact", layers=2, profile="baseline"))


def _space() -> bytes:
    ball = balls((6, 7, 5), [((5, 6, 4), 6)])
    return bare(b"".join(encoder_of(ball, 0.5, precision=0.1, layers=4, profile="baseline")))


WRONG_DECIMALS = (
    ("places_0", "a decimal without places", b"\0\x12"),
    ("places_16", "a decimal of too many places", b"\x10\x12"),
    ("digits_above", "a decimal of too many digits", b"\1" + write_varint(zigzag(1 << 53))),
    ("digits_below", "a decimal of too many digits", b"\1" + write_varint(zigzag(-(1 << 53)))),
    ("digits_most", "a decimal of too many digits", b"\1" + b"\xff" * 8 + b"\x7f"),
    ("digits_long", "a number not in its shortest form", b"\1\x80\x12"),
)
"""Decimals that no isovalue may be, without their kind."""


def _refused(name: str, data: bytes, clause: str, about: str) -> Draft:
    return Draft(f"bad_{name}", data, 3 if name.startswith("space") else 2, (f"refused: {about}",), clause)


def headers() -> Iterator[Draft]:
    """Headers that are wrong."""
    plane, space = split(_plane()), split(_space())
    flags = plane.header[5]
    yield _refused("signature", bytes(plane.with_header(1, ord("i"))), "3.3.1", "another signature")
    yield _refused("signature_cut", b"\x89IS\0", "3.3.1", "another signature, and the file ends")
    yield _refused("text", b"This is not an .iso file.\n", "3.3.1", "a text file")
    yield _refused("read_version", bytes(plane.with_header(4, 0x22)), "3.3.1", "a newer read version")
    yield _refused("draft_version", bytes(plane.with_header(4, 0x10)), "3.3.1", "the read version of drafts")
    yield _refused("reserved_80", bytes(plane.with_header(5, flags | 0x80)), "3.3.2", "a reserved bit")
    yield _refused("space_profile", bytes(space.with_header(5, space.header[5] | 3)), "3.3.2", "an unknown profile")
    yield _refused("side_zero", bytes(plane.with_header(6, 0)), "3.3.3", "no samples along an axis")
    for name, file, sides in (
        ("side_absurd", plane, ((1 << 24) + 1, 8)),
        ("side_huge", plane, (9, (1 << 63) - 1)),
        ("space_side_absurd", space, (6, 7, (1 << 20) + 1)),
    ):
        head = file.header[:6] + b"".join(write_varint(s) for s in sides) + file.header[6 + len(sides) :]
        yield _refused(name, bytes(replace(file, header=head)), "3.3.3", "too many samples along an axis")
    equal = space.with_header(5, space.header[5] | 0x40).header[:6]
    for name, side, about in (("zero", 0, "no samples"), ("absurd", (1 << 20) + 1, "too many samples")):
        head = equal + write_varint(side) + space.header[9:]
        yield _refused(
            f"space_sides_{name}", bytes(replace(space, header=head)), "3.3.3", f"{about} along axes of equal size"
        )
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
    scales = {"zero": 0.0, "negative": -0.5, "nan": float("nan"), "infinite": float("inf")}
    for name, scale in scales.items():
        head = scaled + struct.pack(">d", scale)
        yield _refused(
            f"scale_{name}", bytes(replace(plane, header=head)), "3.3.5", "a scale that is not a positive number"
        )
    decimal = plane.with_header(5, flags | 0x18).header
    for name, about, number in WRONG_DECIMALS:
        head = decimal[:8] + number
        yield _refused(f"isovalue_{name}", bytes(replace(plane, header=head)), "3.3.4", about)
    yield Draft("plane_isovalue_end_in_decimal", decimal[:8] + b"\x10", 2, ("the file ends too early", "decimals"))
    head = plane.header[:8] + LONG
    yield _refused("isovalue_long", bytes(replace(plane, header=head)), "3.3.4", "a number of ten bytes")


def containers() -> Iterator[Draft]:
    """Chunks and checksums that are wrong."""
    data = _plane()
    plane = split(data)
    first = plane.chunks[0]
    unknown = Chunk(15, b"needed")
    yield _refused("critical_chunk", bytes(plane.with_chunks(first, unknown)), "3.5.2", "an unknown critical chunk")
    yield _refused("chunk_zero", bytes(plane.with_chunks(Chunk(0, b""), first)), "3.5.2", "a critical chunk of type 0")
    for kind, name in ((ChunkType.METADATA, "metadata"), (ChunkType.INDEX, "index"), (ChunkType.PROMISES, "promises")):
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
    yield _refused(
        "chunk_checksum_first",
        checked[:-5] + bytes([checked[-5] ^ 1]),
        "3.5.3",
        "a chunk's checksum is wrong, and the file ends before its own",
    )
    yield _refused("file_checksum", data[:-1] + bytes([data[-1] ^ 0x80]), "3.4.4", "the file's checksum is wrong")
    space = _space()
    yield _refused("space_file_checksum", space[:-4] + bytes(4), "3.4.4", "the file's checksum is wrong")
    yield _refused("trailing", data + b"\0", "3.4.4", "bytes after the end")
    yield _refused("two_files", data + data, "3.4.4", "bytes after the end")


def programs() -> Iterator[Draft]:
    """Layer programs that are wrong."""
    plane, space = split(_plane()), split(_space())
    full, bits = (BASE, ALL), b"\x77"
    finest: list[Step] = [(OFFSETS, ESCAPE), b"\x3e"]
    wrong: list[tuple[str, str, tuple[Step, ...]]] = [
        ("second_base", "a second base", ((BASE, 2), (BASE, 2))),
        ("base_too_fine", "a base past the full grid", ((BASE, FULL + 1),)),
        ("base_too_fine_by_escape", "a base past the full grid", ((BASE, ESCAPE), write_varint(1 << 60))),
        ("past_full_grid", "refinement past the full grid", ((BASE, 2), (REFINE, FULL - 1))),
        ("past_full_grid_again", "refinement past the full grid", ((BOTH, 2), (REFINE, ALL))),
        ("no_rounds", "no rounds of refinement", (full, (REFINE, 0))),
        ("refine_first", "refinement before the base", ((REFINE, 2), (BASE, 0))),
        ("offsets_no_unit", "offsets on a coarse mesh without their unit", ((BASE, 2), (OFFSETS, 1))),
        ("offsets_unit_25", "offsets in too large a unit", ((BASE, 2), (OFFSETS, 1), b"\x19")),
        ("offsets_unit_255", "offsets in too large a unit", ((ADAPTIVE, 2), (OFFSETS, 1), b"\xff")),
        ("offsets_first", "offsets before the base", ((OFFSETS, 1), full)),
        ("offsets_after_values_coarse", "offsets after values", ((BASE, 2), (VALUES, 1), bits, (OFFSETS, 1), b"\0")),
        ("offsets_radix_1_coarse", "offsets that divide nothing", ((BASE, 2), (OFFSETS, 0), b"\0")),
        ("offsets_radix_64", "offsets of a radix over 63", (full, (OFFSETS, ESCAPE), b"\x3f")),
        ("offsets_all", "offsets without a radix", (full, (OFFSETS, ALL))),
        ("offsets_too_fine", "more than 2**24 parts", (full, *finest * 5)),
        ("offsets_after_values", "offsets after values", (full, (VALUES, 1), bits, (OFFSETS, 1))),
        ("values_first", "values before the base", ((VALUES, 1), bits, full)),
        ("values_too_many", "more value bits than there are", (full, (VALUES, 8), bits)),
        ("adaptive_too_fine", "an adaptive base past the full grid", ((ADAPTIVE, FULL + 1),)),
        ("adaptive_second", "an adaptive base after a base", ((BASE, 2), (ADAPTIVE, 2))),
        ("base_after_adaptive", "a base after an adaptive base", ((ADAPTIVE, 2), (BASE, 2))),
        ("adapt_first", "adaptive refinement before the base", ((ADAPT, 1), (BASE, 0))),
        ("adapt_full", "adaptive refinement of the full grid", (full, (ADAPT, 1))),
        ("adapt_refined_full", "adaptive refinement of the full grid", ((ADAPTIVE, 0), (REFINE, ALL), (ADAPT, 0))),
        ("adapt_2", "adaptive refinement of an unknown kind", ((ADAPTIVE, 0), (ADAPT, 2))),
        ("adapt_all", "adaptive refinement as far as it goes", ((ADAPTIVE, 0), (ADAPT, ALL))),
        ("leaf_base_alone", "a leaf base that leans on nothing", ((LEAVES, 0),)),
        ("program_open", "a program that does not end", (bytes([0x80 | BASE << 4 | ALL]),)),
    ]
    for name, about, steps in wrong:
        yield _refused(name, bytes(plane.with_chunks(layers(steps_of(*steps), b""))), "3.6", about)
        if name in ("offsets_no_unit", "program_open"):  # which the next byte could complete
            continue
        # the same without a run: who does not look at the program waits for more bytes
        unread = replace(plane.with_chunks(layers(steps_of(*steps), b"")), ends_early=True)
        yield _refused(f"unread_{name}", bytes(unread), "3.6", f"{about}, of which nothing is read")
    many = steps_of(full, (VALUES, 0), bits, *[(VALUES, 0)] * (LAYER_LIMIT - 1))
    yield _refused(f"layers_{LAYER_LIMIT + 1}", bytes(plane.with_chunks(layers(many, b""))), "11.1", "too many layers")
    for name, stated in (("bits_53", b"\x0f\x35"), ("bits_by_escape", b"\xf0\x0e")):
        program = steps_of(full, (VALUES, 1), stated)
        yield _refused(name, bytes(plane.with_chunks(layers(program, b""))), "3.6.4", "too many or too few value bits")
    signs = b"".join(encoder_of(noise((9, 8), 31, 8), 128.5, layers=[("base", None)], profile="baseline"))
    nothing = layers(steps_of(full, (OFFSETS, 0)), split(signs).chunks[0].payload[program_length(signs) :])
    yield _refused("offsets_radix_1", bytes(plane.with_chunks(nothing)), "3.6", "offsets that divide nothing")
    over = layers(steps_of((BASE, ALL), (REFINE, 1)), b"")
    yield _refused("space_past_full_grid", bytes(space.with_chunks(over)), "3.6", "refinement past the full grid")


def runs() -> Iterator[Draft]:
    """Entropy-coded data that are wrong."""
    for name, data in (("", _plane()), ("space_", _space())):
        file, size = split(data), program_length(data)
        whole = file.chunks[0]
        program, run = whole.payload[:size], whole.payload[size:]
        yield _refused(
            f"{name}leftover", bytes(file.with_chunks(layers(program, run + b"\x01\x02\x03\x04\x05"))), "6.3",
            "bytes left over in a run",
        )
        yield _refused(
            f"{name}overrun", bytes(file.with_chunks(layers(program, run[: len(run) // 2]))), "6.3",
            "symbols past the end of a run",
        )
        yield _refused(f"{name}leftover_1", _least_refused(file, program, run), "6.3", "one byte left over in a run")
    plane, space = split(_plane()), split(_space())
    kinds = (("start", (BASE, 3), ""), ("adaptive_start", (ADAPTIVE, 1), " of an adaptive base"))
    for kind, operation, adaptive in kinds:
        for space_name, file, what in (("", plane, "curve"), ("space_", space, "surface")):
            for name, clause, about in (
                ("not_mixed", "5.3.3", f"a component{adaptive} starts where the {what} does not pass"),
                ("visited", "5.3.2", f"a component{adaptive} starts where one has been"),
            ):
                data = _searched(file, clause, steps_of(operation))
                yield _refused(f"{space_name}{kind}_{name}", data, clause, about)


def isovalues() -> Iterator[Draft]:
    """Further isovalues that are wrong."""
    plane, space = split(_plane()), split(_space())
    first = plane.chunks[0]
    ancillary = Chunk(ChunkType.ISOVALUE, write_further(1, 9.5, None), ancillary=True)
    yield _refused("ancillary_isovalue", bytes(plane.with_chunks(first, ancillary)), "3.5.2", "isovalue as ancillary")
    half, single, double, decimal = (kind << 6 for kind in range(4))
    for name, clause, about, payload in (
        ("empty", "3.5.5", "an isovalue without bytes", b""),
        ("missing", "3.5.5", "an isovalue that is not complete", bytes([half])),
        ("cut", "3.5.5", "an isovalue that is not complete", write_further(1, 1 / 3, 0)[:-1]),
        ("trailing", "3.5.5", "bytes behind an isovalue", write_further(1, 9.5, 0) + b"\0"),
        ("far_missing", "3.5.5", "an isovalue that is not complete", bytes([half | 63])),
        ("far_cut", "3.5.5", "an isovalue that is not complete", bytes([half | 63, 0x81])),
        ("far_long", "3.5.5", "a number not in its shortest form", bytes([half | 63, 0x80, 1, 9])),
        ("far_too_far", "3.5.5", "leaning on an isovalue that has not come", bytes([half | 63, 2, 9])),
        ("decimal_missing", "3.5.5", "an isovalue that is not complete", bytes([decimal])),
        ("decimal_cut", "3.5.5", "an isovalue that is not complete", bytes([decimal, 1])),
        *((name, "3.3.4", about, bytes([decimal]) + number) for name, about, number in WRONG_DECIMALS),
        ("not_shortest", "3.3.4", "a number not in its shortest form", bytes([half, 0x80, 9])),
        ("nan", "3.3.4", "an isovalue that is not finite", bytes([single]) + struct.pack(">f", float("nan"))),
        ("infinite", "3.3.4", "an isovalue that is not finite", bytes([double | 1]) + struct.pack(">d", float("inf"))),
        ("lean_on_itself", "3.5.5", "leaning on an isovalue that has not come", write_further(2, 9.5, 0)),
        ("lean_62", "3.5.5", "leaning on an isovalue that has not come", bytes([half | 62, 9])),
        ("twice", "3.5.5", "an isovalue that has come", write_further(1, 128.5, None)),
        ("twice_decimal", "3.5.5", "an isovalue that has come", bytes([decimal, 1]) + write_varint(zigzag(1285))),
        ("twice_by_kind", "3.5.5", "an isovalue that has come", bytes([double]) + struct.pack(">d", 128.5)),
    ):
        file = plane.with_chunks(first, Chunk(ChunkType.ISOVALUE, payload))
        yield _refused(f"further_{name}", bytes(file), clause, about)
    zeros = [Chunk(ChunkType.ISOVALUE, bytes([half, 0])), Chunk(ChunkType.ISOVALUE, bytes([single, 0x80, 0, 0, 0]))]
    yield _refused("further_minus_zero", bytes(plane.with_chunks(first, *zeros)), "3.5.5", "both 0 and -0")
    many = [Chunk(ChunkType.ISOVALUE, write_further(1, i / 2, None)) for i in range(MAX_ISOVALUES + 1) if i != 257]
    yield _refused("isovalues_4097", bytes(plane.with_chunks(*many)), "11.1", "more than 4096 isovalues")
    free, leaning = (Chunk(ChunkType.ISOVALUE, write_further(1, 120.5, lean)) for lean in (None, 0))
    for name, about, before, steps in (
        ("leaf_base_free", "a leaf base that leans on nothing", (first, free), ((LEAVES, 0),)),
        ("leaf_base_argument", "a leaf base with an argument", (first, leaning), ((LEAVES, 1),)),
        ("leaf_base_all", "a leaf base as far as it goes", (first, leaning), ((LEAVES, ALL),)),
        ("leaf_base_nowhere", "a leaf base on an isovalue without a base", (leaning,), ((LEAVES, 0),)),
        ("leaf_base_second", "a leaf base after a base", (first, leaning), ((BASE, 2), (LEAVES, 0))),
        ("leaf_base_full", "refinement past the full grid", (first, leaning), ((LEAVES, 0), (REFINE, 1))),
        ("isovalue_no_base", "refinement before the base of its isovalue", (first, leaning), ((REFINE, 1),)),
    ):
        file = plane.with_chunks(*before, layers(steps_of(*steps), b""))
        yield _refused(name, bytes(file), "3.6", about)
        unread = bytes(replace(file, ends_early=True))
        yield _refused(f"unread_{name}", unread, "3.6", f"{about}, of which nothing is read")
    for name, file in (("leaf_base_start_visited", plane), ("space_leaf_base_start_visited", space)):
        further = Chunk(ChunkType.ISOVALUE, write_further(1, 0.0, 0))
        data = _searched(file, "5.3.2", steps_of((LEAVES, 0)), (file.chunks[0], further))
        yield _refused(name, data, "5.3.2", "a component behind a leaf base starts where one has been")


def _of_base(level: int) -> Chunk:
    """The layers of a base alone, of the field of `_plane`."""
    plan = [("base", level)]
    return split(b"".join(encoder_of(noise((9, 8), 31, 8), 128.5, layers=plan, profile="baseline"))).chunks[0]


def turns() -> Iterator[Draft]:
    """Turns that are wrong."""
    plane = split(_plane())
    first = plane.chunks[0]
    further = Chunk(ChunkType.ISOVALUE, write_further(1, 120.5, 0))
    both = Chunk(ChunkType.TURN, b"\0\2")
    ancillary = Chunk(ChunkType.TURN, b"\0\2", ancillary=True)
    yield _refused("ancillary_turn", bytes(plane.with_chunks(further, ancillary)), "3.5.2", "a turn as ancillary")
    for name, about, payload in (
        ("empty", "a turn without bytes", b""),
        ("cut", "a turn that is not complete", b"\0"),
        ("trailing", "bytes behind a turn", b"\0\1\0"),
        ("long", "a number not in its shortest form", b"\0\x81\0"),
        ("of_none", "a turn of no isovalue", b"\0\0"),
        ("not_begun", "a turn of an isovalue that has not come", b"\0\3"),
        ("first_not_begun", "a turn of an isovalue that has not come", b"\2\1"),
    ):
        file = plane.with_chunks(further, Chunk(ChunkType.TURN, payload))
        yield _refused(f"turn_{name}", bytes(file), "3.5.9", about)
    again = plane.with_chunks(first, further, both)
    yield _refused("turn_again", bytes(again), "3.5.9", "a turn of an isovalue whose layers have ended")
    free, turns_of = Chunk(ChunkType.ISOVALUE, write_further(1, 120.5, None)), [Chunk(ChunkType.TURN, b"\0\1"),
                                                                              Chunk(ChunkType.TURN, b"\1\1")]
    coarse, fine = (_of_base(level) for level in (2, 3))
    for name, clause, about, steps in (
        ("unlike", "3.5.9", "all rounds that are left, of isovalues on different levels", (REFINE, ALL)),
        ("base", "3.6", "a base of isovalues that have one", (BASE, 2)),
        ("rounds", "3.6", "more rounds than one of the isovalues has left", (REFINE, 6)),
    ):
        chunks = (free, turns_of[0], coarse, turns_of[1], fine, both, layers(steps_of(steps), b""))
        yield _refused(f"turn_{name}", bytes(plane.with_chunks(*chunks)), clause, about)
    series = plane.with_chunks(further, both, Chunk(ChunkType.FRAME, b"\0"))
    yield _refused("turn_before_frames", bytes(series), "3.5.7", "a series that begins behind a turn")
    series = plane.with_chunks(Chunk(ChunkType.SERIES, b"\0"), further, both)
    yield _refused("turn_in_series", bytes(series), "3.5.9", "a turn in a series")


def ends() -> Iterator[Draft]:
    """Files that end before their checksum: what is checked after that has not been found wrong yet (clause 3.4.5)."""
    plane = split(_plane())
    for name, kind in (
        ("isovalue", ChunkType.ISOVALUE), ("frame", ChunkType.FRAME), ("series", ChunkType.SERIES),
        ("turn", ChunkType.TURN), ("domain", ChunkType.DOMAIN),
    ):
        whole = plane.with_chunks(*(_of_base(2) for _ in range(kind == ChunkType.SERIES)), Chunk(kind, b""))
        assert dump(bytes(whole)).exit_code == FormatError.exit_code
        about = f"the file ends before its checksum, behind a malformed chunk: {name}"
        yield Draft(f"plane_{name}_end_in_checksum", bytes(whole)[:-1], 2, (about,))


def _least_refused(file: File, program: bytes, run: bytes) -> bytes:
    """The file with its run lengthened by zeros until a decoder must refuse it."""
    while True:
        run += b"\0"
        data = bytes(file.with_chunks(layers(program, run)))
        if dump(data).error is not None:
            return data


def _searched(file: File, clause: str, program: bytes, before: Sequence[Chunk] = ()) -> bytes:
    """The first file, of a row of random ones, whose base violates a clause; its checksums are right."""
    for seed in range(20000):
        run = bytes(random_numbers(seed, 12, 8))
        data = bytes(file.with_chunks(*before, layers(program, run)))
        error = dump(data).error
        if error is not None and error.clause == clause:
            return data
    raise AssertionError(f"no random run violates clause {clause}")


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (headers, containers, programs, runs, isovalues, turns, ends):
        yield from group()
    yield _lone_vertices()


def _lone_vertices() -> Draft:
    """Vertices that lie farther from each other than any block reaches: a base of level 24, cubes of 2048 samples."""
    side = (1 << 19) + 1
    run = bytes(random_numbers(35, 4800, 8))
    chunk = layers(steps_of((BASE, ESCAPE), write_varint(24)), run)
    data = bytes(File(write_header(Header((side,) * 3, 21.0, None, Profile.MAIN)), (chunk,)))
    features = "main profile", "beyond all levels", "a run of random bytes"
    return Draft("space_main_lone_vertices", data, 3, features, "11.2", beyond="6.3")
