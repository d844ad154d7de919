"""Outline of a file: what its chunks state apart from coded symbols, with one reader per type (spec clause 3.5)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

from isospec.container import ChunkType, DomainKind

from ..errors import FormatError
from ..field.times import TIME
from ..format.chunks import (
    Envelope,
    LayerRecord,
    Promises,
    read_further,
    read_index,
    read_metadata,
    read_promises,
    read_turn,
)
from ..format.coordinate_record import CoordinatesRecord, read_coordinates
from ..format.domain import DomainHead, read_domain
from ..format.events import (
    ChunkSkipped,
    CoordinatesRead,
    DomainRead,
    Event,
    FrameRead,
    IsovalueRead,
    MetadataRead,
    PromisesRead,
    SeriesRead,
    TurnRead,
)
from ..format.frames import FRAME_BEFORE, is_key, key_of, read_frame, read_interval
from ..format.header import Header
from ..format.program import Layer, Progress
from ..format.surface import TinHead
from ..grid.lattice.tables import cube_exponent


@dataclass
class Outline:
    """Everything read from a file so far, apart from its symbols.

    Attributes
    ----------
    isovalues : list of float
    leans : list of int or None
        For each isovalue, the number of the earlier one that it is predicted from.
    promises : list of Promises
        For each isovalue, the promises for its layers.
    metadata : dict of str to str
        Notes of the file.
    times : dict of int to str
        Times of frames, by number.
    layers : list of Layer
        Layers announced so far; added by the code that reads chunks of layers.
    records : list of LayerRecord
        Entries of the layer index, if the file has one.
    masked : bool
        Whether there is a mask.
    interval : int or None
        For a series, the interval of key frames (see `SeriesRead`); None for a file without frames.
    frame, number : int
        The current frame and isovalue, whose layers are being read.
    ended : bool
        Whether a chunk has marked the end of the current frame.
    turn : range
        Numbers of the isovalues that the next chunk of layers belongs to.
    turned : bool
        Whether a turn has been read.
    layered : set of int
        Numbers of isovalues that have had layers since an isovalue began last.
    closed : int
        Isovalues that get no layers any more, as bits: files may have thousands of turns of thousands of isovalues.
    begun, placed : bool
        Whether a chunk of layers, and one of a domain, has begun.
    coordinates : CoordinatesRecord or None
        Where the samples lie.
    shape : tuple of int
        Shape of the field, once the header has been read.
    cells : int or None
        Dimension of the cells, for a file on a mesh.
    domain : DomainHead or None
        Head of the domain chunk, for a file on a mesh.
    surface : TinHead or None
        Head of the domain chunk, for a file of a surface.
    run_of_domain : int
        Where the run of a coded mesh begins in the payload of its chunk.
    progresses, progresses_before : list of Progress
        States of the programs of the isovalues of a grid, in the current frame and the one before.
    only : collection of int or None
        Numbers of the isovalues that are to be decoded; all if None.
    wanted : int or None
        Number of the frame that is to be decoded; all if None.
    """

    isovalues: list[float] = field(default_factory=list)
    leans: list[int | None] = field(default_factory=list)
    _begun: set[float] = field(default_factory=set, repr=False)
    promises: list[Promises] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    times: dict[int, str] = field(default_factory=dict)
    layers: list[Layer] = field(default_factory=list)
    records: list[LayerRecord] = field(default_factory=list)
    masked: bool = False
    interval: int | None = None
    frame: int = 0
    number: int = 0
    ended: bool = False
    turn: range = range(0)
    turned: bool = False
    layered: set[int] = field(default_factory=set)
    closed: int = 0
    begun: bool = False
    placed: bool = False
    coordinates: CoordinatesRecord | None = None
    shape: tuple[int, ...] = ()
    cells: int | None = None
    domain: DomainHead | None = None
    surface: TinHead | None = None
    run_of_domain: int = 0
    progresses: list[Progress] = field(default_factory=list)
    progresses_before: list[Progress] = field(default_factory=list)
    only: Collection[int] | None = None
    wanted: int | None = None

    def begin(self, header: Header) -> None:
        """Record the header and its isovalue."""
        self.shape = header.shape
        self.cells = header.cells
        self._add(header.isovalue, None)

    @property
    def kind(self) -> str:
        """Kind of the file, as in `FileInfo.kind`."""
        if self.cells is not None:
            return "mesh" if self.surface is None else "surface"
        return "grid" if self.interval is None else "series"

    @property
    def full_level(self) -> int:
        """Level of the full grid; 0 on a mesh."""
        return len(self.shape) * cube_exponent(self.shape) if self.shape else 0

    def notes(self, before: bool = False) -> dict[str, str]:
        """Notes on a drawing of the frame that is decoded, or of the one before it, with its time."""
        frame = (self.frame if self.wanted is None else min(self.frame, self.wanted)) - before
        return {**self.metadata, **({TIME: self.times[frame]} if frame in self.times else {})}

    @property
    def past(self) -> bool:
        """Whether the frame that is to be decoded has been passed."""
        return self.wanted is not None and self.frame > self.wanted

    def needs(self, number: int) -> bool:
        """Whether an isovalue of the current frame is to be decoded: nothing before a key frame is."""
        if self.past or (self.only is not None and number not in self.only):
            return False
        return self.wanted is None or self.interval is None or self.frame >= key_of(self.wanted, self.interval)

    def _progress(self, lean: Progress | None) -> None:
        """Begin the programs of an isovalue."""
        before = self.progresses or [Progress(self.full_level)]
        self.progresses.append(before[-1].begin(lean))

    def expect(self, chunk: Envelope, at: int) -> None:
        """Check that a critical chunk, whose envelope has been read, is allowed at byte ``at``, and record it.

        Raises
        ------
        FormatError
            If a mask follows another one or a frame, or a mesh (domain) does not come first or once.
        """
        domain, mask = chunk.type == ChunkType.DOMAIN, chunk.type == ChunkType.MASK
        if self.cells is None and mask:
            if self.frame > 0:
                raise FormatError("a mask after the first frame", code="mask", offset=at, clause="3.5.7")
            if self.masked:
                raise FormatError("a second mask", code="mask", offset=at, clause="3.5.6")
            self.masked = True
        elif self.cells is not None:
            if mask:
                raise FormatError("not allowed in a file on a mesh", code="chunk", offset=at, clause="10.1.1")
            if domain == self.placed:
                what = "a second mesh (domain)" if domain else "the mesh (domain) must come first"
                raise FormatError(what, code="domain", offset=at, clause="3.5.8")
            self.placed = True
        self.begun |= chunk.type == ChunkType.LAYERS

    def read(self, chunk: Envelope, payload: bytes, behind: int) -> Event:
        """Read a chunk other than of layers; ``behind`` is the offset after it in the file.

        Raises
        ------
        FormatError
            If the chunk is critical and malformed; malformed ancillary chunks are skipped.
        """
        reader = READERS.get(chunk.type)
        event = None if reader is None else reader(self, payload, chunk.start, behind)
        return event or ChunkSkipped(behind, chunk.type, len(payload))

    def begin_next(self, payload: bytes, start: int, behind: int) -> FrameRead:
        """Begin the next isovalue of a series, in the current frame or the next one.

        Raises
        ------
        FormatError
            If the payload of its chunk is malformed.
        """
        assert self.interval is not None
        frame, number = self.frame, self.number + 1
        if number == len(self.isovalues):
            frame, number = frame + 1, 0
        lean = read_frame(payload, start, number, is_key(frame, self.interval))
        if frame > self.frame:
            self.progresses_before = [*self.progresses]
            self.progresses.clear()
            self.layers.clear()
            self.promises[:] = [Promises({}, False) for _ in self.promises]
        self.frame, self.number, self.ended = frame, number, False
        self.turn = range(number, number + 1)
        before = lean == FRAME_BEFORE
        self._progress(None if lean is None else self.progresses_before[number] if before else self.progresses[lean])
        return FrameRead(behind, frame, number, number if before else lean, before)

    def _add(self, isovalue: float, lean: int | None) -> None:
        self.isovalues.append(isovalue)
        self._begun.add(isovalue)
        self.leans.append(lean)
        self._progress(None if lean is None else self.progresses[lean])
        self.number = len(self.leans) - 1
        self.turn = range(self.number, self.number + 1)
        for layered in self.layered:
            self.closed |= 1 << layered
        self.layered.clear()
        self.promises.append(Promises({}, False))


Reader = Callable[[Outline, bytes, int, int], Event | None]
"""Reads the payload of a chunk, given the offsets of its start and of the chunk's end; returns an event or None."""


