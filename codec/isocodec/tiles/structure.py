"""Records for the directories of a tiled file: head, root and leaf directories (spec clauses 12.3 to 12.5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from isospec.container import Profile

from .layout import TileGrid

FIXED_BYTES = 8
"""Signature, versions, flags and length of the head."""
EXPONENTS = range(5, 21)
"""Smallest and largest width of tiles, as exponents."""
MOST_IN_BLOCK = 1 << 20
MOST_STAGES = 16
MOST_TOGETHER = 256
"""Largest number of isovalues in a group."""
MOST_SIDE = 1 << 40
"""Largest number of samples along an axis."""
GROUP_BYTES = 1 << 10
"""Least number of bytes for a checksum, except for the last bytes of a leaf."""


class Kind(IntEnum):
    """Kind of a tile for an isovalue, or for the mask (clause 12.5)."""

    BELOW = 0
    ABOVE = 1
    CODED = 2


@dataclass(frozen=True)
class Stage:
    """Layers of all tiles that are stored together in the file.

    Attributes
    ----------
    edge : int
        Exponent of the edge, in samples, of the cubes of the uniform mesh that the stage leads to.
    geometry : bool
        Whether the stage stores where edges are crossed.
    adaptive : bool
        Whether its meshes are coarser where the curve is flat.
    """

    edge: int
    geometry: bool = False
    adaptive: bool = False


@dataclass(frozen=True)
class Head:
    """Head of a tiled file.

    Attributes
    ----------
    grid : TileGrid
    isovalues : tuple of float
    stages : tuple of Stage
        Stages of each isovalue.
    scale : float or None
    profile : Profile
    masked : bool
        Whether there is a mask, whose area precedes the others.
    metadata : dict of str to str
    together : int
        Isovalues in each group, the last one apart: in a tile, those of a group lean on one another.
    """

    grid: TileGrid
    isovalues: tuple[float, ...]
    stages: tuple[Stage, ...]
    scale: float | None = None
    profile: Profile = Profile.MAIN
    masked: bool = False
    metadata: dict[str, str] = field(default_factory=dict)
    together: int = 1

    def group_of(self, number: int) -> range:
        """Numbers of the isovalues in the group that contains this one."""
        first = number - number % self.together
        return range(first, min(first + self.together, len(self.isovalues)))

    @property
    def areas(self) -> int:
        """Number of areas of segments: one for the mask, then for each stage one per isovalue."""
        return self.masked + len(self.stages) * len(self.isovalues)

    def area(self, isovalue: int, stage: int) -> int:
        """Number of an area."""
        return self.masked + stage * len(self.isovalues) + isovalue

    @property
    def strands(self) -> int:
        """Number of strands: the mask, if there is one, and the isovalues."""
        return self.masked + len(self.isovalues)

    def areas_of(self, strand: int) -> list[int]:
        """Areas of the mask or of an isovalue, by number of the strand."""
        if self.masked and strand == 0:
            return [0]
        return [self.area(strand - self.masked, stage) for stage in range(len(self.stages))]


@dataclass(frozen=True)
class Root:
    """Offsets of leaf directories and of the segments of their tiles.

    Attributes
    ----------
    end : int
        Number of bytes of head and root directory.
    lengths, checksums : (L,) int64
        Sizes and checksums of leaf directories.
    sizes : (L, A) int64
        Number of bytes of each leaf's segments in each area.
    """

    end: int
    lengths: NDArray[np.int64]
    checksums: NDArray[np.int64]
    sizes: NDArray[np.int64]

    @cached_property
    def leaves(self) -> NDArray[np.int64]:
        """Offsets of leaf directories, and the end of the last one, (L + 1,) int64."""
        return self.end + np.concatenate([[0], np.cumsum(self.lengths)])

    @cached_property
    def segments(self) -> NDArray[np.int64]:
        """Offsets of the leaves' segments in each area, (L, A) int64."""
        flat = self.sizes.T.ravel()
        return (self.leaves[-1] + np.cumsum(flat) - flat).reshape(self.sizes.T.shape).T

    @property
    def total(self) -> int:
        """Size of the file, in bytes."""
        return int(self.leaves[-1] + self.sizes.sum())


@dataclass(frozen=True)
class TileStrand:
    """Part of a leaf directory: the tiles of a block at an isovalue, or their masks.

    Attributes
    ----------
    ends, kinds : (R,) int64
        Runs of tiles of a kind, in the order of the block: where each ends, and its kind.
    coded : (C,) int64
        Positions of the coded tiles in the order of the block.
    lengths : (C, S) int64
        Sizes of their segments, in bytes, by stage.
    checksums : list of (groups,) int64
        Checksums of groups of segments, by stage.
    """

    ends: NDArray[np.int64]
    kinds: NDArray[np.int64]
    coded: NDArray[np.int64]
    lengths: NDArray[np.int64]
    checksums: list[NDArray[np.int64]] = field(default_factory=list)

    @cached_property
    def groups(self) -> list[NDArray[np.int64]]:
        """The first coded tiles of groups, by stage, followed by the number of coded tiles."""
        return [groups_of(lengths) for lengths in self.lengths.T]

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Offsets of segments, relative to the first of their area, and the end of the last one, (C + 1, S)."""
        return np.pad(np.cumsum(self.lengths, axis=0), ((1, 0), (0, 0)))

    def kinds_at(self, positions: NDArray[np.int64]) -> NDArray[np.int64]:
        """Kinds of the tiles at these positions in the order of the block."""
        return self.kinds[np.searchsorted(self.ends, positions, "right")]

    def group_of(self, stage: int, tile: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of the groups that hold the segments of coded tiles, by their number among the coded ones."""
        return np.searchsorted(self.groups[stage], tile, "right") - 1


Leaf = list[TileStrand]
"""A leaf directory: the strand of the mask, if there is one, then those of the isovalues."""


def groups_of(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """First segments of groups; each group ends with the segment that fills it."""
    starts, held = [0], 0
    for i, length in enumerate(lengths.tolist(), start=1):
        held += length
        if held >= GROUP_BYTES:
            starts.append(i)
            held = 0
    if held or len(starts) == 1:
        starts.append(len(lengths))
    return np.array(starts, np.int64) if lengths.sum() else np.zeros(1, np.int64)
