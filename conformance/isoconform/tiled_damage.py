"""Files in tiles (spec clause 12) for fuzzing: small ones of random fields, whole, and with something changed."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np

from isocodec import save
from isocodec.errors import FormatError
from isocodec.format.chunks import CHECKSUM_BYTES
from isocodec.storage.ranges import ranges_of
from isocodec.tiles.structure import Kind
from isocodec.tiles.tiled import TiledFile as Reader
from isospec.container import Checksum, write_varint

from .tiled_file import CODED, Block, Run, TiledFile

SHAPES = (33, 34), (49, 50), (70, 40), (50, 5, 7), (34, 50, 6), (20, 66)
OPTIONS: tuple[dict[str, object], ...] = (
    {"precision": "signs"}, {"precision": "exact"}, {"precision": 0.1}, {"precision": "signs", "profile": "baseline"},
    {"precision": "exact", "profile": "baseline"},
)
EDGE = 32
HEAD_SIZE = slice(6, 8)
"""Where a head says how long it is."""


def any_tiled(random: Random) -> bytes:
    """A file in tiles of a random field, mostly damaged."""
    return damaged(random, encoded(random))


def damaged(random: Random, file: TiledFile) -> bytes:
    """A file, mostly damaged; its parts are changed."""
    for _ in range(random.choice((0, 1, 1, 1, 2, 3))):
        file = random.choice(CHANGES)(random, file)
    data = bytes(file)
    if random.randrange(4) == 0:
        data = _patched(random, data)
    return data


def encoded(random: Random) -> TiledFile:
    """A valid file, in parts."""
    shape = random.choice(SHAPES)
    dice = np.random.default_rng(random.randrange(1 << 30))
    field = np.zeros(shape, np.int64)
    for axis, size in enumerate(shape):
        wave = np.rint(9 * np.sin(np.arange(size) / dice.uniform(2, 9) + dice.uniform(0, 6))).astype(np.int64)
        field += wave.reshape([-1 if a == axis else 1 for a in range(len(shape))])
    gone = np.zeros(shape, np.bool_)
    if random.randrange(3) == 0:
        gone[tuple(slice(0, random.randint(1, size)) for size in shape)] = True
    halves = random.sample(range(-9, 10), random.choice((1, 1, 2)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tiled.iso"
        options = random.choice(OPTIONS)
        save(path, np.ma.masked_array(field, gone), [h / 2 for h in halves], tile=EDGE, **options)  # type: ignore[arg-type]
        return in_parts(path.read_bytes(), [bytes([0]) + write_varint(2 * h if h >= 0 else -2 * h - 1) for h in halves])


def in_parts(data: bytes, isovalues: list[bytes]) -> TiledFile:
    """A valid file in parts; of its isovalues kind and bytes are given."""
    reader = Reader(ranges_of(data))
    head = reader.head
    blocks = []
    for number, block in enumerate(head.grid.all_blocks()):
        (leaf,) = reader.leaves([number])
        channels: list[list[Run]] = [[] for _ in range(head.strands)]
        for at, index in enumerate(map(tuple, head.grid.members(block).tolist())):
            found = [reader.tiles([index], i, len(head.stages) - 1)[0] for i in range(len(isovalues))]
            segments = [[found[0].mask]] * head.masked + [tile.of(i) for i, tile in enumerate(found)]
            for channel, strand, own in zip(channels, leaf, segments, strict=True):
                kind = int(strand.kinds_at(np.array([at]))[0])
                channel.append(Run(kind, 1, [own] if kind == Kind.CODED else []))
        blocks.append(Block([*channels], len(head.stages), head.masked))
    stages = bytes(s.geometry << 7 | s.adaptive << 6 | s.edge for s in head.stages)
    flags = head.masked << 7 | int(head.profile)
    grid = head.grid
    return TiledFile(
        grid.shape, grid.exponent, grid.block, stages, isovalues, blocks, flags, together=head.together
    )


def tiles_of(data: bytes) -> int:
    """How many tiles a file has; none if its head is wrong."""
    try:
        return Reader(ranges_of(data)).head.grid.total
    except FormatError:
        return 0


def _runs(file: TiledFile) -> list[Run]:
    return [run for block in file.blocks for channel in block.channels for run in channel]


def _shape(random: Random, file: TiledFile) -> TiledFile:
    """Another side."""
    sides = list(file.shape)
    axis = random.randrange(len(sides))
    side = sides[axis]
    sides[axis] = random.choice((0, 1, max(side - 1, 0), side + 1, side + EDGE, 1 << 20, 1 << 40, 1 << 41))
    return replace(file, shape=tuple(sides))


def _numbers(random: Random, file: TiledFile) -> TiledFile:
    """Other widths of tiles or blocks, other stages."""
    match random.randrange(3):
        case 0:
            return replace(file, exponent=random.choice((0, 4, 5, 6, 19, 20, 21, 255)))
        case 1:
            return replace(file, block=random.choice((0, 1, 2, 6, 7, 10, 11, 255)))
    stages = bytearray(file.stages)
    stages[random.randrange(len(stages))] = random.randrange(256)
    return replace(file, stages=bytes(stages))


def _head(random: Random, file: TiledFile) -> TiledFile:
    """Other flags, versions, isovalues or metadata."""
    match random.randrange(4):
        case 0:
            return replace(file, flags=file.flags ^ 1 << random.randrange(8))
        case 1:
            return replace(file, version=random.randrange(256))
        case 2:
            return replace(file, isovalues=[*file.isovalues, random.randbytes(random.randint(1, 9))])
    return replace(file, metadata=random.randbytes(random.randint(1, 40)))


def _run(random: Random, file: TiledFile) -> TiledFile:
    """A run of another kind, or of more tiles; with the tiles of others or none."""
    runs = _runs(file)
    run, other = random.choice(runs), random.choice(runs)
    match random.randrange(3):
        case 0:
            run.tiles = random.choice((2, 3, 5, 1 << 20, 1 << 40))
        case 1:
            run.kind, run.segments = random.randrange(4), run.segments
        case 2 if len(run.segments) == len(other.segments) == 1 and len(run.segments[0]) == len(other.segments[0]):
            run.segments = other.segments
    return file


def _segment(random: Random, file: TiledFile) -> TiledFile:
    """A segment with other bytes, and the right checksums: tiles' decoders get to see it."""
    coded = [run for run in _runs(file) if run.kind == CODED and run.segments]
    if coded:
        run = random.choice(coded)
        segments = [list(each) for each in run.segments]
        own = random.choice(segments)
        stage = random.randrange(len(own))
        data = bytearray(own[stage])
        at = random.randint(0, len(data))
        match random.randrange(4):
            case 0:
                data[at:at] = random.randbytes(random.randint(1, 4))
            case 1:
                del data[at : at + random.randint(1, 9)]
            case 2:
                data = bytearray()
            case _ if at < len(data):
                data[at] ^= 1 << random.randrange(8)
        own[stage] = bytes(data)
        run.segments = segments
    return file


CHANGES: tuple[Callable[[Random, TiledFile], TiledFile], ...] = (_shape, _numbers, _head, _run, _segment, _segment)


def _patched(random: Random, data: bytes) -> bytes:
    """A byte changed, put in or taken out anywhere, mostly with the head's checksum repaired; or something behind."""
    out = bytearray(data)
    at = random.randrange(len(out))
    match random.randrange(4):
        case 0:
            out[at:at] = random.randbytes(1)
        case 1:
            del out[at]
        case 2:
            out += random.randbytes(3)
        case _:
            out[at] = random.randrange(256)
    size = int.from_bytes(out[HEAD_SIZE], "big")
    if random.randrange(3) and CHECKSUM_BYTES < size <= len(out):
        out[size - CHECKSUM_BYTES : size] = Checksum.build(zlib.crc32(out[: size - CHECKSUM_BYTES]))
    return bytes(out)
