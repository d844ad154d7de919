"""Vectors of chunks where they may not be: every type of chunk in every kind of file, critical and ancillary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import isocodec
from isocodec import encode
from isocodec.field.meshed import StoredName
from isocodec.format.chunks import write_further
from isospec.container import ChunkType, write_varint

from .draft import Draft
from .explicit_dump import written as mesh_text
from .streams import Chunk, bare, split
from .tiled import written as tiled
from .tiled_file import CODED

UNKNOWN = next(number for number in range(1, 32) if number not in set(ChunkType))
"""A type of chunk that is none."""
TYPES = (*ChunkType, UNKNOWN)
ANCILLARY = {
    ChunkType.METADATA, ChunkType.INDEX, ChunkType.PROMISES, ChunkType.COORDINATES, ChunkType.FRAME_END,
}
"""Types of chunks that are always ancillary (clause 3.5.1)."""
PAYLOADS = {
    ChunkType.LAYERS: b"\0", ChunkType.METADATA: b"{}",
    ChunkType.ISOVALUE: write_further(1, 9.5, None), ChunkType.PROMISES: b"\0\1\1",
    ChunkType.DOMAIN: b"\0" + write_varint(0) + write_varint(4) + write_varint(2) + bytes(16),
    ChunkType.TURN: write_varint(0) + write_varint(1), ChunkType.SERIES: write_varint(2),
}
"""Payloads that are right by themselves; others are empty."""
POINTS, CELLS = np.array([[0, 0], [9, 1], [4, 8], [12, 9], [2, 13]], float), np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]])
VALUES = np.array([0, 1, 2, 3, 1])
FIELD = np.array([[0, 0, 1], [0, 2, 1], [3, 1, 0]])


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    data : bytes
        A valid file.
    explicit, surface, series, masked : bool
        What clauses 3.5.6 to 3.5.9, 10.1.1 and 10.9.1 distinguish.
    mesh : str
        The mesh that it was made on, if the file does not hold it.
    """

    data: bytes
    explicit: bool = False
    surface: bool = False
    series: bool = False
    masked: bool = False
    mesh: str = ""

    def clause(self, number: int, ancillary: bool, first: bool = False) -> str | None:
        """The clause that a further chunk violates; None if its type may be there.

        It is the last chunk or, with ``first``, the first one of a file of an explicit domain.
        """
        if number == UNKNOWN:
            return None if ancillary else "3.5.2"
        if ancillary != (number in ANCILLARY):
            return "3.5.2"
        if ancillary:
            return None
        if self.explicit:
            if number == ChunkType.MASK:
                return "10.1.1"
            if first or number == ChunkType.DOMAIN:
                return "3.5.8"
            if self.surface:
                return "10.9.1"
        match number:
            case ChunkType.DOMAIN:
                return "3.5.8"
            case ChunkType.SERIES:
                return "3.5.7"
            case ChunkType.FRAME if not self.series:
                return "3.5.7"
            case ChunkType.ISOVALUE | ChunkType.MASK if self.series:
                return "3.5.7"
            case ChunkType.MASK if self.masked:
                return "3.5.6"
            case ChunkType.TURN if self.explicit or self.series:
                return "3.5.9"
        return None

    def with_chunk(self, chunk: Chunk, first: bool) -> bytes:
        """The file with a further chunk; ``first`` as for `clause`."""
        file = split(self.data)
        return bytes(file.with_chunks(chunk, *file.chunks) if first else file.with_chunks(*file.chunks, chunk))


class _Tiles(Kind):
    """A file in tiles, whose first coded tile gets the chunk."""

    def with_chunk(self, chunk: Chunk, first: bool) -> bytes:
        file = tiled(2, 2, 2)
        block = file.blocks[0]
        target = next(run for run in block.channels[0] if run.kind == CODED)
        *begin, end = target.segments[0]
        run = replace(target, segments=[[*begin, end + chunk.enveloped()], *target.segments[1:]])
        changed = [run if each is target else each for each in block.channels[0]]
        return bytes(replace(file, blocks=[replace(block, channels=[changed]), *file.blocks[1:]]))


def _on_mesh(stored: StoredName, scattered: bool = False) -> bytes:
    mesh = isocodec.Mesh(POINTS, None if scattered else CELLS, VALUES, stored=stored)
    return encode(mesh, 1.5, precision="signs")


def kinds() -> dict[str, Kind]:
    """Kinds of files, by name."""
    plain: dict[str, Any] = {"precision": "signs", "profile": "baseline", "layers": 0}
    gone = np.zeros(FIELD.shape, np.bool_)
    gone[2, 2] = True
    masked = isocodec.Field(FIELD, gone)
    mesh = mesh_text((POINTS.astype(np.int64), CELLS))
    frames = isocodec.Frames([FIELD, FIELD.T])
    moving = isocodec.Mesh(POINTS, CELLS, np.stack([VALUES, VALUES[::-1]]), stored="whole")
    surface = bare(encode(isocodec.thin(FIELD.astype(float), error=0.5)))
    return {
        "grid": Kind(encode(FIELD, 0.5, **plain)),
        "isovalues": Kind(encode(FIELD, [0.5, 1.5], **plain)),
        "masked": Kind(encode(masked, 0.5, **plain), masked=True),
        "series": Kind(encode(frames, 0.5, interval=0, **plain), series=True),
        "known": Kind(_on_mesh("known"), explicit=True, mesh=mesh),
        "coded": Kind(_on_mesh("whole"), explicit=True),
        "delaunay": Kind(_on_mesh("whole", scattered=True), explicit=True),
        "mesh_series": Kind(encode(moving, 1.5, precision="signs", interval=0), explicit=True, series=True),
        "surface": Kind(surface, explicit=True, surface=True),
        "tiles": _Tiles(b""),
    }


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for name, kind in kinds().items():
        for number in TYPES:
            for ancillary in (False, True):
                for first in (False, True) if kind.explicit else (False,):
                    chunk = Chunk(number, PAYLOADS.get(ChunkType(number), b"") if number != UNKNOWN else b"", ancillary)
                    clause = kind.clause(number, ancillary, first)
                    # the same error at the other end shows nothing more
                    if clause is None or (first and clause in (kind.clause(number, ancillary), "3.5.2")):
                        continue
                    wrong = ancillary != (number in ANCILLARY)
                    how = ("_ancillary" if ancillary else "_critical" if number in ANCILLARY else "") if wrong else ""
                    about = f"a chunk of type {int(number)}{' marked as ' + how[1:] if how else ''} in a file: {name}"
                    yield Draft(
                        f"bad_{name}_chunk_{int(number)}{how}{'_first' if first else ''}",
                        kind.with_chunk(chunk, first), 2, (f"refused: {about}",), clause, mesh=kind.mesh,
                    )
