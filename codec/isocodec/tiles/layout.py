"""Division of a field into tiles, and their order (spec clause 12.2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod

import numpy as np
from numpy.typing import NDArray

from ..grid.lattice.tables import cube_exponent

Index = tuple[int, ...]
COARSEST = 4
"""Exponent of the edge of the first stage's cubes; no tile is narrower than such a cube, unless the field is."""


def morton(index: NDArray[np.int64]) -> NDArray[np.int64]:
    """Compute Morton codes of indices below 2**20: their bits interleaved, with the last axis in the lowest bit."""
    n = index.shape[1]
    code = np.zeros(len(index), np.int64)
    for bit in range(int(index.max(initial=0)).bit_length()):
        for axis in range(n):
            code |= (index[:, axis] >> bit & 1) << (bit * n + n - 1 - axis)
    return code


def in_order(counts: Index) -> NDArray[np.int64]:
    """All indices of a grid with these counts, in Morton order, (K, n) int64."""
    index = np.indices(counts).reshape(len(counts), -1).T.astype(np.int64)
    return index[np.argsort(morton(index), kind="stable")]


@dataclass(frozen=True)
class TileGrid:
    """A field divided into tiles, which share a row of samples with their neighbours.

    Attributes
    ----------
    shape : tuple of int
        Samples along each axis.
    exponent : int
        A tile is ``2**exponent`` samples wide, and one more with the shared row.
    block : int
        Tiles are listed in blocks of ``2**block`` along each axis.
    """

    shape: Index
    exponent: int
    block: int = 0

    @property
    def n(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @cached_property
    def counts(self) -> Index:
        """Number of tiles along each axis; a remainder no wider than a cube is part of the last tile."""
        edge, cube = 1 << self.exponent, 1 << COARSEST
        return tuple(max(-((cube + 1 - s) // edge), 1) for s in self.shape)

    @property
    def total(self) -> int:
        """Total number of tiles."""
        return prod(self.counts)

    @cached_property
    def blocks(self) -> Index:
        """Number of blocks along each axis."""
        return tuple(-(-count >> self.block) for count in self.counts)

    def origin(self, index: Index) -> Index:
        """The first sample of a tile."""
        return tuple(i << self.exponent for i in index)

    def size(self, index: Index) -> Index:
        """Number of samples of a tile along each axis, including shared rows."""
        edge = 1 << self.exponent
        return tuple(
            s - i * edge if i == count - 1 else edge + 1
            for s, i, count in zip(self.shape, index, self.counts, strict=True)
        )

    def window(self, index: Index) -> tuple[slice, ...]:
        """Slices of a tile's samples in the field."""
        return tuple(slice(o, o + s) for o, s in zip(self.origin(index), self.size(index), strict=True))

    def shared(self, index: Index) -> NDArray[np.bool_]:
        """Whether a tile shares its low and its high face across each axis, (n, 2)."""
        return np.array([(i > 0, i < count - 1) for i, count in zip(index, self.counts, strict=True)])

    def neighbour(self, index: Index, axis: int) -> Index:
        """The next tile along an axis."""
        return (*index[:axis], index[axis] + 1, *index[axis + 1 :])

    def members(self, block: Index) -> NDArray[np.int64]:
        """Tiles of a block in order, (K, n) int64."""
        return in_order(self.extent(block)) + (np.array(block, np.int64) << self.block)

    def all_blocks(self) -> Iterator[Index]:
        """Blocks in order."""
        for block in in_order(self.blocks).tolist():
            yield tuple(block)

    def touching(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> tuple[range, ...]:
        """Tiles, along each axis, that have a cell in the box of samples from ``low`` to ``high``, inclusive."""
        ranges = []
        for a, count in enumerate(self.counts):
            first = min(int(low[a]) >> self.exponent, count - 1)
            last = min(max(int(high[a]) - 1, int(low[a])) >> self.exponent, count - 1)
            ranges.append(range(first, last + 1))
        return tuple(ranges)

    def extent(self, block: Index) -> Index:
        """Number of tiles of a block along each axis."""
        return tuple(min(c - (i << self.block), 1 << self.block) for c, i in zip(self.counts, block, strict=True))

    def positions(self, block: Index, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """Positions of tiles, (K, n), in the order of their block."""
        inside = index - (np.array(block) << self.block)
        return self._descend(self.extent(block), np.zeros(len(index), np.int64), inside)[0]

    def at(self, block: Index, positions: NDArray[np.int64]) -> NDArray[np.int64]:
        """Tiles, (K, n), at these positions in the order of their block."""
        return self._descend(self.extent(block), positions, None)[1] + (np.array(block) << self.block)

    @staticmethod
    def _descend(
        extent: Index, position: NDArray[np.int64], index: NDArray[np.int64] | None
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find positions from indices, or indices from positions, by halving boxes instead of listing a block."""
        n, ends = len(extent), np.array(extent)
        corner, left = np.zeros((len(position), n), np.int64), position.copy()
        for bit in reversed(range((max(extent) - 1).bit_length())):
            parts = np.array(list(product((0, 1), repeat=n))) << bit
            # tiles in each half, quarter or eighth of a box, and before it
            sizes = np.clip(ends - (corner[:, None] + parts), 0, 1 << bit).prod(axis=2)
            before = np.cumsum(sizes, axis=1) - sizes
            if index is None:
                child = (left[:, None] >= before + sizes).sum(axis=1)
            else:
                child = ((index >> bit & 1) << np.arange(n)[::-1]).sum(axis=1)
            left += np.take_along_axis(before, child[:, None], axis=1)[:, 0] * (1 if index is not None else -1)
            corner += parts[child]
        return left, corner

    def level(self, index: Index, edge: int) -> int:
        """The level of a tile's uniform mesh with cubes of edge ``2**edge``; 0 if the whole tile is smaller."""
        return self.n * max(cube_exponent(self.size(index)) - edge, 0)
