"""Files made from the syntax, not by an encoder: any header, programs in any order, runs of any bytes.

They reach what no encoder writes, and are small: some tens of bytes. All choices come from a ``random.Random``, so
that a seed stands for a file, and `isoconform.strategies` can let hypothesis choose.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from random import Random

from isocodec.format.program import Progress, expand
from isospec.container import (
    ALL,
    ESCAPE,
    FAR_LEAN,
    MAX_SIDE,
    READ_VERSION,
    SIGNATURE,
    ChunkType,
    IsovalueKind,
    Operation,
    write_varint,
    zigzag,
)

from .growing import FAR, TRIES, Probe, grown, probe
from .meshes import exponent
from .streams import Chunk, File

BASES = (Operation.BASE, Operation.BASE_AND_REFINE, Operation.ADAPTIVE_BASE, Operation.LEAF_BASE)
OTHERS = (Operation.REFINE, Operation.ADAPT, Operation.VALUES, Operation.OFFSETS)
UNKNOWN_TYPES = (0, 14, 20, 31)
assert not {*UNKNOWN_TYPES} & {*ChunkType}, "a type of chunk that is known by now"
Taste = dict[int, int]
"""Operations, with how likely each is, among bases and among those behind a base."""
SIZES = (6, 12, 20, 30, 45)
"""Most bytes of a run."""
LARGE = 100
BROAD = 40
"""Sides are mostly small; a few are as long as this, and some larger by far."""


# -- header --------------------------------------------------------------------------------------------------------


def any_shape(random: Random) -> tuple[int, ...]:
    """Samples along two or three axes: mostly few, now and then one, many, or as many as there can be."""
    n = random.choice((2, 2, 3))
    few = {2: 10, 3: 6}[n]
    match random.randrange(10):
        case 0:
            sides = [random.randint(1, few) for _ in range(n)]
        case 1:
            sides = [random.randint(2, BROAD) for _ in range(n)]
        case 2:
            sides = [random.choice((2, 3, 5, 9, 17, 33)) for _ in range(n)]
        case 3 | 4:
            most = MAX_SIDE[n].bit_length() - 1
            finest = random.choice((random.randint(2, most), most))
            sides = [random.choice((0, -1, 1)) + (1 << random.randint(2, finest)) for _ in range(n)]
            sides = [min(side, MAX_SIDE[n]) for side in sides]
        case 5:
            sides = [random.randint(2, few)] * n
        case _:
            sides = [random.randint(2, few) for _ in range(n)]
    return tuple(sides)


def any_isovalue(random: Random, before: Sequence[float]) -> tuple[float, int]:
    """An isovalue that has not come before, and the kind in which it is written (clause 3.3.4)."""
    while True:
        near = random.choice(before) if before else 0.0
        match random.randrange(10):
            case 0:
                value = struct.unpack(">f", struct.pack(">f", random.uniform(-300, 300)))[0]
            case 1:
                value = near + random.choice((-1, 1)) * 2.0 ** random.randint(20, 60)
            case 2:
                value = near + random.uniform(-2, 2)
            case _:
                value = near + random.randint(-12, 12) / 2
        if value not in before:
            break
    kinds = [IsovalueKind.FLOAT64]
    if struct.unpack(">f", struct.pack(">f", value))[0] == value:
        kinds.append(IsovalueKind.FLOAT32)
    if 2 * value == int(2 * value) and abs(value) < 2**50:
        kinds += [IsovalueKind.HALVES] * 8
    if abs(value) < 1e6:
        kinds.append(IsovalueKind.DECIMAL)
    kind = random.choice(kinds)
    return float(f"{value:.2f}") if kind == IsovalueKind.DECIMAL else value, kind


def isovalue_bytes(value: float, kind: int) -> bytes:
    """An isovalue as a header or an isovalue chunk has it."""
    if kind == IsovalueKind.HALVES:
        return write_varint(zigzag(int(2 * value)))
    if kind == IsovalueKind.DECIMAL:
        return b"\2" + write_varint(zigzag(round(100 * value)))
    return struct.pack(">f" if kind == IsovalueKind.FLOAT32 else ">d", value)


def any_scale(random: Random) -> bytes:
    """A scale, mostly a power of two (clause 3.3.5)."""
    if random.randrange(3):
        return bytes([random.choice((0, 1, 0x7F, 0x81, 0xFF, random.randint(0x81, 0xFF)))])
    return b"\x80" + struct.pack(">d", random.choice((0.1, 5e-324, 1.7e308, 1.0)))


@dataclass(frozen=True)
class Head:
    """A header that has been chosen."""

    data: bytes
    shape: tuple[int, ...]
    isovalue: float
    profile: int


def any_header(random: Random) -> Head:
    """A valid header; equal sides are told once or one by one."""
    shape = any_shape(random)
    value, kind = any_isovalue(random, ())
    profile, scaled = random.randrange(2), random.randrange(6) == 0
    equal = len(set(shape)) == 1 and random.randrange(4) > 0
    flags = equal << 6 | scaled << 5 | kind << 3 | (len(shape) - 2) << 2 | profile
    writer = random.randrange(16) if random.randrange(16) == 0 else 0
    sides = b"".join(map(write_varint, shape[:1] if equal else shape))
    data = SIGNATURE + bytes([writer << 4 | READ_VERSION, flags]) + sides + isovalue_bytes(value, kind)
    return Head(data + (any_scale(random) if scaled else b""), shape, value, profile)


# -- programs ------------------------------------------------------------------------------------------------------


def any_taste(random: Random) -> Taste:
    """Which operations a file's programs are made of: all, or more of some, since values end offsets for good.

    Every fourth file has geometry on the full grid alone, so that isovalues that lean on one another know of the same
    edges and vertices.
    """
    if random.randrange(4) == 0:
        bases, others = (0, 3, 0, 2), random.choice(((0, 0, 0, 1), (0, 0, 1, 0), (0, 0, 1, 3)))
    else:
        bases, others = (
            (2, 1, 2, 3),
            random.choice(
                ((4, 4, 2, 4), (2, 4, 0, 1), (2, 2, 3, 0), (2, 2, 0, 4), (1, 0, 0, 3), (4, 0, 1, 0), (3, 1, 0, 0))
            ),
        )
    return dict(zip((*BASES, *OTHERS), (*bases, *others), strict=True))


def any_program(random: Random, progress: Progress, taste: Taste, most: int = 7) -> bytes:
    """A program that may follow where the programs of an isovalue stand; ``progress`` is moved behind it."""
    steps: list[tuple[int, int, bytes]] = []
    for _ in range(random.randint(1, most)):
        step = _step(random, progress, taste)
        if step is None:
            break
        steps.append(step)
    return b"".join(
        bytes([(i < len(steps) - 1) << 7 | operation << 4 | argument]) + more
        for i, (operation, argument, more) in enumerate(steps)
    )


def _step(random: Random, progress: Progress, taste: Taste) -> tuple[int, int, bytes] | None:
    """An operation that may follow: its number, its argument's four bits, and the bytes behind; None if all fail."""
    for _ in range(20):
        operation = _operation(random, progress, taste)
        argument, stated_all = _argument(random, operation, progress)
        after, more, unit = progress.copy(), b"", 0
        if operation == Operation.VALUES and after.bits is None:
            after.bits, more = any_bits(random)
            after.plane = max(after.bits)
            if not stated_all:
                argument = random.randint(0, after.plane)
        if operation == Operation.OFFSETS and 0 <= after.level < after.full_level:
            unit = min(random.choice((0, 0, 1, 2, random.randrange(25))), 24)
            more = bytes([unit])
        try:
            layers = expand(operation, argument, stated_all, after, unit)
        except ValueError:
            continue
        for layer in layers:
            after.add(layer)
        vars(progress).update(vars(after))
        if stated_all:
            return operation, ALL, more
        if argument >= ESCAPE or random.randrange(24) == 0:
            return operation, ESCAPE, write_varint(argument) + more
        return operation, argument, more
    return None


