"""Assemble a file from encoded tiles: directories, then segments area by area (spec clauses 12.3 to 12.5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .head import write_head
from .layout import Index, TileGrid
from .leaf import sizes_of, strand_of, write_leaf
from .structure import MOST_IN_BLOCK, Head, Kind, Leaf
from .tile_encoder import Tiling

BLOCK = {2: 5, 3: 3}
"""Exponent of the width of blocks, in tiles, unless the root directory has no room for that many blocks."""


class Tiles:
    """Everything about the tiles of a file except their bytes, as arrays over the tiles.

    `kinds` has the mask first, then the isovalues. `lengths` are sizes of segments in bytes, by area, `faces` checksums
    of the samples on faces, `counts` those of `TileSegments`, and `place` is the offset of the stored bytes of each
    tile, -1 if it has not been encoded.
    """

    def __init__(self, tiling: Tiling) -> None:
        grid = tiling.grid
        self.tiling = tiling
        areas = len(tiling.stages) * len(tiling.isovalues)
        self.kinds = np.zeros((1 + len(tiling.isovalues), *grid.counts), np.uint8)
        self.lengths = np.zeros((1 + areas, *grid.counts), np.uint32)
        self.faces = np.zeros((grid.n, 2, *grid.counts), np.uint32)
        self.counts = np.zeros((3 + len(tiling.isovalues), *grid.counts))
        self.place = np.full(grid.counts, -1, np.int64)

    def missing(self) -> int:
        """Number of tiles that have not been encoded."""
        return int((self.place < 0).sum())

    def check_faces(self) -> None:
        """Check that neighbouring tiles had the same samples where they meet.

        Raises `InputError` if two tiles, which are named, had different samples: the field changed while it was being
        read.
        """
        for axis in range(self.tiling.grid.n):
            low, high = (self.faces[axis, side] for side in (0, 1))
            faces = np.delete(low, 0, axis) != np.delete(high, -1, axis)
            differ = np.argwhere(faces)
            if len(differ):
                here = tuple(differ[0].tolist())
                there = self.tiling.grid.neighbour(here, axis)
                raise InputError(
                    f"tiles {here} and {there} disagree on the samples that they share: the field changed while it was "
                    "being read", code="changed",
                    remedy="encode all tiles again from a field that does not change",
                )


def merged(tiles: Tiles, read: Callable[[int, int], bytes]) -> Iterator[bytes]:
    """Yield the bytes of a file, piece by piece, when all tiles have been encoded.

    ``read`` returns a number of bytes from an offset; a tile's bytes are the segment of the mask, then the stages of
    each isovalue. Raises `InputError` if tiles are missing, or do not agree where they meet.
    """
    if tiles.missing():
        raise InputError(f"{tiles.missing():,} tiles have not been encoded", code="tiles")
    tiles.check_faces()
    masked = bool((tiles.kinds[0] != Kind.BELOW).any())
    block = BLOCK[tiles.tiling.grid.n]
    while True:
        head = tiles.tiling.head(masked)
        head = replace(head, grid=replace(head.grid, block=block))
        try:
            # the lengths and checksums that follow take no more than this
            write_head(head, [(bytes(MOST_IN_BLOCK), [1 << 34] * head.areas)] * int(np.prod(head.grid.blocks)))
            break
        except InputError:
            if 1 << head.grid.n * (block + 1) > MOST_IN_BLOCK:
                raise
        block += 1
    yield from _written(head, tiles, read)


def _written(head: Head, tiles: Tiles, read: Callable[[int, int], bytes]) -> Iterator[bytes]:
    blocks = list(head.grid.all_blocks())
    leaves = []
    for block in blocks:
        leaf = _leaf(head, tiles, block, read)
        leaves.append((write_leaf(head, leaf), sizes_of(head, leaf)))
    yield write_head(head, leaves)
    for data, _ in leaves:
        yield data
    for area in range(head.areas):
        for block in blocks:
            yield b"".join(_segments(head, tiles, block, area, read))


def _leaf(head: Head, tiles: Tiles, block: Index, read: Callable[[int, int], bytes]) -> Leaf:
    """Make the directory of a block."""
    members = tuple(head.grid.members(block).T)
    kinds = tiles.kinds[(slice(None), *members)][not head.masked :]
    lengths = np.stack([tiles.lengths[(a, *members)] for a in _held(head)], axis=1).astype(np.int64)
    return [
        strand_of(kinds[number], lengths[:, areas], (_segments(head, tiles, block, area, read) for area in areas))
        for number in range(head.strands) if (areas := head.areas_of(number))
    ]


def _held(head: Head) -> list[int]:
    """For each area of a file, the number of the segment among the stored ones of a tile, isovalue by isovalue."""
    stages, isovalues = len(head.stages), len(head.isovalues)
    own = [1 + i * stages + s for s in range(stages) for i in range(isovalues)]
    return [0, *own] if head.masked else own


def _segments(head: Head, tiles: Tiles, block: Index, area: int, read: Callable[[int, int], bytes]) -> list[bytes]:
    """Read the segments of a block's tiles in an area."""
    members = tuple(head.grid.members(block).T)
    number = _held(head)[area]
    lengths: NDArray[np.int64] = tiles.lengths[(number, *members)].astype(np.int64)
    before = tiles.lengths[:number][(slice(None), *members)].astype(np.int64).sum(axis=0)
    places = tiles.place[members] + before
    pairs = zip(places.tolist(), lengths.tolist(), strict=True)
    return [read(place, length) if length else b"" for place, length in pairs]


def grid_of(shape: Index, exponent: int) -> TileGrid:
    """The grid of a field's tiles, before the size of blocks is known."""
    return TileGrid(shape, exponent, BLOCK[len(shape)])
