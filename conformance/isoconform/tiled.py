"""Vectors of files in tiles (clause 12): as the encoder writes them, put together otherwise, and wrong ones."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from isocodec import save
from isocodec.format.chunks import CHECKSUM_BYTES
from isocodec.storage.ranges import ranges_of
from isocodec.tiles.first_stages import first_stages
from isocodec.tiles.tiled import TiledFile as Tiles
from isospec.container import Checksum, ChunkType, Double, write_varint

from .adaptive import SPACES
from .draft import Draft
from .fields import Integers, Shape, balls, waves
from .isovalues import HIGH
from .special import UNKNOWN
from .streams import Chunk, split
from .tiled_damage import in_parts
from .tiled_file import CODED, GROUP, Block, Run, TiledFile, summed

EDGE = 32
"""Steps along a side of the tiles of all vectors, the least that there is."""
VALUE = 21
HALVES = 0
"""The kind of isovalue that is an integer of halves."""


def _tiled(name: str, field: ArrayLike, isovalue: float | Sequence[float], about: str, **options) -> Draft:
    """A vector as the reference encoder writes it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tiled.iso"
        defaults = {"profile": "baseline", "precision": "exact" if "step" not in options else None, "tile": EDGE}
        save(path, field, isovalue, **{**defaults, **options})
        data = path.read_bytes()
        file = Tiles(ranges_of(data))
        file.head = replace(file.head, metadata={})  # but for what it promises
        data = b"".join(first_stages(file, len(file.head.stages)))
        return Draft(name, data, np.ndim(field), ("file in tiles", f"tiles: {about}"))


def _spots(shape: Shape, *centres: tuple[int, ...]) -> Integers:
    """Small balls, far from one another."""
    return balls(shape, [(tuple(2 * x for x in centre), 9) for centre in centres])


