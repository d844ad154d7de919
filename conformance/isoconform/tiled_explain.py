"""An annotated dump of a file in tiles: head, directories and segments, byte by byte (spec clause 12).

Symbols are those of the tiles' files, which the dump of each shows: `isocodec edit --window` takes a tile out.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import pairwise

from isocodec.errors import FormatError
from isocodec.format.chunks import CHECKSUM_BYTES, read_envelope
from isocodec.format.header import HEAD_BYTES
from isocodec.tiles.head import read_head
from isocodec.tiles.layout import Index
from isocodec.tiles.leaf import read_leaf
from isocodec.tiles.numbers import Reader
from isocodec.tiles.structure import Head, Kind, Leaf, Root, TileStrand
from isospec.container import ChunkType, IsovalueKind

from .rows import Rows
from .tiled_dump import dump_tiled

KINDS = {Kind.BELOW: "below", Kind.ABOVE: "above", Kind.CODED: "coded"}
MASKS = {Kind.BELOW: "no sample missing, or nothing coded", Kind.ABOVE: "all samples missing", Kind.CODED: "coded"}


class _Walk(Rows):
    """Goes through a file and notes what its bytes are."""

    def read(self) -> None:
        head, root = read_head(self.data[:HEAD_BYTES])
        self._head(head, root)
        leaves = []
        for number, block in enumerate(head.grid.all_blocks()):
            start, end = root.leaves[number : number + 2].tolist()
            members = [tuple(index) for index in head.grid.members(block).tolist()]
            if end > len(self.data):
                return
            leaf = read_leaf(head, self.data[start:end], len(members), start)
            self._leaf(head, block, members, leaf, start, end, int(root.checksums[number]))
            leaves.append((members, leaf))
        for area in range(head.areas):
            for members, leaf in leaves:
                self._area(head, area, members, leaf)

    def _head(self, head: Head, root: Root) -> None:
        note, data = self.note, self.data
        length = int.from_bytes(data[6:8], "big")
        reader = Reader(data, 8, length)
        note(4, "signature (12.3)")
        note(5, f"writer version {data[4] >> 4}, read version {data[4] & 15} (3.3.1)")
        about = ["masked"] * head.masked + ["scaled"] * (head.scale is not None)
        note(6, ", ".join([*about, f"{head.grid.n} axes", f"profile {head.profile.name.lower()} (12.3.1)"]))
        note(8, f"{length} bytes of head and root directory")
        for _ in head.grid.shape:
            reader.number()
        note(reader.at, f"shape {' x '.join(map(str, head.grid.shape))}")
        counts = " x ".join(map(str, head.grid.counts))
        note(reader.at + 1, f"tiles of {1 << head.grid.exponent} samples: {counts} (12.2(1))")
        note(reader.at + 2, f"blocks of {1 << head.grid.block} tiles along each axis (12.2(4))")
        note(reader.at + 3, f"{len(head.stages)} stages (12.3.2)")
        for number, stage in enumerate(head.stages):
            more = ", geometry" * stage.geometry + ", adaptive" * stage.adaptive
            note(reader.at + 4 + number, f"stage {number}: cubes of {1 << stage.edge} samples{more}")
        reader.bytes(3 + len(head.stages))
        if head.scale is not None:
            reader.scale()
            note(reader.at, f"scale {head.scale!r}")
        reader.number()
        note(reader.at, f"{len(head.isovalues)} isovalues")
        for number, isovalue in enumerate(head.isovalues):
            kind = IsovalueKind(data[reader.at]).name.lower()
            reader.isovalue()
            note(reader.at, f"isovalue {number}: {isovalue!r}, as {kind} (3.3.4)")
        if head.together > 1:
            reader.number()
            note(reader.at, f"groups of {head.together} isovalues (12.3.1(5))")
        size = reader.number()
        note(reader.at, f"{size} bytes of metadata")
        reader.bytes(size)
        note(reader.at, "metadata (3.7.2)")
        for block in head.grid.all_blocks():
            length_of = reader.number()
            note(reader.at, f"block {_spoken(block)}: leaf directory of {length_of} bytes (12.4(2))")
            reader.bytes(CHECKSUM_BYTES)
            note(reader.at, "its CRC-32")
            sizes = [reader.number() for _ in range(head.areas)]
            note(reader.at, f"bytes of its segments by area: {', '.join(map(str, sizes))}")
        note(length, "CRC-32 of the head (12.3.1)")

    def _leaf(
        self, head: Head, block: Index, members: list[Index], leaf: Leaf, start: int, end: int, stated: int
    ) -> None:
        reader = Reader(self.data, start, end)
        right = zlib.crc32(self.data[start:end])
        wrong = "" if right == stated else f"; its CRC-32 is {right:08x}, stated {stated:08x}"
        for strand in range(head.strands):
            of, names = _strand(head, strand)
            done = 0
            while done < len(members):
                number = reader.number()
                kind, count = Kind(number & 3), (number >> 2) + 1
                about = f"block {_spoken(block)}, {of}: {count} tiles from {_spoken(members[done])}, {names[kind]}"
                self.note(reader.at, about + wrong + " (12.5(1))")
                wrong = ""
                for index in members[done : done + count] if kind == Kind.CODED else ():
                    lengths = [reader.number() for _ in head.areas_of(strand)]
                    self.note(reader.at, f"tile {_spoken(index)}: segments of {', '.join(map(str, lengths))} bytes")
                done += count
        for area in range(head.areas):
            part, stage = _owner(head, leaf, area)
            for first, last in pairwise(part.groups[stage].tolist()):
                reader.bytes(CHECKSUM_BYTES)
                ends = (members[part.coded[at]] for at in (first, last - 1))
                tiles = " to ".join(map(_spoken, ends))
                self.note(reader.at, f"CRC-32 of a group: {_area(head, area)}, tiles {tiles} (12.5(3))")

    def _area(self, head: Head, area: int, members: list[Index], leaf: Leaf) -> None:
        strand, stage = _owner(head, leaf, area)
        lengths = strand.lengths[:, stage]
        groups, wrong = {int(first): number for number, first in enumerate(strand.groups[stage][:-1])}, ""
        for at, (position, length) in enumerate(zip(strand.coded.tolist(), lengths.tolist(), strict=True)):
            here = self.at
            if at in groups:
                first, last = strand.groups[stage][groups[at] : groups[at] + 2].tolist()
                whole = self.data[here : here + int(lengths[first:last].sum())]
                right, stated = zlib.crc32(whole), int(strand.checksums[stage][groups[at]])
                wrong = "" if right == stated else f"; the CRC-32 of its group is {right:08x}, stated {stated:08x}"
            if length:
                segment, index = self.data[here : here + length], members[position]
                self.note(here + length, f"{_area(head, area)}, tile {_spoken(index)}: {_chunks(segment)}{wrong}")


def _chunks(segment: bytes) -> str:
    """What a segment holds, chunk by chunk."""
    found, at = [], 0
    try:
        while at < len(segment) and (chunk := read_envelope(segment, at)) is not None:
            known = chunk.type in [*ChunkType]
            name = ChunkType(chunk.type).name.lower().replace("_", " ") if known else f"of type {chunk.type}"
            found.append(f"chunk {name}, payload of {chunk.end - chunk.start} bytes")
            at = chunk.end + CHECKSUM_BYTES * chunk.checked
    except FormatError as error:
        found.append(error.message)
    return "; ".join(found) or "no whole chunk"


def _strand(head: Head, strand: int) -> tuple[str, dict[Kind, str]]:
    if head.masked and strand == 0:
        return "mask", MASKS
    return f"isovalue {strand - head.masked}", KINDS


def _owner(head: Head, leaf: Leaf, area: int) -> tuple[TileStrand, int]:
    """The strand of an area, and its stage."""
    if area < head.masked:
        return leaf[0], 0
    stage, isovalue = divmod(area - head.masked, len(head.isovalues))
    return leaf[isovalue + head.masked], stage


def _area(head: Head, area: int) -> str:
    if area < head.masked:
        return "mask"
    stage, isovalue = divmod(area - head.masked, len(head.isovalues))
    return f"stage {stage}, isovalue {isovalue}"


def _spoken(index: Index) -> str:
    return f"({', '.join(map(str, index))})"


def explained_tiled(data: bytes) -> Iterator[str]:
    """The lines of an annotated dump."""
    yield from _Walk(data).lines()
    output = dump_tiled(data)
    about = "complete" if output.error is None else str(output.error)
    yield f"exit code {output.exit_code}, {sum(output.symbols.values())} symbols: {about}"
