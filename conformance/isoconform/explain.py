"""An annotated dump of any file: byte by byte, and symbol by symbol with its context and probability.

Damaged and cut files are explained as far as they can be read, and then the reference's error stands.
"""

from __future__ import annotations

import subprocess
import sys
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from isocodec.errors import TruncatedError
from isocodec.format.chunks import CHECKSUM_BYTES, Envelope, read_envelope, read_further
from isocodec.format.events import FrameRead, SeriesRead
from isocodec.format.header import Header, read_header
from isocodec.format.program import Layer, ProgramReader, Progress
from isocodec.stream.outline import Outline
from isospec.container import FAR_LEAN, ChunkType, IsovalueKind, Operation, Profile, read_varint

from .damage import fields_of
from .dump import COMPLETE
from .meshes import exponent
from .plain import environment
from .rows import Rows
from .trace import Symbol, Tracer

CLAUSES = {
    Operation.BASE: "5.3", Operation.REFINE: "5.4", Operation.VALUES: "5.6, 3.6.4", Operation.OFFSETS: "5.7, 3.6.5",
    Operation.BASE_AND_REFINE: "5.3, 5.4", Operation.ADAPTIVE_BASE: "5.8.1", Operation.ADAPT: "5.8.4",
    Operation.LEAF_BASE: "5.9.4",
}


@dataclass
class _Reader(Rows):
    """Goes through a file and notes what its bytes are."""

    header: Header | None = None
    isovalues: list[float] = field(default_factory=list)
    progresses: list[Progress] = field(default_factory=list)
    before: list[Progress] = field(default_factory=list)
    outline: Outline = field(default_factory=Outline)

    def read(self) -> None:
        found = read_header(self.data)
        if found is None:
            return
        self._header(*found)
        while self.at < len(self.data):
            chunk = read_envelope(self.data, self.at)
            if chunk is None:
                return
            self._chunk(chunk)
            if chunk.last:
                return

    def _header(self, header: Header, end: int) -> None:
        self.header = header
        parts = fields_of(self.data[:end])
        self.note(4, "signature (3.3.1)")
        self.note(5, f"writer version {header.writer_version}, read version {header.read_version} (3.3.1)")
        about = "equal sides, " * (len(parts.sides) == 1) + ("scaled" if header.scale is not None else "not scaled")
        kind = IsovalueKind(self.data[5] >> 3 & 3).name.lower()
        self.note(6, f"{about}, isovalue as {kind}, {len(header.shape)} axes, profile {header.profile.name.lower()} "
                  "(3.3.2)")
        k = exponent(header.shape)
        shape = " x ".join(map(str, header.shape))
        self.note(
            self.at + sum(map(len, parts.sides)),
            f"shape {shape}: k = {k}, the full grid is level {len(header.shape) * k} (3.3.3)",
        )
        self.note(self.at + len(parts.isovalue), f"isovalue {header.isovalue!r} (3.3.4)")
        if parts.scale:
            self.note(end, f"scale {header.scale!r} (3.3.5)")
        self._begin(header.isovalue, None)

    def _begin(self, isovalue: float, lean: int | None) -> None:
        assert self.header is not None
        full = len(self.header.shape) * exponent(self.header.shape)
        before = self.progresses[-1] if self.progresses else Progress(full)
        self.progresses.append(before.begin(None if lean is None else self.progresses[lean]))
        self.isovalues.append(isovalue)
        self.outline.isovalues.append(isovalue)
        self.outline.number = len(self.isovalues) - 1

    def _chunk(self, chunk: Envelope) -> None:
        start = self.at
        name = ChunkType(chunk.type).name.lower().replace("_", " ") if chunk.type in [*ChunkType] else "unknown"
        about = [name] + ["ancillary"] * chunk.ancillary + ["checked"] * chunk.checked + ["last"] * chunk.last
        self.note(self.at + 1, f"head of a chunk of type {chunk.type}, {', '.join(about)} (3.4.1)")
        self.note(chunk.start, f"length of the payload: {chunk.end - chunk.start} (3.4.2)")
        if chunk.type == ChunkType.LAYERS:
            self._layers(chunk)
        elif chunk.type == ChunkType.ISOVALUE and chunk.end <= len(self.data):
            isovalue, lean = read_further(self.data[chunk.start : chunk.end], chunk.start, self.isovalues)
            near = self.data[chunk.start] & FAR_LEAN
            far = read_varint(self.data, chunk.start + 1, chunk.end) if near == FAR_LEAN else None
            of = "none" if lean is None else f"isovalue {lean}"
            self.note(chunk.start + 1 if far is None else far[1], f"leans on {of} (3.5.5)")
            self.note(chunk.end, f"isovalue {len(self.isovalues)}: {isovalue!r} (3.3.4)")
            self._begin(isovalue, lean)
        elif chunk.type in (ChunkType.SERIES, ChunkType.FRAME) and chunk.end <= len(self.data):
            self._frame(chunk)
        elif chunk.type == ChunkType.MASK:
            self.note(chunk.end, "run of the mask (3.5.6)")
        elif chunk.end > chunk.start:
            self.note(chunk.end, f"payload: {name} (3.5.1)")
        sums = (chunk.checked, start, "of the chunk (3.5.3)"), (chunk.last, 0, "of the file (3.4.4)")
        for there, first, what in sums:
            if there and self.at + CHECKSUM_BYTES <= len(self.data):
                stated = self.data[self.at : self.at + CHECKSUM_BYTES]
                right = zlib.crc32(self.data[first : self.at]).to_bytes(CHECKSUM_BYTES, "big")
                self.note(
                    self.at + CHECKSUM_BYTES,
                    f"CRC-32 {what}" + ("" if stated == right else f": wrong, it is {right.hex(' ')}"),
                )

    def _frame(self, chunk: Envelope) -> None:
        """The chunk of series, or the beginning of an isovalue of a further frame."""
        event = self.outline.read(chunk, self.data[chunk.start : chunk.end], chunk.end)
        if isinstance(event, SeriesRead):
            self.note(chunk.end, f"interval {event.interval} of a series (3.5.7)")
        elif isinstance(event, FrameRead):
            of = "none" if event.lean is None else f"isovalue {event.lean}{' of the frame before' * event.before}"
            if chunk.end > chunk.start:
                self.note(chunk.end, f"leans on {of} (3.5.7)")
            if event.number == 0:
                self.before, self.progresses = self.progresses, []
            layers = self.progresses[-1].layers if self.progresses else 0
            lean = None if event.lean is None else (self.before if event.before else self.progresses)[event.lean]
            self.progresses.append(Progress(self.before[0].full_level, layers=layers).begin(lean))

    def _layers(self, chunk: Envelope) -> None:
        there = min(chunk.end, len(self.data))
        reader, listed = ProgramReader(self.at, self.progresses[-1].copy()), 0
        for end in range(self.at + 1, there + 1):
            reader.read(self.data, end)
            if reader.at > self.at:
                byte = self.data[self.at]
                operation = Operation(byte >> 4 & 7)
                fresh = [_spoken(layer) for layer in reader.layers[listed:]]
                about = "; ".join(fresh) if len(fresh) < 3 else f"{fresh[0]} .. {fresh[-1]}, {len(fresh)} layers"
                name = ("more, " if byte & 0x80 else "") + operation.name.lower().replace("_", " ")
                self.note(reader.at, f"{name}, argument {byte & 15}: {about} ({CLAUSES[operation]})")
                listed = len(reader.layers)
            if reader.done:
                break
        if not reader.done:
            return
        self.progresses[-1] = reader.progress
        if self.at < there:
            self.note(there, f"run of {there - self.at} bytes (6.1)")


