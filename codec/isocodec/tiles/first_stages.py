"""Make a tiled file from the first stages of another; its segments are unchanged, since areas are sorted by stage."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..errors import OptionError, TruncatedError
from ..stream.promises import last_promise
from .head import write_head
from .leaf import sizes_of, write_leaf
from .tiled import TiledFile

_PIECE = 1 << 22


def first_stages(file: TiledFile, count: int) -> Iterator[bytes]:
    """Yield the bytes of a tiled file with the first ``count`` stages of another, or all stages if it has fewer.

    Damaged segments keep their checksums, which do not match. Raises `OptionError` if ``count`` is less than 1,
    `FormatError` if the directories are damaged, and `TruncatedError` if the file ends before these stages.
    """
    if count < 1:
        raise OptionError(f"layers is {count}; it must be at least 1", code="layers")
    head, root = file.head, file.root
    notes = head.metadata if count >= len(head.stages) else last_promise(head.metadata)
    short = replace(head, stages=head.stages[:count], metadata=notes)
    leaves = []
    for leaf in file.leaves(range(len(root.lengths))):
        kept = [
            strand if number < head.masked
            else replace(strand, lengths=strand.lengths[:, :count], checksums=strand.checksums[:count])
            for number, strand in enumerate(leaf)
        ]
        leaves.append((write_leaf(short, kept), sizes_of(short, kept)))
    yield write_head(short, leaves)
    for data, _ in leaves:
        yield data
    at = int(root.leaves[-1])
    end = at + int(np.sum(root.sizes[:, : short.areas]))
    while at < end:
        piece = file.fetch(at, min(at + _PIECE, end))
        if not piece:
            raise TruncatedError(f"the file ends at {at:,}, before its tiles do", code="truncated", offset=at,
                                 clause="12.4")
        yield piece
        at += len(piece)
