"""Directories of a tiled file: head, root and leaf directories, as records (spec clauses 12.3 to 12.5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from isospec.container import TILED_SIGNATURE as SIGNATURE
from isospec.container import Profile

from .layout import TileGrid

HEAD_BYTES = 1 << 14
"""Head and root directory have no more bytes than this."""
FIXED_BYTES = 8
"""Signature, versions, flags and length of the head."""
EXPONENTS = range(5, 21)
"""Widths of tiles, as exponents."""
MOST_IN_BLOCK = 1 << 20
MOST_STAGES = 16
MOST_SIDE = 1 << 40
"""Most samples along an axis."""
GROUP_BYTES = 1 << 10
"""A checksum is for at least so many bytes, unless they are the last of their leaf."""


class Kind(IntEnum):
    """Kind of a tile for an isovalue, or for the mask (clause 12.5)."""

    BELOW = 0
    ABOVE = 1
    CODED = 2


@dataclass(frozen=True)
class Stage:
    """Layers of all tiles that lie together in the file.

    Attributes
    ----------
    edge : int
        Exponent of the edge of the cubes, in samples, of the uniform mesh that the stage leads to.
    geometry : bool
        Whether it stores where edges are crossed.
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
        Of each isovalue.
    scale : float or None
    profile : Profile
    masked : bool
        Whether there is a mask, in an area before the others.
    metadata : dict of str to str
    """

    grid: TileGrid
    isovalues: tuple[float, ...]
    stages: tuple[Stage, ...]
    scale: float | None = None
    profile: Profile = Profile.MAIN
    masked: bool = False
    metadata: dict[str, str] = field(default_factory=dict)

    @property
    def areas(self) -> int:
        """Areas of segments: the mask's, then stage by stage one for each isovalue."""
        return self.masked + len(self.stages) * len(self.isovalues)

    def area(self, isovalue: int, stage: int) -> int:
        """Number of an area."""
        return self.masked + stage * len(self.isovalues) + isovalue

    @property
    def strands(self) -> int:
        """The mask, if there is one, and the isovalues."""
        return self.masked + len(self.isovalues)

    def areas_of(self, strand: int) -> list[int]:
        """Areas of the mask or of an isovalue, by its number among the strands."""
        if self.masked and strand == 0:
            return [0]
        return [self.area(strand - self.masked, stage) for stage in range(len(self.stages))]


@dataclass(frozen=True)
class Root:
    """Where leaf directories and the segments of their tiles are.

    Attributes
    ----------
    end : int
        Bytes of head and root.
    lengths, checksums : (L,) int64
        Of leaf directories.
    sizes : (L, A) int64
        Bytes of the leaf's segments in each area.
    """

    end: int
    lengths: NDArray[np.int64]
    checksums: NDArray[np.int64]
    sizes: NDArray[np.int64]

    @cached_property
    def leaves(self) -> NDArray[np.int64]:
        """Where leaf directories begin and the last one ends, (L + 1,) int64."""
        return self.end + np.concatenate([[0], np.cumsum(self.lengths)])

    @cached_property
    def segments(self) -> NDArray[np.int64]:
        """Where the leaves' segments begin in each area, (L, A) int64."""
        flat = self.sizes.T.ravel()
        return (self.leaves[-1] + np.cumsum(flat) - flat).reshape(self.sizes.T.shape).T

    @property
    def total(self) -> int:
        """Bytes of the file."""
        return int(self.leaves[-1] + self.sizes.sum())


@dataclass(frozen=True)
class Leaf:
    """A leaf directory: what is known of the tiles of a block.

    Attributes
    ----------
    kinds : (strands, K) uint8
    lengths : (areas, K) int64
        Bytes of segments.
    checksums : list of (groups,) int64
        By area: of groups of segments.
    """

    kinds: NDArray[np.uint8]
    lengths: NDArray[np.int64]
    checksums: list[NDArray[np.int64]]

    @cached_property
    def groups(self) -> list[NDArray[np.int64]]:
        """By area: numbers of the segments that groups begin with, and behind the last one how many there are."""
        return [groups_of(lengths) for lengths in self.lengths]

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Where segments begin behind the first one of their area, and where the last one ends, (areas, K + 1)."""
        return np.pad(np.cumsum(self.lengths, axis=1), ((0, 0), (1, 0)))


def is_tiled(data: object) -> bool:
    """Whether these are the first bytes of a tiled file."""
    return isinstance(data, bytes | bytearray | memoryview) and bytes(data[: len(SIGNATURE)]) == SIGNATURE


def groups_of(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where groups of segments begin: each ends with the segment that fills it."""
    starts, held = [0], 0
    for i, length in enumerate(lengths.tolist(), start=1):
        held += length
        if held >= GROUP_BYTES:
            starts.append(i)
            held = 0
    if held or len(starts) == 1:
        starts.append(len(lengths))
    return np.array(starts, np.int64) if lengths.sum() else np.zeros(1, np.int64)