def _operation(random: Random, progress: Progress, taste: Taste) -> int:
    fitting = OTHERS if progress.level >= 0 else BASES if progress.lean_level >= 0 else BASES[:-1]
    return random.choices(fitting, [taste[operation] for operation in fitting])[0]


def _argument(random: Random, operation: int, progress: Progress) -> tuple[int, bool]:
    """Argument of an operation, and whether it is as far as it goes."""
    if operation in BASES:
        if operation == Operation.LEAF_BASE:
            return 0, False
        full = progress.full_level
        return random.choice((0, 1, 2, 3, random.randint(0, full), max(full - 1, 0), full)), random.randrange(12) == 0
    if operation == Operation.REFINE:
        far = random.randint(1, 24) if progress.full_level > 14 else 2
        return random.choice((1, 1, 2, 3, far, 0)), random.randrange(4) == 0
    if operation == Operation.VALUES:
        return random.choice((0, 1, 1, 2, 3)), random.randrange(4) == 0
    if operation == Operation.OFFSETS:
        return random.choice((1, 1, 2, 3, 4, 9, 13, 62, random.randint(0, 63))), False
    return random.choice((0, 1, 1)), False


def any_bits(random: Random) -> tuple[tuple[int, int], bytes]:
    """Bits of values above and below, and their bytes (clause 3.6.4)."""
    bits = tuple(random.choice((0, 1, 2, 2, 3, 4, 5, random.choice((8, 14, 15, 16, 30, 52)))) for _ in range(2))
    fields = bytes([min(bits[0], 15) << 4 | min(bits[1], 15)])
    return (bits[0], bits[1]), fields + b"".join(write_varint(b) for b in bits if b >= 15)


