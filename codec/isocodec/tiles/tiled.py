"""Read a tiled file: what windows need, in few requests, within limits for all tiles together (spec 11.2, 12.6)."""

from __future__ import annotations

import functools
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isospec.container import ChunkType

from ..drawing.contour import Contour
from ..drawing.window import bounds_of, clipped
from ..errors import LimitError, OptionError
from ..field.isovalues import number_of
from ..field.labelling import noun_of
from ..field.placement import read_placement
from ..format.chunks import write_chunk, write_further, write_metadata, write_turn
from ..format.header import HEAD_BYTES, Header, write_header
from ..limits import Limits
from ..storage.ranges import Fetch, Pieces, Range
from ..stream.container import closed
from ..verbs import threads_of
from .closing import TilePart
from .head import read_head
from .joining import joined
from .layout import Index
from .leaf import read_leaf, sizes_of
from .numbers import wrong
from .shared_limits import Shared
from .structure import Head, Kind, Leaf, TileStrand

if TYPE_CHECKING:
    from ..stream.grid_contents import GridContents

KEPT = 1 << 24
"""Number of bytes of the file, and of memory of its directories, that are kept for later windows."""
LEAF_PEAK, LEAF_KEPT = 64, 24
"""Memory that a leaf directory takes while it is read, and afterwards, for each of its bytes."""
AT_ONCE = 4
"""Tiles that are decoded before any of them is joined, for each thread."""
DRAWN = 3
"""Memory that drawings of tiles take while they are joined, in their own size."""
Box = Sequence[tuple[int, int]]
"""First and last samples along each axis."""


@dataclass
class TilesWanted:
    """Coded tiles of a block at isovalues of a group that are wanted, up to a stage.

    Attributes
    ----------
    block, stage : int
        Number of the block, and of the last stage.
    group : range
        Numbers of the isovalues of the group.
    index : (K, n) int64
    positions : (K,) int64
        Positions of the tiles in the order of the block.
    """

    block: int
    stage: int
    group: range
    index: NDArray[np.int64]
    positions: NDArray[np.int64]


@dataclass(frozen=True)
class GroupSegments:
    """Fetched segments of a tile at the isovalues of a group.

    Attributes
    ----------
    index : tuple of int
    numbers : list of int
        Numbers of the group's isovalues at which the tile is coded.
    mask : bytes
        Segment of its mask.
    segments : list of bytes
        Stage by stage, in each one those of all these isovalues.
    last : int
        Number of the last stage that is wanted.
    """

    index: Index
    numbers: list[int]
    mask: bytes
    segments: list[bytes]
    last: int

    def of(self, number: int) -> list[bytes]:
        """Segments of an isovalue, by stage."""
        return self.segments[self.numbers.index(number) :: len(self.numbers)] if number in self.numbers else []