def _isovalue(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.frame > 0:
        raise FormatError("a new isovalue after the first frame", code="frame", offset=start, clause="3.5.7")
    isovalue, lean = read_further(payload, start, outline._begun)
    outline._add(isovalue, lean)
    return IsovalueRead(behind, len(outline.isovalues) - 1, isovalue, lean)


def _turn(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.interval is not None or outline.cells is not None:
        where = "a series" if outline.interval is not None else "a file on a mesh"
        raise FormatError(f"a turn of isovalues in {where}", code="turn", offset=start, clause="3.5.9")
    turn = read_turn(payload, start, len(outline.isovalues))
    if outline.closed >> turn.start & (1 << len(turn)) - 1:
        raise FormatError("a turn of an isovalue whose layers have ended", code="turn", offset=start, clause="3.5.9")
    outline.turn, outline.turned = turn, True
    return TurnRead(behind, turn.start, len(turn))


def _series(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.begun or outline.turned or outline.interval is not None:
        what = "a second chunk of series" if outline.interval is not None else "a series after layers"
        raise FormatError(what, code="frame", offset=start, clause="3.5.7")
    outline.interval = read_interval(payload, start)
    return SeriesRead(behind, outline.interval)


def _frame(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.interval is None:
        raise FormatError("a frame in a file that is not a series", code="frame", offset=start, clause="3.5.7")
    return outline.begin_next(payload, start, behind)


def _frame_end(outline: Outline, payload: bytes, start: int, behind: int) -> None:
    outline.ended = outline.interval is not None


def _metadata(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    found = read_metadata(payload)
    own = {**found}
    if outline.interval is not None and TIME in own:
        outline.times[outline.frame] = own.pop(TIME)
    outline.metadata.update(own)
    return MetadataRead(behind, found)


def _promises(outline: Outline, payload: bytes, start: int, behind: int) -> Event | None:
    promises = read_promises(payload)
    if promises is None:
        return None
    outline.promises[outline.number] = promises
    return PromisesRead(behind, promises)


def _coordinates(outline: Outline, payload: bytes, start: int, behind: int) -> Event | None:
    found = read_coordinates(payload, outline.shape)
    if found is None:
        return None
    outline.coordinates = found
    return CoordinatesRead(behind, found)


def _index(outline: Outline, payload: bytes, start: int, behind: int) -> None:
    outline.records = read_index(payload, outline.layers) or outline.records


def _domain(outline: Outline, payload: bytes, start: int, behind: int) -> Event:
    if outline.cells is None:
        raise FormatError("a mesh (domain) in a file of a grid", code="domain", offset=start, clause="3.5.8")
    outline.domain, outline.run_of_domain = read_domain(payload, outline.cells, start)
    return DomainRead(behind, outline.domain.vertices, outline.domain.cells)


READERS: Mapping[int, Reader] = {
    ChunkType.ISOVALUE: _isovalue,
    ChunkType.SERIES: _series,
    ChunkType.FRAME: _frame,
    ChunkType.FRAME_END: _frame_end,
    ChunkType.TURN: _turn,
    ChunkType.METADATA: _metadata,
    ChunkType.PROMISES: _promises,
    ChunkType.INDEX: _index,
    ChunkType.COORDINATES: _coordinates,
    ChunkType.DOMAIN: _domain,
}
"""Readers by type of chunk."""


def holds_surface(header: Header, first: int) -> bool:
    """Whether the first byte of a domain chunk begins a surface instead of a mesh."""
    return first >> 4 == DomainKind.POINTS and header.cells == 2
