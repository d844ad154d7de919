"""Extract a window of a tiled file as an ordinary file: the chunks of one tile unchanged, or several tiles joined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OptionError
from ..field.samples import Samples
from ..grid.tube.decoded import Decoded
from ..stream.cropped_source import box_of, moved_notes
from ..stream.promises import last_promise
from ..stream.recoder import Source, source_of
from .layout import Index
from .shared_limits import Shared
from .structure import Kind
from .tiled import TiledFile, file_of, group_chunks, plain


class Extract:
    """A box (window) of samples of a tiled file.

    It is enlarged to whole samples, and its start is rounded down to even indices, so that the full grid has the same
    diagonals. `low` and `size` are the first sample and the number of samples along each axis; `notes` those of the
    file, with the placement shifted so that all samples keep their positions. Raises `OptionError` if the box is not
    valid, and `LimitError` if it has too many samples.
    """

    def __init__(self, file: TiledFile, box: Sequence[Sequence[float]] | None) -> None:
        self._file = file
        self.low, self.size = box_of(file.shape, box, file.limits)
        self.notes = moved_notes(file.metadata, self.low)
        low, size = np.array([self.low, self.size], np.int64)
        self._ranges = file.head.grid.touching(low, low + size - 1)
        self._call = Shared(file.limits)

    def strands(self, numbers: Sequence[int]) -> bytes | None:
        """Make a file of isovalues, by number, from unchanged bytes; None unless the box is a tile with all of them.
        """
        head = self._file.head
        index = tuple(low >> head.grid.exponent for low in self.low)
        if any(i >= count for i, count in zip(index, head.grid.counts, strict=True)):
            return None
        if (head.grid.origin(index), head.grid.size(index)) != (self.low, self.size):
            return None
        self._file.prefetch(self._ranges, numbers)
        groups = dict.fromkeys(map(head.group_of, numbers))
        found = [self._file.tiles([index], group[0], len(head.stages) - 1)[0] for group in groups]
        if [number for tile in found for number in tile.numbers] != [*numbers]:
            # a tile without a curve, or only some isovalues of a group
            return None
        chunks: list[bytes] = []
        done = 0
        for tile in found:
            chunks += group_chunks(head, tile, done)
            done += len(tile.numbers)
        return file_of(head, index, found[0].mask, chunks, numbers[0], last_promise(self.notes))

    def sources(self, numbers: Sequence[int]) -> list[Source]:
        """Recover the sources of isovalues, by number, from the tiles, as from an ordinary file.

        Raises `OptionError` if the meshes of the tiles are not the full grid, and `FormatError` or `LimitError`.
        """
        head = self._file.head
        last = head.stages[-1]
        if last.adaptive or last.edge:
            one = " x ".join(str((1 << head.grid.exponent) + 1) for _ in self.low)
            raise OptionError(
                "the file's meshes are coarser than the grid: only whole tiles can be extracted", code="extract",
                remedy=f"ask for the window of one tile ({one} samples), or decode the window",
            )
        self._file.prefetch(self._ranges, numbers)
        told = [self._told(number) for number in numbers]
        gone = np.logical_or.reduce([each for _, each, _ in told])
        missing = gone if gone.any() else None
        return [
            source_of(state, Samples(signs, head.isovalues[number], signs, head.scale, missing), "the file")
            for number, (signs, _, state) in zip(numbers, told, strict=True)
        ]

    def _told(self, number: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Decoded]:
        """Signs of an isovalue, samples that its tiles mark as missing, and the decoded state that the tiles hold."""
        head, told = self._file.head, []
        # the tile along each axis that a sample belongs to, or one of the two
        tile = np.ix_(*(
            np.minimum(np.arange(low, low + size) >> head.grid.exponent, one.stop - 1) - one.start
            for low, size, one in zip(self.low, self.size, self._ranges, strict=True)
        ))
        signs = (self._file.kinds(self._ranges, number + head.masked) == Kind.ABOVE)[tile]
        gone = np.zeros(self.size, np.bool_)
        if head.masked:
            gone = (self._file.kinds(self._ranges, 0) == Kind.ABOVE)[tile]
            signs &= ~gone
        for tile_there in self._file.coded(self._ranges, number):
            here, there = self._windows(tile_there.index)
            decoder = self._call.decoded(plain(head, tile_there, number))
            place = tile_there.numbers.index(number)
            signs[here] = decoder.above(place)[there]
            gone[here] |= ~decoder.valid()[there]
            state = decoder.state(place)
            assert state is not None
            told.append(self._moved(state, np.subtract(head.grid.origin(tile_there.index), self.low)))
        return signs, gone, _together(told, self.size)

    def _windows(self, index: Index) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
        """Samples of a tile that lie in the box, as ranges in the box and in the tile."""
        grid = self._file.head.grid
        bounds = [
            (max(o, low), min(o + s, low + size), o, low)
            for o, s, low, size in zip(grid.origin(index), grid.size(index), self.low, self.size, strict=True)
        ]
        here = tuple(slice(a - low, b - low) for a, b, _, low in bounds)
        return here, tuple(slice(a - o, b - o) for a, b, o, _ in bounds)

    def _moved(self, state: Decoded, move: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        """Crop a state to the box, and shift it to the box's origin."""
        last = np.array(self.size) - 1
        position, low, high = state.position + move, state.edge_low + move, state.edge_high + move
        kept = ((position >= 0) & (position <= last)).all(axis=1)
        edges = ((low >= 0) & (high <= last)).all(axis=1)
        return {
            "position": position[kept], "above": state.above[kept], "missing": state.missing[kept],
            "number": state.number[kept], "edge_low": low[edges], "edge_high": high[edges],
            "edge_parts": state.edge_parts[edges], "edge_number": state.edge_number[edges],
        }


def _together(told: Sequence[Mapping[str, NDArray[Any]]], size: Index) -> Decoded:
    """Join the states of tiles, with shared faces once; each sample comes from the tile with most bits of it."""
    n = len(size)
    none: dict[str, NDArray[Any]] = {
        "position": np.zeros((0, n), np.int64), "edge_low": np.zeros((0, n), np.int64),
        "edge_high": np.zeros((0, n), np.int64), "above": np.zeros(0, np.bool_),
    }
    names = ("position", "above", "missing", "number", "edge_low", "edge_high", "edge_parts", "edge_number")
    whole = {
        name: np.concatenate([none.get(name, np.zeros(0, np.int64)), *(each[name] for each in told)]) for name in names
    }
    # complete numbers first, then those with missing bits, then samples without numbers
    order = np.argsort(np.where(whole["missing"] < 0, 64, whole["missing"]), kind="stable")
    _, first = np.unique(whole["position"][order], axis=0, return_index=True)
    whole.update({name: whole[name][order[first]] for name in names if not name.startswith("edge")})
    _, once = np.unique(np.concatenate([whole["edge_low"], whole["edge_high"]], axis=1), axis=0, return_index=True)
    whole.update({name: whole[name][once] for name in names if name.startswith("edge")})
    return Decoded(size, 0, np.zeros((0, n), np.int64), **whole)