def encoded() -> Iterator[Draft]:
    """As the reference encoder writes them."""
    for shape in ((70, 101), (52, 51, 8)):
        n, space = len(shape), SPACES[len(shape)]
        small = shape if n == 2 else (50, 9, 11)
        hills = waves(small, HIGH, 4)
        gone = np.zeros(small, np.bool_)
        gone[tuple(slice(5, size // 2) for size in small)] = True
        gone[-17:, -40:] = True
        signs = {"precision": "signs"}
        yield _tiled(f"{space}_exact", hills, VALUE, "values")
        yield _tiled(f"{space}_main", hills, VALUE, "the main profile", profile="main")
        yield _tiled(f"{space}_offsets", hills, VALUE, "offsets", precision=0.05, profile="main")
        yield _tiled(f"{space}_signs", waves(shape, HIGH, 4), VALUE, "signs, sides that are no multiples", **signs)
        yield _tiled(f"{space}_isovalues", hills, (VALUE, VALUE + 4.5, 1e9), "several isovalues", **signs)
        yield _tiled(f"{space}_leaning", hills, (VALUE, 1e9, VALUE + 2, VALUE - 3), "values of isovalues that lean")
        yield _tiled(
            f"{space}_independent", hills, (VALUE, VALUE + 2), "independent isovalues", order="independent", **signs
        )
        yield _tiled(
            f"{space}_leaning_main", np.ma.masked_array(hills / 8, gone), (VALUE / 8, VALUE / 8 + 1.3),
            "isovalues that lean, a scale, missing samples", precision="step=0.25", profile="main",
        )
        yield _tiled(f"{space}_missing", np.ma.masked_array(hills, gone), VALUE, "missing samples")
        steps = np.where(gone, np.nan, hills / 8)
        yield _tiled(f"{space}_steps", steps, VALUE / 8, "a scale, missing samples", precision="step=0.25")
        yield _tiled(f"{space}_empty", hills, 1e9, "no curve")
    yield _tiled(
        "plane_together", waves((33, 70), HIGH, 4), [VALUE + 3 * i for i in range(11)], "groups of isovalues",
        precision="signs",
    )
    yield _tiled(
        "plane_descending", waves((33, 20), HIGH, 4), (VALUE + 4.5, VALUE), "isovalues in descending order",
        precision="signs",
    )
    yield _tiled("plane_tenths", waves((33, 20), HIGH, 4) / 8, 2.7, "a scale of 0.3", precision="step=0.3")
    yield _tiled("plane_128", waves((150, 20), HIGH, 4), VALUE, "sides of two bytes", precision="signs", tile=128)
    yield _tiled("plane_adaptive", 40 * waves((70, 101), HIGH, 4), 40 * VALUE, "an adaptive stage", precision=1.0)
    yield _tiled(
        "space_adaptive", balls((33, 66, 36), [((34, 60, 40), 23), ((30, 90, 30), 12)]), -0.5,
        "an adaptive stage in space", precision=1.0, profile="main",
    )
    for name, shape, centres in (
        ("plane_leaves", (1100, 1170), [(40, 50), (1024, 30), (500, 1024), (1050, 1100)]),
        ("space_leaves", (300, 34, 18), [(30, 20, 9), (256, 10, 9)]),
    ):
        about = "runs, several leaf directories"
        yield _tiled(name, _spots(shape, *centres), -0.5, about, precision="signs")
    for name, shape in (("plane_narrow", (2, 90)), ("plane_last", (49, 50)), ("space_last", (50, 5, 7))):
        yield _tiled(name, waves(shape, HIGH, 4), VALUE, "partial tiles")


def _opened(draft: Draft) -> Tiles:
    return Tiles(ranges_of(draft.data))


def _segments(data: bytes) -> list[bytes]:
    """The chunks of a tile's file, the last one apart."""
    return [chunk.enveloped() for chunk in split(data).chunks[:-1]]


def _morton(extent: Shape) -> list[Shape]:
    """Indices in Morton order."""
    bits = range(max(extent).bit_length() - 1, -1, -1)
    return sorted(np.ndindex(*extent), key=lambda index: [(x >> bit) & 1 for bit in bits for x in index])


def written(n: int, block: int, stages: int) -> TiledFile:
    """A file of other blocks and stages than the encoder's, one run for each tile."""
    shape = (70, 150) if n == 2 else (50, 8, 83)
    spots = _spots(shape, *(((30, 30), (32, 90), (64, 120)) if n == 2 else ((30, 4, 31), (40, 3, 64))))
    file = _opened(_tiled("", spots, -0.5, "", precision="signs"))
    counts = file.head.grid.counts
    blocks = []
    for first in _morton(tuple(-(-m >> block) if block else m for m in counts)):
        origin = [x << block for x in first]
        extent = tuple(min(1 << block, m - o) for m, o in zip(counts, origin, strict=True))
        runs = []
        for index in _morton(extent):
            chunks = _segments(file.plain(tuple(np.add(origin, index).tolist())))
            parts = [b"".join(chunks[: len(chunks) - stages + 1]), *chunks[len(chunks) - stages + 1 :]]
            runs.append(Run(CODED, 1, [parts]) if chunks else Run(0, 1))
        blocks.append(Block([runs], stages))
    isovalue = bytes([HALVES]) + bytes([1])
    return TiledFile(shape, 5, block, bytes([2, 0])[-stages:], [isovalue], blocks)


def _filled(segment: bytes, size: int) -> bytes:
    """A segment with as much of an unknown ancillary chunk behind it as it takes."""
    # the chunk has a byte of its type and two of its length
    filler = Chunk(UNKNOWN, bytes(size - len(segment) - 3), ancillary=True).enveloped()
    return segment + filler


def grouped() -> TiledFile:
    """A file with areas whose first segment just fills a group; of the second area nothing is left behind it."""
    spots = _spots((33, 65), (16, 16), (16, 48))
    file = _opened(_tiled("", spots, -0.5, "", precision="signs"))
    (*coarse, fine), (*more, _) = (_segments(file.plain(index)) for index in ((0, 0), (0, 1)))
    tiles = [[_filled(b"".join(coarse), GROUP), _filled(fine, GROUP)], [b"".join(more), b""]]
    return TiledFile((33, 65), 5, 1, bytes([2, 0]), [bytes([HALVES, 1])], [Block([[Run(CODED, 2, tiles)]], 2)])


def others() -> Iterator[Draft]:
    """Put together otherwise, and what readers take no offence at."""
    for n in (2, 3):
        for block, stages, about in ((0, 1, "blocks of one tile, one stage"), (1, 2, "small blocks, two stages")):
            name = f"{SPACES[n]}_blocks_{block}"
            yield Draft(name, bytes(written(n, block, stages)), n, ("file in tiles", f"tiles: {about}"))
    file = written(2, 2, 2)
    plain = bytes(file)
    for name, about, data in (
        ("metadata", "metadata that is no JSON", replace(file, metadata=b"none")),
        ("writer", "a later writer version", replace(file, version=0x31)),
        ("stage_bits", "stages that layers do not lead to", replace(file, stages=bytes([0xCF, 0x80]))),
        ("behind", "bytes behind the last segment", plain + b"more"),
        ("groups", "segments that fill a group, and empty ones behind", bytes(grouped())),
        ("wide", "more samples along an axis than a file without tiles may have", bytes(
            replace(file, shape=(2, 2**24 + 100), exponent=20, block=5, blocks=[Block([[Run(0, 17)]], 2)])
        )),
    ):
        yield Draft(f"plane_{name}", bytes(data), 2, ("file in tiles", f"tiles: {about}"))


def _harmed(part: bytes, data: bytes) -> bytes:
    """A file with a bit of the first byte of a part changed."""
    return _changed(data, data.index(part))


def _changed(data: bytes, at: int) -> bytes:
    """Bytes with a bit of one of them changed."""
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def _lying(file: TiledFile) -> bytes:
    """A file whose root directory says of the first block's last two areas what is not so."""
    entry = bytearray(replace(file, blocks=file.blocks[:1]).root())
    entry[-2:] = entry[-1], entry[-2]
    data = bytes(file)
    return file.head(bytes(entry) + file.root()[len(entry) :]) + data[len(file.head(file.root())) :]


def _critical(run: Run, at: Run) -> Run:
    """The same run, but of the run ``at`` with another type of its first chunk."""
    if run is not at:
        return run
    first, *rest = run.segments[0]
    return replace(run, segments=[[b"\x1f" + first[1:], *rest]])


def wrong() -> Iterator[tuple[str, str, str, bytes]]:
    """Names, the clause that is violated, how, and files."""
    file = written(2, 2, 2)
    block = file.blocks[0]
    plain, leaf = bytes(file), block.leaf()
    size = len(file.head(file.root()))
    segment = next(segment for area in block.areas() for segment in area)

    def other(first: Block) -> bytes:
        return bytes(replace(file, blocks=[first, *file.blocks[1:]]))

    def runs(*changed: Run) -> Block:
        return replace(block, channels=[[*changed, *block.channels[0][len(changed) :]]])

    yield "head_checksum", "12.3", "the head has a wrong checksum", _harmed(plain[size - 1 : size + 3], plain)
    yield "head_long", "12.3", "a head of 32767 bytes, which the file has not", plain[:6] + b"\x7f\xff" + plain[8:]
    yield "leaf_checksum", "12.4", "a leaf directory has a wrong checksum", _harmed(leaf, plain)
    yield "group_checksum", "12.5", "a group of segments has a wrong checksum", _harmed(segment, plain)
    yield "version", "3.3.1", "a later read version", bytes(replace(file, version=2))
    yield "draft", "3.3.1", "the read version of drafts", bytes(replace(file, version=0x10))
    yield "flag", "12.3", "an unknown flag", bytes(replace(file, flags=8))
    yield "profile", "12.3", "an unknown profile", bytes(replace(file, flags=2))
    yield "stage", "12.3", "an unknown bit of a stage", bytes(replace(file, stages=bytes([0x12, 0])))
    yield "edge", "12.3", "tiles of 16 samples", bytes(replace(file, exponent=4))
    yield "block", "12.3", "blocks of too many tiles", bytes(replace(file, block=11))
    yield "blocks", "12.3", "too many blocks", bytes(replace(file, block=0, shape=(2, 32 * 3400)))
    yield "isovalues", "12.3", "no isovalue", bytes(replace(file, isovalues=[], blocks=[]))
    yield "group_none", "12.3", "groups of no isovalues", bytes(replace(file, flags=0x40))
    yield "group_long", "12.3", "groups of 257 isovalues", bytes(replace(file, together=257))
    yield "isovalue", "3.3.4", "an isovalue that is no number", bytes(
        replace(file, isovalues=[b"\2" + Double.build(float("nan"))])
    )
    yield "scale", "12.3", "a scale of 0", bytes(replace(file, scale=0.0))
    yield "root_leftover", "12.3", "bytes behind the root directory", file.head(file.root() + b"\0") + plain[size:]
    yield "root_short", "12.4", "a root directory that ends too early", file.head(file.root()[:-2]) + plain[size:]
    yield "run", "12.5", "a run with more tiles than are left", other(runs(Run(0, 100)))
    yield "run_long", "12.5", "a run of 2**50 tiles", other(runs(Run(0, 2**50)))
    yield "kind", "12.5", "tiles of kind 3", other(runs(Run(3, 1)))
    missing = [run for run in block.channels[0] if run.kind == CODED]
    yield "leaf_short", "12.5", "a leaf directory that ends too early", other(replace(block, channels=[missing]))
    yield "sizes", "12.4", "segments of other lengths than the root directory says", _lying(file)
    yield "tile", "3.5.2", "an unknown critical chunk in a segment", other(
        replace(block, channels=[[_critical(run, missing[0]) for run in block.channels[0]]])
    )


def _pair(mask: bytes | None = None) -> tuple[TiledFile, list[list[bytes]]]:
    """A file of one tile at two isovalues of a group, and their segments; ``mask`` comes behind that of a mask."""
    field = waves((33, 33), HIGH, 4)
    gone = np.zeros(field.shape, np.bool_)
    gone[5:9, 4:20] = mask is not None
    draft = _tiled("", np.ma.masked_array(field, gone), (VALUE, VALUE + 2), "", precision="signs")
    file = in_parts(draft.data, [bytes([HALVES, 4 * VALUE]), bytes([HALVES, 4 * (VALUE + 2)])])
    masks, own = file.blocks[0].channels[: file.blocks[0].masked], file.blocks[0].channels[-2:]
    for channel in masks:
        channel[0].segments[0][0] += mask or b""
    return file, [channel[0].segments[0] for channel in own]


def _turned(stage: int, *segments: bytes | None, mask: bytes | None = None) -> bytes:
    """That file with other segments of a stage, both isovalues'; None: with its own."""
    file, own = _pair(mask)
    for found, segment in zip(own, segments, strict=True):
        found[stage] = found[stage] if segment is None else segment
    return bytes(file)


def _turn(*numbers: int) -> bytes:
    return Chunk(ChunkType.TURN, b"".join(map(write_varint, numbers))).enveloped()


def turns() -> Iterator[Draft]:
    """Chunks of other types than layers in segments: turns, further isovalues, a series."""
    _, (first, second) = _pair()
    further = Chunk(ChunkType.ISOVALUE, bytes([HALVES, 4 * VALUE + 16])).enveloped()
    series = Chunk(ChunkType.SERIES, b"\0").enveloped()
    tiles = "file in tiles"
    moved = _turned(-1, first[-1] + _turn(1, 1) + second[-1], b"")
    yield Draft("tiled_plane_turns", moved, 2, (tiles, "tiles: a turn within a segment, an empty segment behind it"))
    last = _turned(-1, None, second[-1] + further)
    yield Draft("tiled_plane_further", last, 2, (tiles, "tiles: a further isovalue in the last segment"))
    empty, own = _pair()
    own[1][-2] += further
    own[0][-1] = own[1][-1] = b""
    for name, clause, how, data in (
        ("turn_ended", "3.5.9", "a turn before an empty segment, of an isovalue without more layers", bytes(empty)),
        ("turn_none", "3.5.9", "a turn without numbers", _turned(-1, _turn(), None)),
        ("turn_short", "3.5.9", "a turn of one number", _turned(-1, _turn(0), None)),
        ("turn_long", "3.5.9", "a turn of three numbers", _turned(-1, _turn(0, 1, 0), None)),
        ("turn_zero", "3.5.9", "a turn of no isovalues", _turned(-1, _turn(0, 0), None)),
        ("turn_beyond", "3.5.9", "a turn of an isovalue that has not begun", _turned(-1, _turn(2, 1), None)),
        ("turn_far", "3.5.9", "a turn of which the last isovalue has not begun", _turned(-1, _turn(1, 2), None)),
        ("turn_series", "3.5.7", "a series behind a turn", _turned(0, series + first[0], None)),
        ("mask_series", "3.5.9", "turns in a series", _turned(0, None, None, mask=series)),
    ):
        yield Draft(f"bad_tiled_{name}", data, 2, (f"refused: {how}",), clause)


MANY = 65537
"""Tiles of a file whose text decoders under test do not make (annex B.4)."""


def _many(**changes: object) -> TiledFile:
    """A row of more tiles than a text may have, all without a curve, in blocks of 1024."""
    blocks = [Block([[Run(0, min(1024, MANY - first))]], 1) for first in range(0, MANY, 1024)]
    file = TiledFile((2, EDGE * MANY), 5, 10, bytes([0]), [bytes([HALVES, 1])], blocks)
    return replace(file, **changes)  # type: ignore[arg-type]


def many() -> Iterator[Draft]:
    """More tiles than a text may have: what is wrong with head, root or the file's end comes before, all else after."""
    plain = bytes(_many())
    leaf = _many().blocks[0].leaf()
    too_many, wrong_leaf = "tiles: more than 65536", "tiles: more than 65536, and a wrong leaf directory"
    yield Draft("tiled_plane_many", plain, 2, ("file in tiles", too_many))
    yield Draft("tiled_plane_many_wrong", _harmed(leaf, plain), 2, ("file in tiles", wrong_leaf))
    yield Draft("tiled_cut_many", plain[:-1], 2, ("file in tiles", "tiles: more than 65536, and cut off"))
    refused = ("refused: more than 65536 tiles, and a wrong flag",)
    yield Draft("bad_tiled_many", bytes(_many(flags=8)), 2, refused, "12.3")


def _with_leaf(file: TiledFile, leaf: bytes) -> bytes:
    """A file of one block with another leaf directory, whose length and checksum the root directory has."""
    own, root = file.blocks[0].leaf(), file.root()
    entry = len(write_varint(len(own))) + CHECKSUM_BYTES
    behind = bytes(file)[len(file.head(root)) + len(own) :]
    return file.head(write_varint(len(leaf)) + Checksum.build(zlib.crc32(leaf)) + root[entry:]) + leaf + behind


def only_wrong() -> Iterator[tuple[str, str, str, bytes]]:
    """Names, clauses, how, and files with nothing else wrong: who does not look decodes all tiles."""
    file = written(2, 3, 2)
    plain, leaf, root = bytes(file), file.blocks[0].leaf(), file.root()
    (runs,) = file.blocks[0].channels
    behind = plain[len(file.head(root)) :]
    at = len(write_varint(len(leaf)))
    yield "block_all", "12.3", "one block of too many tiles", bytes(written(2, 11, 2))
    yield "leaf_sum", "12.4", "another checksum of a leaf directory", file.head(_changed(root, at)) + behind
    yield "group_sum", "12.5", "another checksum of a group", _with_leaf(file, _changed(leaf, len(leaf) - 1))
    yield "leaf_number", "12.5", "a number not in its shortest form", _with_leaf(file, b"\x80" + leaf)
    yield "leaf_number_long", "12.5", "a number of ten bytes", _with_leaf(file, b"\xff" * 9 + b"\1" + leaf)
    coded = next(i for i, run in enumerate(runs) if run.kind == CODED)
    ahead = b"".join(map(bytes, runs[:coded])) + write_varint(CODED)
    yield "leaf_far", "12.5", "a segment of 2**40 bytes", _with_leaf(file, ahead + write_varint(1 << 40) + leaf)
    head = file.head(root)[: -len(root) - CHECKSUM_BYTES - 1]
    yield "metadata_long", "12.3", "metadata longer than the head", summed(head + b"\x7f" + root) + behind
    yield "leaf_leftover", "12.5", "bytes behind a leaf directory's checksums", _with_leaf(file, leaf + b"\0")
    yield "sizes_last", "12.4", "a last area shorter than its segments", file.head(_less(root)) + behind
    yield "run_last", "12.5", "a last run with a tile too many", bytes(
        replace(file, blocks=[replace(file.blocks[0], channels=[[*runs[:-1], Run(0, runs[-1].tiles + 1)]])])
    )


def _less(root: bytes) -> bytes:
    """A root directory that says one byte less of the last area."""
    return root[:-1] + bytes([root[-1] - 1])


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for draft in (*encoded(), *others()):
        yield replace(draft, name=f"tiled_{draft.name}")
    for name, clause, how, data in (*wrong(), *only_wrong()):
        yield Draft(f"bad_tiled_{name}", data, 2, (f"refused: {how}",), clause)
    yield from many()
    yield from turns()
    file = written(2, 2, 2)
    plain, root = bytes(file), file.root()
    far = write_varint(2**45) + root[len(write_varint(len(file.blocks[0].leaf()))) :]
    data = file.head(far) + plain[len(file.head(root)) :]
    yield Draft("tiled_cut_far", data, 2, ("file in tiles", "tiles: a leaf directory of 2**45 bytes, as the root says"))
    later = bytes(replace(file, version=2))[:20]
    yield Draft("tiled_cut_version", later, 2, ("file in tiles", "tiles: a later version that ends within its head"))
    for name, size in (("start", 6), ("head", 20), ("leaf", len(plain) // 2), ("segment", len(plain) - 1)):
        yield Draft(f"tiled_cut_{name}", plain[:size], 2, ("file in tiles", f"tiles: ends within a {name}"))
