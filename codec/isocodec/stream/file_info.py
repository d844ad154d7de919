"""Facts about a file that are known without decoding it: chunks, layers, frames (spec clause 3)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from ..errors import TruncatedError
from ..field.isovalues import number_of
from ..field.labelling import caption, listed, noun_of
from ..format.domain import DomainHead
from ..format.surface import TinHead


@dataclass(frozen=True)
class LayerInfo:
    """One layer; ``offset``, ``bytes`` and ``symbols`` are None if the file does not state them.

    Attributes
    ----------
    kind : str
    level : int
    plane : int
        Bits of values that remain to be coded afterwards.
    parts : int
        Number of parts into which edges are divided afterwards.
    offset : int or None
        Byte offset in the file at which its data begin.
    bytes : int or None
    symbols : dict of str to int, or None
    isovalue : int
        Number of the isovalue that it belongs to.
    within : float or None
        How many cells decoded and original curve lie from each other at most, when this layer is complete and no later
        one begun: as the writer promises, or 0 of all values of integers on the full grid. None without a promise. On a
        mesh in the unit of its points.
    frame : int
        Number of the frame that it belongs to.
    """

    kind: str
    level: int
    plane: int
    parts: int
    offset: int | None = None
    bytes: int | None = None
    symbols: dict[str, int] | None = None
    isovalue: int = 0
    within: float | None = None
    frame: int = 0


@dataclass(frozen=True)
class FrameInfo:
    """One frame of a series.

    Attributes
    ----------
    offset, bytes : int
        Byte offset of its first chunk, and number of bytes of all its chunks; for the first frame, from the beginning
        of the file.
    key : bool
        Whether it is a key frame, which is not predicted from earlier frames.
    leans : list of int or None
        For each isovalue, the number of the isovalue of the same frame that it is predicted from.
    before : list of bool
        For each isovalue, whether it is predicted from the same isovalue of the previous frame.
    complete : bool
        Whether all of its bytes are there: the file ends with it, or states that it has ended.
    time : str or None
        ``0.5``, ``6 h`` or ``2024-01-31T06:00``, if the file states it.
    """

    offset: int
    bytes: int
    key: bool
    leans: list[int | None]
    before: list[bool]
    complete: bool = True
    time: str | None = None


@dataclass(frozen=True)
class ChunkInfo:
    """One chunk.

    Attributes
    ----------
    type : str
        Name of its type.
    offset, bytes : int
        Byte offset, and length with envelope and checksums.
    frame, isovalue : int
        Numbers of the frame and the isovalue that it belongs to.
    """

    type: str
    offset: int
    bytes: int
    frame: int = 0
    isovalue: int = 0


@dataclass(frozen=True)
class FileInfo:
    """Result of ``inspect``.

    Attributes
    ----------
    overhead_bytes : int
        All bytes that are not entropy-coded data.
    complete : bool
        Whether the file is complete and its checksum is correct.
    isovalues : list of float
        All isovalues of the file; ``isovalue`` is the first.
    leans : list of int or None
        For each isovalue, the number of the earlier one that it is predicted from.
    topology : list of bool
        For each isovalue, whether the file guarantees that all complete layers have the topology of the original curve.
    mask_bytes : int or None
        Entropy-coded bytes of the mask; None if no sample is missing.
    interval : int or None
        For a series, the interval of key frames; 0 if only the first frame is one. None without frames.
    frames : list of FrameInfo
        Frames of a series; the last one may not be complete.
    coordinates : str or None
        Description of the coordinates of a mapped grid; None for other grids.
    domain : DomainHead or None
        Head of the mesh, for a file on one.
    kind : str
        ``grid``, ``series`` (of grids), ``mesh``, ``surface`` or ``tiles``.
    surface : TinHead or None
        Head of a triangulated surface.
    tile : int or None
        For a tiled file, the number of samples along each axis of a tile.
    tiles : tuple of int or None
        For a tiled file, the number of tiles along each axis.
    turned : bool
        Whether layers of several isovalues come in turn, so that these can only be decoded together.
    """

    version: int
    read_version: int
    profile: str
    shape: tuple[int, ...]
    isovalue: float
    scale: float | None
    bytes: int
    overhead_bytes: int
    complete: bool
    layers: list[LayerInfo] = field(default_factory=list)
    chunks: list[ChunkInfo] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    isovalues: list[float] = field(default_factory=list)
    leans: list[int | None] = field(default_factory=list)
    topology: list[bool] = field(default_factory=list)
    mask_bytes: int | None = None
    interval: int | None = None
    frames: list[FrameInfo] = field(default_factory=list)
    coordinates: str | None = None
    domain: DomainHead | None = None
    kind: str = "grid"
    surface: TinHead | None = None
    tile: int | None = None
    tiles: tuple[int, ...] | None = None
    turned: bool = False

    @property
    def noun(self) -> str:
        """Noun for the isovalues of the file: ``isovalue``, or ``label`` in a file of labels."""
        return noun_of(self.metadata)

    def caption(self, isovalue: float) -> str:
        """Name an isovalue for people: ``isovalue 500.5``, ``label 3``."""
        return caption(isovalue, self.metadata)

    def number_of(self, isovalue: float | None) -> int:
        """Number of an isovalue of the file, or of the first if None.

        Raises
        ------
        OptionError
            If the file does not have it.
        """
        if isovalue is not None and isovalue not in self.isovalues and not self.complete:
            raise TruncatedError(f"the file ends before {self.noun} {listed([isovalue])} begins", code="truncated")
        return number_of(isovalue, self.isovalues, self.noun)

    def chain(self, number: int) -> frozenset[int]:
        """Numbers of all isovalues needed to decode one, in any frame."""
        if self.turned:
            return frozenset(range(len(self.isovalues)))
        out = {number}
        for leans in [self.leans, *(frame.leans for frame in self.frames)]:
            # an isovalue is predicted only from earlier ones
            for i in range(len(leans) - 1, -1, -1):
                lean = leans[i]
                if i in out and lean is not None:
                    out.add(lean)
        return frozenset(out)

    def as_dict(self) -> dict[str, Any]:
        """Convert to plain data for JSON."""
        out = asdict(self)
        if self.domain is None:
            del out["domain"]
        else:
            out["domain"]["digest"] = self.domain.digest.hex()
            out["domain"]["kind"] = self.domain.kind.name.lower()
        if self.surface is None:
            del out["surface"]
        return out
