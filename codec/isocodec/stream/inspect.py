"""Inspect a file without decoding it (spec clause 3). Loads no kernels unless asked to count symbols."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, field, replace
from functools import partial
from typing import Any

from isospec.container import ChunkType, DomainKind

from ..deferred import dataclass
from ..errors import FormatError, OptionError, TruncatedError
from ..field.labelling import caption, listed, noun_of
from ..format.chunks import Envelope, LayerRecord, Promises, whole_bytes
from ..format.coordinate_record import CoordinatesRecord
from ..format.domain import DomainHead, read_mesh_layer
from ..format.events import Event, FrameRead, IsovalueRead, LayerComplete
from ..format.frames import is_key
from ..format.header import Header, varint
from ..format.kinds import LayerKind
from ..format.program import Layer, Progress, read_program
from ..format.surface import TinHead, read_tin
from ..grid.lattice.tables import cube_exponent
from ..limits import Limits
from .outline import LAYER_CHUNKS, Outline, check_explicit
from .promise_note import noted_at_last, noted_exact
from .session import Session

POINTS = DomainKind.POINTS
_NAMES = {t.value: t.name.lower() for t in ChunkType}
_NAMED = 6
"""Most isovalues that an error names."""


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
        one begun: as the writer promises, or 0 of all values of integers on the full grid. None without a promise, and
        of layers in a cut chunk, which may not be complete; counting symbols finds out. On a mesh in the unit of its
        points, and only of the last layer of an isovalue: files state no distances of those before.
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
    """

    offset: int
    bytes: int
    key: bool
    leans: list[int | None]
    before: list[bool]
    complete: bool = True


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
        if isovalue is None:
            return 0
        if isovalue not in self.isovalues:
            if not self.complete:
                raise TruncatedError(f"the file ends before {self.noun} {listed([isovalue])} begins", code="truncated")
            near = sorted(sorted(self.isovalues, key=lambda one: abs(one - isovalue))[:_NAMED])
            others = f", and {len(self.isovalues) - len(near):,} others" if len(near) < len(self.isovalues) else ""
            raise OptionError(
                f"the file has no {self.noun} {listed([isovalue])}", code="isovalue",
                remedy=f"it has {listed(near, ', ')}{others}",
            )
        return self.isovalues.index(isovalue)

    def chain(self, number: int) -> frozenset[int]:
        """Numbers of all isovalues needed to decode one of them, in any frame."""
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


@dataclass
class _Strands:
    """State of the programs of isovalues, in the current frame and the one before, and where frames begin."""

    progresses: list[Progress]
    starts: list[int]
    leans: list[list[int | None]]
    follows: list[list[bool]]
    before: list[Progress] = field(default_factory=list)

    def begin(self, event: FrameRead, start: int) -> None:
        """Begin a further isovalue of a series, with a chunk at ``start``."""
        if event.number == 0:
            self.before, self.progresses = self.progresses, []
            self.starts.append(start)
            self.leans.append([])
            self.follows.append([])
        self.leans[-1].append(None if event.before else event.lean)
        self.follows[-1].append(event.before)
        earlier = self.before if event.before else self.progresses
        layers = self.progresses[-1].layers if self.progresses else 0
        fresh = Progress((self.progresses or self.before)[0].full_level, layers=layers)
        self.progresses.append(fresh.begin(None if event.lean is None else earlier[event.lean]))

    def frames(self, interval: int | None, end: int, whole: int) -> list[FrameInfo]:
        """Frames of the series, with their sizes; the first ``whole`` ones are complete."""
        if interval is None:
            return []
        ends = [*self.starts[1:], end]
        return [
            FrameInfo(
                start, stop - start, is_key(number, interval), leans, before or [False] * len(leans), number < whole
            )
            for number, (start, stop, leans, before) in enumerate(
                zip(self.starts, ends, self.leans, self.follows, strict=True)
            )
        ]