class TiledFile:
    """A tiled file, whose parts are fetched when they are needed.

    ``fetch`` reads ranges of the file, and ``first`` is its first ``HEAD_BYTES``, if already read. The limits are those
    of a call, for all its tiles together; ``bytes`` limits what it fetches. `requests` and `received` count ranges and
    bytes fetched. Raises `FormatError` if it is not a tiled file or is damaged, `TruncatedError` if it ends too early,
    and `LimitError` if it has too many isovalues. ``threads`` decode tiles: if not given, as many
    as there are cores, of planes one.
    """

    def __init__(
        self, fetch: Fetch, limits: Limits | None = None, first: bytes | None = None, threads: int | None = None
    ) -> None:
        self.limits = limits or Limits()
        self._source = fetch
        self.requests, self.received = (0, 0) if first is None else (1, len(first))
        self._first = self.fetch(0, HEAD_BYTES) if first is None else first
        self.head, self.root = read_head(self._first)
        # tiles of planes take so little time that threads wait for one another
        self._threads = 1 if threads is None and self.head.grid.n == 2 else threads_of(threads)
        if len(self.head.isovalues) > self.limits.isovalues:
            raise LimitError(f"more than {self.limits.isovalues} isovalues", code="limit-isovalues", clause="11.2")
        self._blocks = list(self.head.grid.all_blocks())
        self._number_of = {block: number for number, block in enumerate(self._blocks)}
        self._leaves: dict[int, Leaf] = {}
        self._pieces = Pieces(self._first)

    def fetch(self, start: int, end: int) -> bytes:
        """Fetch the bytes of the file from one offset up to another, or up to its end."""
        return self._fetched([(start, end)])[0]

    def _fetched(self, ranges: Sequence[Range]) -> list[bytes]:
        found = self._source(ranges)
        self.requests += len(ranges)
        self.received += sum(map(len, found))
        return found

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

        Raises `OptionError` if both are given, or the stage does not exist.
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
    ) -> Contour:
        """Draw the curve or surface of an isovalue, the first if none is given, in a box; see `windows`."""
        number = self.number_of(isovalue)
        (drawn,) = self.windows(box, [number], within=within, layer=layer, partial=partial)
        return drawn

    def windows(
        self, box: Sequence[Sequence[float]] | None = None, numbers: Sequence[int] | None = None, *,
        within: float | Callable[[Box], float] | None = None, layer: int | None = None, partial: bool = False,
    ) -> Iterator[Contour]:
        """Draw the curves or surfaces of isovalues in a box, one after the other; all is fetched before the first.

        All isovalues are drawn if no numbers are given; ``box``, ``within`` and ``partial`` are those of
        `IsoFile.contour`, and ``layer`` is the number of the last stage, from 0. Contours are in index coordinates of
        the whole field, and tiles meet without seams. A contour is not complete if a needed layer of a tile is missing.
        """
        grid, call = self.head.grid, Shared(self.limits)
        low, high, ranges = self._reached(box)
        stage = within if callable(within) else self.stage_of(within, layer)
        numbers = range(len(self.isovalues)) if numbers is None else numbers
        leaves, found = self._found(ranges, numbers, stage, call, partial)
        parts_of: dict[int, list[TilePart]] = {}
        incomplete: set[int] = set()
        for place, number in enumerate(numbers):
            if number not in parts_of:
                # what a tile has at a group's isovalues is decoded once
                group = self.head.group_of(number)
                parts_of |= {each: [] for each in numbers[place:] if each in group}
                for tile, drawn in self._all_drawn(self._segments(found[group], leaves), parts_of, call):
                    incomplete |= {
                        each for each in tile.numbers if each in parts_of and len(tile.of(each)) - 1 < tile.last
                    }
                    for each, part in drawn.items():
                        parts_of[each].append(part)
                        call.budget.hold(part, DRAWN * part.nbytes)
            parts, complete = parts_of.pop(number), number not in incomplete
            kind = self._kind(leaves[0], number, 0) if all(one.start == 0 for one in ranges) else Kind.CODED
            origin = None if kind == Kind.CODED else kind == Kind.ABOVE
            for part in parts:
                origin = origin if any(part.index) else part.contour.origin_above
            drawing = clipped(Contour(
                *joined(parts, grid.n), self.isovalues[number], self.shape, complete,
                read_placement(self.metadata, grid.n), self.metadata, origin, self.head.masked,
            ), None if box is None else np.stack([low, high], axis=1))
            call.budget.release(*parts)
            call.keep(drawing.points.nbytes + drawing.cells.nbytes)
            yield drawing

    def fetched(
        self, box: Sequence[Sequence[float]] | None = None, *, within: float | Callable[[Box], float] | None = None,
        layer: int | None = None, partial: bool = False,
    ) -> Iterator[list[list[float]]]:
        """Fetch what `windows` needs of all isovalues in a box, then yield the parts of the box in coded tiles."""
        grid, (low, high, ranges) = self.head.grid, self._reached(box)
        stage = within if callable(within) else self.stage_of(within, layer)
        _, found = self._found(ranges, range(len(self.isovalues)), stage, Shared(self.limits), partial)
        index = np.concatenate([each.index for wanted in found.values() for each in wanted])
        for tile in map(tuple, np.unique(index, axis=0).tolist()):
            first = np.array(grid.origin(tile))
            last = first + grid.size(tile) - 1
            yield np.stack([np.maximum(low, first), np.minimum(high, last)], axis=1).tolist()

    def _reached(
        self, box: Sequence[Sequence[float]] | None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[range, ...]]:
        """First and last samples of a box, by default all, and the box of tiles that it reaches into."""
        low, high = bounds_of(self.shape, box)
        return low, high, self.head.grid.touching(np.floor(low).astype(np.int64), np.ceil(high).astype(np.int64))

    def plain(self, index: Index, isovalue: float | None = None, layer: int | None = None) -> bytes:
        """Make a separate ``.iso`` file of a tile, with all isovalues of the group of one."""
        number = self.number_of(isovalue)
        (tile,) = self.tiles([index], number, self.stage_of(None, layer))
        return plain(self.head, tile, number)

    def _all_drawn(
        self, tiles: Iterable[GroupSegments], wanted: Collection[int], call: Shared
    ) -> Iterator[tuple[GroupSegments, dict[int, TilePart]]]:
        """Draw tiles at the isovalues that are wanted, some at a time in threads, each only once."""
        waiting = iter(tiles)
        while some := [*islice(waiting, AT_ONCE * self._threads)]:
            asked = [(tile, [each for each in tile.numbers if each in wanted and any(tile.of(each))]) for tile in some]
            coded = [(tile, numbers) for tile, numbers in asked if numbers]
            files = [plain(self.head, tile, numbers[0]) for tile, numbers in coded]
            drawn = iter(call.each(files, functools.partial(self._drawn, coded), self._threads))
            yield from ((tile, next(drawn) if numbers else {}) for tile, numbers in asked)

    def _drawn(
        self, coded: Sequence[tuple[GroupSegments, list[int]]], place: int, decoded: GridContents
    ) -> dict[int, TilePart]:
        """Draw one of several tiles, which has been decoded, at its isovalues that are wanted."""
        (tile, numbers), grid, found = coded[place], self.head.grid, dict[int, TilePart]()
        for number in numbers:
            contour, ends = decoded.ends(tile.numbers.index(number))
            stage = len(tile.of(number)) - 1
            found[number] = TilePart(
                tile.index, stage, 1 << self.head.stages[stage].edge, grid.origin(tile.index), grid.size(tile.index),
                contour, ends, decoded.whole_cells,
            )
        return found

    # -- what is fetched ---------------------------------------------------------------------------------------------

    def tiles(self, wanted: Iterable[Index], isovalue: int, stage: int) -> list[GroupSegments]:
        """Get the segments of tiles up to a stage, at the isovalues of the group of one."""
        index = np.array([*wanted], np.int64)
        call, out = Shared(self.limits), list[GroupSegments]()
        block_of = [self._number_of[tuple(block)] for block in (index >> self.head.grid.block).tolist()]
        leaves = self._read_leaves(sorted(set(block_of)), call)
        for number in dict.fromkeys(block_of):
            own = index[np.array(block_of) == number]
            positions = self.head.grid.positions(self._blocks[number], own)
            each = TilesWanted(number, stage, self.head.group_of(isovalue), own, positions)
            self._get([each], leaves, False)
            out += self._segments([each], leaves)
        return out

    def kinds(self, ranges: Sequence[range], strand: int) -> NDArray[np.int64]:
        """Kinds of a box of tiles in a strand."""
        out = np.zeros([len(one) for one in ranges], np.int64)
        for block, leaf in self._leaves_in(ranges, Shared(self.limits)).items():
            own = [range(max(a.start, b.start), min(a.stop, b.stop))
                   for a, b in zip(ranges, self._extent(block), strict=True)]
            index = np.stack(np.meshgrid(*own, indexing="ij"), axis=-1)
            positions = self.head.grid.positions(self._blocks[block], index.reshape(-1, len(own)))
            here = tuple(slice(a.start - b.start, a.stop - b.start) for a, b in zip(own, ranges, strict=True))
            out[here] = leaf[strand].kinds_at(positions).reshape(index.shape[:-1])
        return out

    def coded(self, ranges: Sequence[range], number: int) -> Iterator[GroupSegments]:
        """Get the segments of the coded tiles in a box of tiles at an isovalue."""
        leaves, found = self._found(ranges, [number], len(self.head.stages) - 1, Shared(self.limits))
        yield from self._segments(found[self.head.group_of(number)], leaves)

    def prefetch(self, ranges: Sequence[range], numbers: Sequence[int]) -> None:
        """Fetch what `coded` and `tiles` need of some isovalues, if it is not too much to be kept."""
        self._found(ranges, numbers, len(self.head.stages) - 1, Shared(self.limits))

    def leaves(self, numbers: Sequence[int]) -> list[Leaf]:
        """Fetch leaf directories, by number."""
        found = self._read_leaves(list(numbers), Shared(self.limits))
        return [found[number] for number in numbers]

    def _found(
        self, ranges: Sequence[range], numbers: Sequence[int], stage: int | Callable[[Box], float], call: Shared,
        partial: bool = False,
    ) -> tuple[dict[int, Leaf], dict[range, list[TilesWanted]]]:
        """Find the tiles in a box of tiles that are coded at some isovalues, by their group, and fetch their segments.
        """
        leaves = self._leaves_in(ranges, call)
        groups = dict.fromkeys(map(self.head.group_of, numbers))
        found = {group: [*self._coded(ranges, leaves, group, {*group}.intersection(numbers), stage)]
                 for group in groups}
        self._get([each for wanted in found.values() for each in wanted], leaves, partial)
        return leaves, found

    def _extent(self, number: int) -> list[range]:
        """Tiles of a block along each axis."""
        grid, block = self.head.grid, self._blocks[number]
        return [range(b << grid.block, (b << grid.block) + size)
                for b, size in zip(block, grid.extent(block), strict=True)]

    def _leaves_in(self, ranges: Sequence[range], call: Shared) -> dict[int, Leaf]:
        """Get the directories of the blocks with tiles in a box of tiles."""
        return self._read_leaves([
            number for number in range(len(self._blocks))
            if all(a.start < b.stop and b.start < a.stop for a, b in zip(ranges, self._extent(number), strict=True))
        ], call)

    def _read_leaves(self, numbers: list[int], call: Shared) -> dict[int, Leaf]:
        """Get leaf directories, kept or fetched."""
        self._pieces.begin(self.limits.bytes, KEPT)
        missing = [self._leaf_range(number) for number in numbers if number not in self._leaves]
        self._pieces.fetch(self._fetched, missing)
        found = {}
        for number in numbers:
            size = int(self.root.lengths[number])
            if number not in self._leaves:
                call.budget.check(LEAF_PEAK * size)
                self._leaves[number] = self._read_leaf(number)
            found[number] = self._leaves[number]
            call.keep(LEAF_KEPT * size)
        while sum(LEAF_KEPT * int(self.root.lengths[number]) for number in self._leaves) > KEPT:
            del self._leaves[next(iter(self._leaves))]
        return found

    def _leaf_range(self, number: int) -> Range:
        start, end = self.root.leaves[number : number + 2].tolist()
        return start, end

    def _read_leaf(self, number: int) -> Leaf:
        at = int(self.root.leaves[number])
        data = self._pieces.get(*self._leaf_range(number))
        if zlib.crc32(data) != self.root.checksums[number]:
            raise wrong("a leaf directory's checksum is wrong", "checksum", at, "12.4")
        tiles = int(np.prod(self.head.grid.extent(self._blocks[number])))
        leaf = read_leaf(self.head, data, tiles, at)
        if sizes_of(self.head, leaf) != self.root.sizes[number].tolist():
            raise wrong("a leaf directory and the root disagree", "leaf", at, "12.4")
        return leaf

    def _kind(self, leaf: Leaf, isovalue: int, position: int) -> Kind:
        """Kind of a tile of a block; of one without any valid sample, below."""
        at = np.array([position])
        if self.head.masked and leaf[0].kinds_at(at)[0] == Kind.ABOVE:
            return Kind.BELOW
        return Kind(leaf[isovalue + self.head.masked].kinds_at(at)[0])

    def _coded(
        self, ranges: Sequence[range], leaves: Mapping[int, Leaf], group: range, numbers: Collection[int],
        stage: int | Callable[[Box], float],
    ) -> Iterator[TilesWanted]:
        """Find the coded tiles in a box of tiles, block by block and stage by stage."""
        low, high = ([getattr(one, end) for one in ranges] for end in ("start", "stop"))
        for block, leaf in leaves.items():
            strands = [leaf[number + self.head.masked].coded for number in numbers]
            positions = strands[0] if len(strands) == 1 else np.unique(np.concatenate(strands))
            index = self.head.grid.at(self._blocks[block], positions)
            inside = ((index >= low) & (index < high)).all(axis=1)
            index, positions = index[inside], positions[inside]
            if not callable(stage):
                yield TilesWanted(block, stage, group, index, positions)
                continue
            windows = map(self.head.grid.window, map(tuple, index.tolist()))
            stages = np.array([self.stage_of(stage([(w.start, w.stop - 1) for w in each])) for each in windows])
            for own in np.unique(stages).tolist():
                yield TilesWanted(block, own, group, index[stages == own], positions[stages == own])

    def _parts(self, wanted: TilesWanted, leaf: Leaf) -> Iterator[tuple[int, int, TileStrand, NDArray[np.int64]]]:
        """Parts of the file with segments of tiles: area, stage, strand, and the tiles' numbers among its coded ones.

        The mask first, then stage by stage. Numbers are -1 for tiles without segments there.
        """
        masked = self.head.masked
        strands = [(0, 0, leaf[0])] * masked
        strands += [(self.head.area(number, stage), stage, leaf[number + masked])
                    for stage in range(wanted.stage + 1) for number in wanted.group]
        for area, stage, strand in strands:
            at = np.minimum(np.searchsorted(strand.coded, wanted.positions), max(len(strand.coded) - 1, 0))
            there = (strand.coded[at] == wanted.positions) if len(strand.coded) else np.zeros(len(at), np.bool_)
            there[there] = strand.lengths[at[there], stage] > 0
            yield area, stage, strand, np.where(there, at, -1)

    def _groups(self, wanted: TilesWanted, leaf: Leaf) -> Iterator[tuple[Range, int]]:
        """Ranges of the groups with segments of tiles, each with its checksum."""
        for area, stage, strand, tiles in self._parts(wanted, leaf):
            start = int(self.root.segments[wanted.block, area])
            for group in np.unique(strand.group_of(stage, tiles[tiles >= 0])).tolist():
                first, after = strand.starts[strand.groups[stage][group : group + 2], stage].tolist()
                yield (start + first, start + after), int(strand.checksums[stage][group])

    def _get(self, wanted: Sequence[TilesWanted], leaves: Mapping[int, Leaf], partial: bool) -> None:
        """Fetch the groups with segments of tiles, and verify them."""
        groups = dict(group for each in wanted for group in self._groups(each, leaves[each.block]))
        self._pieces.fetch(self._fetched, groups, partial)
        for (start, end), checksum in groups.items():
            if self._pieces.has(start, end) and zlib.crc32(self._pieces.get(start, end)) != checksum:
                raise wrong("a checksum of segments is wrong", "checksum", start, "12.5")

    def _segments(
        self, wanted: Sequence[TilesWanted], leaves: Mapping[int, Leaf]
    ) -> Iterator[GroupSegments]:
        """Give those segments of tiles that have been fetched."""
        masked = self.head.masked
        for each in wanted:
            leaf = leaves[each.block]
            parts = [(self.root.segments[each.block, area], stage, strand, tiles)
                     for area, stage, strand, tiles in self._parts(each, leaf)]
            coded = np.array([np.isin(each.positions, leaf[number + masked].coded) for number in each.group])
            for i, index in enumerate(map(tuple, each.index.tolist())):
                numbers = [number for number, own in zip(each.group, coded[:, i].tolist(), strict=True) if own]
                own_parts = [
                    part for k, part in enumerate(parts) if k < masked or coded[(k - masked) % len(each.group), i]
                ]
                segments = []
                for start, stage, strand, tiles in own_parts:
                    tile = int(tiles[i])
                    first, after = (start + strand.starts[tile : tile + 2, stage]).tolist() if tile >= 0 else (0, 0)
                    if not self._pieces.has(first, after):
                        break
                    segments.append(self._pieces.get(first, after))
                mask = segments.pop(0) if masked and segments else b""
                yield GroupSegments(index, numbers, mask, segments, each.stage)

    def number_of(self, isovalue: float | None) -> int:
        """Number of an isovalue, 0 for None; raises `OptionError` if the file has no such isovalue."""
        return number_of(isovalue, self.isovalues, noun_of(self.metadata))


