"""Files in tiles (spec clause 12) put together from what their directories say, right or wrong."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from isospec.container import Checksum, Double, write_varint

from .tiled_dump import SIGNATURE

CODED = 2
GROUP = 1024


def summed(data: bytes) -> bytes:
    """Bytes with their CRC-32 behind them."""
    return data + Checksum.build(zlib.crc32(data))


@dataclass
class Run:
    """Tiles of a kind that follow one another; of coded ones the segments of each, by stage."""

    kind: int
    tiles: int
    segments: list[list[bytes]] = field(default_factory=list)

    def __bytes__(self) -> bytes:
        lengths = [write_varint(len(segment)) for segments in self.segments for segment in segments]
        return write_varint(4 * (self.tiles - 1) + self.kind) + b"".join(lengths)


Channel = Sequence[Run]
"""The tiles of a block at an isovalue, or their masks."""


def groups(segments: Iterable[bytes]) -> list[bytes]:
    """Segments of an area of a block by what a checksum holds together (12.5(3))."""
    found, group = [], b""
    for segment in segments:
        group += segment
        if len(group) >= GROUP:
            found.append(group)
            group = b""
    return [*found, group] if group else found


@dataclass
class Block:
    """What a block has: its masks if the file has any, then its tiles at each isovalue."""

    channels: list[Channel]
    stages: int
    masked: bool = False

    def areas(self) -> list[list[bytes]]:
        """Segments by area: of the masks, then for each stage those of each isovalue."""
        columns = [[segments for run in channel for segments in run.segments] for channel in self.channels]
        masks, others = (columns[:1], columns[1:]) if self.masked else ([], columns)
        own = [[segments[stage] for segments in column] for stage in range(self.stages) for column in others]
        return [[segments[0] for segments in column] for column in masks] + own

    def leaf(self) -> bytes:
        """The leaf directory."""
        runs = b"".join(bytes(run) for channel in self.channels for run in channel)
        return runs + b"".join(Checksum.build(zlib.crc32(group)) for area in self.areas() for group in groups(area))


@dataclass
class TiledFile:
    """A file in tiles; ``bytes(file)`` puts it together.

    Attributes
    ----------
    shape, exponent, block : tuple of int, int, int
        As in 12.3.
    stages, isovalues : bytes, sequence of bytes
        A byte for each stage; of each isovalue its kind and itself.
    blocks : list of Block
        In Morton order.
    flags : int
        Bits 7, 5, 1 and 0.
    together : int
        Isovalues in a group.
    """

    shape: tuple[int, ...]
    exponent: int
    block: int
    stages: bytes
    isovalues: Sequence[bytes]
    blocks: list[Block]
    flags: int = 0
    scale: float | None = None
    metadata: bytes = b""
    version: int = 0x11
    together: int = 1

    def head(self, root: bytes) -> bytes:
        """Head and root directory."""
        flags = self.flags | (len(self.shape) - 2) << 2 | (self.scale is not None) << 5 | (self.together > 1) << 6
        sides = b"".join(map(write_varint, self.shape))
        fields = sides + bytes([self.exponent, self.block, len(self.stages)]) + self.stages
        fields += b"" if self.scale is None else Double.build(self.scale)
        fields += write_varint(len(self.isovalues)) + b"".join(self.isovalues)
        fields += write_varint(self.together) if self.together > 1 else b""
        fields += write_varint(len(self.metadata)) + self.metadata + root
        size = len(SIGNATURE) + 4 + len(fields) + 4
        return summed(SIGNATURE + bytes([self.version, flags]) + size.to_bytes(2, "big") + fields)

    def root(self) -> bytes:
        """The root directory."""
        entries = b""
        for block in self.blocks:
            leaf, sizes = block.leaf(), [sum(map(len, area)) for area in block.areas()]
            entries += write_varint(len(leaf)) + Checksum.build(zlib.crc32(leaf)) + b"".join(map(write_varint, sizes))
        return entries

    def __bytes__(self) -> bytes:
        leaves = b"".join(block.leaf() for block in self.blocks)
        areas = zip(*(block.areas() for block in self.blocks), strict=True)
        segments = b"".join(segment for area in areas for of_block in area for segment in of_block)
        return self.head(self.root()) + leaves + segments
