"""Reading a tiled file: only what a window needs, in few pieces (spec clause 12.6)."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType

from ..drawing.contour import Contour
from ..errors import OptionError, TruncatedError
from ..field.placement import read_placement
from ..format.chunks import write_chunk
from ..format.header import Header, write_header
from ..limits import Limits
from ..stream.container import with_checksum
from ..stream.decoder import Decoder
from .container import FIXED_BYTES, HEAD_BYTES, Head, Kind, Leaf
from .grid import Index
from .head import head_length, read_head
from .joining import joined
from .leaf import read_leaf
from .numbers import wrong

Fetch = Callable[[int, int], bytes]
"""Bytes of a file from one place up to another."""
Range = tuple[int, int]
MOST_PIECES = 5
"""Ranges are joined over gaps of at most ``GAP`` bytes until there are no more than so many."""
GAP = 1 << 18
KEPT_LEAVES = 64


class TiledFile:
    """A tiled file of which only what is asked for is fetched.

    Parameters
    ----------
    fetch : callable
        Gives the bytes of the file from one place up to another, fewer at its end.
    limits : Limits, optional
        What decoding each tile may need at most; ``bytes`` is for what is fetched at a time.

    Attributes
    ----------
    head : Head
    root : Root

    Raises
    ------
    FormatError
        If it is no tiled file, or damaged.
    TruncatedError
        If it ends too early.
    """

    def __init__(self, fetch: Fetch, limits: Limits | None = None) -> None:
        self._fetch = fetch
        self.limits = limits or Limits()
        first = fetch(0, HEAD_BYTES)
        if len(first) >= FIXED_BYTES and len(first) < head_length(first):
            raise TruncatedError("the file ends within its head", code="truncated", offset=len(first), clause="12.3")
        self.head, self.root = read_head(first)
        self._blocks = {block: number for number, block in enumerate(self.head.grid.all_blocks())}
        self._leaf = lru_cache(KEPT_LEAVES)(self._read_leaf)

    @property
    def shape(self) -> Index:
        """Samples along each axis."""
        return self.head.grid.shape

    @property
    def isovalues(self) -> tuple[float, ...]:
        """In the order of the file."""
        return self.head.isovalues

    @property
    def metadata(self) -> dict[str, str]:
        """Notes of the file."""
        return dict(self.head.metadata)

    def stage_of(self, within: float | None = None, stage: int | None = None) -> int:
        """The number of a stage: the first whose cubes are no wider than ``within`` samples, the last if none is.

        Raises
        ------
        OptionError
            If both are given, or there is no such stage.
        """
        stages = self.head.stages
        if within is not None and stage is not None:
            raise OptionError("within and layer contradict one another", code="layers", remedy="choose one")
        if stage is not None:
            if not 0 <= stage < len(stages):
                raise OptionError(f"layer {stage}; the file has {len(stages)}, from 0 on", code="layers")
            return stage
        if within is None:
            return len(stages) - 1
        return next((i for i, each in enumerate(stages) if 1 << each.edge <= within), len(stages) - 1)

    def window(
        self, box: Sequence[Sequence[float]] | None = None, *, isovalue: float | None = None,
        within: float | None = None, layer: int | None = None, clip: bool = True,
    ) -> Contour:  # fmt: skip
        """The curve or surface in a box.

        Parameters
        ----------
        box : n pairs of numbers, optional
            From where to where along each axis, in samples. Everything if not given.
        isovalue : float, optional
            One of the file; the first if not given.
        within : float, optional
            Cubes of the mesh no wider than so many samples are enough.
        layer : int, optional
            Up to which layer of the file; the last if neither is given.
        clip : bool
            Whether cells are left out none of whose points lies in the box.

        Returns
        -------
        Contour
            In index coordinates of the whole field; tiles meet without seams.

        Raises
        ------
        OptionError
        FormatError, TruncatedError
            If the file is damaged.
        LimitError
        """
        number = self._number(isovalue)
        stage = self.stage_of(within, layer)
        grid = self.head.grid
        low, high = self._bounds(box)
        found = self.tiles(grid.touching(np.floor(low).astype(np.int64), np.ceil(high).astype(np.int64)), number, stage)
        metadata = self.metadata
        origin_above = None
        parts = []
        for index, kind, mask, segments in found:
            if not any(index):
                origin_above = self._origin_above(kind, index, number, mask, segments)
            if kind != Kind.CODED:
                continue
            drawn = self.drawn(index, number, mask, segments)
            parts.append((np.array(grid.origin(index)), grid.size(index), *drawn))
        points, cells = joined(parts, grid.n)
        if box is not None and clip:
            points, cells = _within(points, cells, low, high)
        return Contour(
            points, cells, self.isovalues[number], self.shape, True, read_placement(metadata, grid.n), metadata,
            origin_above, self.head.masked,
        )  # fmt: skip

    def _origin_above(
        self, kind: Kind, index: Index, number: int, mask: bytes, segments: Sequence[bytes]
    ) -> bool | None:
        return self.drawn(index, number, mask, segments)[0].origin_above if kind == Kind.CODED else kind == Kind.ABOVE

    def plain(self, index: Index, isovalue: float | None = None, layer: int | None = None) -> bytes:
        """A tile as an ``.iso`` file of its own."""
        number = self._number(isovalue)
        ((_, _, mask, segments),) = self.tiles([index], number, self.stage_of(None, layer))
        return plain(self.head, index, number, mask, segments)

    def drawn(
        self, index: Index, number: int, mask: bytes, segments: Sequence[bytes]
    ) -> tuple[Contour, NDArray[np.int64] | None]:
        """What segments of a tile show, in its own coordinates, and between which samples the points lie."""
        decoder = Decoder(self.limits)
        decoder.feed(plain(self.head, index, number, mask, segments))
        for _ in decoder:
            pass
        decoder.close()
        return decoder.ends()

    # -- what is fetched ---------------------------------------------------------------------------------------------

    def tiles(self, wanted: Iterable[Index], isovalue: int, stage: int) -> list[tuple[Index, Kind, bytes, list[bytes]]]:
        """Tiles in their order: what each is, and the segments of its mask and of its stages up to one."""
        grid = self.head.grid
        by_leaf: dict[int, list[Index]] = {}
        for index in wanted:
            by_leaf.setdefault(self._blocks[tuple(i >> grid.block for i in index)], []).append(index)
        areas = [self.head.area(isovalue, s) for s in range(stage + 1)]
        if self.head.masked:
            areas.insert(0, 0)
        held = self._whole_leaves(sorted(by_leaf), areas) if len(by_leaf) == math.prod(grid.blocks) else _Held()
        missing = [tuple(self.root.leaves[number : number + 2].tolist()) for number in by_leaf]
        held.fetch(self, [each for each in missing if not held.has(*each)])
        leaves = {number: self._leaf(number, held.get(*self._leaf_range(number))) for number in sorted(by_leaf)}
        places: dict[int, dict[Index, int]] = {}
        groups: set[tuple[int, int, int]] = set()
        for number, leaf in leaves.items():
            block = next(block for block, n in self._blocks.items() if n == number)
            order = {tuple(index): i for i, index in enumerate(grid.members(block).tolist())}
            places[number] = {index: order[index] for index in by_leaf[number]}
            for area in areas:
                bounds = leaf.groups(area)
                for i in places[number].values():
                    if leaf.lengths[area, i]:
                        groups.add((area, number, int(np.searchsorted(bounds, i, "right")) - 1))
        ranges = {key: self._group_range(leaves[key[1]], *key) for key in sorted(groups)}
        held.fetch(self, [each for each in ranges.values() if not held.has(*each)])
        for (area, number, group), (start, end) in ranges.items():
            if zlib.crc32(held.get(start, end)) != leaves[number].checksums[area][group]:
                raise wrong("a checksum of segments is wrong", "checksum", start, "12.5")
        out = []
        for number, leaf in leaves.items():
            for index, i in places[number].items():
                strand = isovalue + self.head.masked
                segments = [held.get(*self._segment_range(leaf, area, number, i)) for area in areas]
                mask = segments.pop(0) if self.head.masked else b""
                if self.head.masked and leaf.kinds[0, i] == Kind.ABOVE:
                    out.append((index, Kind.BELOW, b"", [b""] * len(segments)))
                    continue
                out.append((index, Kind(leaf.kinds[strand, i]), mask, segments))
        return out

    def _whole_leaves(self, numbers: list[int], areas: list[int]) -> _Held:
        """All leaves, and all segments of the first areas if these stand right behind them: one piece."""
        held = _Held()
        end = int(self.root.leaves[-1])
        if areas == list(range(len(areas))) and len(numbers):
            end += int(self.root.sizes[:, : len(areas)].sum())
        held.fetch(self, [(int(self.root.leaves[0]), end)])
        return held

    def _leaf_range(self, number: int) -> Range:
        start, end = self.root.leaves[number : number + 2].tolist()
        return start, end

    def _read_leaf(self, number: int, data: bytes) -> Leaf:
        at = int(self.root.leaves[number])
        if zlib.crc32(data) != self.root.checksums[number]:
            raise wrong("a leaf directory's checksum is wrong", "checksum", at, "12.4")
        block = next(block for block, n in self._blocks.items() if n == number)
        leaf = read_leaf(self.head, data, len(self.head.grid.members(block)), at)
        if not np.array_equal(leaf.lengths.sum(axis=1), self.root.sizes[number]):
            raise wrong("a leaf directory and the root disagree", "leaf", at, "12.4")
        return leaf

    def _segment_range(self, leaf: Leaf, area: int, number: int, i: int) -> Range:
        start = int(self.root.segments[number, area] + leaf.lengths[area, :i].sum())
        return start, start + int(leaf.lengths[area, i])

    def _group_range(self, leaf: Leaf, area: int, number: int, group: int) -> Range:
        first, behind = leaf.groups(area)[group : group + 2].tolist()
        start = int(self.root.segments[number, area] + leaf.lengths[area, :first].sum())
        return start, start + int(leaf.lengths[area, first:behind].sum())

    def _number(self, isovalue: float | None) -> int:
        if isovalue is None:
            return 0
        if isovalue not in self.isovalues:
            known = ", ".join(f"{value:g}" for value in self.isovalues[:20])
            raise OptionError(f"the file has no isovalue {isovalue:g}", code="isovalue", remedy=f"it has {known}")
        return self.isovalues.index(isovalue)

    def _bounds(self, box: Sequence[Sequence[float]] | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        last = np.array(self.shape, np.float64) - 1
        if box is None:
            return np.zeros(len(last)), last
        bounds = np.array(box, np.float64)
        if bounds.shape != (len(last), 2) or not np.isfinite(bounds).all() or (bounds[:, 0] > bounds[:, 1]).any():
            raise OptionError(
                f"the box is {box!r}; it must be {len(last)} pairs, from where to where along each axis", code="box"
            )
        if (bounds[:, 1] < 0).any() or (bounds[:, 0] > last).any():
            raise OptionError(f"the box lies outside the field of {self.shape} samples", code="box")
        return np.clip(bounds[:, 0], 0, last), np.clip(bounds[:, 1], 0, last)


class _Held:
    """Pieces of the file that have been fetched."""

    def __init__(self) -> None:
        self._pieces: list[tuple[int, bytes]] = []

    def has(self, start: int, end: int) -> bool:
        return any(at <= start and end <= at + len(data) for at, data in self._pieces)

    def get(self, start: int, end: int) -> bytes:
        if start == end:
            return b""
        return next(data[start - at : end - at] for at, data in self._pieces if at <= start and end <= at + len(data))

    def fetch(self, file: TiledFile, ranges: Iterable[Range]) -> None:
        for start, end in together(ranges):
            if end - start > file.limits.bytes:
                raise OptionError(
                    f"{end - start:,} bytes would be fetched, more than the limit of {file.limits.bytes:,}",
                    code="limit-bytes", remedy="ask for a smaller box or a coarser layer",
                )  # fmt: skip
            data = file._fetch(start, end)
            if len(data) != end - start:
                raise TruncatedError(
                    f"the file ends at {start + len(data):,}, before its tiles do", code="truncated",
                    offset=start + len(data), clause="12.4",
                )  # fmt: skip
            self._pieces.append((start, data))


def together(ranges: Iterable[Range]) -> list[Range]:
    """Ranges in their order, joined over the smallest gaps while there are many."""
    found = sorted(each for each in ranges if each[0] < each[1])
    if not found:
        return []
    gaps = sorted((b[0] - a[1], i) for i, (a, b) in enumerate(pairwise(found), start=1))
    most = max(len(found) - MOST_PIECES, 0)
    bridged = {i for rank, (gap, i) in enumerate(gaps) if gap <= 0 or (rank < most and gap <= GAP)}
    out = [found[0]]
    for i, each in enumerate(found[1:], start=1):
        if i in bridged:
            out[-1] = out[-1][0], max(out[-1][1], each[1])
        else:
            out.append(each)
    return out


def plain(head: Head, index: Index, number: int, mask: bytes, segments: Iterable[bytes]) -> bytes:
    """An ``.iso`` file of a tile at an isovalue, of its segments."""
    header = Header(head.grid.size(index), head.isovalues[number], head.scale, head.profile)
    last = write_chunk(ChunkType.METADATA, b"", ancillary=True, last=True)
    return b"".join(with_checksum([write_header(header), mask, *segments, last]))


def _within(
    points: NDArray[np.float64], cells: NDArray[np.int64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Cells with a point in a box, and their points."""
    inside: NDArray[np.bool_] = np.all((points >= low) & (points <= high), axis=1)
    kept = cells[inside[cells].any(axis=1)]
    used, number = np.unique(kept, return_inverse=True)
    return points[used], number.reshape(kept.shape)