# -- files ---------------------------------------------------------------------------------------------------------


@dataclass
class _Draft:
    """A file that grows chunk by chunk."""

    head: Head
    chunks: list[Chunk] = field(default_factory=list)
    isovalues: list[float] = field(default_factory=list)
    progresses: list[Progress] = field(default_factory=list)

    def file(self, *further: Chunk) -> bytes:
        """With further chunks, whole, its checksums right."""
        return bytes(File(self.head.data, (*self.chunks, *further)))

    def start(self, kind: int, before_run: bytes) -> bytes:
        """Up to the run of one more chunk, of which a length is stated that is not reached."""
        out = self.head.data + b"".join(chunk.enveloped() for chunk in self.chunks)
        return out + bytes([kind]) + write_varint(FAR) + before_run


def any_file(random: Random) -> bytes:
    """A file from the syntax: valid, cut off within its last run, or (rarely) with a run that is an error."""
    head = any_header(random)
    draft = _Draft(head, isovalues=[head.isovalue], progresses=[Progress(len(head.shape) * exponent(head.shape))])
    size, taste = random.choice(SIZES), any_taste(random)
    isovalues = random.choice((1, 2, 2, 3))
    for number in range(isovalues):
        if number:
            _another_isovalue(random, draft)
        if number < isovalues - 1 and random.randrange(10) == 0:
            # one without a base, that others lean on
            continue
        for _ in range(random.choice((1, 1, 1, 2, 3))):
            _perhaps_ancillary(random, draft)
            last = _more_layers(random, draft, taste, random.randint(2, size))
            if last is not None:
                return last
    _perhaps_ancillary(random, draft)
    if not draft.chunks or random.randrange(12) == 0:
        draft.chunks.append(Chunk(random.choice(UNKNOWN_TYPES), b"", True))
    return draft.file()


