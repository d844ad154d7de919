"""What a file says of itself, without decoding (spec clause 3). Loads no kernels unless asked to count symbols."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from isospec.container import ChunkType

from ..errors import FormatError, OptionError, TruncatedError
from ..format.chunks import CHECKSUM_BYTES, Envelope, LayerRecord, Promises, read_envelope, verify, whole_bytes
from ..format.coordinates import CoordinatesRecord
from ..format.domain import DomainHead, read_mesh_layer
from ..format.events import FrameRead, IsovalueRead, LayerComplete
from ..format.frames import first_operation, is_key
from ..format.header import Header, read_header, varint
from ..format.program import Layer, Progress, read_program
from ..grid.lattice.tables import cube_exponent
from ..limits import Limits
from .contents import LAYER_CHUNKS, Contents

_NAMES = {t.value: t.name.lower() for t in ChunkType}


@dataclass(frozen=True)
class LayerInfo:
    """One layer; ``offset``, ``bytes`` and ``symbols`` are None where the file does not say.

    Attributes
    ----------
    kind : str
    level : int
    plane : int
        Missing bits of values afterwards.
    parts : int
        Parts that edges are divided into afterwards.
    offset : int or None
        Byte offset in the file at which its data begin.
    bytes : int or None
    symbols : dict of str to int, or None
    isovalue : int
        Number of the isovalue that it belongs to.
    within : float or None
        How many cells decoded and original curve lie from each other at most, when this layer is complete and no later
        one begun, if the writer promises it.
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
        Where in the file its first chunk begins, and what all of its chunks take; for the first frame from the file's
        beginning on.
    key : bool
        Whether it leans on none before it.
    leans : list of int or None
        For each isovalue the number of the one of the same frame that it leans on.
    """

    offset: int
    bytes: int
    key: bool
    leans: list[int | None]


@dataclass(frozen=True)
class ChunkInfo:
    """One chunk: its type by name, byte offset and length with envelope and checksums."""

    type: str
    offset: int
    bytes: int


@dataclass(frozen=True)
class FileInfo:
    """What ``inspect`` finds.

    Attributes
    ----------
    overhead_bytes : int
        All that is not entropy-coded data.
    complete : bool
        The file is whole and its checksum is right.
    isovalues : list of float
        All isovalues of the file; ``isovalue`` is the first.
    leans : list of int or None
        For each the number of the earlier one that it leans on.
    topology : list of bool
        For each whether the writer promises that all complete layers have the topology of the original curve.
    mask_bytes : int or None
        Entropy-coded bytes of the mask; None if no sample is missing.
    interval : int or None
        Of a series, how often a frame leans on none before it; 0 if only the first does. None without frames.
    frames : list of FrameInfo
        Those of a series.
    coordinates : str or None
        In words, how samples lie on a mapped grid; None if it is none.
    domain : DomainHead or None
        Of a file on a mesh what it says of that.
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

    def number_of(self, isovalue: float | None) -> int:
        """Number of an isovalue of the file, of the first if None.

        Raises
        ------
        OptionError
            If the file does not have it.
        """
        if isovalue is None:
            return 0
        if isovalue not in self.isovalues:
            if not self.complete:
                raise TruncatedError(f"the file ends before isovalue {isovalue!r} begins", code="truncated")
            raise OptionError(
                f"the file has no isovalue {isovalue!r}", code="isovalue",
                remedy=f"it has {', '.join(map(repr, self.isovalues))}",
            )
        return self.isovalues.index(isovalue)

    def chain(self, number: int) -> frozenset[int]:
        """Numbers of all isovalues that it takes to decode one, in any frame."""
        out = {number}
        for leans in [self.leans, *(frame.leans for frame in self.frames)]:
            # an isovalue leans on earlier ones only
            for i in range(len(leans) - 1, -1, -1):
                lean = leans[i]
                if i in out and lean is not None:
                    out.add(lean)
        return frozenset(out)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, for JSON."""
        out = asdict(self)
        if self.domain is None:
            del out["domain"]
        else:
            out["domain"]["digest"] = self.domain.digest.hex()
            out["domain"]["kind"] = self.domain.kind.name.lower()
        return out


@dataclass
class _Strands:
    """Where the programs of isovalues stand, of the present frame and of the one before; where frames begin."""

    progresses: list[Progress]
    starts: list[int]
    leans: list[list[int | None]]
    before: list[Progress] = field(default_factory=list)

    def begin(self, event: FrameRead, start: int) -> None:
        """Another isovalue of a series begins with a chunk at ``start``."""
        if event.number == 0:
            self.before, self.progresses = self.progresses, []
            self.starts.append(start)
            self.leans.append([])
        self.leans[-1].append(None if event.before else event.lean)
        earlier = self.before if event.before else self.progresses
        layers = self.progresses[-1].layers if self.progresses else 0
        fresh = Progress((self.progresses or self.before)[0].full_level, layers=layers)
        self.progresses.append(fresh.begin(None if event.lean is None else earlier[event.lean]))

    def frames(self, interval: int | None, end: int) -> list[FrameInfo]:
        """The frames of a series."""
        if interval is None:
            return []
        ends = [*self.starts[1:], end]
        return [
            FrameInfo(start, stop - start, is_key(number, interval), leans)
            for number, (start, stop, leans) in enumerate(zip(self.starts, ends, self.leans, strict=True))
        ]


def inspect(data: bytes, symbols: bool = False, limits: Limits | None = None) -> FileInfo:
    """Structure of a file.

    Parameters
    ----------
    data : bytes
        The file, or the beginning of one.
    symbols : bool
        Decode the file to fill in what it does not state of its layers. Loads the kernels.
    limits : Limits, optional
        What decoding may take at most.

    Raises
    ------
    FormatError
        If the bytes violate the container's specification.
    LimitError
        If decoding takes more than the limits allow.
    """
    data = whole_bytes(data)
    found = read_header(data)
    if found is None:
        raise TruncatedError("the file ends within its header", code="truncated", offset=len(data), clause="3.3")
    header, at = found
    chunks: list[ChunkInfo] = []
    layers: list[LayerInfo] = []
    contents = Contents()
    contents.begin(header)
    strands = _Strands(
        [Progress(len(header.shape) * cube_exponent(header.shape) if header.shape else 0)], [0], [contents.leans]
    )
    promised: dict[tuple[int, int], Promises] = {}
    coded = mask_bytes = 0
    complete = False
    while not complete:
        chunk = read_envelope(data, at)
        if chunk is None:
            break
        end = min(chunk.end, len(data))
        behind = chunk.end + CHECKSUM_BYTES * (chunk.checked + chunk.last)
        if header.cells is not None and chunk.type == ChunkType.LAYERS:
            if chunk.end <= len(data):
                head, begins = read_mesh_layer(data[chunk.start : chunk.end], chunk.start)
                size, number, frame = chunk.end - chunk.start - begins, contents.number, contents.frame
                contents.begun = True
                coded += size
                kind = head.kind.name.lower()
                layers.append(LayerInfo(kind, -1, 0, 0, chunk.start + begins, size, isovalue=number, frame=frame))
        elif chunk.type in LAYER_CHUNKS:
            operation = first_operation(data, chunk)
            begun = None if operation is None else contents.begin_layers(data[operation], operation)
            if begun is not None:
                strands.begin(begun, at)
            first = len(contents.layers)
            run = _run_start(data, chunk, end, strands.progresses[-1], contents.layers)
            if run is not None:
                coded += end - run
                for i, layer in enumerate(contents.layers[first:]):
                    number, frame = contents.number, contents.frame
                    place = None if i else run
                    layers.append(
                        LayerInfo(
                            layer.kind, layer.level, layer.plane, layer.parts, place, isovalue=number, frame=frame
                        )
                    )
        elif chunk.type == ChunkType.MASK:
            contents.begin_mask(at)
            mask_bytes = end - chunk.start
            coded += mask_bytes
        elif chunk.end <= len(data):
            event = contents.read(chunk, data[chunk.start : chunk.end], behind)
            if isinstance(event, IsovalueRead):
                strands.progresses.append(
                    strands.progresses[-1].begin(None if event.lean is None else strands.progresses[event.lean])
                )
            elif isinstance(event, FrameRead):
                strands.begin(event, at)
            promised[contents.frame, contents.number] = contents.promises[contents.number]
        chunks.append(ChunkInfo(_NAMES.get(chunk.type, f"unknown {chunk.type}"), at, min(behind, len(data)) - at))
        if verify(data, chunk, at) is None:
            break
        if chunk.last and len(data) > behind:
            raise FormatError("bytes after the end of the file", code="trailing", offset=behind, clause="3.4.4")
        complete = chunk.last
        at = behind
    earlier = sum(layer.frame < contents.frame for layer in layers)
    layers = layers[:earlier] + _with_index(contents.records, layers[earlier:])
    if symbols and header.cells is None:
        layers = _decoded(data, layers, limits)
    return FileInfo(
        header.writer_version, header.read_version, header.profile.name.lower(), header.shape, header.isovalue,
        header.scale, len(data), len(data) - coded, complete, _promised(layers, promised), chunks,
        contents.metadata, contents.isovalues, contents.leans, [one.topology for one in contents.promises],
        mask_bytes if contents.masked else None, contents.interval, strands.frames(contents.interval, at),
        _in_words(contents.coordinates), contents.domain,
    )


def _in_words(record: CoordinatesRecord | None) -> str | None:
    """What a chunk of coordinates says, without decoding its run."""
    if record is None:
        return None
    nodes = any(len(one.axes) > 1 for one in record.coordinates)
    parts = ["for each sample" if nodes else "for each axis", f"{len(record.run):,} bytes"]
    parts += [f"axis {axis} is periodic" for axis in record.periodic]
    periods = zip("xyz", record.coordinates, strict=False)
    parts += [f"{name} repeats after {one.unit * one.period:.12g}" for name, one in periods if one.period]
    return ", ".join(parts)


def _promised(layers: Sequence[LayerInfo], promises: Mapping[tuple[int, int], Promises]) -> list[LayerInfo]:
    """The layers with what is promised of each."""
    counts: Counter[tuple[int, int]] = Counter()
    out = []
    for layer in layers:
        strand = layer.frame, layer.isovalue
        counts[strand] += 1
        within = promises[strand].within.get(counts[strand]) if strand in promises else None
        out.append(replace(layer, within=within))
    return out


def _run_start(data: bytes, chunk: Envelope, end: int, progress: Progress, plain: list[Layer]) -> int | None:
    at = chunk.start
    if chunk.type == ChunkType.CUT_LAYERS:
        number = varint(data, at, end, "3.5.4")
        if number is None:
            return None
        at = number[1]
    program = read_program(data, at, end, progress)
    if program is None:
        return None
    plain += program[0]
    return program[1]


def _with_index(records: Sequence[LayerRecord], layers: list[LayerInfo]) -> list[LayerInfo]:
    """The layers with what a level index says of the first of them."""
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


__all__ = ["ChunkInfo", "FileInfo", "FrameInfo", "Header", "LayerInfo", "inspect"]
