"""Leaf directories of a tiled file, as bytes (spec clause 12.5)."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isospec.container import Checksum, write_varint

from .numbers import Reader, wrong
from .structure import Head, Kind, Leaf, groups_of


def write_leaf(head: Head, leaf: Leaf) -> bytes:
    """A leaf directory: kinds in runs, lengths of segments, checksums of their groups."""
    out = []
    for strand, kinds in enumerate(leaf.kinds):
        areas = head.areas_of(strand)
        starts = np.flatnonzero(np.diff(kinds, prepend=-1))
        for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(kinds)], strict=True):
            out.append(write_varint(int(kinds[start]) | (end - start - 1) << 2))
            if kinds[start] == Kind.CODED:
                out += [write_varint(int(leaf.lengths[a, i])) for i in range(start, end) for a in areas]
    out += [Checksum.build(int(value)) for values in leaf.checksums for value in values]
    return b"".join(out)


def read_leaf(head: Head, data: bytes, tiles: int, at: int) -> Leaf:
    """Inverse of ``write_leaf`` for a given number of tiles; the leaf begins at ``at`` in the file.

    Raises
    ------
    FormatError
    """
    reader = Reader(data, 0, len(data), at)
    kinds = np.zeros((head.strands, tiles), np.uint8)
    lengths = np.zeros((head.areas, tiles), np.int64)
    for strand in range(head.strands):
        areas, done = head.areas_of(strand), 0
        while done < tiles:
            number = reader.number()
            kind, end = number & 3, done + (number >> 2) + 1
            if kind > Kind.CODED or end > tiles:
                raise wrong("invalid run of tiles", "leaf", at + reader.at, "12.5")
            kinds[strand, done:end] = kind
            if kind == Kind.CODED:
                # checked before memory is allocated; each length takes at least a byte
                reader.check((end - done) * len(areas))
                lengths[areas, done:end] = np.array(
                    [[reader.number() for _ in areas] for _ in range(done, end)], np.int64
                ).T
            done = end
    if lengths.max(initial=0) >= 1 << 40:
        raise wrong("a segment is too long", "leaf", at, "12.5")
    checksums = []
    for area in range(head.areas):
        count = len(groups_of(lengths[area])) - 1
        packed = reader.bytes(4 * count)
        checksums.append(np.frombuffer(packed, ">u4").astype(np.int64))
    if reader.at != len(data):
        raise wrong("bytes after a leaf directory", "leaf", at + reader.at, "12.5")
    return Leaf(kinds, lengths, checksums)


def checksums_of(segments: Sequence[bytes]) -> NDArray[np.int64]:
    """Compute the checksums of the groups of a leaf's segments in an area."""
    bounds = groups_of(np.array([len(s) for s in segments], np.int64)).tolist()
    return np.array([zlib.crc32(b"".join(segments[a:b])) for a, b in pairwise(bounds)], np.int64)
