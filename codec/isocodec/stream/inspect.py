"""Inspect a file without decoding it (spec clause 3). Loads no kernels unless asked to count symbols."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

from isospec.container import ChunkType

from ..errors import FormatError, TruncatedError
from ..format.chunks import Envelope, LayerRecord, Promises, whole_bytes
from ..format.coordinate_record import CoordinatesRecord
from ..format.domain import read_mesh_layer
from ..format.events import Event, FrameRead, LayerComplete
from ..format.frames import is_key
from ..format.header import Header
from ..format.program import Layer, read_program
from ..format.surface import read_tin
from ..limits import Limits
from .file_info import ChunkInfo, FileInfo, FrameInfo, LayerInfo
from .outline import holds_surface
from .promises import promised
from .session import Session

_NAMES = {t.value: t.name.lower() for t in ChunkType}


class _Survey:
    """Records the chunks of a file of any kind without decoding them.

    Parameters
    ----------
    session : Session
    header : Header
    to_layers : bool
        Stop at the first chunk of layers.

    Attributes
    ----------
    layers : list of LayerInfo
    chunks : list of ChunkInfo
    coded : int
        Number of entropy-coded bytes.
    mask_bytes : int
    promised : dict
        Promises by frame and isovalue.
    frames : list of tuple
        Byte offset of each frame, and for each of its isovalues what it is predicted from, as of `FrameInfo`.
    """

    def __init__(self, session: Session, header: Header, to_layers: bool = False) -> None:
        self.outline = session.outline
        self.layers: list[LayerInfo] = []
        self.chunks: list[ChunkInfo] = []
        self.coded = self.mask_bytes = 0
        self.promised: dict[tuple[int, int], Promises] = {}
        self.frames: list[tuple[int, list[int | None], list[bool]]] = [(0, self.outline.leans, [])]
        self._session, self._header = session, header
        self._to_layers = to_layers

    def arrive(self, chunk: Envelope, at: int) -> tuple[Event | None, bool]:
        """See `Contents.arrive`."""
        if self._to_layers and chunk.type == ChunkType.LAYERS:
            return None, False
        data = self._session.data
        there = max(min(chunk.end, len(data)) - chunk.start, 0)
        if chunk.type == ChunkType.MASK:
            self.mask_bytes = there
            self.coded += there
        elif self._header.cells is None and chunk.type == ChunkType.LAYERS:
            self._grid_layers(chunk, chunk.start + there)
        elif chunk.type == ChunkType.LAYERS and there == chunk.end - chunk.start:
            self._mesh_layer(chunk)
        elif chunk.type == ChunkType.DOMAIN and there and holds_surface(self._header, data[chunk.start]):
            with suppress(FormatError):  # of the beginning of a chunk
                self._surface_layers(chunk, chunk.start + there)
        return None, True

    def take(self, chunk: Envelope, at: int, behind: int) -> Event | None:
        """See `Contents.take`."""
        self.note(chunk, at, behind)
        if chunk.type in (ChunkType.LAYERS, ChunkType.MASK):
            return None
        payload = bytes(self._session.data[chunk.start : chunk.end])
        if chunk.type == ChunkType.DOMAIN and payload and holds_surface(self._header, payload[0]):
            self.outline.surface, _ = read_tin(payload, chunk.start)
            return None
        event = self.outline.read(chunk, payload, behind)
        if isinstance(event, FrameRead):
            if event.number == 0:
                self.frames.append((at, [], []))
            _, leans, before = self.frames[-1]
            leans.append(None if event.before else event.lean)
            before.append(event.before)
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
        """List the layers of the part of a chunk that has arrived."""
        outline, data = self.outline, self._session.data
        plain: list[list[Layer]] = []
        run = chunk.start
        for number in outline.turn:
            progress, lean = outline.progresses[number], outline.leans[number]
            if outline.turned and lean is not None:
                progress.lean_level = outline.progresses[lean].level
            read = read_program(data, chunk.start, end, progress)
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
        for i, (number, layer) in enumerate(found):
            outline.layers.append(layer)
            self.layers.append(LayerInfo(
                layer.kind, layer.level, layer.plane, layer.parts, None if i else run, isovalue=number,
                frame=outline.frame,
            ))

    def _surface_layers(self, chunk: Envelope, end: int) -> None:
        """List the layers of a surface, whose chunk has arrived up to ``end``."""
        head, begins = read_tin(bytes(self._session.data[chunk.start : chunk.end]), chunk.start)
        self.outline.surface = head
        run, whole = chunk.start + begins, chunk.end - chunk.start - begins
        self.coded += end - run
        first, *others = [LayerInfo("points", -1, 0, 0) for _ in head.counts]
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


def _surveyed(data: bytes, limits: Limits | None, to_layers: bool = False) -> tuple[Session, Header, _Survey]:
    session = Session(limits, partial(_Survey, to_layers=to_layers))
    session.feed(data)
    for _ in session:
        pass
    header, survey = session.header, session.contents
    if header is None or not isinstance(survey, _Survey):
        raise TruncatedError("the file ends within its header", code="truncated", offset=len(data), clause="3.3")
    return session, header, survey


def kind_of(data: bytes, limits: Limits | None = None) -> str:
    """Find the kind of a file, as in `FileInfo.kind`, from the chunks before its layers.

    Raises
    ------
    FormatError
        If the bytes are not an ``.iso`` file.
    """
    return _surveyed(data, limits, to_layers=True)[0].outline.kind


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
    session, header, survey = _surveyed(data, replace(limits or Limits(), bytes=max(len(data), 1)))
    if session.pending is not None:
        survey.note(session.pending, session.at, len(data))
    outline, layers, uncertain = session.outline, survey.layers, set[int]()
    earlier = sum(layer.frame < outline.frame for layer in layers)
    layers = layers[:earlier] + _with_index(outline.records, layers[earlier:])
    kind, surface = outline.kind, outline.surface
    if symbols and kind == "surface":
        layers = _decoded_surface(data, layers, limits)
    elif symbols and kind != "mesh":
        layers = _decoded(data, layers, limits)
        uncertain = {number for number, layer in enumerate(layers) if layer.bytes is None}
    layers = promised(layers, survey.promised, outline, header, uncertain)
    isovalues, leans = (outline.isovalues, outline.leans) if surface is None else ([], [])
    ends = [*(start for start, _, _ in survey.frames[1:]), session.at]
    frames = [
        FrameInfo(start, end - start, is_key(number, outline.interval or 0), leans, before or [False] * len(leans),
                  number < session.frames, outline.times.get(number))
        for number, ((start, leans, before), end) in enumerate(zip(survey.frames, ends, strict=True))
    ]
    return FileInfo(
        header.writer_version, header.read_version, header.profile.name.lower(),
        header.shape if surface is None or not surface.grid else surface.extent, header.isovalue, header.scale,
        len(data), len(data) - survey.coded, session.complete, layers, survey.chunks, outline.metadata, isovalues,
        leans, [one.topology for one in outline.promises[: len(isovalues)]],
        survey.mask_bytes if outline.masked else None, outline.interval, [] if outline.interval is None else frames,
        _in_words(outline.coordinates), outline.domain, kind, surface, turned=outline.turned,
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
    """Find out where those layers of a surface that have arrived begin and end."""
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