def bare_file(random: Random) -> bytes:
    """A file with little in its runs: its container and programs are what counts, mostly before they are damaged."""
    head = any_header(random)
    draft = _Draft(head, isovalues=[head.isovalue], progresses=[Progress(len(head.shape) * exponent(head.shape))])
    for number in range(random.choice((1, 1, 2, 3))):
        if number:
            _another_isovalue(random, draft)
        program = any_program(random, draft.progresses[-1], any_taste(random), 3)
        if program:
            # no curve: the sign of the origin, and no component
            draft.chunks.append(Chunk(ChunkType.LAYERS, program + b"\xff" * random.randint(1, 4)))
        _perhaps_ancillary(random, draft)
    return draft.file(*[Chunk(random.choice(UNKNOWN_TYPES), b"", True)] * (not draft.chunks))


def _more_layers(random: Random, draft: _Draft, taste: Taste, size: int) -> bytes | None:
    """Append a chunk of layers; the whole file if there can be none behind it."""
    progress = draft.progresses[-1].copy()
    program = any_program(random, progress, taste)
    if not program:
        return None
    start = draft.start(ChunkType.LAYERS, program)
    # in large domains curves are to begin late, at fine levels, every other time: first comes a stretch of 0s
    late = max(draft.head.shape) > LARGE and not draft.chunks and random.randrange(2) == 0
    lead = b"\xff" * random.randint(1, 4) if late else b""
    # now and then what goes wrong first
    run, found = grown(start, random, size, 1 if random.randrange(10) == 0 else TRIES, lead)
    if found.error is not None:
        return start + run if random.randrange(2) else draft.file(Chunk(ChunkType.LAYERS, program + run))
    whole = _finished(random, draft, program, run, found) if found.layers == progress.layers else None
    if whole is None:
        return draft.start(ChunkType.LAYERS, program) + run
    draft.chunks.append(whole)
    draft.progresses[-1] = progress
    return None


def _another_isovalue(random: Random, draft: _Draft) -> None:
    value, kind = any_isovalue(random, draft.isovalues)
    count = len(draft.isovalues)
    back = random.randint(0, count) if random.randrange(3) == 0 else 1
    far = random.randrange(16) == 0
    head = bytes([kind << 6 | FAR_LEAN]) + write_varint(back) if far else bytes([kind << 6 | back])
    payload = head + isovalue_bytes(value, kind)
    assert count < FAR_LEAN
    draft.chunks.append(Chunk(ChunkType.ISOVALUE, payload, checked=random.randrange(16) == 0))
    draft.isovalues.append(value)
    before = draft.progresses[-1]
    draft.progresses.append(before.begin(draft.progresses[-back] if back else None))


def _perhaps_ancillary(random: Random, draft: _Draft) -> None:
    if random.randrange(12):
        return
    kind, payload = random.choice((
        (random.choice(UNKNOWN_TYPES), random.randbytes(random.randint(0, 4))),
        (ChunkType.METADATA, b'{"a":"b"}'), (ChunkType.METADATA, b"[1"),
        (ChunkType.INDEX, random.randbytes(random.randint(0, 6))),
        (ChunkType.PROMISES, bytes(random.choice(((0,), (1, 1, 5), (2,), (0, 0, 1))))),
    ))
    draft.chunks.append(Chunk(kind, payload, True, random.randrange(4) == 0))


def _finished(random: Random, draft: _Draft, program: bytes, run: bytes, found: Probe) -> Chunk | None:
    """The chunk with a run that ends with its layers, by as many bytes as a run may have too few or too many."""
    place = len(draft.start(ChunkType.LAYERS, program))
    used = found.used - place
    checked = random.randrange(16) == 0
    for size in (used - random.choice((0, 0, 1, 2, 3, 4)), used):
        chunk = Chunk(ChunkType.LAYERS, program + run[: max(size, 0)].ljust(max(size, 0), b"\0"), checked=checked)
        again = probe(draft.file(chunk))
        if again.error is None and again.layers == found.layers:
            return chunk
    return None