def _spoken(layer: Layer) -> str:
    match layer.kind:
        case "values":
            return f"values, {layer.plane} bits missing"
        case "offsets":
            return f"offsets, {layer.parts} parts of {1 << layer.unit} samples"
        case "adapt":
            return f"adapt at level {layer.level}{'' if layer.births else ', no new components'}"
    return f"{layer.kind.replace('_', ' ')} at level {layer.level}"


def explained(data: bytes) -> list[str]:
    """The lines of an annotated dump; the kernels have to be interpreted (see `plain`)."""
    tracer = Tracer(data)
    lines = [*_Reader(data).lines(), *_symbols(tracer.symbols), ""]
    lines.append(_outcome(tracer))
    return lines


def _symbols(symbols: list[Symbol]) -> Iterator[str]:
    layer = 0
    for number, symbol in enumerate(symbols, 1):
        if symbol.number != layer:
            layer = symbol.number
            yield f"layer {layer}: {_spoken(symbol.layer)}"
        mixing = f" [{symbol.mixing}]" if symbol.mixing else ""
        says = f"  {'; '.join(symbol.says)}" if symbol.says else ""
        yield (
            f"{number:6}  {symbol.element}, {symbol.context}{mixing}: p = {symbol.probability}/65536, "
            f"range {symbol.width:09x}, bit {symbol.bit}{says}"
        )
    if not symbols:
        yield "no symbols"


def _outcome(tracer: Tracer) -> str:
    code = COMPLETE if tracer.error is None else tracer.error.exit_code
    profile = tracer.decoder.header.profile if tracer.decoder.header else None
    about = "complete" if tracer.error is None else str(tracer.error)
    if isinstance(tracer.error, TruncatedError):
        about = f"{tracer.error}: what was received counts"
    name = f", profile {Profile(profile).name.lower()}" if profile is not None else ""
    return f"exit code {code}{name}, {len(tracer.symbols)} symbols: {about}"


def explanation(path: Path) -> str:
    """The dump of a file as text, by a process of its own that interprets the kernels; if it fails, with what."""
    command = [sys.executable, "-m", "isoconform", "explain", str(path)]
    done = subprocess.run(command, capture_output=True, check=False, text=True, env=environment())
    return done.stdout if done.returncode == 0 else "".join(done.stderr.splitlines(keepends=True)[-1:])
