"""Read a tiled file: only what a window needs, in few requests (spec clause 12.6)."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType

from ..drawing.contour import Contour
from ..errors import OptionError
from ..field.placement import read_placement
from ..format.chunks import write_chunk, write_metadata
from ..format.header import Header, write_header
from ..limits import Limits
from ..storage.ranges import Fetch, Pieces, Range
from ..stream.container import with_checksum
from ..stream.decoder import Decoder
from ..stream.grid_contents import GridContents
from ..stream.recoder import bounds_of
from .closing import TilePart
from .head import read_head
from .joining import joined
from .layout import Index
from .leaf import read_leaf
from .numbers import wrong
from .structure import HEAD_BYTES, Head, Kind, Leaf

KEPT_LEAVES = 64
"""Number of leaf directories that are cached."""
Box = Sequence[tuple[int, int]]
"""First and last samples along each axis."""
Found = tuple[Index, Kind, bytes, list[bytes]]
"""A tile: its kind for an isovalue, the segment of its mask, and the segments of its stages."""


class TiledFile:
    """A tiled file, of which only the necessary parts are fetched.

    Parameters
    ----------
    fetch : callable
        Returns the bytes of the file from one offset up to another, or up to its end.
    limits : Limits, optional
        Limits for decoding each tile; ``bytes`` limits what is fetched at a time.
    first : bytes, optional
        The first ``HEAD_BYTES`` of the file, if already read.

    Attributes
    ----------
    head : Head
    root : Root
    requests, received : int
        Number of requests, and number of bytes fetched.

    Raises
    ------
    FormatError
        If it is not a tiled file, or is damaged.
    TruncatedError
        If it ends too early.
    """

    def __init__(self, fetch: Fetch, limits: Limits | None = None, first: bytes | None = None) -> None:
        self.limits = limits or Limits()
        self._source = fetch
        self.requests, self.received = (0, 0) if first is None else (1, len(first))
        first = self.fetch(0, HEAD_BYTES) if first is None else first
        self._pieces = lambda: Pieces(self.fetch, self.limits.bytes, first)
        self.head, self.root = read_head(first)
        self._blocks = list(self.head.grid.all_blocks())
        self._number_of = {block: number for number, block in enumerate(self._blocks)}
        self._leaves: dict[int, Leaf] = {}

    def fetch(self, start: int, end: int) -> bytes:
        """Fetch the bytes of the file from one offset up to another, or up to its end."""
        data = self._source(start, end)
        self.requests += 1
        self.received += len(data)
        return data

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
        """Number of the first stage whose cubes are no wider than ``within`` samples, or of the last stage.

        Raises
        ------
        OptionError
            If both are given, or the stage does not exist.
        """
        stages = self.head.stages
        if within is not None and stage is not None:
            raise OptionError("within and layers cannot be combined", code="layers", remedy="choose one")
        if stage is not None:
            if not 0 <= stage < len(stages):
                raise OptionError(f"layer {stage} does not exist; the file has the layers 0 to {len(stages) - 1}",
                                  code="layers")
            return stage
        if within is None:
            return len(stages) - 1
        return next((i for i, each in enumerate(stages) if 1 << each.edge <= within), len(stages) - 1)

    def window(
        self, box: Sequence[Sequence[float]] | None = None, *, isovalue: float | None = None,
        within: float | Callable[[Box], float] | None = None, layer: int | None = None, partial: bool = False,
        clip: bool = True,
    ) -> Contour:
        """Draw the curve or surface in a box.

        Parameters
        ----------
        box, isovalue, within, layer, partial
            As there.
        clip : bool
            Whether to drop cells that do not reach into the box.

        Returns
        -------
        Contour
            Contour in index coordinates of the whole field; tiles meet without seams. It is not complete if a needed
            layer of a tile is missing.

        Raises
        ------
        OptionError
        FormatError, TruncatedError
            If the file is damaged.
        LimitError
        """
        number = self.number_of(isovalue)
        grid = self.head.grid
        low, high = bounds_of(self.shape, box)
        by_stage: dict[int, list[Index]] = {}
        for index in grid.touching(np.floor(low).astype(np.int64), np.ceil(high).astype(np.int64)):
            own = within([(w.start, w.stop - 1) for w in grid.window(index)]) if callable(within) else within
            by_stage.setdefault(self.stage_of(own, layer), []).append(index)
        metadata = self.metadata
        origin_above, complete = None, True
        parts = []
        for stage, wanted in by_stage.items():
            for index, kind, mask, segments in self.tiles(wanted, number, stage, partial):
                above: bool | None = kind == Kind.ABOVE
                if kind == Kind.CODED:
                    there = len(segments) - 1
                    complete &= there == stage
                    if there < 0:
                        continue
                    parts.append(self.drawn(index, number, mask, segments))
                    above = parts[-1].contour.origin_above
                if not any(index):
                    origin_above = above
        points, cells = joined(parts, grid.n)
        if box is not None and clip:
            points, cells = _within(points, cells, low, high)
        return Contour(
            points, cells, self.isovalues[number], self.shape, complete, read_placement(metadata, grid.n), metadata,
            origin_above, self.head.masked,
        )

    def plain(self, index: Index, isovalue: float | None = None, layer: int | None = None) -> bytes:
        """Make a separate ``.iso`` file of a tile."""
        number = self.number_of(isovalue)
        ((_, _, mask, segments),) = self.tiles([index], number, self.stage_of(None, layer))
        return plain(self.head, index, number, mask, segments)

    def drawn(self, index: Index, number: int, mask: bytes, segments: Sequence[bytes]) -> TilePart:
        """Draw segments of a tile."""
        grid_of_tile, stage = self.decoded(index, number, mask, segments), len(segments) - 1
        contour, ends = grid_of_tile.ends()
        grid, cube = self.head.grid, 1 << self.head.stages[stage].edge
        origin, size = grid.origin(index), grid.size(index)
        return TilePart(index, stage, cube, origin, size, contour, ends, grid_of_tile.whole_cells)

    def decoded(self, index: Index, number: int, mask: bytes, segments: Sequence[bytes]) -> GridContents:
        """Decode segments of a tile."""
        decoder = Decoder(self.limits)
        decoder.feed(plain(self.head, index, number, mask, segments))
        decoder.close()
        return decoder.grid

    # -- what is fetched ---------------------------------------------------------------------------------------------

    def tiles(self, wanted: Iterable[Index], isovalue: int, stage: int, partial: bool = False) -> list[Found]:
        """Yield tiles, leaf by leaf: the kind of each for an isovalue, and its segments up to a stage.

        With ``partial``, a truncated file gives segments up to the last stage that is complete.
        """
        by_leaf: dict[int, list[Index]] = {}
        for index in wanted:
            block = tuple(i >> self.head.grid.block for i in index)
            by_leaf.setdefault(self._number_of[block], []).append(index)
        numbers = sorted(by_leaf)
        areas = [0] * self.head.masked + [self.head.area(isovalue, s) for s in range(stage + 1)]
        pieces = self._pieces()
        if sum(map(len, by_leaf.values())) == self.head.grid.total:
            pieces.fetch([(int(self.root.leaves[0]), self._end_of(areas))], partial)
        leaves = self._read_leaves(numbers, pieces)
        places = {number: self._places(number, by_leaf[number]) for number in numbers}
        groups = {
            (area, number, int(np.searchsorted(leaves[number].groups[area], i, "right")) - 1)
            for number in numbers for area in areas for i in places[number] if leaves[number].lengths[area, i]
        }
        ranges = {group: self._group_range(leaves[group[1]], *group) for group in sorted(groups)}
        pieces.fetch(ranges.values(), partial)
        gone = {group for group, each in ranges.items() if not pieces.has(*each)} if partial else set()
        for (area, number, group), (start, end) in ranges.items():
            if (area, number, group) in gone:
                continue
            if zlib.crc32(pieces.get(start, end)) != leaves[number].checksums[area][group]:
                raise wrong("a checksum of segments is wrong", "checksum", start, "12.5")
        return [
            self._found(leaves[number], index, i, isovalue,
                        [pieces.get(*self._segment_range(leaves[number], area, number, i))
                         for area in self._there(leaves[number], areas, number, i, gone)])
            for number in numbers for index, i in zip(by_leaf[number], places[number], strict=True)
        ]

    def _there(self, leaf: Leaf, areas: list[int], number: int, i: int, gone: set[tuple[int, int, int]]) -> list[int]:
        """Number of the first areas whose segments of a tile have been received."""
        if not gone:
            return areas

        def is_there(area: int) -> bool:
            group = int(np.searchsorted(leaf.groups[area], i, "right")) - 1
            return not leaf.lengths[area, i] or (area, number, group) not in gone

        return list(takewhile(is_there, areas))

    def _found(self, leaf: Leaf, index: Index, i: int, isovalue: int, segments: list[bytes]) -> Found:
        mask = segments.pop(0) if self.head.masked and segments else b""
        kind = Kind(leaf.kinds[isovalue + self.head.masked, i])
        if self.head.masked and leaf.kinds[0, i] == Kind.ABOVE:
            kind = Kind.BELOW
        return index, kind, mask, segments

    def _end_of(self, areas: list[int]) -> int:
        """End of the leaf directories or, if the first areas are wanted, of those, which follow the directories."""
        end = int(self.root.leaves[-1])
        return end + int(self.root.sizes[:, : len(areas)].sum()) if areas == list(range(len(areas))) else end

    def _places(self, number: int, wanted: list[Index]) -> list[int]:
        """Positions of tiles in their leaf."""
        order = {tuple(index): i for i, index in enumerate(self.head.grid.members(self._blocks[number]).tolist())}
        return [order[index] for index in wanted]

    def _read_leaves(self, numbers: list[int], pieces: Pieces) -> dict[int, Leaf]:
        """Get leaf directories, cached or fetched."""
        pieces.fetch(self._leaf_range(number) for number in numbers if number not in self._leaves)
        out = {
            number: self._leaves.pop(number) if number in self._leaves else self._read_leaf(number, pieces)
            for number in numbers
        }
        self._leaves.update(out)
        while len(self._leaves) > KEPT_LEAVES:
            del self._leaves[next(iter(self._leaves))]
        return out

    def leaves(self, numbers: Sequence[int]) -> list[Leaf]:
        """Fetch leaf directories, by number."""
        found = self._read_leaves(list(numbers), self._pieces())
        return [found[number] for number in numbers]

    def _leaf_range(self, number: int) -> Range:
        start, end = self.root.leaves[number : number + 2].tolist()
        return start, end

    def _read_leaf(self, number: int, pieces: Pieces) -> Leaf:
        at = int(self.root.leaves[number])
        data = pieces.get(*self._leaf_range(number))
        if zlib.crc32(data) != self.root.checksums[number]:
            raise wrong("a leaf directory's checksum is wrong", "checksum", at, "12.4")
        leaf = read_leaf(self.head, data, len(self.head.grid.members(self._blocks[number])), at)
        if not np.array_equal(leaf.lengths.sum(axis=1), self.root.sizes[number]):
            raise wrong("a leaf directory and the root disagree", "leaf", at, "12.4")
        return leaf

    def _segment_range(self, leaf: Leaf, area: int, number: int, i: int) -> Range:
        start = int(self.root.segments[number, area])
        return start + int(leaf.starts[area, i]), start + int(leaf.starts[area, i + 1])

    def _group_range(self, leaf: Leaf, area: int, number: int, group: int) -> Range:
        start = int(self.root.segments[number, area])
        first, behind = leaf.groups[area][group : group + 2].tolist()
        return start + int(leaf.starts[area, first]), start + int(leaf.starts[area, behind])

    def number_of(self, isovalue: float | None) -> int:
        """Number of an isovalue; 0 for None.

        Raises
        ------
        OptionError
            If the file has no such isovalue.
        """
        if isovalue is None:
            return 0
        if isovalue not in self.isovalues:
            known = ", ".join(f"{value:g}" for value in self.isovalues[:20])
            raise OptionError(f"the file has no isovalue {isovalue:g}", code="isovalue", remedy=f"it has {known}")
        return self.isovalues.index(isovalue)


def plain(
    head: Head, index: Index, number: int, mask: bytes, segments: Iterable[bytes],
    notes: Mapping[str, str] | None = None,
) -> bytes:
    """Make an ``.iso`` file of a tile at an isovalue from its segments; further chunks may be inserted between them."""
    header = Header(head.grid.size(index), head.isovalues[number], head.scale, head.profile)
    last = write_chunk(ChunkType.METADATA, write_metadata(notes) if notes else b"", ancillary=True, last=True)
    return b"".join(with_checksum([write_header(header), mask, *segments, last]))


def _within(
    points: NDArray[np.float64], cells: NDArray[np.int64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Keep the cells that reach into a box, and their points."""
    corners = points[cells]
    kept = cells[((corners.min(axis=1) < high) & (corners.max(axis=1) > low)).all(axis=1)]
    used, number = np.unique(kept, return_inverse=True)
    return points[used], number.reshape(kept.shape)
