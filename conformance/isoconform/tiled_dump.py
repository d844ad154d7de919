"""The decoded state of a file in tiles (spec clause 12) as canonical text (annex B.4)."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from isocodec.errors import IsoError, KernelError, LimitError, TruncatedError
from isocodec.limits import Limits
from isocodec.storage.ranges import ranges_of
from isocodec.tiles.tiled import TiledFile

from .dump import COMPLETE, Output, dump

SIGNATURE = b"\x89IST"
MOST_TILES = 65536
"""Tiles of a file whose text is made; one of more is refused."""


def is_tiled(data: bytes) -> bool:
    """Whether a file is meant to be in tiles."""
    return data[3:4] == SIGNATURE[3:]


def dump_tiled(data: bytes, limits: Limits | None = None) -> Output:
    """Decode all tiles of a file, for each isovalue, with the reference decoder."""
    symbols: Counter[str] = Counter()
    try:
        text = "".join(f"{line}\n" for line in _lines(data, limits, symbols))
    except KernelError:
        # the file is not to blame
        raise
    except IsoError as wrong:
        return Output(wrong.exit_code, "", wrong)
    return Output(COMPLETE, text, symbols=dict(symbols))


def _lines(data: bytes, limits: Limits | None, symbols: Counter[str]) -> list[str]:
    file = TiledFile(ranges_of(data), limits)
    counts = file.head.grid.counts
    if len(data) < file.root.total:
        raise TruncatedError("the file ends before its last segment", offset=len(data))
    if math.prod(counts) > MOST_TILES:
        raise LimitError("a text of so many tiles")
    lines = [" ".join(map(str, ("tiles", *file.shape)))]
    for number in range(0, len(file.isovalues), file.head.together):
        lines.append(f"isovalue {number}")
        for index in np.ndindex(*counts):
            output = dump(file.plain(index, file.isovalues[number]), limits=limits)
            if output.error is not None:
                raise output.error
            symbols.update(output.symbols)
            if any(line.startswith("v ") for line in output.text.partition("mask\n")[0].splitlines()):
                lines += [f"tile {' '.join(map(str, index))}", *output.text.splitlines()]
    return lines
