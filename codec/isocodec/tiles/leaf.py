"""Leaf directories of a tiled file, as bytes (spec clause 12.5)."""

from __future__ import annotations

import zlib
from array import array
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isospec.container import MAX_VARINT, Checksum, write_varint

from .numbers import wrong
from .structure import Head, Kind, Leaf, TileStrand, groups_of


def write_leaf(head: Head, leaf: Leaf) -> bytes:
    """A leaf directory: kinds in runs, lengths of segments, checksums of their groups."""
    out, sums = [], [b""] * head.areas
    for number, strand in enumerate(leaf):
        done = tile = 0
        for end, kind in zip(strand.ends.tolist(), strand.kinds.tolist(), strict=True):
            out.append(write_varint(kind | (end - done - 1) << 2))
            if kind == Kind.CODED:
                out += map(write_varint, strand.lengths[tile : tile + end - done].ravel().tolist())
                tile += end - done
            done = end
        for area, checksums in zip(head.areas_of(number), strand.checksums, strict=True):
            sums[area] = b"".join(Checksum.build(int(value)) for value in checksums)
    return b"".join([*out, *sums])


def strand_of(kinds: NDArray[np.uint8], lengths: NDArray[np.int64], areas: Iterable[Sequence[bytes]]) -> TileStrand:
    """Make a strand of a block from kinds of its tiles (K,), lengths of their segments (K, S), and these by area."""
    checksums = []
    for segments in areas:
        bounds = groups_of(np.array([len(segment) for segment in segments], np.int64)).tolist()
        checksums.append(np.array([zlib.crc32(b"".join(segments[a:b])) for a, b in pairwise(bounds)], np.int64))
    ends = np.append(np.flatnonzero(np.diff(kinds)) + 1, len(kinds))
    coded = np.flatnonzero(kinds == Kind.CODED)
    return TileStrand(ends, kinds[ends - 1].astype(np.int64), coded, lengths[coded], checksums)


class _Varints:
    """Varints of a leaf directory, all read at once.

    Attributes
    ----------
    values, ends : (V,) int64
        Numbers, and where they end.
    next : int
    """

    def __init__(self, data: bytes, at: int) -> None:
        view = np.frombuffer(data, np.uint8)
        self.ends = np.flatnonzero(view < 0x80) + 1
        starts = np.append(0, self.ends[:-1])[: len(self.ends)]
        sizes = self.ends - starts
        self.values = np.zeros(len(sizes), np.int64)
        for byte in range(min(int(sizes.max(initial=0)), MAX_VARINT)):
            there = np.flatnonzero(sizes > byte)
            self.values[there] = self.values[there] << 7 | view[starts[there] + byte] & 0x7F
        # bytes after the varints may be anything
        self._wrong = np.flatnonzero((sizes > MAX_VARINT) | ((sizes > 1) & (view[starts] == 0x80)))
        self._at, self._length, self.next = at, len(data), 0

    @property
    def place(self) -> int:
        """Offset of the next number."""
        return int(self.ends[self.next - 1]) if self.next else 0

    def take(self, count: int) -> NDArray[np.int64]:
        """Read the next numbers; raises `FormatError` if one is malformed."""
        first, self.next = self.next, self.next + count
        wrong_ = np.searchsorted(self._wrong, first)
        if wrong_ < len(self._wrong) and self._wrong[wrong_] < self.next:
            raise wrong("a number is not well formed", "varint", self._at + self.place, "12.5")
        if self.next > len(self.values):
            raise wrong("a directory ends too early", "directory", self._at + self._length, "12.4")
        return self.values[first : self.next]


def read_leaf(head: Head, data: bytes, tiles: int, at: int) -> Leaf:
    """Inverse of ``write_leaf`` for a given number of tiles; the leaf begins at ``at`` in the file.

    Raises `FormatError`.
    """
    numbers = _Varints(data, at)
    leaf = [_read_strand(numbers, tiles, len(head.areas_of(strand)), at) for strand in range(head.strands)]
    place = numbers.place
    owners = [(0, 0)] * head.masked
    owners += [(i + head.masked, stage) for stage in range(len(head.stages)) for i in range(len(head.isovalues))]
    for strand, stage in owners:
        end = place + 4 * (len(leaf[strand].groups[stage]) - 1)
        if end > len(data):
            raise wrong("a directory ends too early", "directory", at + len(data), "12.4")
        leaf[strand].checksums.append(np.frombuffer(data[place:end], ">u4").astype(np.int64))
        place = end
    if place != len(data):
        raise wrong("bytes after a leaf directory", "leaf", at + place, "12.5")
    return leaf


def _read_strand(numbers: _Varints, tiles: int, stages: int, at: int) -> TileStrand:
    ends, kinds, coded = array("q"), array("q"), [np.zeros(0, np.int64)]
    lengths = [np.zeros(0, np.int64)]
    done = 0
    while done < tiles:
        place = numbers.place
        number = int(numbers.take(1)[0])
        kind, end = number & 3, done + (number >> 2) + 1
        if kind > Kind.CODED or end > tiles:
            raise wrong("invalid run of tiles", "leaf", at + place, "12.5")
        if kind == Kind.CODED:
            lengths.append(numbers.take((end - done) * stages))
            coded.append(np.arange(done, end))
        ends.append(end)
        kinds.append(kind)
        done = end
    sizes = np.concatenate(lengths).reshape(-1, stages)
    if sizes.max(initial=0) >= 1 << 40:
        raise wrong("a segment is too long", "leaf", at, "12.5")
    return TileStrand(np.array(ends, np.int64), np.array(kinds, np.int64), np.concatenate(coded), sizes)


def sizes_of(head: Head, leaf: Leaf) -> list[int]:
    """Number of bytes of segments in each area."""
    sizes = [0] * head.areas
    for number, strand in enumerate(leaf):
        for area, size in zip(head.areas_of(number), strand.lengths.sum(axis=0).tolist(), strict=True):
            sizes[area] = size
    return sizes