def plain(head: Head, tile: GroupSegments, number: int) -> bytes:
    """Make an ``.iso`` file of a tile with the isovalues of a group at which it is coded, else without layers of one.
    """
    return file_of(head, tile.index, tile.mask, [*group_chunks(head, tile)], (tile.numbers or [number])[0])


def group_chunks(head: Head, tile: GroupSegments, first: int = 0) -> Iterator[bytes]:
    """Yield the chunks of a tile at the isovalues of a group; the first isovalue has number ``first`` in its file.

    It begins with the file's header if that is 0, else with a chunk here.
    """
    count = len(tile.numbers)
    for place, number in enumerate(tile.numbers):
        if first + place:
            lean = first + place - 1 if place else None
            yield write_chunk(ChunkType.ISOVALUE, write_further(first + place, head.isovalues[number], lean))
    for at, segment in enumerate(tile.segments):
        if count > 1:
            place = first + at % count
            yield write_chunk(ChunkType.TURN, write_turn(range(place, place + 1)))
        yield segment


def file_of(
    head: Head, index: Index, mask: bytes, chunks: Iterable[bytes], number: int, notes: Mapping[str, str] | None = None
) -> bytes:
    """Make an ``.iso`` file of a tile from chunks; its header has the isovalue of that number."""
    header = Header(head.grid.size(index), head.isovalues[number], head.scale, head.profile)
    last = write_chunk(ChunkType.METADATA, write_metadata(notes) if notes else b"", ancillary=True, last=True)
    return b"".join(closed([write_header(header), mask, *chunks, last]))