class _Survey:
    """Records the chunks of a file of any kind without decoding them.

    Attributes
    ----------
    layers : list of LayerInfo
    chunks : list of ChunkInfo
    coded : int
        Number of entropy-coded bytes.
    mask_bytes : int
    promised : dict
        Promises by frame and isovalue.
    strands : _Strands
    surface : TinHead or None
    uncertain : set of int
        Numbers of the layers, from 0, in chunks that were cut.

    With ``to_layers``, it stops at the first chunk of layers.
    """

    def __init__(self, session: Session, header: Header, to_layers: bool = False) -> None:
        self.outline = session.outline
        self.layers: list[LayerInfo] = []
        self.chunks: list[ChunkInfo] = []
        self.coded = self.mask_bytes = 0
        self.promised: dict[tuple[int, int], Promises] = {}
        full = len(header.shape) * cube_exponent(header.shape) if header.shape else 0
        self.strands = _Strands([Progress(full)], [0], [self.outline.leans], [[]])
        self.surface: TinHead | None = None
        self.uncertain: set[int] = set()
        self._session, self._cells, self._begun = session, header.cells, False
        self._to_layers = to_layers

    def expect(self, chunk: Envelope, at: int) -> None:
        """See `Contents.expect`."""
        if self._cells is not None:
            check_explicit(chunk, at, self._begun)
            self._begun |= chunk.type == ChunkType.DOMAIN
        elif chunk.type == ChunkType.MASK:
            self.outline.begin_mask(at)
        self.outline.begun |= chunk.type in LAYER_CHUNKS

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`."""
        if self._to_layers and chunk.type in LAYER_CHUNKS:
            return None, False
        data = self._session.data
        there = max(min(chunk.end, len(data)) - chunk.start, 0)
        if chunk.type == ChunkType.MASK:
            self.mask_bytes = there
            self.coded += there
        elif self._cells is None and chunk.type in LAYER_CHUNKS:
            self._grid_layers(chunk, chunk.start + there)
        elif chunk.type == ChunkType.LAYERS and there == chunk.end - chunk.start:
            self._mesh_layer(chunk)
        elif chunk.type == ChunkType.DOMAIN and self._cells == 2 and there and data[chunk.start] >> 4 == POINTS:
            with suppress(FormatError):  # of the beginning of a chunk
                self._surface_layers(chunk, chunk.start + there)
        return None, True

    def take(self, chunk: Envelope, at: int, behind: int) -> Event | None:
        """See `Contents.take`."""
        self.note(chunk, at, behind)
        if chunk.type in (*LAYER_CHUNKS, ChunkType.MASK):
            return None
        payload = bytes(self._session.data[chunk.start : chunk.end])
        if chunk.type == ChunkType.DOMAIN and self._cells == 2 and payload and payload[0] >> 4 == POINTS:
            self.surface, _ = read_tin(payload, chunk.start)
            return None
        event = self.outline.read(chunk, payload, behind)
        if isinstance(event, IsovalueRead):
            progresses = self.strands.progresses
            progresses.append(progresses[-1].begin(None if event.lean is None else progresses[event.lean]))
        elif isinstance(event, FrameRead):
            self.strands.begin(event, at)
        outline = self.outline
        self.promised[outline.frame, outline.number] = outline.promises[outline.number]
        return event

    def drop(self) -> None:
        """See `Contents.drop`."""

    def note(self, chunk: Envelope, at: int, behind: int) -> None:
        """List a chunk that ends before ``behind``."""
        name, outline = _NAMES.get(chunk.type, f"unknown {chunk.type}"), self.outline
        self.chunks.append(ChunkInfo(name, at, behind - at, outline.frame, outline.number))

    def _grid_layers(self, chunk: Envelope, end: int) -> None:
        """List the layers of a chunk as far as it has arrived."""
        outline, data = self.outline, self._session.data
        plain: list[list[Layer]] = []
        run = chunk.start
        for number in outline.turn:
            progress, lean = self.strands.progresses[number], outline.leans[number]
            if outline.turned and lean is not None:
                progress.lean_level = self.strands.progresses[lean].level
            read = _program(data, chunk, end, progress)
            outline.layered.add(number)
            if read is None:
                return
            if plain and (read[1] != run or len(read[0]) != len(plain[0])):
                raise FormatError("a program differs among the isovalues of a turn", code="program", offset=chunk.start,
                                  clause="3.5.9")
            plain.append(read[0])
            run = read[1]
        self.coded += end - run
        rounds = zip(*plain, strict=True)
        found = [(number, layer) for each in rounds for number, layer in zip(outline.turn, each, strict=True)]
        if chunk.type == ChunkType.CUT_LAYERS:
            self.uncertain |= set(range(len(self.layers), len(self.layers) + len(found)))
        for i, (number, layer) in enumerate(found):
            outline.layers.append(layer)
            self.layers.append(LayerInfo(
                layer.kind, layer.level, layer.plane, layer.parts, None if i else run, isovalue=number,
                frame=outline.frame,
            ))

    def _surface_layers(self, chunk: Envelope, end: int) -> None:
        """List the layers of a surface, whose chunk has arrived up to ``end``."""
        self.surface, begins = read_tin(bytes(self._session.data[chunk.start : chunk.end]), chunk.start)
        run, whole = chunk.start + begins, chunk.end - chunk.start - begins
        self.coded += end - run
        first, *others = [LayerInfo("points", -1, 0, 0) for _ in self.surface.counts]
        alone = not others and end == chunk.end
        self.layers += [replace(first, offset=run, bytes=whole if alone else None), *others]

    def _mesh_layer(self, chunk: Envelope) -> None:
        """List a layer of a file on a mesh."""
        head, begins = read_mesh_layer(bytes(self._session.data[chunk.start : chunk.end]), chunk.start)
        size, outline = chunk.end - chunk.start - begins, self.outline
        self.coded += size
        self.layers.append(LayerInfo(
            head.kind.name.lower(), -1, head.rounds, 0, chunk.start + begins, size, isovalue=outline.number,
            frame=outline.frame,
        ))


def kind_of(data: bytes, limits: Limits | None = None) -> str:
    """Find the kind of a file, as in `FileInfo.kind`, from the chunks before its layers.

    Raises
    ------
    FormatError
        If the bytes are not an ``.iso`` file.
    """
    session = Session(limits, partial(_Survey, to_layers=True))
    session.feed(data)
    for _ in session:
        pass
    if session.header is None or not isinstance(session.contents, _Survey):
        raise TruncatedError("the file ends within its header", code="truncated", offset=len(data), clause="3.3")
    return _kind(session.header, session.outline, session.contents)


def _kind(header: Header, outline: Outline, survey: _Survey) -> str:
    if header.cells is not None:
        return "mesh" if survey.surface is None else "surface"
    return "grid" if outline.interval is None else "series"


def inspect(data: bytes, symbols: bool = False, limits: Limits | None = None) -> FileInfo:
    """Read the structure of a file.

    Parameters
    ----------
    data : bytes
        The file, or the beginning of one.
    symbols : bool
        Decode the file to fill in what it does not state about its layers. Loads the kernels.
    limits : Limits, optional
        Limits for decoding.

    Raises
    ------
    FormatError
        If the bytes violate the container's specification.
    LimitError
        If decoding takes more than the limits allow.
    """
    data = whole_bytes(data)
    session = Session(replace(limits or Limits(), bytes=max(len(data), 1)), _Survey)
    session.feed(data)
    for _ in session:
        pass
    header, survey = session.header, session.contents
    if header is None or not isinstance(survey, _Survey):
        raise TruncatedError("the file ends within its header", code="truncated", offset=len(data), clause="3.3")
    if session.pending is not None:
        survey.note(session.pending, session.at, len(data))
    outline, layers = session.outline, survey.layers
    earlier = sum(layer.frame < outline.frame for layer in layers)
    layers = layers[:earlier] + _with_index(outline.records, layers[earlier:])
    uncertain = survey.uncertain
    kind = _kind(header, outline, survey)
    if symbols and kind == "surface":
        layers = _decoded_surface(data, layers, limits)
    elif symbols and kind != "mesh":
        layers = _decoded(data, layers, limits)
        uncertain = {number for number, layer in enumerate(layers) if layer.bytes is None}
    isovalues, leans = (outline.isovalues, outline.leans) if kind != "surface" else ([], [])
    surface = survey.surface
    shape = header.shape if surface is None or not surface.grid else surface.extent
    layers = (
        _promised_on_mesh(layers, outline, header, session.complete) if kind == "mesh"
        else _promised(layers, survey.promised, header, uncertain)
    )
    return FileInfo(
        header.writer_version, header.read_version, header.profile.name.lower(), shape, header.isovalue,
        header.scale, len(data), len(data) - survey.coded, session.complete, layers,
        survey.chunks, outline.metadata, isovalues, leans, [one.topology for one in outline.promises[: len(isovalues)]],
        survey.mask_bytes if outline.masked else None, outline.interval,
        survey.strands.frames(outline.interval, session.at, session.frames), _in_words(outline.coordinates),
        outline.domain, kind, surface, turned=outline.turned,
    )


def _in_words(record: CoordinatesRecord | None) -> str | None:
    """Read the head of a chunk of coordinates, without decoding its run."""
    if record is None:
        return None
    nodes = any(len(one.axes) > 1 for one in record.coordinates)
    parts = ["for each sample" if nodes else "for each axis", f"{len(record.run):,} bytes"]
    parts += [f"axis {axis} is periodic" for axis in record.periodic]
    periods = zip("xyz", record.coordinates, strict=False)
    parts += [f"{name} repeats after {one.unit * one.period:.12g}" for name, one in periods if one.period]
    return ", ".join(parts)


def _promised(
    layers: Sequence[LayerInfo], promises: Mapping[tuple[int, int], Promises], header: Header, uncertain: set[int]
) -> list[LayerInfo]:
    """The layers with what is promised of each, but for those that may not be complete."""
    counts: Counter[tuple[int, int]] = Counter()
    full = len(header.shape) * cube_exponent(header.shape) if header.shape else None
    out = []
    for number, layer in enumerate(layers):
        strand = layer.frame, layer.isovalue
        counts[strand] += 1
        within = promises[strand].within.get(counts[strand]) if strand in promises else None
        if within is None and (layer.kind, layer.level, layer.plane) == (LayerKind.VALUES, full, 0):
            within = 0.0 if header.scale is None else None
        out.append(replace(layer, within=None if number in uncertain else within))
    return out


def _promised_on_mesh(
    layers: Sequence[LayerInfo], outline: Outline, header: Header, complete: bool
) -> list[LayerInfo]:
    """The layers of a file on a mesh, the last one of each isovalue that is complete with the distance of the note."""
    last, cut = {}, set()
    for number, layer in enumerate(layers):
        strand = layer.frame, layer.isovalue
        last[strand] = number
        cut |= {strand} if layer.kind == "cut" else set()
    if not complete:
        last.pop((outline.frame, outline.number), None)
    known = outline.domain is not None and outline.domain.kind == DomainKind.KNOWN
    distance, exact = noted_at_last(outline.metadata), noted_exact(outline.metadata)
    out = list(layers)
    for strand, number in last.items():
        values = layers[number].kind == "values" and header.scale is None
        zero = values and known and (exact or strand not in cut)
        out[number] = replace(layers[number], within=0.0 if zero else None if exact else distance)
    return out


def _program(
    data: bytes | bytearray, chunk: Envelope, end: int, progress: Progress
) -> tuple[list[Layer], int] | None:
    """Read the program of a chunk and where its run begins; None if more bytes are needed."""
    at = chunk.start
    if chunk.type == ChunkType.CUT_LAYERS:
        number = varint(data, at, end, "3.5.4")
        if number is None:
            return None
        at = number[1]
    return read_program(data, at, end, progress)


def _with_index(records: Sequence[LayerRecord], layers: list[LayerInfo]) -> list[LayerInfo]:
    """Complete the first layers with their entries in a layer index."""
    out = []
    place = 0
    for info, record in zip(layers, records, strict=False):
        place = info.offset if info.offset is not None else place
        out.append(replace(info, offset=place, bytes=record.bytes, symbols=record.symbols))
        place += record.bytes
    return out + layers[len(out) :]


def _decoded(data: bytes, layers: list[LayerInfo], limits: Limits | None) -> list[LayerInfo]:
    from .decoder import Decoder

    decoder = Decoder(limits)
    decoder.feed(data)
    complete = [event for event in decoder if isinstance(event, LayerComplete)]
    out = [
        replace(info, offset=e.offset - e.bytes, bytes=e.bytes, symbols=e.symbols)
        for info, e in zip(layers, complete, strict=False)
    ]
    return out + [replace(info, offset=None, bytes=None, symbols=None) for info in layers[len(out) :]]


def _decoded_surface(data: bytes, layers: list[LayerInfo], limits: Limits | None) -> list[LayerInfo]:
    """Find out where the layers of a surface begin and end, as far as they have arrived."""
    from .decoder import Decoder

    decoder = Decoder(limits)
    decoder.feed(data)
    places: tuple[int, ...] = ()
    with suppress(TruncatedError):  # the file ends within the first layer
        places = decoder.take().surface.received()[1].places
    begin, run = 0, layers[0].offset or 0
    out = []
    for info, end in zip(layers, places, strict=False):
        out.append(replace(info, offset=run + begin, bytes=end - begin))
        begin = end
    return out + layers[len(out) :]


__all__ = ["ChunkInfo", "FileInfo", "FrameInfo", "Header", "LayerInfo", "inspect"]
